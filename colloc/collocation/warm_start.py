"""Feasible starting points: from a gait alone to all variables of a transcription, through the
fixed-point solver."""

from __future__ import annotations

import numpy as np

from colloc.collocation.layout import Layout
from colloc.collocation.program import GaitProgram
from colloc.gaits.control_problem import Dynamics
from colloc.gaits.gait_fields import AnyGait
from colloc.motion.collocated import CollocatedPose, stage_weights, sums
from colloc.motion.kinds import OMEGA, Passed, Shapes, begin_of, first_theta, kind_of_motion
from colloc.numerics.mesh import Mesh


def feasible_point(transcription: GaitProgram, parameters: np.ndarray, delta: float) -> np.ndarray:
    """Variables ``(n,)`` that satisfy every equation of the transcription but net rotation, for
    gait parameters ``(n_parameter,)`` and delta in the units of the problem's class of gaits."""
    gait = transcription.member(parameters)
    mesh = transcription.phase_mesh(gait)
    return balanced_variables(
        transcription.control.dynamics, transcription.layout, mesh, gait, parameters, delta
    )


def balanced_variables(
    dynamics: Dynamics,
    layout: Layout,
    mesh: Mesh,
    gait: AnyGait,
    parameters: np.ndarray,
    delta: float,
) -> np.ndarray:
    """The same for a layout of variables, a mesh in phases of the gait, and the gait's parameters
    in that layout."""
    x = np.zeros(layout.n)
    x[layout.parameters[:, 0]] = parameters
    unit = gait.speed_unit
    slow = delta * gait.delta_unit / unit
    angles, rates = gait.angles(mesh.times), gait.rates(mesh.times) / unit
    kind = kind_of_motion(dynamics.in_speeds_of(unit))
    body, friction = kind.body, kind.friction
    begin = begin_of(kind, gait)
    along = kind.along(mesh, Shapes(angles, rates, slow, unit), begin)
    now, z = along.now, along.z

    centre, weight, points = np.array(now.centre), unit * stage_weights(mesh), mesh.points
    pose = CollocatedPose.on_mesh(
        mesh, unit * z[OMEGA] - kind.turn, unit * centre, first_theta(kind, begin)
    )
    power = (weight * now.power[points]).sum(axis=1)
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
    at = kind.instants(Shapes(angles, rates, slow, unit), pose.theta_on(mesh), z)
    for quantity, total in zip(layout.integrals, layout.totals, strict=True):
        x[total] = (weight * quantity.at(at)[0, points]).sum()
    if layout.z.size:
        x[layout.angles], x[layout.rates], x[layout.z] = angles, rates, z
    if layout.momenta.size:
        x[layout.momenta[:, mesh.sites]] = along.states[: len(layout.momenta), points]
        x[layout.momenta[:, mesh.edge_sites]] = along.edges
    if layout.forces.size:
        x[layout.forces] = body.forces(friction, angles, rates, z, slow)
    return x
