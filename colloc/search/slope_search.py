"""The gait of a class that climbs a slope at the least work, by the same SQP as on the level, and what a replay says of it.

Starts are those of a search on the level, each pointed so that it would go uphill there. They are told apart on a coarse mesh
at a large delta; the best few are followed down in delta, and the best of these is optimised on meshes whose edges lie where
the replay's steps do, until mesh and replay agree.
"""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass

import numpy as np

from colloc.gaits.harmonic import Fourier, Harmonic
from colloc.gaits.objective import EFFICIENCY
from colloc.gaits.problem import Problem
from colloc.gaits.starts import on_speed_floor
from colloc.mechanics.chain import Chain
from colloc.numerics.sqp import Stationarity
from colloc.reduced.closure import closed_gait
from colloc.reduced.harmonic_space import HarmonicSpace
from colloc.reduced.slope_program import SlopeProgram
from colloc.results.checks import Check
from colloc.search.far_contact import crossing_pairs, last_free
from colloc.search.global_search import starting_gaits
from colloc.search.reduced_search import FINE, FIRST_RADIUS, NEXT_RADIUS, REMESH_RADIUS, ROUGH, VERY_ROUGH, at_rest, deltas
from colloc.system.errors import CollocError, NotConvergedError, ProblemError
from colloc.verification.gait_on_slope import SlopeMotion
from colloc.verification.slope import check_finite, checked_chain, slope_motion

STARTS = 12
_SCHEME = "gauss-3"
_COARSE, _FIRST, _MOST = 30, 60, 480
"""Intervals of a period: to tell starts apart, of the first mesh at the final delta, and at most."""
_DELTA = 0.2
"""Where starts are told apart, in units of the problem's first delta."""
_FOLLOWED = 3
_ADMISSIBLE, _TURN, _KKT, _VIOLATION, _CROSSING, _PHASES = 1e-6, 1e-4, 1e-6, 1e-8, 1e-8, 2000
_MESH, _REPLAYED, _SEVERAL, _ASTRAY, _PAID = 1e-4, 1e-3, 1e-3, 1e-3, 1e-6
"""What the checks allow, by their meanings below."""
_DRIER = 0.1


@dataclass(frozen=True, eq=False)
class ClimbingGait:
    """A gait for a slope, and how it was checked.

    Attributes
    ----------
    gait : Fourier
    heading : float
        Of a body that goes on in the same way period by period, as `colloc.slope_motion` counts it [rad].
    motion : SlopeMotion
        One period from there, by the replay.
    way, value : float
        Climb, or way in the direction that was asked for, and that over work of the joints; by the replay.
    checks : tuple of Check
    starts : int
        Tried in all.
    smallest : bool
        Whether it is as small as the problem's ``smallest_shape_speed`` allows: then that bound chose its size.
    """

    gait: Fourier
    heading: float
    motion: SlopeMotion
    way: float
    value: float
    checks: tuple[Check, ...]
    starts: int
    smallest: bool

    @property
    def passed(self) -> bool:
        """Whether all checks hold."""
        return all(check.passed for check in self.checks)

    @property
    def line(self) -> str:
        """What it achieves."""
        work, grade = self.motion.joint_work[0], self.motion.grade
        return f"way {self.way:.6f}, work of the joints {work:.6f}, way/work {self.value:.6f} on a grade of {grade:g}"

    def __repr__(self) -> str:
        return f"<ClimbingGait: {self.line}; {'all checks hold' if self.passed else 'not all checks hold'}>"

    def __str__(self) -> str:
        size = ["the gait shrank to the bound smallest_shape_speed"] * self.smallest
        return "\n".join([self.line, *size, *(check.line() for check in self.checks)])


@dataclass(frozen=True, eq=False)
class _Found:
    """A program at rest."""

    program: SlopeProgram
    u: np.ndarray
    objective: float
    conditions: Stationarity


