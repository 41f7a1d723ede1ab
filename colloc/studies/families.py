"""Families of certified gaits, each solved from its neighbours.

Pareto fronts by the epsilon-constraint method: between its ends, the first objective is maximised
at evenly spaced values of the second, from both neighbours. Where neighbours are too far apart,
points are added halfway; what stays empty is a gap.

Steering: the best gait for every turn per period. After the straight gait, others are sought in
the class without symmetry, each from its neighbour, or from the mirror image of the opposite turn.
Controllers can interpolate between neighbours.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise
from typing import Any

import numpy as np

from colloc.gaits.limits import one_sided
from colloc.gaits.objective import EFFICIENCY, SPEED, Objective, objective_from
from colloc.gaits.period import Period
from colloc.gaits.problem import Problem
from colloc.gaits.symmetry import ANTIPODAL, NONE
from colloc.results.solution import Solution
from colloc.search.options import OPTIONS
from colloc.studies.solve import solve_member
from colloc.system.arguments import check_count, is_number
from colloc.system.environment import higher
from colloc.system.errors import NotConvergedError, ProblemError
from colloc.verification.replay import replayer

_MOST_POINTS = 1000
_BETTER = 1e-6  # relative gain for which a point is replaced
_CLOSE, _APART = 0.1, 2.0  # spacing of duplicates, and of gaps, over the even one
_LEAST_WORK = Objective("1 / work", "least work")  # turning on the spot: moving takes work
_PHASES = 1000  # tried for the begin of a gait

Objectives = tuple[Objective, Objective]


@dataclass(frozen=True)
class Gap:
    """Part of a front, wider than twice the even spacing, where nothing was found."""

    after: int  # the point before it
    why: str
    certified: bool  # whether gaits found there are; they are no better than its neighbours


@dataclass(frozen=True, eq=False)
class ParetoFront:
    """Certified gaits from the best by the first objective to the best by the second; gaps are
    where neighbours are more than twice the even spacing apart."""

    problem: Problem
    objectives: Objectives
    points: tuple[Solution, ...]
    gaps: tuple[Gap, ...] = ()

    @property
    def values(self) -> np.ndarray:
        """Both objectives of every point, by replay, ``(n, 2)``."""
        return np.array([_measure(point, self.objectives)[0] for point in self.points])

    @property
    def certified(self) -> bool:
        """True if the gaits that were found in its gaps are certified, too."""
        return all(gap.certified for gap in self.gaps)

    def plot(self, ax: Any = None) -> Any:
        """Draw the front and its gaits as a matplotlib Figure; with a matplotlib Axes `ax` the
        front there, and return the Axes."""
        return higher("pictures.figure:plot_front")(self, ax)

    def __repr__(self) -> str:
        first, second = (aim.name for aim in self.objectives)
        counts = f"{len(self.points)} certified points, {len(self.gaps)} gaps"
        return f"<ParetoFront of {self.problem.name}: {first} against {second}, {counts}>"


def pareto_front(
    problem: Problem,
    first: Objective | str = SPEED,
    second: Objective | str = EFFICIENCY,
    points: int = 9,
    *,
    starts: int = OPTIONS.starts,
    progress: Callable[[int, Solution], object] | None = None,
) -> ParetoFront:
    """Find the Pareto front of two objectives of a problem.

    Parameters
    ----------
    problem : Problem
        Its own objective does not matter; its constraints hold for every point.
    first, second : Objective or str
        As for `colloc.gaits.problem.Problem`.
    points : int
        At least 2, evenly spaced in the second objective. Dominated points and duplicates are left
        out; what fills gaps is added.
    starts : int
        Starting points for both ends, and in gaps that no neighbour leads into.
    progress : callable, optional
        Called with the number of a point and its solution, also when it is replaced.

    Raises
    ------
    ProblemError
        If the objectives are the same, or one of their best gaits is not certified.
    NotConvergedError
        If no start leads anywhere.

    Examples
    --------
    >>> import colloc
    >>> problem = colloc.Problem("quick", gait=colloc.Harmonic(1, "bilateral"), delta=1e-2)
    >>> colloc.pareto_front(problem, "speed", "efficiency", 3, starts=1)
    <ParetoFront of quick: speed against efficiency, 3 certified points, 0 gaps>
    """
    if not problem.gait.free:
        raise ProblemError("nothing is free in a prescribed motion: it is one point, and no front.")
    aims = objective_from(first), objective_from(second)
    if aims[0].expression == aims[1].expression:
        raise ProblemError(f"a front needs two objectives, not {aims[0].name} twice.")
    check_count(starts=starts)
    if not 2 <= points <= _MOST_POINTS:
        raise ProblemError(f"a front has 2 to {_MOST_POINTS} points, not {points}.")
    last = points - 1
    solutions: dict[int, Solution] = {}

    def keep(k: int, solution: Solution) -> None:
        value, before = solution.measured.value, solutions.get(k)
        if before is None or (solution.success, value) > (
            before.success,
            before.measured.value + _BETTER * abs(value),
        ):
            solutions[k] = solution
            if progress is not None:
                progress(k, solution)

    def reach(which: int, level: float, begin: Solution | None) -> Solution:
        """Maximise one objective where the other reaches a level, from a gait or from starts."""
        limits = (*problem.at_least, (aims[which], level))
        stated = problem.with_(objective=aims[1 - which], at_least=limits)
        if begin is None:
            return solve_member(stated, starts)
        return solve_member(stated.with_(guess=begin.gait, delta_start=problem.delta), 1)

    for k, aim in zip((0, last), aims, strict=True):
        keep(k, solve_member(problem.with_(objective=aim), starts))
        if not solutions[k].success:
            raise ProblemError(
                f"the gait of best {aim.name} is not certified, so there is no front: "
                f"{solutions[k].message}"
            )
    if len(_thin(solutions.values(), aims, last)) > 1:
        lowest, highest = (float(_measure(solutions[k], aims)[0][1]) for k in (0, last))
        levels = np.linspace(lowest, highest, points).tolist()
        backwards = range(last - 1, 0, -1)
        for k in backwards:
            keep(k, reach(1, levels[k], solutions[k + 1]))
        for k in range(1, last):
            keep(k, reach(1, levels[k], solutions[k - 1]))
        for k in backwards:  # a point that is dominated by the next one
            here, beside = (_measure(solutions[j], aims)[0][0] for j in (k, k + 1))
            if beside > here:
                keep(k, reach(1, levels[k], solutions[k + 1]))
    front, empty = _thin(solutions.values(), aims, last), {}
    for _ in range(2 * points):
        wide = {pair: size for pair, size in _wide(front, aims, last).items() if pair not in empty}
        if not wide:
            break
        pair = max(wide, key=lambda each: wide[each].max())
        which, attempts, failure = int(wide[pair].argmax()), [], ""
        level = 0.5 * sum(float(_measure(each, aims)[0][which]) for each in pair)
        for begin in (*pair, None):
            if begin is None and pair not in pairwise(front):
                break  # a neighbour led into the gap
            try:
                attempts.append(reach(which, level, begin))
            except NotConvergedError as error:
                failure = str(error)
                continue
            keep(len(solutions), attempts[-1])
            front = _thin(solutions.values(), aims, last)
        if attempts:
            failure = "" if any(each.success for each in attempts) else attempts[0].message
        empty[pair] = failure or "the best gaits found there are those beside it", not failure
    unknown, wide = ("not sought: ask for more points", True), _wide(front, aims, last)
    gaps = (
        Gap(k, *empty.get(pair, unknown)) for k, pair in enumerate(pairwise(front)) if pair in wide
    )
    return ParetoFront(problem, aims, tuple(front), tuple(gaps))


@lru_cache(maxsize=256)
def _measure(solution: Solution, aims: Objectives) -> np.ndarray:
    """Objectives of a solution and their errors, ``(2, 2)``, from its certificate or a replay."""
    problem, gait, measured = solution.problem, solution.gait, []
    for aim in aims:
        period: Period = solution.certificate
        if not set(aim.uses) <= set(period.values):
            at: Any = (problem.body, problem.law, gait, solution.delta_per_period)
            period = replayer(problem.regime)(
                *at, breaks=gait.corner_phases, objective=aim, turn=problem.rotation or 0.0
            )
        value = aim(period.values)
        measured.append((value, abs(value) * period.error_of(aim)))
    return np.transpose(measured)


def _thin(solutions: Iterable[Solution], aims: Objectives, intervals: int) -> list[Solution]:
    """Non-dominated certified solutions (by more than the errors), without near duplicates."""
    front: list[Solution] = []
    for each in (solution for solution in solutions if solution.success):
        (values, errors), others = _measure(each, aims), [_measure(other, aims) for other in front]
        if any((values <= other + errors + error).all() for other, error in others):
            continue
        left = [
            point
            for point, (other, error) in zip(front, others, strict=True)
            if (values < other - errors - error).any()
        ]
        close = np.ptp([values, *(other for other, _ in others)], axis=0) * _CLOSE / intervals
        if len(left) == len(front) > 1 and any(
            (abs(values - other) < close).all() for other, _ in others
        ):
            continue
        front = [*left, each]
    return sorted(front, key=lambda each: -_measure(each, aims)[0][0])


def _wide(
    front: list[Solution], aims: Objectives, intervals: int
) -> dict[tuple[Solution, Solution], np.ndarray]:
    """Neighbours that are too far apart, and their distance in each objective over the front's."""
    apart = np.abs(np.diff([_measure(each, aims)[0] for each in front], axis=0))
    shares = zip(pairwise(front), apart / apart.sum(axis=0), strict=True)
    return {pair: size for pair, size in shares if size.max() * intervals > _APART}


