"""Drake: contacts in discrete time, friction from the normal force of the step before ("lagged"),
regularised at a slip speed.

Its other approximations, "sap" and "similar", lift a foot that slides, as MuJoCo does: three links
on feet go 16 % too short.
"""

import numpy as np
from pydrake.geometry import CollisionFilterDeclaration, GeometrySet, HalfSpace
from pydrake.math import RigidTransform
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import AddMultibodyPlant, CoulombFriction, MultibodyPlantConfig
from pydrake.multibody.tree import PdControllerGains
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder

from benchmarks.engines.task import Task

NAME, DIRECTIONS = "Drake", False
SETTINGS = "lagged contacts, stiction tolerance 1e-5 m/s, implicit servos"
STIFF, DAMPED = 1e4, 1e2
"""Of the servos [N m/rad], [N m s/rad]."""
SLIP = 1e-5
"""Below which friction grows in proportion [m/s]."""


def play(task: Task, step: float) -> np.ndarray:
    steps = task.steps(step)
    step = task.seconds / steps
    builder = DiagramBuilder()
    config = MultibodyPlantConfig(
        time_step=step, discrete_contact_approximation="lagged", stiction_tolerance=SLIP
    )
    plant, scene = AddMultibodyPlant(config, builder)
    (robot,) = Parser(plant).AddModelsFromString(task.urdf, "urdf")
    plant.mutable_gravity_field().set_gravity_vector([0, 0, -task.gravity])
    plant.RegisterCollisionGeometry(
        plant.world_body(), RigidTransform(), HalfSpace(), "floor", CoulombFriction(1, 1)
    )
    actuators = [plant.AddJointActuator(name, plant.GetJointByName(name)) for name in task.joints]
    for actuator in actuators:
        actuator.set_controller_gains(PdControllerGains(p=STIFF, d=DAMPED))
    plant.Finalize()
    feet = GeometrySet(
        [
            g
            for name in task.feet
            for g in plant.GetCollisionGeometriesForBody(plant.GetBodyByName(name))
        ]
    )
    scene.collision_filter_manager().Apply(CollisionFilterDeclaration().ExcludeWithin(feet))
    simulator = Simulator(builder.Build())
    context = plant.GetMyMutableContextFromRoot(simulator.get_mutable_context())
    joints = [plant.GetJointByName(name) for name in task.joints]
    tail = [plant.GetJointByName(name).position_start() for name in ("x", "y", "heading")]
    speeds = [joint.velocity_start() for joint in joints]
    q, v = plant.GetPositions(context), plant.GetVelocities(context)
    q[[joint.position_start() for joint in joints]], v[speeds] = task.at(0.0)
    plant.SetPositions(context, q)
    plant.SetVelocities(context, v)
    wanted, torques = (
        plant.get_desired_state_input_port(robot),
        plant.get_net_actuation_output_port(robot),
    )
    work, rows = 0.0, [[0.0] * 4]
    for k in range(task.periods * steps):
        wanted.FixValue(context, np.concatenate(task.at((k + 1) * step)))
        simulator.AdvanceTo((k + 1) * step)
        work += float(torques.Eval(context) @ plant.GetVelocities(context)[speeds]) * step
        if (k + 1) % steps == 0:
            rows.append([*plant.GetPositions(context)[tail], work])
    return np.array(rows)