def climbing_gait(problem: Problem, grade: float, *, towards: float | None = None, starts: int = STARTS) -> ClimbingGait:
    """The gait of a class of harmonics that climbs a slope at the least work of the joints, of those that starts lead to.

    It is a local optimum of climb/work over the gait and the heading of the body, which a period must not turn; a stable
    heading is not asked for (`SlopeMotion.stable` tells). On the level climb/work is the efficiency d/W. Where a direction is
    asked for, the body moves in that direction, and its way counts instead of its climb.

    Parameters
    ----------
    problem : Problem
        Of a chain, with a class `Harmonic` and the objective "efficiency"; limits on actuators, and values to be reached, are
        not for slopes.
    grade : float
        Tangent of the inclination, see `colloc.slope_motion`.
    towards : float, optional
        Direction of the way, from straight uphill, positive to the left [rad]; by default whichever climbs best.
    starts : int

    Raises
    ------
    ProblemError
        For a problem of another kind, or a slope that is too steep.
    NotConvergedError
        If no start leads anywhere: no gait was found that climbs, or goes that way.

    Examples
    --------
    >>> import colloc
    >>> problem = colloc.Problem("steep", gait=colloc.Harmonic(1, "bilateral"), delta=1e-2)
    >>> found = colloc.climbing_gait(problem, grade=0.1, starts=2)
    >>> found.passed, round(found.value, 2)
    (True, 0.09)
    """
    _check(problem, grade)
    check_finite(towards=0.0 if towards is None else towards)
    if starts < 1:
        raise ProblemError(f"starts must be at least 1, not {starts}.")
    first = max(_DELTA * problem.delta_start, problem.delta)
    known: list[_Found] = []
    for gait in starting_gaits(problem, starts):
        with suppress(CollocError):
            begun = _begun(problem, grade, towards, closed_gait(problem, gait, first), first)
            known.append(_settled(*begun, FIRST_RADIUS, VERY_ROUGH))
    ends = []
    for found in sorted(known, key=lambda one: one.objective)[:_FOLLOWED]:
        for delta in deltas(problem, first):
            found = _settled(_program(found.program, delta=delta), found.u, NEXT_RADIUS, ROUGH)
        ends.append(found)
    best = min(ends, key=lambda one: one.objective, default=None)
    if best is None or not best.objective < 0:
        raise NotConvergedError(
            f"no gait was found that climbs a grade of {grade:g}, or goes the way asked for; try a gentler slope, more starts, "
            "or more harmonics."
        )
    return _refined(best, starts)


def _check(problem: Problem, grade: float) -> None:
    if not isinstance(problem.body, Chain) or not isinstance(problem.gait, Harmonic):
        raise ProblemError("a gait for a slope is sought for chains of straight links, in a class Harmonic.")
    if problem.objective != EFFICIENCY or problem.at_least or problem.actuator_limits.names or problem.rotation != 0:
        raise ProblemError("on a slope climb/work is maximised: leave objective, rotation, at_least and limits of joints out.")
    checked_chain(problem.body, problem.friction, grade)


def _begun(
    problem: Problem, grade: float, towards: float | None, gait: Fourier, delta: float
) -> tuple[SlopeProgram, np.ndarray]:
    """A program on a coarse mesh, and the gait pointed uphill, or where it is to go."""
    space = HarmonicSpace(problem, np.linspace(0.0, 1.0, _COARSE + 1), _SCHEME)
    v = space.parameters(gait)
    level = SlopeProgram(space, 0.0, delta)
    ahead, _, _, aside = level.values(np.append(v, 0.0))
    program, u = SlopeProgram(space, grade, delta, towards), np.append(v, (towards or 0.0) - np.arctan2(aside, ahead))
    if not np.isfinite(program.objective(u)):
        raise NotConvergedError("friction does not hold the body, or its joints brake it.")
    return program, u


def _program(program: SlopeProgram, space: HarmonicSpace | None = None, delta: float | None = None) -> SlopeProgram:
    """The same on another mesh, or at another delta."""
    return SlopeProgram(space or program.space, program.grade, program.delta if delta is None else delta, program.towards)


def _settled(program: SlopeProgram, u: np.ndarray, radius: float, accuracy: float) -> _Found:
    """At rest, with pairs of links more than two apart kept from crossing as they turn out to cross."""
    while True:
        space, begin = program.space, u
        rested = at_rest(program, begin, radius, accuracy)
        new = tuple(pair for pair in crossing_pairs(space, rested.v[:-1]) if pair not in space.far)
        if not new:
            return _Found(program, rested.v, rested.objective, rested.conditions)
        u = np.append(last_free(space, begin[:-1], rested.v[:-1]), begin[-1])
        program = _program(program, space.with_far(space.far + new))


