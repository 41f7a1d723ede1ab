"""A gait played with inertia, period by period alike: by Adams' and Gear's methods, steps of their
own, and shooting.

How fast a gait is played matters once the body's mass does. The Froude number Fr = L/(g T^2),
length over gravity and the period squared, says how much: it is the mass times acceleration of a
body that covers its length in a period, over its weight. It counts against the coefficient of
friction. At Fr = 0 this is `colloc.verification.replay.replay`.

Nothing is shared with collocation but the forces. The momenta after a period are those before it;
they are found by Newton's method on the map from one to the other, whose derivatives also say
whether the motion is stable.
"""

from __future__ import annotations

from collections.abc import Iterable
from contextlib import suppress
from dataclasses import dataclass, field
from functools import lru_cache, partial
from typing import Any, NamedTuple

import numpy as np

from colloc.gaits.objective import EFFICIENCY, Objective
from colloc.gaits.period import Period, chord_per_way
from colloc.gaits.regime import LEVEL, Regime
from colloc.gaits.sloped import Slope
from colloc.mechanics.bodies import Body
from colloc.mechanics.chain import Chain
from colloc.mechanics.densities import LENGTH, Quantity, quantities_of
from colloc.mechanics.fixed_point import solve_balance
from colloc.mechanics.inertia import checked_mass, momenta
from colloc.mechanics.law import Law
from colloc.motion.compiled_momenta import MomentaAt
from colloc.motion.follow import ONE_SIDED, STEP, Course, followed
from colloc.system.arguments import MOST_PERIODS, check_count, check_finite
from colloc.system.errors import NotConvergedError
from colloc.verification.adaptive_motion import whole_totals
from colloc.verification.played import Numbers, Path, to_tolerance

_ROUGH = 1e-4
"""Error of the runs that say how the momenta at the end depend on those at the start, over the size
of the momenta; less where friction is so dry that a step would err by more than a tenth of delta:
then bodies that should rest are shaken to and fro."""
_APART = 1e-3
"""How far the runs of that start from each other."""
_CLOSED = 10.0
"""Gap between the momenta at start and end that is left open at most, over the error of a run:
where steps close it no more."""
_USUAL = 0.125
"""What the ends of two runs differ by, over the larger of the errors that were asked of their
steps: at most, in 19 of 20."""
_MOST_PERIODS = 30
_MOMENTA, _THETA, _PLACE, _WORK = slice(0, 3), 3, slice(4, 6), 6


@dataclass(frozen=True, eq=False)
class InertialMotion(Period):
    """A gait played with inertia, over one period of the motion in which all periods are alike.

    The work is that against friction [weight x length]; errors are those of
    `GaitWithInertia.errors`.

    Attributes
    ----------
    froude : float
        Froude number L/(g T^2).
    multipliers : (3,)
        By what small changes of the momenta are multiplied in a period (Floquet multipliers);
        stable if all are within 1.
    phases, states : (n,), (7, n)
        Where the solver stepped, and Vx, Vy, H (`colloc.mechanics.inertia`), the tail link's
        orientation, the place of the centre of mass, and the work up to there; orientation and
        place are seen from axes that turn evenly.
    """

    froude: float
    multipliers: np.ndarray = field(repr=False)
    phases: np.ndarray = field(repr=False)
    states: np.ndarray = field(repr=False)

    @property
    def error(self) -> float:
        """Relative error of the efficiency."""
        return self.error_of(EFFICIENCY)

    @property
    def stable(self) -> bool:
        """Whether motions beside this one come closer to it, period by period."""
        return bool(np.abs(self.multipliers).max() < 1.0)


