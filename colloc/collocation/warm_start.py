"""Feasible starting points: from a gait alone to all variables of a transcription, through the fixed-point solver."""

from __future__ import annotations

import numpy as np

from colloc.collocation.layout import Layout
from colloc.collocation.program import GaitProgram
from colloc.gaits.gait_fields import AnyGait
from colloc.gaits.problem import Problem
from colloc.mechanics.actuators import driven_power_in_balance
from colloc.mechanics.balance_results import BalancedMotion
from colloc.motion.collocated import CollocatedPose, stage_weights, sums
from colloc.motion.heading import heading
from colloc.numerics.mesh import Mesh
from colloc.numerics.orientation import Orientation
from colloc.verification.collocated_slope import PointsOnSlope, points_on_slope

_TOLERANCE = 1e-11


def feasible_point(transcription: GaitProgram, parameters: np.ndarray, delta: float) -> np.ndarray:
    """Variables ``(n,)`` that satisfy every equation of the transcription but net rotation, for gait parameters
    ``(n_parameter,)`` and delta in the units of the problem's class of gaits."""
    gait = transcription.member(parameters)
    mesh = transcription.phase_mesh(gait)
    return balanced_variables(transcription.problem, transcription.layout, mesh, gait, parameters, delta)


def balanced_variables(
    problem: Problem, layout: Layout, mesh: Mesh, gait: AnyGait, parameters: np.ndarray, delta: float
) -> np.ndarray:
    """The same for a layout of variables, a mesh in phases of the gait, and the gait's parameters in that layout."""
    x = np.zeros(layout.n)
    x[layout.parameters[:, 0]] = parameters
    unit = gait.speed_unit
    slow = delta * gait.delta_unit / unit
    angles, rates = gait.angles(mesh.times), gait.rates(mesh.times) / unit
    body, friction, slope = problem.body, problem.friction.in_speeds_of(unit), problem.slope
    now: BalancedMotion | PointsOnSlope
    if slope is None:
        solved = body.solve(friction, angles, rates, slow, tolerance=_TOLERANCE)
        now, z = body.motion(friction, angles, rates, slow, solved), solved.z
    else:
        now = points_on_slope(body, friction, slope, Orientation(mesh, unit), angles, rates, slow, gait.theta)
        z = now.z

    centre, weight, points = np.array(now.centre), unit * stage_weights(mesh), mesh.points
    pose = CollocatedPose.on_mesh(mesh, unit * z[2], unit * centre)
    # on a slope the gait says where it points, and the way in a given direction counts; on the level it travels along +x
    if slope is None:
        theta_0, ahead = -heading(problem.gait.symmetry, complex(pose.place[-1]), float(pose.theta[-1])), 0.0
        uphill = 0.0
    else:
        theta_0, ahead, uphill = gait.theta, slope.ahead, slope.grade
    power = (weight * now.power[points]).sum(axis=1)
    way = np.exp(1j * (theta_0 - ahead)) * pose.place
    x[layout.distance[0, 1:]] = way[1:].real
    x[layout.work[0, 1:]] = sums(power)[1:] + uphill * (np.exp(1j * ahead) * way)[1:].real
    x[layout.theta[0, mesh.sites]] = theta_0 + pose.stage_theta
    x[layout.theta[0, mesh.edge_sites]] = theta_0 + pose.theta
    if layout.driven_work.size:
        driven = driven_power_in_balance(body, friction, angles, rates, z, slow)
        x[layout.driven_work] = (weight * driven[points]).sum()
    x[layout.length] = (weight * np.linalg.norm(rates, axis=0)[points]).sum()
    if layout.z.size:
        x[layout.angles], x[layout.rates], x[layout.z] = angles, rates, z
    if layout.forces.size:
        x[layout.forces] = body.forces(friction, angles, rates, z, slow)
    return x
