r"""Motions by differential equations: on slopes, where the heading is a state, and with inertia,
where momenta are. Nothing is shared with collocation but the forces.

*Slopes.* On a plane of grade g, the tangent of its inclination, the body presses on the ground with
a force of 1. With theta the angle of the tail link from straight uphill, the weight pulls with ``-g
e^(-i theta)`` in the body's axes, the balance gives velocities that depend on theta, and

    d theta/dt = omega(q, q', theta),      d x/dt = e^(i theta) c(q, q', theta),

c being the velocity of the centre of mass in the body's axes and x its place, real part uphill. The
work of the joints, by their moments, is the work against friction + g climb.

*Inertia.* At the Froude number Fr = L/(g T^2) mass times acceleration counts against friction as Fr
to mu; at 0 this is `colloc.replay`. The period that leaves the momenta as they are is found by
shooting: Adams' and Gear's methods, and Newton's on the map of a cycle.
"""

from __future__ import annotations

import threading
import warnings
from collections.abc import Callable, Iterable
from contextlib import suppress
from dataclasses import dataclass
from functools import lru_cache, partial
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

from colloc.dynamics.chain import MomentaAt, balance_on_slope, joint_torques, momenta_at
from colloc.gaits.objective import Objective, chord_per_way
from colloc.gaits.regime import LEVEL, Regime, checked_chain
from colloc.mechanics.bodies import Body
from colloc.mechanics.chain import Chain
from colloc.mechanics.densities import Instants, PathLimits, Quantity
from colloc.mechanics.fixed_point import solve_balance
from colloc.mechanics.inertia import checked_mass, kinetic_energy, momenta, tail_velocity
from colloc.mechanics.law import Law
from colloc.mechanics.solution_branches import all_balanced_velocities
from colloc.system.arguments import MOST_PERIODS, check_count, check_finite
from colloc.system.errors import NotConvergedError, ProblemError
from colloc.verification.adaptive_motion import (
    PANEL_RULE,
    Numbers,
    Path,
    Replay,
    fine_motion,
    lever,
    to_tolerance,
)

STEP = 1 / 100
"""Local error over that of a run. Stick and slip make kinks, which methods of long steps skip
(Runge and Kutta's left 1e-5 at 1e-7 a step); Adams' errs by 8 to 40 times a step."""
_METHODS = ("LSODA", 50_000), ("Radau", np.inf)
"""Methods and their largest number of evaluations; the second for friction that is stiff beside
little inertia."""
ONE_SIDED = 1e-12
"""Distance in phase from a jump at which rates are evaluated."""
_ONE_AT_A_TIME = threading.RLock()
"""Old LSODA is not reentrant, and warning filters are shared by all threads."""


class _TooOften(Exception): ...


class _Interpolant:
    """States at phases, ``(n_state, n)``: the polynomials of a solver's steps, all at once."""

    def __init__(self, ends: list[float], pieces: list[Any]) -> None:
        # LSODA's begin at the end of a step, Radau's at its begin
        of_step = [
            (each.t_old, np.column_stack([each.y_old, each.Q]))
            if hasattr(each, "Q")
            else (each.t, each.yh)
            for each in pieces
        ]
        self._ends, self._length = np.array(ends), np.array([each.h for each in pieces])
        self._origin = np.array([origin for origin, _ in of_step])
        terms = max(each.shape[1] for _, each in of_step)
        self._coefficients = np.zeros((terms, len(pieces), len(of_step[0][1])))
        for k, (_, each) in enumerate(of_step):
            self._coefficients[: each.shape[1], k] = each.T

    def __call__(self, t: np.ndarray) -> np.ndarray:
        step = np.clip(np.searchsorted(self._ends, t) - 1, 0, self._length.size - 1)
        x = ((t - self._origin[step]) / self._length[step])[:, None]
        value = self._coefficients[-1, step]
        for each in self._coefficients[-2::-1]:
            value = value * x + each[step]
        return value.T


