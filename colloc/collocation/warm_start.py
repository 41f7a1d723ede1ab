"""Feasible starting points: from a gait alone to all variables of a transcription, through the
fixed-point solver."""

from __future__ import annotations

import numpy as np

from colloc.collocation.layout import RADIANS, Layout
from colloc.collocation.program import GaitProgram
from colloc.gaits.control_problem import ControlProblem
from colloc.gaits.gait_fields import AnyGait
from colloc.motion.collocated import CollocatedPose, point_weights, stage_weights, sums
from colloc.motion.kinds import OMEGA, Passed, Shapes, begin_of, first_theta, kind_of_motion
from colloc.numerics.mesh import Mesh


def feasible_point(transcription: GaitProgram, parameters: np.ndarray, delta: float) -> np.ndarray:
    """Variables ``(n,)`` that satisfy every equation of the transcription but net rotation, for
    gait parameters ``(n_parameter,)`` and delta in the units of the problem's class of gaits."""
    return balanced_variables(
        transcription.control, transcription.layout, transcription.mesh, parameters, delta
    )


def balanced_variables(
    control: ControlProblem,
    layout: Layout,
    mesh: Mesh,
    parameters: np.ndarray,
    delta: float,
    gait: AnyGait = None,
) -> np.ndarray:
    """The same for a layout of variables and a mesh; `gait` is in the time of the mesh, by default
    the one of the parameters."""
    admissible = control.admissible
    kind = kind_of_motion(control.dynamics.in_speeds_of(RADIANS))
    if gait is None:
        gait = admissible.gait.trajectory(parameters, admissible.n_joint)
        begin = parameters[parameters.size - len(kind.told) :]
    else:
        begin = begin_of(kind, gait)
    x = np.zeros(layout.n)
    x[layout.parameters[:, 0]] = parameters
    unit, relative = RADIANS, admissible.gait.relative_delta
    angles, rates = gait.angles(mesh.times), gait.rates(mesh.times) / unit
    pace = np.ones(mesh.n_point)
    if relative:
        rates = (admissible.gait.rates_on(mesh, len(angles)) @ parameters).T / unit
        pace = np.linalg.norm(rates, axis=0)
    slow = delta if relative else delta / unit
    shapes = Shapes(angles, rates / pace, slow, unit, pace)
    body, friction = kind.body, kind.friction
    along = kind.along(mesh, shapes, begin)
    now, z = along.now, pace * along.z

    centre, weight, points = pace * np.array(now.centre), unit * stage_weights(mesh), mesh.points
    turn = kind.turn * pace / (point_weights(mesh) @ pace) if relative else kind.turn
    pose = CollocatedPose.on_mesh(
        mesh, unit * z[OMEGA] - turn, unit * centre, first_theta(kind, begin)
    )
    power = (weight * (pace * now.power)[points]).sum(axis=1)
    shares = kind.shares(
        Passed(complex(pose.place[-1]), float(pose.rotations.sum()), float(power.sum()), begin)
    )
    heading = float(np.angle(shares["distance"].side))
    ahead = (pose.place * np.exp(-1j * heading)).real
    climbed = (pose.place * np.conj(shares["work"].side)).real
    # where the orientation is no state the plane is turned so that the gait goes along +x
    theta_0 = 0.0 if "theta" in kind.told else -heading
    x[layout.distance[0, 1:]] = ahead[1:]
    x[layout.work[0, 1:]] = sums(power)[1:] + climbed[1:]
    x[layout.theta[0, mesh.sites]] = theta_0 + pose.stage_theta
    x[layout.theta[0, mesh.edge_sites]] = theta_0 + pose.theta
    at = kind.instants(shapes, pose.theta_on(mesh), along.z)
    for quantity, total in zip(layout.integrals, layout.totals, strict=True):
        x[total] = (weight * (pace * quantity.at(at))[0, points]).sum()
    x[layout.angles], x[layout.rates], x[layout.z] = angles, rates, z
    if layout.momenta.size:
        x[layout.momenta[:, mesh.sites]] = along.states[: len(layout.momenta), points]
        x[layout.momenta[:, mesh.edge_sites]] = along.edges
    if layout.forces.size:
        x[layout.forces] = body.forces(friction, angles, shapes.rates, along.z, slow)
    return x
