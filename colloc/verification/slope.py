r"""Gaits on a slope, where the heading is a state: the weight pulls downhill while the body turns.

On a plane of grade g, the tangent of its inclination, the body presses on the ground with a force
of 1. With theta the angle of the tail link from straight uphill, the weight pulls with ``-g e^(-i
theta)`` in the body's axes, the balance gives velocities that depend on theta, and

    d theta/dt = omega(q, q', theta),      d x/dt = e^(i theta) c(q, q', theta),

c being the velocity of the centre of mass in the body's axes and x its place, real part uphill. The
work of the joints, by their moments, is the work against friction + g climb.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from colloc.dynamics.chain import balance_on_slope
from colloc.dynamics.follow import Course, integrate_period
from colloc.gaits.objective import EFFICIENCY, Objective
from colloc.gaits.regime import Regime, checked_chain
from colloc.mechanics.bodies import Body
from colloc.mechanics.densities import (
    LENGTH,
    Instants,
    PathLimit,
    PathLimits,
    Quantity,
    limits_of,
    quantities_of,
)
from colloc.mechanics.fixed_point import solve_balance
from colloc.mechanics.law import Law
from colloc.mechanics.solution_branches import all_balanced_velocities
from colloc.system.arguments import MOST_PERIODS, check_count, check_finite
from colloc.system.errors import NotConvergedError
from colloc.verification.adaptive_motion import PANEL_RULE, fine_motion, whole_totals
from colloc.verification.replay_record import Path, Replay, lever, through_periods, to_tolerance

_UNITS = np.array([1.0, 1.0, 1.0, 1.0, 1.0, 100.0])
"""Units of the errors of theta, place, works, and of the logarithm of the steering."""
_OMEGA = 2
_LOOSER = 30.0  # error of the run that states the error, over that of the run it is of
_PANELS = 40
_WAY_ALONE = {"distance": 1.0, "work": 0.0, "rotation": 0.0}
_FIRST = 0.1  # error of the first run of a replay, over the relative one that is asked for
_LONGEST = 4.0  # longest step of a replay, in instants of a uniform grid


@dataclass(frozen=True, eq=False)
class SlopeMotion:
    """A gait on a slope, period by period."""

    grade: float  # tangent of the inclination
    course: float
    """Direction of the gait on the level, from that of the tail link at phase 0 [rad]."""
    headings: np.ndarray
    """Directions, at the ends of periods ``(n_period + 1,)``, in which the gait would go on from
    there on the level, from straight uphill, positive to the left [rad]."""
    climb: np.ndarray  # of the centre of mass up the fall line [body lengths], (n_period,)
    aside: np.ndarray  # to the left of it
    friction_work: np.ndarray  # [pressing force x body length]
    joint_work: np.ndarray  # by the moments in the joints
    steering: np.ndarray  # derivative of a period's last heading by its first, always positive
    error: float
    """Error of headings, ways and works at the end: their change where steps may err 30 times as
    much."""
    several: float
    """Part of the time at which several motions are balanced. One of them is followed, and no error
    says what the others would change."""
    phases: np.ndarray  # where the solver stepped, counted from the first start, (n,)
    states: np.ndarray
    """Theta, way up and aside, work against friction and of the joints, logarithm of the steering,
    all but theta from the first start, ``(6, n)``."""

    def __repr__(self) -> str:
        count = (
            f"{self.climb.size} period{'s' * (self.climb.size > 1)} on a grade of {self.grade:g}"
        )
        ends = f"heading {self.headings[0]:.4f} -> {self.headings[-1]:.4f}"
        return (
            f"<SlopeMotion of {count}: climb {self.climb.sum():.6g}, work of the joints "
            f"{self.joint_work.sum():.6g}, {ends}>"
        )

    @property
    def turn(self) -> float:
        """Turn of the heading over all periods [rad]."""
        return float(self.headings[-1] - self.headings[0])

    @property
    def stable(self) -> bool:
        """Whether headings beside this one come closer to it."""
        return bool(np.prod(self.steering) < 1.0)


class GaitOnSlope:
    """A gait of a chain on a slope."""

    def __init__(
        self,
        body: Body,
        friction: Law,
        path: Path,
        delta: float,
        grade: float,
        breaks: np.ndarray | tuple[float, ...] = (),
    ) -> None:
        self.body, self.slope = checked_chain(body, friction, grade), Regime(grade=float(grade))
        self.friction, self.path, self.delta = friction, path, delta
        self.breaks = tuple(sorted(map(float, breaks)))

    def integrate(self, begin: np.ndarray, tolerance: float, longest: float = np.inf) -> Course:
        """The unknowns of `SlopeMotion` through a period, from the first of them at its begin."""
        start = np.append(begin, np.zeros(6 - begin.size))
        return integrate_period(self._rates, start, tolerance * _UNITS, self.breaks, longest)

    def _rates(
        self, t: float, state: np.ndarray, near: np.ndarray | None
    ) -> tuple[np.ndarray, np.ndarray]:
        """Derivatives of the unknowns, and the tail velocity to start the next balance from."""
        shapes, theta = (*self.path(np.array([t])), self.delta), state[0]
        solved, now, _, by_theta = balance_on_slope(
            self.body, self.friction, self.slope, shapes, np.array([theta]), start=near
        )
        if not solved.converged.all():
            raise NotConvergedError(
                f"no balance at phase {t:.4f} on a slope of grade {self.slope.grade:g} (residual "
                f"{solved.residual[0]:.1e}): friction may be too weak to hold the body in that "
                f"direction, so that it slides down; try a gentler slope."
            )
        moved = np.exp(1j * theta) * complex(*now.centre[:, 0])
        works = now.power[0], now.actuator_power[0]
        omega, steering = now.z[_OMEGA, 0], by_theta[_OMEGA, 0]
        return np.array([omega, moved.real, moved.imag, *works, steering]), solved.z

    def totals(self, ran: Course, quantities: Sequence[Quantity], ends: np.ndarray) -> np.ndarray:
        """Quantities up to ascending phases, ``(k, n)``, by Gauss quadrature between the solver's
        steps."""
        if not quantities:
            return np.empty((0, ends.size))
        edges = np.union1d(np.union1d(ran.phases, ends), 0.0)
        h = np.diff(edges)
        t = (edges[:-1, None] + h[:, None] * PANEL_RULE.c).ravel()
        now, _ = self.instants(t, ran.at(t)[0])
        parts = [h * (each.at(now)[0].reshape(h.size, -1) @ PANEL_RULE.b) for each in quantities]
        sums = np.concatenate([np.zeros((len(parts), 1)), np.cumsum(parts, axis=1)], axis=1)
        return sums[:, np.searchsorted(edges, ends)]

    def instants(self, phases: np.ndarray, theta: np.ndarray) -> tuple[Instants, np.ndarray]:
        """Instants at phases and orientations ``(n,)``, and the residual of the balance."""
        at = (self.body, self.friction, *self.path(phases), self.delta)
        load = self.slope.pull(theta[None])
        solved = solve_balance(*at, load=load)
        return Instants(*at, z=solved.z, load=load), solved.residual

    def several(self, phases: np.ndarray, theta: np.ndarray) -> float:
        """Part of the time at which several motions are balanced."""
        if self.friction.associated:
            return 0.0
        at = (self.body, self.friction, *self.path(phases % 1.0), self.delta)
        several = all_balanced_velocities(*at, self.slope.pull(theta[None])).number > 1
        return float(np.diff(phases) @ (0.5 * several[1:] + 0.5 * several[:-1])) / float(phases[-1])

    def course(self, tolerance: float) -> float:
        """`SlopeMotion.course`; 0 where the gait stays."""
        edges = np.union1d(np.linspace(0.0, 1.0, _PANELS + 1), self.breaks)
        at = self.body, self.friction, self.path, self.delta
        way = fine_motion(*at, edges, tolerance, lambda period: _WAY_ALONE).path[-1]
        return float(np.angle(way)) if abs(way) > tolerance else 0.0

    def run(self, course: float, heading: float, periods: int, tolerance: float) -> SlopeMotion:
        """The motion through periods from a heading, without its error."""
        start = np.append(heading - course, np.zeros(5))
        one = partial(self.integrate, tolerance=tolerance)
        phases, states, ends = through_periods(one, start, periods)
        climb, aside, friction_work, joint_work, steering = np.diff(ends[1:])
        ways = climb, aside, friction_work, joint_work
        at = self.slope.grade, course, ends[0] + course
        return SlopeMotion(*at, *ways, np.exp(steering), np.nan, np.nan, phases, states)


def slope_motion(
    body: Body,
    friction: Law,
    gait: Path,
    delta: float,
    grade: float,
    *,
    heading: float | None = None,
    theta: float | None = None,
    periods: int = 1,
    tolerance: float = 1e-6,
    breaks: np.ndarray | tuple[float, ...] = (),
) -> SlopeMotion:
    """Follow a gait on a slope through periods, from a heading.

    Parameters
    ----------
    body : Chain
    friction : Law
        Coefficients are in units of the force that presses the body on the slope, its weight times
        the cosine of the inclination; so are all forces and works.
    gait : callable
        Joint angles and rates at phases in [0, 1]; any gait of colloc.
    delta : float
        Regularisation speed, per period. A body at rest creeps down at about delta x grade / mu.
    grade : float
        Tangent of the inclination, from 0.
    heading : float, optional
        At the start: the direction in which the gait would go on the level, from straight uphill,
        positive to the left [rad]. Of a gait that goes nowhere on the level, the direction of its
        tail link at phase 0. By default 0, or of a solution's gait for a slope its own.
    theta : float, optional
        The same by the direction of the tail link at phase 0 from straight uphill; instead of a
        heading.
    periods : int
    tolerance : float
        Of headings, ways and works over a period, about; what is left is stated
        (`SlopeMotion.error`).
    breaks : (n,), optional
        Phases in (0, 1) where the rates jump, as `gait.corner_phases`.

    Raises
    ------
    ProblemError
        For a body that is no chain, or a slope that is steeper than friction can hold.
    NotConvergedError
        If no balance is found at some instant: unequal coefficients may hold the body in one
        direction and not in another.

    Examples
    --------
    The most efficient gait of one harmonic is none for slopes:

    >>> import colloc
    >>> gait = colloc.ellipse(A0=0, A1=2.859, B1=1.302)
    >>> for grade in (0.0, 0.05, 0.1):
    ...     ran = colloc.slope_motion(colloc.Chain(), colloc.Friction(), gait, delta=1e-4,
    ...         grade=grade)
    ...     print(ran.climb.round(3), ran.joint_work.round(3))
    [0.268] [1.03]
    [0.181] [1.041]
    [0.091] [1.048]
    """
    on = GaitOnSlope(body, friction, gait, delta, grade, breaks)
    if heading is None and theta is None:
        theta = getattr(gait, "theta", None)
    check_finite(heading=0.0 if heading is None else heading, theta=0.0 if theta is None else theta)
    check_finite(positive=True, tolerance=tolerance)
    check_count(MOST_PERIODS, periods=periods)
    course = on.course(tolerance)
    heading = (heading or 0.0) if theta is None else theta + course
    loose = on.run(course, heading, periods, _LOOSER * tolerance).states[:5, -1]
    ran = on.run(course, heading, periods, tolerance)
    error = float(np.abs(ran.states[:5, -1] - loose).max())
    return replace(ran, error=error, several=on.several(ran.phases, ran.states[0]))


def slope_replay(
    body: Body,
    friction: Law,
    gait: Any,
    delta: float,
    *,
    slope: Regime,
    instants: int = 1600,
    tolerance: float = 1e-6,
    breaks: np.ndarray | tuple[float, ...] = (),
    objective: Objective = EFFICIENCY,
    quantities: Iterable[Quantity | str] = (),
    limits: Iterable[PathLimit] | PathLimits = (),
    **_: object,
) -> Replay:
    """A period of a gait that says where it points, with the arguments of `colloc.replay`: the
    distance is the way in the direction that counts, the work that of the joints."""
    asked = dict.fromkeys([LENGTH, *objective.integrals, *quantities_of(quantities)])
    with_forces = [each for each in asked if each.needs_forces]
    totals = whole_totals([each for each in asked if not each.needs_forces], gait)
    on = GaitOnSlope(body, friction, gait, delta, slope.grade, breaks)

    def run(aim: float) -> tuple[tuple[Course, float], dict[str, float]]:
        ran = on.integrate(np.array([gait.theta]), aim, _LONGEST / instants)
        theta, climb, aside, spent, *_ = ran.states[:, -1] - ran.states[:, 0]
        way, work = slope.travel_along(complex(climb, aside)), float(spent + slope.grade * climb)
        numbers = {"distance": way.real, "work": work, "rotation": float(theta)}
        sums = on.totals(ran, with_forces, np.ones(1))[:, 0].tolist()
        names = (each.name for each in with_forces)
        return (ran, way.imag), numbers | dict(zip(names, sums, strict=True))

    first = _FIRST * tolerance
    (ran, across), values, errors = to_tolerance(run, first, objective, tolerance, totals)
    limits, phases = limits_of(limits, body.n_joint), ran.phases % 1.0
    now, residual = on.instants(phases, ran.states[0])
    used = limits.at(now) if limits.names else np.empty((0, phases.size))
    return Replay(
        values=values,
        errors=errors,
        others={},
        lever=float(lever(body, now.angles).max()),
        actuator_work=float(ran.states[4, -1]),
        residual=float(residual.max()),
        error=float(objective.relative_error(values, errors)),
        several=on.several(ran.phases, ran.states[0]),
        instants=phases.size,
        tail=(phases, now.z),
        shares=limits.sizes(used).max(axis=1),
        objective=objective,
        across=across,
    )