class Course(NamedTuple):
    phases: np.ndarray
    """Steps of the solver, ``(n,)``."""
    states: np.ndarray
    at: Callable[[np.ndarray], np.ndarray]
    """States at phases, ``(n_state, n_time)``."""


class _Integrals:
    """Integrals from phase 0 of densities ``(k, n)`` at phases, by Gauss quadrature on panels that
    are halved where that changes more than an error, as at kinks of a power."""

    def __init__(
        self, densities: Callable[[np.ndarray], np.ndarray], edges: np.ndarray, error: float
    ) -> None:
        self._densities = densities
        left, right = edges[:-1], edges[1:]
        whole, lefts, sums = self._panel_sums(left, right), list[np.ndarray](), list[np.ndarray]()
        while left.size:
            middle = 0.5 * (left + right)
            each = np.column_stack([left, middle]).ravel(), np.column_stack([middle, right]).ravel()
            parts = self._panel_sums(*each)
            both = parts[:, ::2] + parts[:, 1::2]
            change = np.abs(both - whole).max(axis=0, initial=0.0)
            off = change > error * np.maximum(right - left, _KINK)
            off &= right - left > 2 * _NARROWEST
            lefts.append(left[~off])
            sums.append(both[:, ~off])
            again = np.repeat(off, 2)
            (left, right), whole = (edge[again] for edge in each), parts[:, again]
        begin = np.concatenate(lefts)
        order = np.argsort(begin)
        self._begin = begin[order]
        self._before = np.cumsum(np.pad(np.hstack(sums)[:, order], ((0, 0), (1, 0))), axis=1)

    def _panel_sums(self, left: np.ndarray, right: np.ndarray) -> np.ndarray:
        t = (left[:, None] + (right - left)[:, None] * PANEL_RULE.c).ravel()
        densities = self._densities(t)
        stages = densities.reshape(len(densities), left.size, PANEL_RULE.c.size)
        return (right - left) * (stages @ PANEL_RULE.b)

    @property
    def whole(self) -> np.ndarray:
        """Up to the last edge, ``(k,)``."""
        return self._before[:, -1]

    def __call__(self, ends: np.ndarray) -> np.ndarray:
        """Up to phases, ``(k, n)``."""
        panel = np.searchsorted(self._begin, ends, side="right") - 1
        return self._before[:, panel] + self._panel_sums(self._begin[panel], ends)


def integrate_period(
    rates: Callable[[float, np.ndarray, Any], tuple[np.ndarray, Any]],
    begin: np.ndarray,
    tolerance: np.ndarray | float,
    breaks: tuple[float, ...] = (),
    longest: float = np.inf,
    jacobian: Callable[[float, np.ndarray], np.ndarray] | None = None,
) -> Course:
    """Follow states from `begin` ``(n_state,)`` at phase 0 to 1, each to about a tolerance, by
    adaptive multistep methods of steps no longer than `longest`; `NotConvergedError` if the solver
    cannot go on.

    rates: of a phase, the states and what it last said to remember (None at first), such as
    velocities from which the next balance may start: their rates, and what to remember. breaks:
    phases in (0, 1), ascending, at which the rates jump. jacobian: derivatives of the rates
    ``(n_state, n_state)`` at a phase; by default from differences, one evaluation a state.
    """
    from scipy.integrate import solve_ivp

    memory: Any = None
    first = last = left = 0.0

    def inside(t):
        return min(max(t, first + ONE_SIDED), last - ONE_SIDED)  # rates may jump at the ends

    def slope(t, state):
        nonlocal memory, left
        left -= 1
        if left < 0:
            raise _TooOften
        slopes, memory = rates(inside(t), state, memory)
        return slopes

    exact = jacobian and (lambda t, state: jacobian(inside(t), state))

    phases, states, ends, pieces, state = [], [], [0.0], [], begin
    for first, last in pairwise([0.0, *breaks, 1.0]):
        accuracy = {"rtol": 1e-13, "atol": STEP * tolerance, "max_step": longest, "jac": exact}
        for method, most in _METHODS:
            left = most
            giving_up = warnings.catch_warnings(action="ignore", category=UserWarning)
            with (
                suppress(_TooOften),
                _ONE_AT_A_TIME,
                giving_up,
                np.errstate(over="ignore"),
            ):  # of the steps of Radau's differences
                run = solve_ivp(
                    slope, (first, last), state, method=method, dense_output=True, **accuracy
                )
                if run.success:
                    break
        else:
            raise NotConvergedError(
                f"the motion could not be followed beyond phase {run.t[-1]:.4f}."
            )
        state = run.y[:, -1]
        phases.append(run.t)
        states.append(run.y)
        ends.extend(run.sol.ts[1:])
        pieces.extend(run.sol.interpolants)
    at = _Interpolant(ends, pieces)
    return Course(np.concatenate(phases), np.concatenate(states, axis=1), at)