def _refined(found: _Found, starts: int) -> ClimbingGait:
    """Optimised on meshes with ever more intervals, until the replay agrees with the mesh."""
    intervals, radius = _FIRST, NEXT_RADIUS
    replayed = _replay(found)
    while True:
        space = found.program.space
        edges = _where_it_steps(replayed, intervals)
        space = HarmonicSpace(space.problem, edges, _SCHEME, space.far)
        found = _settled(_program(found.program, space), found.u, radius, FINE)
        replayed = _replay(found)
        value = _way(found, replayed).real / float(replayed.joint_work[0])
        apart = abs(value + found.objective) / abs(value)
        if apart < space.problem.mesh_tolerance or 2 * intervals > _MOST:
            gait = space.member(found.u[:-1])
            heading, way = float(np.angle(np.exp(1j * replayed.headings[0]))), _way(found, replayed).real
            return ClimbingGait(
                gait,
                heading,
                replayed,
                way,
                value,
                _checks(found, replayed, apart),
                starts,
                on_speed_floor(space.problem, gait),
            )
        intervals, radius = 2 * intervals, REMESH_RADIUS


def _where_it_steps(replayed: SlopeMotion, intervals: int) -> np.ndarray:
    """Edges between which the replay's solver took equally many steps; half of them equally far apart, for the gait moves."""
    steps = np.linspace(0.0, 1.0, replayed.phases.size)
    share = 0.5 * (steps + replayed.phases)
    return np.interp(np.linspace(0.0, 1.0, intervals + 1), share, replayed.phases)


def _replay(found: _Found, part: float = 1.0) -> SlopeMotion:
    """A period by the differential equation, from the same theta."""
    problem, gait = found.program.space.problem, found.program.space.member(found.u[:-1])
    at = problem.body, problem.friction, gait, part * found.program.delta, found.program.grade
    return slope_motion(*at, theta=float(found.u[-1]))


def _way(found: _Found, ran: SlopeMotion) -> complex:
    """Way of a period in the direction that counts, and to the left of it."""
    return complex(ran.climb[0], ran.aside[0]) * complex(np.exp(-1j * (found.program.towards or 0.0)))


def _checks(found: _Found, replayed: SlopeMotion, apart: float) -> tuple[Check, ...]:
    space, conditions, body = found.program.space, found.conditions, found.program.space.problem.body
    drier, way = _replay(found, _DRIER), _way(found, replayed)
    value, dry = way.real / replayed.joint_work[0], _way(found, drier).real / drier.joint_work[0]
    influence, astray = abs(dry - value) / abs(value), 0.0 if found.program.towards is None else way.imag / way.real
    angles = space.member(found.u[:-1]).angles(np.arange(_PHASES) / _PHASES)
    crossing = max(float(body.crossing_depth(angles).max()), body.passing_depth(angles))
    stationary, usual = max(conditions.kkt_error, conditions.complementarity), body.usual
    paid = abs(replayed.joint_work[0] - replayed.friction_work[0] - replayed.grade * replayed.climb[0])
    return (
        Check("KKT error", stationary, _KKT, "gradient of the Lagrangian, complementarity"),
        Check("constraint violation", conditions.violation, _VIOLATION, "largest violated row or bound"),
        Check(
            "admissible", max(found.program.place_rows(found.u), 0.0), _ADMISSIBLE, "excess over joint limits and contact [rad]"
        ),
        Check("crossing", crossing, _CROSSING, "depth to which links pass through each other"),
        Check("replay", apart, _MESH, "way/work of the mesh against the replay, relative"),
        Check("error of the replay", replayed.error / abs(way.real), _REPLAYED, "relative to the way"),
        Check("direction", astray, _ASTRAY, "of the way, off the one that was asked for [rad]"),
        Check("turn", replayed.turn, _TURN, "of the heading in a period, by the replay [rad]"),
        Check("one motion", replayed.several, _SEVERAL, "part of the period at which several motions are balanced"),
        Check("work", paid, _PAID, "work of the joints less that against friction and of the climb"),
        Check("delta influence", influence, usual.delta_influence, "change of way/work at a tenth of delta, relative"),
    )