@dataclass(frozen=True, eq=False)
class Steering:
    """Family of gaits by the angle that a period turns."""

    problem: Problem
    turns: tuple[float, ...]  # counter-clockwise [rad], ascending
    points: tuple[Solution, ...]
    on_the_spot: Steering | None = None  # gaits that turn with the least work

    @property
    def certified(self) -> bool:
        """True if every gait is certified."""
        spot = self.on_the_spot is None or self.on_the_spot.certified
        return spot and all(point.success for point in self.points)

    @property
    def efficiency(self) -> np.ndarray:
        """Chord of the arc of a period per work, independent of the phase at which it begins."""
        return np.array([point.arc.chord / point.work for point in self.points])

    @property
    def begins(self) -> tuple[float, ...]:
        """Phases at which to begin the gaits, so that each is near its neighbour that turns
        less."""
        t, straight = np.arange(_PHASES) / _PHASES, min(self.turns, key=abs)
        begins = dict.fromkeys(self.turns, 0.0)
        gaits = {turn: point.gait for turn, point in zip(self.turns, self.points, strict=True)}
        for turn, inner in _outwards(self.turns, straight):
            known, angles = gaits[inner].angles(t + begins[inner]), gaits[turn].angles(t)
            overlap = (np.fft.fft(angles) * np.conj(np.fft.fft(known))).sum(axis=0)
            begins[turn] = float(t[np.fft.ifft(overlap).real.argmax()])
        return tuple(begins.values())

    def table(self, phases: int = 100) -> dict[str, Any]:
        """Return turns, their arcs, and joint angles at equal phases from `begins`, as JSON can
        hold them; angles are interpolated linearly between turns."""
        t, points = np.arange(phases) / phases, self.points
        radii = [point.arc.radius for point in points]
        more = {} if self.on_the_spot is None else {"on_the_spot": self.on_the_spot.table(phases)}
        return more | {
            "name": self.problem.name,
            "turn_rad": list(self.turns),
            "chord_body_lengths": [point.arc.chord for point in points],
            "radius_body_lengths": [radius if math.isfinite(radius) else None for radius in radii],
            "work_per_period_weight_times_length": [point.work for point in points],
            "status": [point.status for point in points],
            "phase": t.tolist(),
            f"{points[0].gait.motor_gait.coordinate}_angles_rad": [
                point.gait.motor_gait.angles(t + begin).T.tolist()
                for point, begin in zip(points, self.begins, strict=True)
            ],
        }

    def plot(self, ax: Any = None, panel: str = "cost") -> Any:
        """Draw efficiency against the turn, and the tracks, as a matplotlib Figure; with a
        matplotlib Axes `ax` the panel "cost" or "tracks" there, and return the Axes."""
        return higher("pictures.figure:plot_steering")(self, ax, panel)

    def __repr__(self) -> str:
        turns = ", ".join(f"{math.degrees(turn):+.4g}" for turn in self.turns)
        verdict = "all certified" if self.certified else "NOT all certified"
        return f"<Steering of {self.problem.name}: {turns} degrees a period, {verdict}>"


