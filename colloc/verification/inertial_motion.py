"""Gaits with inertia by shooting: Adams' and Gear's methods, and Newton's on the map of a period.

At the Froude number Fr = L/(g T^2) mass times acceleration counts against friction as Fr to mu; at
0 this is `colloc.replay`. Nothing is shared with collocation but the forces.
"""

from __future__ import annotations

from collections.abc import Iterable
from contextlib import suppress
from dataclasses import dataclass, field
from functools import lru_cache, partial
from typing import Any, NamedTuple

import numpy as np

from colloc.dynamics.chain import MomentaAt, joint_torques
from colloc.dynamics.follow import ONE_SIDED, STEP, Course, integrate_period
from colloc.gaits.objective import EFFICIENCY, Objective
from colloc.gaits.period import Period, chord_per_way
from colloc.gaits.regime import LEVEL, Regime
from colloc.mechanics.bodies import Body
from colloc.mechanics.densities import LENGTH, Instants, PathLimits, Quantity, quantities_of
from colloc.mechanics.fixed_point import solve_balance
from colloc.mechanics.inertia import checked_mass, kinetic_energy, momenta, tail_velocity
from colloc.mechanics.law import Law
from colloc.system.arguments import MOST_PERIODS, check_count, check_finite
from colloc.system.errors import NotConvergedError
from colloc.verification.adaptive_motion import whole_totals
from colloc.verification.replay_record import (
    Numbers,
    Path,
    Replay,
    lever,
    through_periods,
    to_tolerance,
)

_ROUGH = 1e-4
"""Error of the runs that differentiate the period map; less where friction is so dry that a step
would err by more than a tenth of delta: bodies that should rest are then shaken to and fro."""
_APART = 1e-3  # distance between the starts of those runs
_LEFT_OPEN = 10.0
"""Gap between the momenta that is left open, over the error of a run, where steps close it no
more."""
_USUAL = 0.125
"""Difference between the ends of two runs, over the error asked of their steps: at most, in 19 of
20."""
_MOST_STEPS = 30
_OTHER = 1e-2  # momenta [body lengths per period] by which two motions differ that are not one
_MOMENTA, _THETA, _PLACE, _WORK = slice(0, 3), 3, slice(4, 6), 6


@dataclass(frozen=True, eq=False)
class InertialMotion(Period):
    """A period of a gait with inertia that leaves the momenta as they are; the work is that against
    friction [weight x length]."""

    froude: float  # L/(g T^2)
    multipliers: np.ndarray = field(repr=False)
    """By what small changes of the momenta are multiplied in a period (Floquet multipliers)."""
    phases: np.ndarray = field(repr=False)
    """Phases ``(n,)`` where the solver stepped."""
    states: np.ndarray = field(repr=False)
    """Vx, Vy, H (`colloc.mechanics.inertia`), the tail link's orientation, the place of the centre
    of mass, and the work up to there, ``(7, n)``; seen from axes that turn evenly."""

    @property
    def error(self) -> float:
        """Relative error of the efficiency."""
        return self.error_of(EFFICIENCY)

    @property
    def stable(self) -> bool:
        """Whether motions beside this one come closer to it, period by period."""
        return bool(np.abs(self.multipliers).max() < 1.0)


class RoughPeriod(NamedTuple):
    """A period that leaves the momenta as they are, but for `_rough`."""

    momenta: np.ndarray  # at the start, (3,)
    ends: np.ndarray  # states at the start and the end, (7, 2)
    slopes: np.ndarray  # of the states at the end by the momenta at the start, (7, 3)


class PeriodicRun(NamedTuple):
    """A period that leaves the momenta as they are, to an error `aim`."""

    course: Course
    momenta: np.ndarray
    """At the start of one that would close the gap that is left: where a body glides far they are
    much further away than the gap is wide."""
    aim: float

    @property
    def ends(self) -> np.ndarray:
        return self.course.states[:, [0, -1]]