_UNITS = np.array([1.0, 1.0, 1.0, 1.0, 1.0, 100.0])
"""Units of the errors of theta, place, works, and of the logarithm of the steering."""
_LOOSER = 30.0  # error of the run that states the error, over that of the run it is of
_PANELS = 40
_FIRST = 0.1  # error of the first run of a replay, over the relative one that is asked for
_LONGEST = 4.0  # longest step of a replay, in instants of a uniform grid
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
_KINK, _NARROWEST = 1e-3, 1e-9
"""Least part of the cycle that a panel's error is held against, as kinks are few; least width."""
_TOGETHER = 4
"""Steps of a run in a panel: they are a few times shorter than quadrature of this order needs."""
_MOMENTA, _THETA, _PLACE, _WORK = slice(0, 3), 3, slice(4, 6), 6
_Breaks = np.ndarray | tuple[float, ...]


def _through_periods(
    run: Callable[[np.ndarray], Course], start: np.ndarray, periods: int
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Phases, states there, and states at the ends of periods ``(n_state, periods + 1)``."""
    courses, ends = [], [start]
    for _ in range(periods):
        courses.append(run(ends[-1]))
        ends.append(courses[-1].states[:, -1])
    phases = np.concatenate([k + course.phases for k, course in enumerate(courses)])
    states = np.concatenate([course.states for course in courses], axis=1)
    return phases, states, np.stack(ends, axis=1)


class _Gait:
    def __init__(
        self, body: Chain, friction: Law, path: Path, delta: float, breaks: _Breaks,
        quantities: Iterable[Quantity],
    ) -> None:  # fmt: skip
        self.body, self.friction, self.path, self.delta = body, friction, path, delta
        self.breaks = tuple(sorted(map(float, breaks)))
        self.quantities = [each for each in dict.fromkeys(quantities) if each.needs_forces]

    def instants(self, t: np.ndarray, states: np.ndarray) -> Instants:
        """Instants at phases where the motion has the states ``(n_state, n)``."""
        raise NotImplementedError

    def integrals(self, course: Course, error: float, motion: int = 0) -> _Integrals:
        """Of quantities that need forces, along one of the motions of a run."""

        def densities(t):
            if not self.quantities:
                return np.empty((0, t.size))
            now = self.instants(t, course.at(t)[7 * motion :])
            return np.stack([each.at(now)[0] for each in self.quantities])

        edges = np.union1d(course.phases[::_TOGETHER], [0.0, 1.0])
        return _Integrals(densities, edges, error)

    def measured(
        self, course: Course, z: np.ndarray, values: Numbers, errors: Numbers, objective: Objective,
        limits: PathLimits, **more: Any,
    ) -> Replay:  # fmt: skip
        angles, _ = self.path(t := course.phases % 1.0)
        shares = np.empty(0)
        if limits.names:  # of torques, perhaps, which are infinite at corners
            shares = limits.sizes(limits.at(self.instants(t, course.states))).max(axis=1)
        error = float(objective.relative_error(values, errors))
        more |= {"lever": lever(self.body, angles), "tail": (course.phases, z), "shares": shares}
        return Replay(values, errors, **more, objective=objective, error=error, instants=t.size)


@dataclass(frozen=True, eq=False)
class SlopeMotion:
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
    steering: np.ndarray  # derivative of a cycle's last heading by its first, always positive
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
        count = self.climb.size
        return (
            f"<SlopeMotion of {count} cycle{'s' * (count > 1)} on a grade of {self.grade:g}: "
            f"climb {self.climb.sum():.6g}, work of the joints {self.joint_work.sum():.6g}, "
            f"heading {self.headings[0]:.4f} -> {self.headings[-1]:.4f}>"
        )

    @property
    def turn(self) -> float:
        """Turn of the heading over all periods [rad]."""
        return float(self.headings[-1] - self.headings[0])

    @property
    def stable(self) -> bool:
        """True if headings beside this one come closer to it."""
        return bool(np.prod(self.steering) < 1.0)


class GaitOnSlope(_Gait):
    """A gait of a chain in slow motion on a slope; its states are those of `SlopeMotion`."""

    def __init__(
        self, body: Body, friction: Law, path: Any, delta: float, slope: Regime,
        breaks: _Breaks = (), quantities: Iterable[Quantity] = (),
    ) -> None:  # fmt: skip
        chain, self.slope = checked_chain(body, friction, slope.grade), slope
        super().__init__(chain, friction, path, delta, breaks, quantities)

    def integrate(
        self, begin: np.ndarray | float, tolerance: float, longest: float = np.inf
    ) -> Course:
        """The states through a cycle, from the first of them at its begin."""

        def rates(t, state, guess):
            at = self.body, self.friction, self.slope, (*self.path(np.array([t])), self.delta)
            solved, now, _, by_theta = balance_on_slope(*at, state[:1], start=guess)
            if not solved.converged.all():
                raise NotConvergedError(
                    f"no balance at phase {t:.4f} on a slope of grade {self.slope.grade:g} "
                    f"(residual {solved.residual[0]:.1e}): friction may be too weak to hold the "
                    f"body in that direction, so that it slides down; try a gentler slope."
                )
            velocity = np.exp(1j * state[0]) * complex(*now.centre[:, 0])
            works = now.power[0], now.actuator_power[0]
            (omega,), (steering,) = now.z[2], by_theta[2]
            return np.array([omega, velocity.real, velocity.imag, *works, steering]), solved.z

        start = np.append(begin, np.zeros(6 - np.size(begin)))
        return integrate_period(rates, start, tolerance * _UNITS, self.breaks, longest)

    def balanced(self, t: np.ndarray, theta: np.ndarray) -> tuple[Instants, np.ndarray]:
        """Instants at phases and orientations ``(n,)``, and the residual of the balance."""
        at = (self.body, self.friction, *self.path(t), self.delta)
        load = self.slope.pull(theta[None])
        solved = solve_balance(*at, load=load)
        return Instants(*at, z=solved.z, load=load), solved.residual

    def instants(self, t: np.ndarray, states: np.ndarray) -> Instants:
        return self.balanced(t, states[0])[0]

    def several(self, phases: np.ndarray, theta: np.ndarray) -> float:
        """Part of the time at which several motions are balanced."""
        if self.friction.associated:
            return 0.0
        at = (self.body, self.friction, *self.path(phases % 1.0), self.delta)
        several = all_balanced_velocities(*at, self.slope.pull(theta[None])).number > 1
        return float(np.diff(phases) @ (0.5 * several[1:] + 0.5 * several[:-1])) / float(phases[-1])

    def replay(
        self, objective: Objective, tolerance: float, extra: Any, limits: PathLimits, instants: int
    ) -> Replay:
        """A cycle of a gait that says where it points: the distance is the way in the direction
        that counts, the work that of the joints."""

        theta_0 = self.path.theta  # type: ignore[attr-defined]

        def run(aim):
            motion = self.integrate(theta_0, aim, _LONGEST / instants)
            theta, climb, aside, spent, *_ = (motion.states[:, -1] - motion.states[:, 0]).tolist()
            way = self.slope.travel_along(complex(climb, aside))
            work = spent + self.slope.grade * climb
            numbers = {"distance": way.real, "work": work, "rotation": theta}
            sums = zip(self.quantities, self.integrals(motion, aim).whole.tolist(), strict=True)
            return (motion, way.imag), numbers | {each.name: total for each, total in sums}

        first = _FIRST * tolerance
        (motion, across), values, errors = to_tolerance(run, first, objective, tolerance, extra)
        now, residual = self.balanced(motion.phases % 1.0, motion.states[0])
        return self.measured(
            *(motion, now.z, values, errors, objective, limits),
            others={},
            actuator_work=float(motion.states[4, -1]),
            residual=float(residual.max()),
            several=self.several(motion.phases, motion.states[0]),
            across=across,
        )


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
    breaks: _Breaks = (),
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
        The same by the direction of the tail link at phase 0; instead of a heading.
    periods : int
    tolerance : float
        Of headings, ways and works over a cycle, about; what is left is stated
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
    on = GaitOnSlope(body, friction, gait, delta, Regime(grade=grade), breaks)
    if heading is None and theta is None:
        theta = getattr(gait, "theta", None)
    check_finite(heading=0.0 if heading is None else heading, theta=0.0 if theta is None else theta)
    check_finite(positive=True, tolerance=tolerance)
    check_count(MOST_PERIODS, periods=periods)
    edges = np.union1d(np.linspace(0.0, 1.0, _PANELS + 1), on.breaks)
    way = fine_motion(on.body, friction, gait, delta, edges, tolerance, None).path[-1]
    course = float(np.angle(way)) if abs(way) > tolerance else 0.0
    start = np.append((heading or 0.0) - course if theta is None else theta, np.zeros(5))
    (_, loose, _), (phases, states, ends) = (
        _through_periods(partial(on.integrate, tolerance=aim), start, periods)
        for aim in (_LOOSER * tolerance, tolerance)
    )
    *ways, steering = np.diff(ends[1:])
    error = float(np.abs(states[:5, -1] - loose[:5, -1]).max())
    several: Any = on.several(phases, states[0]), phases, states
    numbers = float(grade), course, ends[0] + course, *ways, np.exp(steering), error
    return SlopeMotion(*numbers, *several)


class RoughPeriod(NamedTuple):
    """A cycle that leaves the momenta as they are, but for `_rough`. What k quantities sum up to
    counts as states, too."""

    momenta: np.ndarray  # at the start, (3,)
    ends: np.ndarray  # states at the start and the end, (7 + k, 2)
    slopes: np.ndarray  # of the states at the end by the momenta at the start, (7 + k, 3)


class PeriodicRun(NamedTuple):
    """A cycle that leaves the momenta as they are, to an error `aim`."""

    course: Course
    momenta: np.ndarray
    """At the start of one that would close the gap that is left: where a body glides far they are
    much extra away than the gap is wide."""
    aim: float
    sums: np.ndarray = np.empty(0)  # of quantities, (k,)

    @property
    def ends(self) -> np.ndarray:
        sums = np.stack([0 * self.sums, self.sums], axis=1)
        return np.concatenate([self.course.states[:, [0, -1]], sums])


class GaitWithInertia(_Gait):
    """A gait of a chain at a Froude number; on a slope orientations are from straight uphill. Its
    states are `Replay.states`."""

    def __init__(
        self, body: Body, friction: Law, path: Path, delta: float, *, froude: float,
        breaks: _Breaks = (), turn: float = 0.0, regime: Regime = LEVEL,
        quantities: Iterable[Quantity] = (),
    ) -> None:  # fmt: skip
        super().__init__(checked_mass(body), friction, path, delta, breaks, quantities)
        if self.quantities and self.breaks:
            name = self.quantities[0].name
            raise ProblemError(f"torques are infinite where joint rates jump: leave {name} out.")
        self.froude, self.turn, self.regime = float(froude), turn, regime
        self.theta = float(getattr(path, "theta", None) or 0.0)  # of the tail link at first
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
        """The states through a cycle from a state ``(7,)``, momenta ``(3,)`` at the origin, or
        several states ``(n, 7)``, with the same steps."""
        if start.shape == (3,):
            start = np.append(start, [self.theta, 0.0, 0.0, 0.0])
        at = start.ravel(), aim, self.breaks
        return integrate_period(
            lambda t, states, _: (self.rates(t, states), None), *at, jacobian=self.jacobian
        )

    def rates(self, t: float, states: np.ndarray) -> np.ndarray:
        """Rates ``(7 n,)`` of n motions' states at a phase."""
        states, (angles, rates) = states.reshape(-1, 7), self.path(np.array([t]))
        at = angles[:, 0], rates[:, 0], states[:, _MOMENTA]
        now, out = self._momenta_of(len(states))(*at), np.empty_like(states)
        if self.regime.slides:
            now[:, -3:-1] += self._pull(states).T
        velocity = np.exp(1j * states[:, _THETA]) * (now[:, 3] + 1j * now[:, 4])
        out[:, _MOMENTA], out[:, _THETA] = now[:, 6:], now[:, 2] - self.turn
        out[:, 4], out[:, 5], out[:, _WORK] = velocity.real, velocity.imag, now[:, 5]
        return out.ravel()

    def jacobian(self, t: float, states: np.ndarray) -> np.ndarray:
        """Derivatives ``(7 n, 7 n)`` of `rates` along the states."""
        states = states.reshape(-1, 7)
        n, shapes = len(states), self.path(np.full(len(states), t))
        at = self.body, self.friction, (*shapes, self.delta), states[:, _MOMENTA].T, self.froude
        now, slopes = momenta_at(*at, along_states=True)
        axis, each = np.exp(1j * states[:, _THETA]), np.arange(n)
        velocity, slope = axis * (now[3] + 1j * now[4]), axis * (slopes[3] + 1j * slopes[4])
        by_state = np.zeros((7, 7, n))
        by_state[_MOMENTA, _MOMENTA], by_state[_THETA, _MOMENTA] = slopes[6:], slopes[2]
        by_state[4, _MOMENTA], by_state[5, _MOMENTA] = slope.real, slope.imag
        by_state[4, _THETA], by_state[5, _THETA] = -velocity.imag, velocity.real
        by_state[_WORK, _MOMENTA] = slopes[5]
        if self.regime.slides:  # the pull turns against the body
            pull = self._pull(states)
            by_state[0, _THETA], by_state[1, _THETA] = pull[1], -pull[0]
        apart = np.zeros((n, 7, n, 7))
        apart[each, :, each] = by_state.transpose(2, 0, 1)
        return apart.reshape(7 * n, 7 * n)

    def _pull(self, states: np.ndarray) -> np.ndarray:
        """Force of the weight along the slope over the Froude number, ``(2, n)``."""
        return np.asarray(self.regime.pull(states[None, :, _THETA])) / self.froude

    def instants(self, t: np.ndarray, states: np.ndarray) -> Instants:
        of = self.body, self.friction
        how: Any = {"delta": self.delta, "froude": self.froude}
        moments = joint_torques(*of, self.path, t, states[_MOMENTA], **how)
        return Instants(*of, *self.path(t), moments=moments, **how)

    def totals(self, states: np.ndarray) -> Numbers:
        """Distance, joints' work, rotation and quantities from the first of states to the last."""
        change = states[:, -1] - states[:, 0]
        way = self.regime.travel_along(complex(*change[_PLACE]))
        return {
            "distance": chord_per_way(self.turn) * way.real,
            "work": float(change[_WORK] + self.regime.grade * change[_PLACE][0]),
            "rotation": float(change[_THETA]) + self.turn,
            **{each.name: float(change[7 + k]) for k, each in enumerate(self.quantities)},
        }

    def rough_period(self, guess: np.ndarray) -> RoughPeriod:
        """By Newton's method, with derivatives from three runs beside each one."""
        start, begin = guess, np.zeros((4, 7))
        for _ in range(_MOST_STEPS):
            begin[:, _MOMENTA] = start + np.vstack([np.zeros(3), _APART * np.eye(3)])
            begin[:, _THETA] = self.theta
            motion = self.run(begin, self._rough)
            end = motion.states[:, -1].reshape(begin.shape)
            first, *others = end[:, _MOMENTA]
            step = _newton_step(first - start, np.subtract(others, first).T / _APART)
            start = start + step
            if np.abs(step).max() < _LEFT_OPEN * self._rough:
                sums = [self.integrals(motion, self._rough, k).whole for k in range(len(begin))]
                end = np.column_stack([end, sums])
                before = np.pad(begin[0], (0, len(self.quantities)))
                slopes = (end[1:] - end[0]).T / _APART
                return RoughPeriod(start, np.column_stack([before, end[0]]), slopes)
        raise self._not_alike()

    def find_period(self, guess: np.ndarray | None = None) -> RoughPeriod:
        """`rough_period` near some momenta; else near the quasi-static ones, or none: a body that
        friction hardly brakes keeps what it begins with."""
        if guess is not None:
            with suppress(NotConvergedError):
                return self.rough_period(guess)
        with suppress(NotConvergedError):
            return self.rough_period(self.momenta())
        return self.rough_period(np.zeros(3))

    def periodic_run(self, guess: np.ndarray, aim: float, slopes: np.ndarray) -> PeriodicRun:
        """To an error `aim`, from the momenta and slopes of a `RoughPeriod`."""
        start, before = guess, np.inf
        for _ in range(_MOST_STEPS):
            course = self.run(start, aim)
            gap = course.states[_MOMENTA, -1] - start
            step = _newton_step(gap, slopes)
            start, size = start + step, np.abs(step).max()
            if size < aim or (before <= size and np.abs(gap).max() < _LEFT_OPEN * aim):
                return PeriodicRun(course, start, aim, self.integrals(course, aim).whole)
            before = size
        raise self._not_alike()

    def _not_alike(self) -> NotConvergedError:
        return NotConvergedError(
            f"at a Froude number of {self.froude:g} no motion was found in which all cycles are "
            f"alike; try a smaller one."
        )

    def errors(self, motion: PeriodicRun, before: PeriodicRun, slopes: np.ndarray) -> Numbers:
        """Errors of the `totals` of a run, seen from one whose steps might err more.

        From a start s a run ends at F(s) + e, F being the exact map of a cycle. The true motion
        starts at s* = F(s*); so, M being the derivatives of the momenta, gap what is left open,

            s* - s = (I - M)^-1 (gap - e).

        A bound of e is the difference of the ends of both runs, had they had one start, but the aim
        at least, as differences vanish now and then.
        """
        (first, last), (other, end) = (each.ends.T for each in (motion, before))
        steps = np.maximum(np.abs(end - last - slopes @ (other - first)[_MOMENTA]), motion.aim)
        return self.changes(motion.ends, slopes, steps, np.abs(last - first)[_MOMENTA])

    def changes(
        self, ends: np.ndarray, slopes: np.ndarray, steps: np.ndarray, gap: np.ndarray
    ) -> Numbers:
        """Changes of `totals` where the end errs by `steps` ``(7 + k,)`` and momenta do not close
        by a gap."""
        off = np.column_stack([np.diag(steps), amplification(slopes) * (steps[_MOMENTA] + gap)])
        (start, end), totals = ends.T, self.totals(ends)
        others = [self.totals(np.column_stack([start, end + each])) for each in off.T]
        return {x: sum(abs(other[x] - value) for other in others) for x, value in totals.items()}

    def replay(
        self, objective: Objective, tolerance: float, extra: Any, limits: PathLimits,
        guess: Replay | None,
    ) -> Replay:  # fmt: skip
        """The period that leaves the momenta as they are, on a slope as of `slope_motion`.

        A body from rest may come to another motion: then the gait has several. The joints' work is
        that against friction and what the body gains in kinetic energy.
        """
        check_finite(positive=True, froude=self.froude, delta=self.delta)
        begin = None if guess is None else self.momenta(guess.tail_velocity(np.zeros(1)))
        start, ends, slopes = self.find_period(begin)
        period = {"period": self.froude**-0.5}

        def run(aim):
            nonlocal start
            motion = self.periodic_run(start, aim, slopes)
            start = motion.momenta
            return motion, self.totals(motion.ends) | period

        # runs that cannot be the last but one are left out
        usual = self.changes(ends, slopes, np.full(len(ends), _USUAL * tolerance), np.zeros(3))
        error = objective.relative_error(self.totals(ends) | period | extra[0], usual)
        first = tolerance / max(1.0, error / tolerance)
        errors_of = partial(self.errors, slopes=slopes)
        motion, values, errors = to_tolerance(run, first, objective, tolerance, extra, errors_of)
        phases, states, _ = motion.course
        from_rest = states[_MOMENTA, 0]
        if guess is None or guess.several:
            with suppress(NotConvergedError):  # Newton's method need not lead to any from there
                from_rest = self.rough_period(np.zeros(3)).momenta
        several = float(np.abs(from_rest - states[_MOMENTA, 0]).max() > _OTHER)
        others: Numbers = {}
        if several:
            other = self.run(from_rest, tolerance)
            sums = self.integrals(other, tolerance).whole
            there = self.totals(PeriodicRun(other, from_rest, tolerance, sums).ends)
            others = {name: abs(value - values[name]) for name, value in there.items()}
        shapes = self.body, *self.path(phases % 1.0)
        z = tail_velocity(*shapes, states[_MOMENTA])
        energy = self.froude * kinetic_energy(*shapes, z)[0]
        change = states[:, -1] - states[:, 0]
        return self.measured(
            *(motion.course, z, values, errors, objective, limits),
            others=others,
            actuator_work=values["work"] + float(energy[-1] - energy[0]),
            residual=float(np.abs(change[_MOMENTA]).max()),
            several=several,
            across=self.regime.travel_along(complex(*change[_PLACE])).imag,
            multipliers=tuple(map(complex, np.linalg.eigvals(slopes[_MOMENTA]))),
            states=states,
        )


def amplification(slopes: np.ndarray) -> np.ndarray:
    """Derivatives ``(7 + k, 3)`` of the end of a cycle by what each adds to the momenta."""
    return np.linalg.solve(np.eye(3) - slopes[_MOMENTA].T, slopes.T).T


def _newton_step(gap: np.ndarray, slopes: np.ndarray) -> np.ndarray:
    return np.linalg.solve(np.eye(3) - slopes[_MOMENTA], gap)


class FromRest(NamedTuple):
    """Periods of a gait that a body with inertia begins at rest."""

    phases: np.ndarray  # where the solver stepped, (n,), from 0 to the number of periods
    states: np.ndarray  # there, as `Replay.states`, (7, n)
    periods: np.ndarray  # distance, work and rotation of each cycle, (n_period, 3)


def motion_from_rest(
    body: Body,
    friction: Law,
    gait: Path,
    delta: float,
    froude: float,
    *,
    periods: int = 3,
    tolerance: float = 1e-5,
    breaks: _Breaks = (),
    grade: float = 0.0,
    theta: float = 0.0,
) -> FromRest:
    """Move a body with inertia from rest: how it comes to the motion in which all periods are
    alike, or glides downhill.

    Its momenta are zero at first, while its joints already turn at the gait's rates.

    Parameters
    ----------
    body : Chain
        With the masses of its links.
    friction, gait, breaks
        As of `colloc.slope_motion`. The gait's pace within the period counts.
    delta : float
        Regularisation speed, per period.
    froude : float
        Froude number L/(g T^2), above 0.
    periods : int
    tolerance : float
        About the error of the states after a cycle.
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
    how: Any = {"froude": froude, "breaks": breaks, "regime": Regime(grade=float(grade))}
    moving = GaitWithInertia(body, friction, gait, delta, **how)
    start = np.array([0.0, 0.0, 0.0, theta, 0.0, 0.0, 0.0])
    phases, states, ends = _through_periods(partial(moving.run, aim=tolerance), start, periods)
    change = np.diff(ends)
    totals = [np.hypot(*change[_PLACE]), change[_WORK], change[_THETA]]
    return FromRest(phases, states, np.array(totals).T)