def _outwards(turns: Sequence[float], middle: float) -> Iterator[tuple[float, float]]:
    """Turns to the left of the middle, then to the right, each with its inner neighbour."""
    for side in (
        [turn for turn in turns if turn > middle],
        [turn for turn in reversed(turns) if turn < middle],
    ):
        yield from zip(side, (middle, *side), strict=False)


def steer(
    problem: Problem,
    turns: Sequence[float],
    *,
    spot: Sequence[float] = (),
    starts: int = OPTIONS.starts,
    progress: Callable[[float, Solution], object] | None = None,
) -> Steering:
    """Find the best gaits of a problem for given turns per period.

    Parameters
    ----------
    problem : Problem
        States the gait that goes straight; its objective is that of all.
    turns : sequence of float
        Counter-clockwise [rad], less than half a turn.
    spot : sequence of float
        Turns on the spot, not 0.
    starts : int
        Starting points for the straight gait, and the first on the spot.
    progress : callable, optional
        Called with a turn and its solution.

    Raises
    ------
    ProblemError
        If a turn cannot be asked for, or the straight gait is not certified.
    NotConvergedError
        If no start leads anywhere.

    Examples
    --------
    >>> import colloc
    >>> problem = colloc.Problem("quick", gait=colloc.Harmonic(1, "bilateral"), delta=1e-2)
    >>> colloc.steer(problem, [0.0, 0.1], starts=1)
    <Steering of quick: +0, +5.73 degrees a period, all certified>
    """
    if not problem.gait.free or problem.regime.slides or problem.rotation != 0:
        raise ProblemError(
            "steering begins at a gait that is free and goes straight on the level: rotation 0, "
            "grade 0."
        )
    # by more than half a turn the body could turn the other way
    possible = all(is_number(turn) and abs(turn) < math.pi for turn in (*turns, *spot))
    if not len(turns) or not possible or 0 in spot:
        raise ProblemError(
            f"turns must be angles of less than half a turn a period, and not 0 on the spot; not "
            f"{[*turns, *spot]!r}."
        )
    check_count(starts=starts)

    def member(turn: float, stated: Problem, starts: int = starts) -> Solution:
        solution = solve_member(stated, starts)
        if progress is not None:
            progress(turn, solution)
        return solution

    straight = member(0.0, problem)
    if not straight.success:
        raise ProblemError(
            f"the straight gait is not certified, so there is nothing to steer: {straight.message}"
        )
    anywhere = problem.gait.with_symmetry(NONE)
    bent = problem.joint_map is not None and any(problem.joint_map.rest)
    mirrors = (
        ANTIPODAL in problem.body.symmetries and not one_sided(problem.joint_limit) and not bent
    )

    def family(
        stated: Problem, wanted: Sequence[float], known: dict[float, Solution]
    ) -> tuple[Solution, ...]:
        """Solve outwards from known members, or from all starts if there is none."""
        for turn, inner in _outwards(wanted, 0.0):
            begin = known[inner].gait if inner in known else None
            if -turn in known and mirrors:
                begin = known[-turn].gait.mirrored
            asked = {"gait": anywhere, "rotation": turn, "guess": begin}
            if begin is None:
                known[turn] = member(turn, stated.with_(**asked, delta_start=None))
            else:
                known[turn] = member(turn, stated.with_(**asked, delta_start=problem.delta), 1)
        return tuple(known[turn] for turn in wanted)

    turns, spot = (sorted({float(turn) for turn in each}) for each in (turns, spot))
    points = family(problem, turns, {0.0: straight})
    cheapest = problem.with_(gait=anywhere, objective=_LEAST_WORK, rotation=1.0)
    places = Steering(cheapest, tuple(spot), family(cheapest, spot, {})) if spot else None
    return Steering(problem, tuple(turns), points, places)
