"""PyBullet: velocities and impulses by projected Gauss-Seidel sweeps; what the last sweep leaves is
the error."""

import tempfile
from pathlib import Path

import numpy as np
import pybullet

from benchmarks.engines.task import Task

NAME, DIRECTIONS = "PyBullet", True
SETTINGS = (
    "implicit cones, 200 sweeps or a residual of 1e-12, no damping, joint motors as constraints"
)


def play(task: Task, step: float) -> np.ndarray:
    client, steps = pybullet.connect(pybullet.DIRECT), task.steps(step)
    try:
        pybullet.setGravity(0, 0, -task.gravity)
        pybullet.setPhysicsEngineParameter(
            fixedTimeStep=task.seconds / steps,
            numSolverIterations=200,
            solverResidualThreshold=1e-12,
            enableConeFriction=1,
        )
        floor = pybullet.createMultiBody(0, pybullet.createCollisionShape(pybullet.GEOM_PLANE))
        pybullet.changeDynamics(floor, -1, lateralFriction=1.0)
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder, "robot.urdf")
            path.write_text(task.urdf, encoding="utf-8")
            robot = pybullet.loadURDF(
                str(path), useFixedBase=True, flags=pybullet.URDF_USE_INERTIA_FROM_FILE
            )
        infos = [pybullet.getJointInfo(robot, j) for j in range(pybullet.getNumJoints(robot))]
        joint = {info[1].decode(): info[0] for info in infos}
        link = {info[12].decode(): info[0] for info in infos}
        for index in joint.values():
            pybullet.changeDynamics(
                robot, index, linearDamping=0, angularDamping=0, jointDamping=0, lateralFriction=0
            )
            pybullet.setJointMotorControl2(robot, index, pybullet.VELOCITY_CONTROL, force=0)
        for name, law in task.feet.items():
            pybullet.changeDynamics(
                robot,
                link[name],
                lateralFriction=1.0,
                anisotropicFriction=[law.mu_f, law.mu_t, 1.0],
            )
        driven, tail = (
            [joint[name] for name in task.joints],
            [joint[name] for name in ("x", "y", "heading")],
        )
        for index, angle, rate in zip(driven, *task.at(0.0), strict=True):
            pybullet.resetJointState(robot, index, angle, rate)
        work, rows = 0.0, [[0.0] * 4]
        for k in range(task.periods * steps):
            angles, rates = task.at((k + 1) * task.seconds / steps)
            pybullet.setJointMotorControlArray(
                robot,
                driven,
                pybullet.POSITION_CONTROL,
                angles,
                rates,
                forces=[1e3] * len(driven),
                positionGains=[1.0] * len(driven),
            )
            pybullet.stepSimulation()
            work += (
                sum(state[1] * state[3] for state in pybullet.getJointStates(robot, driven))
                * task.seconds
                / steps
            )
            if (k + 1) % steps == 0:
                rows.append([*(state[0] for state in pybullet.getJointStates(robot, tail)), work])
        return np.array(rows)
    finally:
        pybullet.disconnect(client)
