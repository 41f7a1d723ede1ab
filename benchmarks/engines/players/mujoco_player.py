"""MuJoCo: soft contacts from a convex problem, in which a foot that slides is also lifted, the more
the faster it slides.

As it comes (solref 0.02, solimp from 0.9) feet hover and hop: three links on feet go 7 % too short
slowly, and 33 % at a Froude number of 0.05. Contacts of two steps whose impedance begins at 0 take
the hops' cause away.
"""

import mujoco
import numpy as np

from benchmarks.engines.task import Task

NAME, DIRECTIONS = "MuJoCo", False
SETTINGS = (
    "elliptic cones, impratio 100, solref of two steps, solimp from 0, Newton to 1e-12, "
    "implicitfast"
)
STIFF, DAMPED = 1e4, 1e2
"""Of the servos [N m/rad], [N m s/rad]: angles are held to 1e-4 rad."""


def play(task: Task, step: float) -> np.ndarray:
    spec, steps = mujoco.MjSpec.from_string(task.urdf), task.steps(step)
    option = spec.option
    option.timestep, option.gravity = task.seconds / steps, [0, 0, -task.gravity]
    option.cone, option.solver = mujoco.mjtCone.mjCONE_ELLIPTIC, mujoco.mjtSolver.mjSOL_NEWTON
    option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    option.impratio, option.tolerance, option.iterations = 100, 1e-12, 200
    touch = {
        "condim": 3,
        "solref": [2 * option.timestep, 1.0],
        "solimp": [0.0, 0.95, 0.001, 0.5, 2.0],
    }
    spec.worldbody.add_geom(
        type=mujoco.mjtGeom.mjGEOM_PLANE, size=[0, 0, 1], contype=0, conaffinity=1, **touch
    )
    for name, law in task.feet.items():
        for geom in spec.body(name).geoms:
            geom.friction, geom.priority, geom.contype, geom.conaffinity = (
                [law.largest, 0, 0],
                1,
                1,
                0,
            )
            geom.condim, geom.solref, geom.solimp = touch.values()
    for name in task.joints:
        servo = spec.add_actuator(name=name, target=name, trntype=mujoco.mjtTrn.mjTRN_JOINT)
        servo.gainprm[0], servo.biastype = STIFF, mujoco.mjtBias.mjBIAS_AFFINE
        servo.biasprm[1:3] = -STIFF, -DAMPED
    model = spec.compile()
    data = mujoco.MjData(model)
    driven = [(model.joint(name).qposadr[0], model.joint(name).dofadr[0]) for name in task.joints]
    places, speeds = (list(at) for at in zip(*driven, strict=True))
    tail = [model.joint(name).qposadr[0] for name in ("x", "y", "heading")]
    data.qpos[places], data.qvel[speeds] = task.at(0.0)
    work, rows = 0.0, [[*data.qpos[tail], 0.0]]
    for k in range(task.periods * steps):
        angles, rates = task.at((k + 1) * model.opt.timestep)
        data.ctrl[:] = angles + DAMPED / STIFF * rates
        mujoco.mj_step(model, data)
        work += float(data.actuator_force @ data.qvel[speeds]) * model.opt.timestep
        if (k + 1) % steps == 0:
            rows.append([*data.qpos[tail], work])
    return np.array(rows)
