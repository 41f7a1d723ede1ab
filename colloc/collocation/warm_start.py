"""Feasible starting points: from a gait alone to all variables of a transcription, through the fixed-point solver."""

from __future__ import annotations

import numpy as np
from scipy.sparse.linalg import spsolve

from colloc.collocation.layout import Layout
from colloc.collocation.program import GaitProgram
from colloc.gaits.gait_fields import AnyGait
from colloc.gaits.problem import Problem
from colloc.mechanics.actuators import driven_power_in_balance
from colloc.mechanics.balance_results import BalancedMotion
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
    body, friction, slope = problem.body, problem.law.in_speeds_of(unit), problem.slope
    now: BalancedMotion | PointsOnSlope
    if slope is None:
        solved = body.solve(friction, angles, rates, slow, tolerance=_TOLERANCE)
        now, z = body.motion(friction, angles, rates, slow, solved), solved.z
    else:
        now = points_on_slope(body, friction, slope, Orientation(mesh, unit), angles, rates, slow, gait.theta)
        z = now.z

    state, rate = mesh.integration()
    # theta_0 = 0 closes the system; the matrix is block bidiagonal
    theta = np.zeros(mesh.n_site)
    theta[1:] = spsolve(state[:, 1:].tocsc(), unit * (rate @ z[2]))
    site_of_point = np.empty(mesh.n_point, dtype=int)
    site_of_point[mesh.points] = mesh.sites
    cx, cy = now.centre
    _, quadrature = mesh.quadrature()

    if slope is not None:
        theta += gait.theta
    elif problem.gait.symmetry == "antipodal":
        theta -= 0.5 * theta[-1]
    else:  # turn the motion into +x
        c, s = np.cos(theta[site_of_point]), np.sin(theta[site_of_point])
        dx, dy = quadrature @ (c * cx - s * cy), quadrature @ (s * cx + c * cy)
        theta -= np.arctan2(dy.sum(), dx.sum())
    at_points = theta[site_of_point]
    ahead, power = _forward(at_points, cx, cy), now.power
    if slope is not None:
        ahead, power = _forward(at_points - slope.ahead, cx, cy), power + slope.grade * ahead
    distance = np.cumsum(unit * (quadrature @ ahead))
    if slope is None and distance[-1] < 0:  # an antipodal gait that travels the other way along its axis
        theta, distance = theta + np.pi, -distance
    x[layout.distance[0, 1:]] = distance
    x[layout.work[0, 1:]] = np.cumsum(unit * (quadrature @ power))
    x[layout.theta[0]] = theta
    if layout.driven_work.size:
        driven = driven_power_in_balance(body, friction, angles, rates, z, slow)
        x[layout.driven_work] = unit * (quadrature @ driven).sum()
    x[layout.length] = unit * (quadrature @ np.linalg.norm(rates, axis=0)).sum()
    if layout.z.size:
        x[layout.angles], x[layout.rates], x[layout.z] = angles, rates, z
    if layout.forces.size:
        x[layout.forces] = body.forces(friction, angles, rates, z, slow)
    return x


def _forward(theta: np.ndarray, cx: np.ndarray, cy: np.ndarray) -> np.ndarray:
    return np.cos(theta) * cx - np.sin(theta) * cy
