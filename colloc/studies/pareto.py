"""Pareto fronts of two objectives by the epsilon-constraint method.

Between its ends, the first objective is maximised at evenly spaced values of the second, from both
neighbours. Where neighbours are too far apart, points are added halfway; what stays empty is a gap.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise
from typing import Any

import numpy as np

from colloc.gaits.objective import EFFICIENCY, SPEED, Objective, objective_from
from colloc.gaits.period import Period
from colloc.gaits.problem import Problem
from colloc.results.solution import Solution
from colloc.search.options import OPTIONS
from colloc.studies.saved import solve_member
from colloc.system.arguments import check_count
from colloc.system.errors import NotConvergedError, ProblemError
from colloc.system.lazy import higher
from colloc.verification.replay import replayer

POINTS, _MOST_POINTS = 9, 1000
_BETTER = 1e-6  # relative gain for which a point is replaced
_CLOSE, _APART = 0.1, 2.0  # spacing of duplicates, and of gaps, over the even one

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
        if ax is None:
            return higher("pictures.families:front_figure")(self)
        return higher("pictures.families:draw_front")(ax, self)

    def __repr__(self) -> str:
        first, second = (aim.name for aim in self.objectives)
        counts = f"{len(self.points)} certified points, {len(self.gaps)} gaps"
        return f"<ParetoFront of {self.problem.name}: {first} against {second}, {counts}>"


def pareto_front(
    problem: Problem,
    first: Objective | str = SPEED,
    second: Objective | str = EFFICIENCY,
    points: int = POINTS,
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

    def put(k: int, solution: Solution) -> None:
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
        put(k, solve_member(problem.with_(objective=aim), starts))
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
            put(k, reach(1, levels[k], solutions[k + 1]))
        for k in range(1, last):
            put(k, reach(1, levels[k], solutions[k - 1]))
        for k in backwards:  # a point that is dominated by the next one
            here, beside = (_measure(solutions[j], aims)[0][0] for j in (k, k + 1))
            if beside > here:
                put(k, reach(1, levels[k], solutions[k + 1]))
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
            put(len(solutions), attempts[-1])
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
