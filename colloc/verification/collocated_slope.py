r"""A gait on a slope as a collocation scheme sees it, and how wrong it is, interval by interval.

The scheme's orientation at its points obeys ``theta = theta_0 + H omega(theta)`` (`colloc.numerics.orientation`), omega being
that of the balance under the weight's pull. Newton's method solves for all points at once. What this says of every interval is
held against the differential equation (`colloc.verification.gait_on_slope`).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from colloc.gaits.problem import Problem
from colloc.gaits.sloped import Slope, checked_chain
from colloc.mechanics.chain_motion import chain_slopes
from colloc.mechanics.fixed_point import solve_balance
from colloc.mechanics.law import Law
from colloc.numerics.mesh import Mesh
from colloc.numerics.orientation import Orientation
from colloc.verification.adaptive_motion import path_lengths
from colloc.verification.gait_on_slope import GaitOnSlope

_TOLERANCE, _ACCEPTED = 1e-12, 1e-9
_CLOSED, _STEPS = 1e-12, 30
_OUTPUTS, _LOAD = slice(2, 6), slice(-2, None)


class PointsOnSlope(NamedTuple):
    """A collocated motion at the points of a mesh."""

    theta: np.ndarray  # (n,)
    z: np.ndarray
    """Tail velocities, ``(3, n)``."""
    centre: np.ndarray
    """Velocities of the centre of mass, in the body's axes, ``(2, n)``."""
    power: np.ndarray
    """Against friction, ``(n,)``."""
    on_shape: np.ndarray
    on_theta: np.ndarray
    """Derivatives of rotation rate, centre and power along (angles, rates), ``(4, 2 n_joint, n)``, and theta, ``(4, n)``."""
    held: bool
    """Whether there is such a motion: friction holds the body everywhere."""

    def travelled(self) -> np.ndarray:
        """Velocity of the centre of mass in the plane, its real part uphill, ``(n,)``."""
        return np.exp(1j * self.theta) * (self.centre[0] + 1j * self.centre[1])


def points_on_slope(
    body: Any,
    friction: Law,
    slope: Slope,
    mesh: Orientation,
    angles: np.ndarray,
    rates: np.ndarray,
    delta: float,
    theta_0: float,
    near: tuple[np.ndarray, np.ndarray] | None = None,
) -> PointsOnSlope:
    """The collocated motion of a chain with shapes ``(n_joint, n_point)`` whose tail link starts at an angle from straight
    uphill; `near`: theta and tail velocities to start from."""
    at = checked_chain(body, friction, slope.grade), friction, angles, rates, delta
    n = angles.shape[1]
    theta, z = near or (np.full(n, theta_0), np.zeros((3, n)))
    for _ in range(_STEPS):
        load = slope.pull(theta[None])
        solved = solve_balance(*at, load=load, start=z, tolerance=_TOLERANCE)
        now, slopes = chain_slopes(*at, solved, load)
        z, slopes = solved.z, slopes[_OUTPUTS]
        on_theta = slopes[:, -2] * load[1] - slopes[:, -1] * load[0]  # the pull turns against theta
        left_over = theta - theta_0 - mesh.turned(now.z[2])
        balanced = bool((solved.residual < _ACCEPTED).all())
        held = balanced and bool(np.abs(left_over).max() < _CLOSED)
        if held or not balanced:
            break
        theta = theta - mesh.solved(on_theta[0], left_over)
    return PointsOnSlope(theta, z, now.centre, now.power, slopes[:, : _LOAD.start], on_theta, held)


class SlopeDefects(NamedTuple):
    """What collocation adds to a motion on a slope, ``(n_interval,)`` each: to the rotation, to the way along and across the
    direction that counts (complex), to the work of the joints, to velocities of the tail between the points, to the objective
    relative to it. Then the last as a whole, what the differential equation may miss of it, and the rotation that is missed,
    times the body's reach over the distance."""

    rotation: np.ndarray
    displacement: np.ndarray
    work: np.ndarray
    velocity: np.ndarray
    value: np.ndarray
    total: float
    unresolved: float
    turning: float


class SlopeCourse(NamedTuple):
    """A gait's motion on a slope by the differential equation: theta, way up and aside, work against friction and of the
    joints, ``(5, n)``, at phases in order; and about the error of these."""

    at: Callable[[np.ndarray], np.ndarray]
    error: float


def slope_course(problem: Problem, gait: Any, delta: float, error: float) -> SlopeCourse:
    """The motion of a gait without breaks, delta per period."""
    assert problem.slope is not None
    body, friction, grade = problem.body, problem.friction, problem.slope.grade
    on = GaitOnSlope(checked_chain(body, friction, grade), friction, gait, delta, (), grade)
    *_, (unknowns,) = on.followed(np.array([gait.theta, 0.0, 0.0, 0.0, 0.0, 0.0]), error)
    return SlopeCourse(lambda t: unknowns(t)[:5], error)


def slope_defects(problem: Problem, mesh: Mesh, gait: Any, delta: float, exact: SlopeCourse) -> SlopeDefects:
    """Errors of collocating a gait on a slope, delta per period."""
    slope, body, friction = problem.slope, problem.body, problem.friction
    assert slope is not None
    orientation, (angles, rates) = Orientation(mesh), gait(mesh.times)
    own = points_on_slope(body, friction, slope, orientation, angles, rates, delta, gait.theta)
    moved, weight = own.travelled(), orientation.weight
    power = own.power + slope.grade * moved.real if own.held else np.nan * own.power
    pace = np.linalg.norm(rates, axis=0)
    turned, way, work, passed = (
        (weight * rate).reshape(mesh.n, -1).sum(axis=1) for rate in (own.z[2], moved, power, pace)
    )  # fmt: skip
    theta, up, aside, _, joint_work = np.diff(exact.at(mesh.edges), axis=1)
    length, back = path_lengths(gait, mesh.edges[:-1], mesh.edges[1:], 4), np.exp(-1j * slope.ahead)
    rotation, displacement, energy = turned - theta, back * (way - (up + 1j * aside)), work - joint_work
    ahead = float((back * (up + 1j * aside)).sum().real)
    period = {"distance": ahead, "work": float(joint_work.sum()), "length": float(length.sum())}
    shares = problem.objective.shares(period)
    value = shares["distance"] * displacement.real + shares["work"] * energy + shares["length"] * (passed - length)
    found = {"distance": ahead + displacement.real.sum(), "work": work.sum(), "length": passed.sum()}
    return SlopeDefects(
        rotation,
        displacement,
        energy,
        np.full(mesh.n, np.nan),
        value,
        float(problem.objective(found) / problem.objective(period) - 1),
        float(exact.error * sum(map(abs, shares.values()))),
        abs(float(rotation.sum())) * 0.5 / max(abs(ahead), 1e-300),
    )