class GaitWithInertia:
    """A gait of a chain, and how fast it is played.

    Parameters
    ----------
    body, friction, path, delta
    froude : float
    breaks : tuple of float
        Phases in (0, 1), ascending, at which the rates jump.
    turn : float
        That a period is asked for [rad].
    regime : Regime
        Whose weight pulls, as on a slope; then orientations are from straight uphill.
    theta : float
        Angle of the tail link at first [rad].
    """

    def __init__(
        self,
        body: Chain,
        friction: Law,
        path: Path,
        delta: float,
        *,
        froude: float,
        breaks: tuple[float, ...] = (),
        turn: float = 0.0,
        regime: Regime = LEVEL,
        theta: float = 0.0,
    ) -> None:
        self.body, self.friction, self.path, self.delta = body, friction, path, delta
        self.froude, self.breaks, self.turn, self.regime, self.theta = (
            froude,
            breaks,
            turn,
            regime,
            theta,
        )
        self._rough = min(_ROUGH, 0.1 * delta / STEP)
        self._momenta_of = lru_cache(partial(MomentaAt, body, friction, delta, froude))

    def slow_momenta(self) -> np.ndarray:
        """Those at the start of the period if the gait is played slowly on the level, ``(3,)``:
        where to begin."""
        angles, rates = self.path(np.full(1, ONE_SIDED))
        return self.momenta(
            solve_balance(self.body, self.friction, angles, rates, self.delta).require().z
        )

    def momenta(self, z: np.ndarray) -> np.ndarray:
        """Those at the start of the period, ``(3,)``, where the tail link has a velocity ``(3,
        1)``."""
        angles, rates = self.path(np.full(1, ONE_SIDED))
        posture = self.body.posture(angles)
        return momenta(self.body, posture, self.body.velocity(posture, rates, z))[:, 0]

    def run(self, start: np.ndarray, aim: float) -> Course:
        """`InertialMotion.states` through a period from a state ``(7,)``, or from momenta ``(3,)``
        at the origin."""
        return self._run(np.append(start, [self.theta, 0.0, 0.0, 0.0][start.size - 3 :])[None], aim)

    def _run(self, begin: np.ndarray, aim: float) -> Course:
        """Several such motions with the same steps, from states ``(n, 7)``."""

        def slope(t: float, states: np.ndarray, _: None) -> tuple[np.ndarray, None]:
            return self._rates(t, states.reshape(begin.shape)).ravel(), None

        return followed(slope, begin.ravel(), aim, self.breaks)

    def mapped(self, start: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """States before and after a period ``(7, 2)``, and derivatives of the latter with respect
        to the momenta before it, ``(7, 3)``, by differences."""
        begin = np.zeros((4, 7))
        begin[:, _MOMENTA], begin[:, _THETA] = (
            start + np.vstack([np.zeros(3), _APART * np.eye(3)]),
            self.theta,
        )
        end = self._run(begin, self._rough).states[:, -1].reshape(begin.shape)
        return np.stack([begin[0], end[0]], axis=1), (end[1:] - end[0]).T / _APART

    def closed(self, near: np.ndarray) -> Closed:
        """A period near some momenta that leaves them as they are, but for the error of rough
        runs."""
        start = near
        for _ in range(_MOST_PERIODS):
            ends, slopes = self.mapped(start)
            step = _newton_step(ends[_MOMENTA, 1] - start, slopes)
            start = start + step
            if np.abs(step).max() < _CLOSED * self._rough:
                return Closed(start, ends, slopes)
        raise NotConvergedError(
            f"at a Froude number of {self.froude:g} no motion was found in which all periods are "
            f"alike; try a smaller one."
        )

    def closed_from(self, near: np.ndarray | None) -> Closed:
        """`closed` near some momenta; where they are not given or lead nowhere, near the slow ones,
        or near none: a body that friction hardly brakes keeps what it begins with at rest."""
        for begin in (lambda: near, self.slow_momenta):
            with suppress(NotConvergedError):
                if (momenta := begin()) is not None:
                    return self.closed(momenta)
        return self.closed(np.zeros(3))

    def periodic_run(self, near: np.ndarray, aim: float, slopes: np.ndarray) -> PeriodicRun:
        """A period that leaves the momenta as they are, to an error, sought near those of `closed`,
        with its derivatives."""
        start, before = near, np.inf
        for _ in range(_MOST_PERIODS):
            ran = self.run(start, aim)
            gap = ran.states[_MOMENTA, -1] - start
            step = _newton_step(gap, slopes)
            start, size = start + step, np.abs(step).max()
            if size < aim or (before <= size and np.abs(gap).max() < _CLOSED * aim):
                return PeriodicRun(ran, start, aim)
            before = size
        raise NotConvergedError(
            f"at a Froude number of {self.froude:g} the periods do not become alike; try a "
            f"smaller one."
        )

    def errors(self, ran: PeriodicRun, before: PeriodicRun, slopes: np.ndarray) -> Numbers:
        """How wrong `passed` of a run may be, seen from one whose steps might err more.

        From a start s a run ends at F(s) + e, F being the exact map of a period, and e what its
        steps err by. The true motion starts where the momenta are those at the end, s* = F(s*); so

            s* - s = (I - M)^-1 (gap - e),

        M being the derivatives of the momenta, and gap what is left open. Errors of momenta are
        multiplied many times where friction brakes little, and so carried with the body through all
        the period. Of e a bound is the difference of the ends of both runs, had they had one start;
        but it is the aim at least, as differences vanish now and then.
        """
        (first, last), (other, end) = (each.ends.T for each in (ran, before))
        steps = np.maximum(np.abs(end - last - slopes @ (other - first)[_MOMENTA]), ran.aim)
        return self.changes(ran.ends, slopes, steps, np.abs(last - first)[_MOMENTA])

    def changes(
        self, ends: np.ndarray, slopes: np.ndarray, steps: np.ndarray, gap: np.ndarray
    ) -> Numbers:
        """Of `passed` between states ``(7, 2)``, where those at the end err by `steps` ``(7,)``,
        and momenta do not close by a gap ``(3,)``."""
        off = np.column_stack([np.diag(steps), amplified(slopes) * (steps[_MOMENTA] + gap)])
        numbers, changed = (
            self.passed(ends),
            [self.passed(np.column_stack([ends[:, 0], ends[:, 1] + each])) for each in off.T],
        )
        return {
            name: sum(abs(each[name] - value) for each in changed)
            for name, value in numbers.items()
        }

    def _at(self, t: float, states: np.ndarray) -> np.ndarray:
        """What `colloc.motion.compiled_momenta` says of a phase and n momenta, with the weight's
        pull, ``(n, 9)``."""
        angles, rates = self.path(np.array([t]))
        now = self._momenta_of(len(states))(angles[:, 0], rates[:, 0], states[:, _MOMENTA])
        if self.regime.slides:
            pull: Any = self.regime.pull(states[None, :, _THETA])
            now[:, -3:-1] += pull.T / self.froude
        return now

    def _rates(self, t: float, states: np.ndarray) -> np.ndarray:
        """Of `InertialMotion.states` ``(n, 7)`` at a phase."""
        now, rates = self._at(t, states), np.empty(states.shape)
        moved = np.exp(1j * states[:, _THETA]) * (now[:, 3] + 1j * now[:, 4])
        rates[:, _MOMENTA], rates[:, _THETA], rates[:, _WORK] = (
            now[:, 6:],
            now[:, 2] - self.turn,
            now[:, 5],
        )
        rates[:, 4], rates[:, 5] = moved.real, moved.imag
        return rates

    def passed(self, states: np.ndarray) -> dict[str, float]:
        """Distance, work of the joints and rotation from the first of states ``(7, n)`` to the
        last."""
        gone = states[:, -1] - states[:, 0]
        way = self.regime.counted(complex(*gone[_PLACE]))
        work = float(gone[_WORK] + self.regime.grade * gone[_PLACE][0])
        return {
            "distance": chord_per_way(self.turn) * way.real,
            "work": work,
            "rotation": float(gone[_THETA]) + self.turn,
        }


class Closed(NamedTuple):
    """A period that leaves the momenta as they are, but for the error of rough runs."""

    momenta: np.ndarray
    """At the start, ``(3,)``."""
    ends: np.ndarray
    """States at the start and the end, ``(7, 2)``, about."""
    slopes: np.ndarray
    """Of the states at the end with respect to the momenta at the start, ``(7, 3)``."""


class PeriodicRun(NamedTuple):
    """A period that leaves the momenta as they are, to an error."""

    course: Course
    momenta: np.ndarray
    """At the start of one that would close the gap that is left, ``(3,)``: where a body glides far
    they are much further away than the gap is wide."""
    aim: float

    @property
    def ends(self) -> np.ndarray:
        """States at the start and the end, ``(7, 2)``."""
        return self.course.states[:, [0, -1]]


def amplified(slopes: np.ndarray) -> np.ndarray:
    """Derivatives ``(7, 3)`` of the states at the end of a period with respect to what every period
    adds to the momenta."""
    return np.asarray(np.linalg.solve(np.eye(3) - slopes[_MOMENTA].T, slopes.T).T)


def _newton_step(gap: np.ndarray, slopes: np.ndarray) -> np.ndarray:
    """To where a period changes nothing."""
    return np.linalg.solve(np.eye(3) - slopes[_MOMENTA], gap)


def gait_with_inertia(
    body: Body,
    friction: Law,
    gait: Path,
    delta: float,
    *,
    froude: float,
    breaks: np.ndarray | tuple[float, ...],
    turn: float = 0.0,
    regime: Regime = LEVEL,
) -> GaitWithInertia:
    """A gait of a body, or a `ProblemError` that says why it cannot be played with inertia."""
    chain, at = checked_mass(body), tuple(sorted(float(t) for t in breaks))
    theta = float(getattr(gait, "theta", None) or 0.0)
    how: Any = {
        "froude": float(froude),
        "breaks": at,
        "turn": turn,
        "regime": regime,
        "theta": theta,
    }
    return GaitWithInertia(chain, friction, gait, delta, **how)


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
    """Play a gait with inertia, once the body has settled to a motion in which all periods are
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
        What shapes and their rates sum up to and is asked for besides.
    regime : Regime
        On a slope `problem.regime`, or `colloc.gaits.sloped.Slope`: the gait says where it points,
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
    played = gait_with_inertia(
        body, friction, gait, delta, froude=froude, breaks=breaks, turn=turn, regime=regime
    )
    start, ends, slopes = played.closed_from(near)
    totals = whole_totals([LENGTH, *objective.integrals, *quantities_of(quantities)], gait)
    period = {"period": float(froude) ** -0.5}

    def run(aim: float) -> tuple[PeriodicRun, Numbers]:
        nonlocal start
        ran = played.periodic_run(start, aim, slopes)
        start = ran.momenta
        return ran, played.passed(ran.ends) | period

    # runs that cannot be the last but one are left out
    usual = played.changes(ends, slopes, np.full(7, _USUAL * tolerance), np.zeros(3))
    lost = objective.relative_error(played.passed(ends) | period | totals[0], usual)
    first = tolerance / max(1.0, lost / tolerance)
    ran, values, errors = to_tolerance(
        run, first, objective, tolerance, totals, partial(played.errors, slopes=slopes)
    )
    multipliers, course = np.linalg.eigvals(slopes[_MOMENTA]), ran.course
    return InertialMotion(
        values, errors, {}, froude, multipliers, phases=course.phases, states=course.states
    )


class FromRest(NamedTuple):
    """Periods of a gait that a body with inertia begins at rest."""

    phases: np.ndarray
    """Where the solver stepped, ``(n,)``, from 0 to the number of periods."""
    states: np.ndarray
    """There, as in `InertialMotion`, ``(7, n)``."""
    periods: np.ndarray
    """Distance, work and rotation of each period, ``(n_period, 3)``."""


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
    """Play a gait from rest: how a body with inertia comes to the motion in which all periods are
    alike, or glides downhill.

    Its momenta are zero at first, while its joints already turn at the gait's rates.

    Parameters
    ----------
    body, friction, gait, delta, froude, breaks
        As of `inertial_motion`.
    periods : int
        How many.
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
    >>> begun = colloc.motion_from_rest(colloc.Chain(), colloc.Friction(), gait, delta=1e-2,
    ...     froude=0.1, periods=2)
    >>> begun.periods[:, 0].round(3)
    array([0.12 , 0.146])
    """
    check_finite(positive=True, froude=froude, delta=delta, tolerance=tolerance)
    check_count(MOST_PERIODS, periods=periods)
    check_finite(grade=grade, theta=theta)
    regime = Slope(float(grade)) if grade else LEVEL
    played = gait_with_inertia(
        body, friction, gait, delta, froude=froude, breaks=breaks, regime=regime
    )
    courses: list[tuple[np.ndarray, np.ndarray]] = []
    passed, start = [], np.zeros(7)
    start[_THETA] = theta
    for _ in range(periods):
        course = played.run(start, tolerance)
        courses.append((course.phases + len(courses), course.states))
        before, start = start, course.states[:, -1]
        gone = start - before
        passed.append([np.hypot(*gone[_PLACE]), gone[_WORK], gone[_THETA]])
    phases, states = (np.concatenate(parts, axis=-1) for parts in zip(*courses, strict=True))
    return FromRest(phases, states, np.array(passed))