class GaitWithInertia:
    """A gait of a chain at a Froude number; on a slope orientations are from straight uphill."""

    def __init__(
        self,
        body: Body,
        friction: Law,
        gait: Path,
        delta: float,
        *,
        froude: float,
        breaks: np.ndarray | tuple[float, ...] = (),
        turn: float = 0.0,
        regime: Regime = LEVEL,
    ) -> None:
        self.body, self.path = checked_mass(body), gait
        self.friction, self.delta, self.froude = friction, delta, float(froude)
        self.breaks, self.turn, self.regime = tuple(sorted(map(float, breaks))), turn, regime
        self.theta = float(getattr(gait, "theta", None) or 0.0)  # of the tail link at first
        self._rough = min(_ROUGH, 0.1 * delta / STEP)
        self._momenta_of = lru_cache(partial(MomentaAt, self.body, friction, delta, self.froude))

    def momenta(self, z: np.ndarray | None = None) -> np.ndarray:
        """Momenta at phase 0 for a velocity of the tail link ``(3, 1)``; by default the
        quasi-static one."""
        angles, rates = self.path(np.full(1, ONE_SIDED))
        if z is None:
            z = solve_balance(self.body, self.friction, angles, rates, self.delta).require().z
        posture = self.body.posture(angles)
        return momenta(self.body, posture, self.body.velocity(posture, rates, z))[:, 0]

    def run(self, start: np.ndarray, aim: float) -> Course:
        """`InertialMotion.states` through a period from a state ``(7,)``, or momenta ``(3,)`` at
        the origin."""
        return self._run(np.append(start, [self.theta, 0.0, 0.0, 0.0][start.size - 3 :])[None], aim)

    def _run(self, begin: np.ndarray, aim: float) -> Course:
        """Several motions with the same steps, from states ``(n, 7)``."""

        def rates(t: float, states: np.ndarray, _: None) -> tuple[np.ndarray, None]:
            return self._rates(t, states.reshape(begin.shape)).ravel(), None

        return integrate_period(rates, begin.ravel(), aim, self.breaks)

    def _at(self, t: float, states: np.ndarray) -> np.ndarray:
        """Outputs of `colloc.dynamics.chain`, with the weight's pull, ``(n, 9)``."""
        angles, rates = self.path(np.array([t]))
        now = self._momenta_of(len(states))(angles[:, 0], rates[:, 0], states[:, _MOMENTA])
        if self.regime.slides:
            pull: Any = self.regime.pull(states[None, :, _THETA])
            now[:, -3:-1] += pull.T / self.froude
        return now

    def _rates(self, t: float, states: np.ndarray) -> np.ndarray:
        now, rates = self._at(t, states), np.empty(states.shape)
        moved = np.exp(1j * states[:, _THETA]) * (now[:, 3] + 1j * now[:, 4])
        rates[:, _MOMENTA], rates[:, _THETA] = now[:, 6:], now[:, 2] - self.turn
        rates[:, 4], rates[:, 5], rates[:, _WORK] = moved.real, moved.imag, now[:, 5]
        return rates

    def totals(self, states: np.ndarray) -> Numbers:
        """Distance, work of the joints and rotation from the first of states ``(7, n)`` to the
        last."""
        change = states[:, -1] - states[:, 0]
        way = self.regime.travel_along(complex(*change[_PLACE]))
        return {
            "distance": chord_per_way(self.turn) * way.real,
            "work": float(change[_WORK] + self.regime.grade * change[_PLACE][0]),
            "rotation": float(change[_THETA]) + self.turn,
        }

    def period_map(self, start: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """States before and after a period ``(7, 2)``, and derivatives of the latter by the momenta
        before it, ``(7, 3)``, by differences."""
        begin = np.zeros((4, 7))
        begin[:, _MOMENTA] = start + np.vstack([np.zeros(3), _APART * np.eye(3)])
        begin[:, _THETA] = self.theta
        end = self._run(begin, self._rough).states[:, -1].reshape(begin.shape)
        return np.stack([begin[0], end[0]], axis=1), (end[1:] - end[0]).T / _APART

    def rough_period(self, near: np.ndarray) -> RoughPeriod:
        """A period near some momenta that leaves them as they are."""
        start = near
        for _ in range(_MOST_STEPS):
            ends, slopes = self.period_map(start)
            step = _newton_step(ends[_MOMENTA, 1] - start, slopes)
            start = start + step
            if np.abs(step).max() < _LEFT_OPEN * self._rough:
                return RoughPeriod(start, ends, slopes)
        raise NotConvergedError(
            f"at a Froude number of {self.froude:g} no motion was found in which all periods are "
            f"alike; try a smaller one."
        )

    def find_period(self, near: np.ndarray | None = None) -> RoughPeriod:
        """`rough_period` near some momenta; else near the quasi-static ones, or none: a body that
        friction hardly brakes keeps what it begins with."""
        if near is not None:
            with suppress(NotConvergedError):
                return self.rough_period(near)
        with suppress(NotConvergedError):
            return self.rough_period(self.momenta())
        return self.rough_period(np.zeros(3))

    def periodic_run(self, near: np.ndarray, aim: float, slopes: np.ndarray) -> PeriodicRun:
        """A period that leaves the momenta as they are, to an error, from a `RoughPeriod`."""
        start, before = near, np.inf
        for _ in range(_MOST_STEPS):
            course = self.run(start, aim)
            gap = course.states[_MOMENTA, -1] - start
            step = _newton_step(gap, slopes)
            start, size = start + step, np.abs(step).max()
            if size < aim or (before <= size and np.abs(gap).max() < _LEFT_OPEN * aim):
                return PeriodicRun(course, start, aim)
            before = size
        raise NotConvergedError(
            f"at a Froude number of {self.froude:g} the periods do not become alike; try a "
            f"smaller one."
        )

    def errors(self, ran: PeriodicRun, before: PeriodicRun, slopes: np.ndarray) -> Numbers:
        """Errors of the `totals` of a run, seen from one whose steps might err more.

        From a start s a run ends at F(s) + e, F being the exact map of a period. The true motion
        starts at s* = F(s*); so, M being the derivatives of the momenta, gap what is left open,

            s* - s = (I - M)^-1 (gap - e).

        A bound of e is the difference of the ends of both runs, had they had one start, but the aim
        at least, as differences vanish now and then.
        """
        (first, last), (other, end) = (each.ends.T for each in (ran, before))
        steps = np.maximum(np.abs(end - last - slopes @ (other - first)[_MOMENTA]), ran.aim)
        return self.changes(ran.ends, slopes, steps, np.abs(last - first)[_MOMENTA])

    def changes(
        self, ends: np.ndarray, slopes: np.ndarray, steps: np.ndarray, gap: np.ndarray
    ) -> Numbers:
        """Changes of `totals` where the end errs by `steps` ``(7,)`` and momenta do not close by a
        gap."""
        off = np.column_stack([np.diag(steps), amplification(slopes) * (steps[_MOMENTA] + gap)])
        (start, end), totals = ends.T, self.totals(ends)
        changed = [self.totals(np.column_stack([start, end + each])) for each in off.T]
        return {x: sum(abs(other[x] - value) for other in changed) for x, value in totals.items()}


def amplification(slopes: np.ndarray) -> np.ndarray:
    """Derivatives ``(7, 3)`` of the end of a period by what every period adds to the momenta."""
    return np.asarray(np.linalg.solve(np.eye(3) - slopes[_MOMENTA].T, slopes.T).T)


def _newton_step(gap: np.ndarray, slopes: np.ndarray) -> np.ndarray:
    return np.linalg.solve(np.eye(3) - slopes[_MOMENTA], gap)


def inertial_motion(
    body: Body,
    friction: Law,
    gait: Path,
    delta: float,
    froude: float,
    *,
    tolerance: float = 1e-5,
    breaks: np.ndarray | tuple[float, ...] = (),
    objective: Objective = EFFICIENCY,
    turn: float = 0.0,
    quantities: Iterable[Quantity | str] = (),
    regime: Regime = LEVEL,
    near: np.ndarray | None = None,
) -> InertialMotion:
    """Move a body by a gait with inertia, once it has settled to a motion in which all periods are
    alike.

    Parameters
    ----------
    body : Chain
        With the masses of its links.
    friction : Law
    gait : callable
        Joint angles and rates at phases in [0, 1]; any gait of colloc. Its pace within the period
        counts.
    delta : float
        Regularisation speed, per period.
    froude : float
        Froude number L/(g T^2), above 0: 0.0255 for a body of 1 m in 2 s. What counts is its ratio
        to the friction coefficient.
    tolerance : float
        Relative error of the objective.
    breaks : (n,), optional
        Phases in (0, 1) where the rates jump, as `gait.corner_phases`.
    objective : Objective
        Of distance, work, rotation, period [sqrt(length / gravity)] and what shapes and their rates
        sum up to.
    turn : float
        Net rotation that the gait is asked for [rad]: the distance is the chord of an arc that
        turns by as much.
    quantities : iterable of Quantity or str
        Further quantities that shapes and their rates sum up to.
    regime : Regime
        On a slope `problem.regime`, or `colloc.gaits.regime.Regime`: the gait says where it points,
        distance and work are as of `colloc.slope_motion`.
    near : (3,), optional
        Momenta at phase 0 to begin with, as those of another delta; then as if the gait were played
        slowly, or else at rest.

    Raises
    ------
    ProblemError
        If the body is no chain, or numbers are out of range.
    NotConvergedError
        If no such motion is found, or rounding hides the accuracy that is asked for.

    Examples
    --------
    >>> import colloc
    >>> gait = colloc.ellipse(A0=0, A1=2.859, B1=1.302)
    >>> played = colloc.inertial_motion(colloc.Chain(), colloc.Friction(), gait, delta=1e-2,
    ...     froude=0.1, tolerance=1e-3)
    >>> round(played.efficiency, 3), played.stable
    (0.136, True)
    """
    check_finite(positive=True, froude=froude, delta=delta)
    moving = GaitWithInertia(
        body, friction, gait, delta, froude=froude, breaks=breaks, turn=turn, regime=regime
    )
    start, ends, slopes = moving.find_period(near)
    totals = whole_totals([LENGTH, *objective.integrals, *quantities_of(quantities)], gait)
    period = {"period": float(froude) ** -0.5}

    def run(aim: float) -> tuple[PeriodicRun, Numbers]:
        nonlocal start
        ran = moving.periodic_run(start, aim, slopes)
        start = ran.momenta
        return ran, moving.totals(ran.ends) | period

    # runs that cannot be the last but one are left out
    usual = moving.changes(ends, slopes, np.full(7, _USUAL * tolerance), np.zeros(3))
    lost = objective.relative_error(moving.totals(ends) | period | totals[0], usual)
    first = tolerance / max(1.0, lost / tolerance)
    errors_of = partial(moving.errors, slopes=slopes)
    ran, values, errors = to_tolerance(run, first, objective, tolerance, totals, errors_of)
    multipliers, (phases, states, _) = np.linalg.eigvals(slopes[_MOMENTA]), ran.course
    return InertialMotion(values, errors, {}, froude, multipliers, phases, states)


def inertial_replay(
    body: Body,
    friction: Law,
    gait: Path,
    delta: float,
    *,
    regime: Regime,
    tolerance: float = 1e-6,
    breaks: np.ndarray | tuple[float, ...] = (),
    objective: Objective = EFFICIENCY,
    turn: float = 0.0,
    quantities: Iterable[Quantity | str] = (),
    limits: PathLimits | None = None,
    near: Replay | None = None,
    **_: object,
) -> Replay:
    """`inertial_motion` with the arguments of `colloc.replay`, at the pace of the regime.

    A body from rest may come to another motion: then the gait has several. The joints' work is that
    against friction and what the body gains in kinetic energy.
    """
    regime = regime.at(gait)
    how: Any = {"froude": regime.froude, "breaks": breaks, "turn": turn, "regime": regime}
    moving = GaitWithInertia(body, friction, gait, delta, **how)
    begin = None if near is None else moving.momenta(near.tail_velocity(np.zeros(1)))
    how |= {"tolerance": tolerance, "objective": objective, "quantities": quantities}
    ran = inertial_motion(body, friction, gait, delta, near=begin, **how)
    phases, states, chain = ran.phases % 1.0, ran.states, moving.body
    from_rest = states[_MOMENTA, 0]
    if near is None or near.several:
        with suppress(NotConvergedError):  # Newton's method need not lead to any from there
            from_rest = moving.rough_period(np.zeros(3)).momenta
    several = float(np.abs(from_rest - states[_MOMENTA, 0]).max() > _OTHER)
    other = moving.run(from_rest, tolerance).states if several else states
    here, there = moving.totals(states), moving.totals(other)
    angles, rates = moving.path(phases)
    z = tail_velocity(chain, angles, rates, states[_MOMENTA])
    energy = regime.froude * kinetic_energy(chain, angles, rates, z)[0]
    change = states[:, -1] - states[:, 0]
    shares = np.empty(0)
    if limits is not None and limits.names:
        at: Any = {"delta": delta, "froude": regime.froude}
        moments = joint_torques(chain, friction, moving.path, phases, states[_MOMENTA], **at)
        now = Instants(chain, friction, angles, rates, delta, moments=moments)
        shares = limits.sizes(limits.at(now)).max(axis=1)
    return Replay(
        values=ran.values,
        errors=ran.errors,
        others={name: abs(there[name] - here[name]) for name in here},
        lever=float(lever(chain, angles).max()),
        actuator_work=ran.work + float(energy[-1] - energy[0]),
        residual=float(np.abs(change[_MOMENTA]).max()),
        error=ran.error_of(objective),
        several=several,
        instants=phases.size,
        tail=(phases, z),
        objective=objective,
        across=regime.travel_along(complex(*change[_PLACE])).imag,
        shares=shares,
        multipliers=tuple(map(complex, ran.multipliers)),
    )


class FromRest(NamedTuple):
    """Periods of a gait that a body with inertia begins at rest."""

    phases: np.ndarray  # where the solver stepped, (n,), from 0 to the number of periods
    states: np.ndarray  # there, as in `InertialMotion`, (7, n)
    periods: np.ndarray  # distance, work and rotation of each period, (n_period, 3)


def motion_from_rest(
    body: Body,
    friction: Law,
    gait: Path,
    delta: float,
    froude: float,
    *,
    periods: int = 3,
    tolerance: float = 1e-5,
    breaks: np.ndarray | tuple[float, ...] = (),
    grade: float = 0.0,
    theta: float = 0.0,
) -> FromRest:
    """Move a body with inertia from rest: how it comes to the motion in which all periods are
    alike, or glides downhill.

    Its momenta are zero at first, while its joints already turn at the gait's rates.

    Parameters
    ----------
    body, friction, gait, delta, froude, breaks
        As of `inertial_motion`.
    periods : int
    tolerance : float
        About the error of the states after a period.
    grade : float
        Tangent of the inclination of a slope. There gravity, in the Froude number too, is that
        which presses the body on the ground, and +x is straight uphill; friction need not hold the
        body.
    theta : float
        Angle of the tail link from +x at first [rad].

    Raises
    ------
    ProblemError
        If the body is no chain, or numbers are out of range.
    NotConvergedError
        If the motion cannot be followed.

    Examples
    --------
    >>> import colloc
    >>> gait = colloc.ellipse(A0=0, A1=2.859, B1=1.302)
    >>> ran = colloc.motion_from_rest(colloc.Chain(), colloc.Friction(), gait, delta=1e-2,
    ...     froude=0.1, periods=2)
    >>> ran.periods[:, 0].round(3)
    array([0.12 , 0.146])
    """
    check_finite(positive=True, froude=froude, delta=delta, tolerance=tolerance)
    check_count(MOST_PERIODS, periods=periods)
    check_finite(grade=grade, theta=theta)
    how: Any = {"froude": froude, "breaks": breaks}
    moving = GaitWithInertia(body, friction, gait, delta, regime=Regime(grade=float(grade)), **how)
    start = np.array([0.0, 0.0, 0.0, theta, 0.0, 0.0, 0.0])
    phases, states, ends = through_periods(partial(moving.run, aim=tolerance), start, periods)
    change = np.diff(ends)
    totals = [np.hypot(*change[_PLACE]), change[_WORK], change[_THETA]]
    return FromRest(phases, states, np.array(totals).T)
