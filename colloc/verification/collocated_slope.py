r"""How wrong a collocated gait on a slope is, interval by interval.

What the scheme says of every interval (`colloc.motion.kinds.SlowOnSlope`) is held against the differential equation
(`colloc.verification.gait_on_slope`).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from colloc.gaits.problem import Problem
from colloc.gaits.sloped import checked_chain
from colloc.motion.collocated import CollocatedPose, stage_weights
from colloc.motion.kinds import OMEGA, Shapes, begin_of, first_theta, kind_of_motion
from colloc.numerics.mesh import Mesh
from colloc.verification.adaptive_motion import path_lengths
from colloc.verification.gait_on_slope import GaitOnSlope


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
    body, friction, grade = problem.body, problem.law, problem.slope.grade
    on = GaitOnSlope(checked_chain(body, friction, grade), friction, gait, delta, (), grade)
    course = on.followed(np.array([gait.theta, 0.0, 0.0, 0.0, 0.0, 0.0]), error)
    return SlopeCourse(lambda t: course.at(t)[:5], error)


def slope_defects(problem: Problem, mesh: Mesh, gait: Any, delta: float, exact: SlopeCourse) -> SlopeDefects:
    """Errors of collocating a gait on a slope, delta per period."""
    slope, kind = problem.slope, kind_of_motion(problem)
    assert slope is not None
    angles, rates = gait(mesh.times)
    begin = begin_of(kind, gait)
    own = kind.along(mesh, Shapes(angles, rates, delta), begin)
    pose = CollocatedPose.on_mesh(mesh, own.now.z[OMEGA], own.now.centre, first_theta(kind, begin))
    weight, way = stage_weights(mesh), np.diff(pose.place)
    spent, passed = ((weight * rate[mesh.points]).sum(axis=1) for rate in (own.now.power, np.linalg.norm(rates, axis=0)))
    turned, work = pose.rotations, spent + slope.grade * way.real
    if not own.held.all():
        work = np.nan * work
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
