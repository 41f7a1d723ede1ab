"""What two objectives cost each other: certified gaits of which none is better in both.

The ends of the front are the best gaits by one objective alone. Between them the first objective is maximised while the second
is kept at a value (an epsilon constraint), which finds the front where it is not convex, too. Every point is begun at the gait
of a neighbour, from both ends, and the better one counts: so the front may pass from one kind of gait to another.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from colloc.gaits.objective import EFFICIENCY, SPEED, Objective, objective_from
from colloc.gaits.problem import Problem
from colloc.results.solution import Solution
from colloc.search.explore import STARTS
from colloc.search.solve import solve
from colloc.studies.saved import member_file
from colloc.system.arguments import check_count
from colloc.system.errors import ProblemError
from colloc.system.late_binding import bound
from colloc.verification.replayer import replayer

POINTS = 9
_MOST_POINTS = 1000
_SAME = 1e-6
"""Relative difference below which two values are the same: what the search leaves of it."""
_BETTER = 1e-6
"""Relative gain for which a point is replaced."""


@dataclass(frozen=True, eq=False)
class ParetoFront:
    """Gaits from the best by the first objective to the best by the second.

    Attributes
    ----------
    problem : Problem
        Whatever its own objective is.
    objectives : (Objective, Objective)
    points : tuple of Solution
        Each with a certificate of its own.
    """

    problem: Problem
    objectives: tuple[Objective, Objective]
    points: tuple[Solution, ...]

    @property
    def values(self) -> np.ndarray:
        """Both objectives of every point, replayed, ``(n, 2)``."""
        return np.array([[_value(point, aim) for aim in self.objectives] for point in self.points])

    @property
    def certified(self) -> bool:
        """Whether every point is."""
        return all(point.success for point in self.points)

    def plot(self, ax: Any = None) -> Any:
        """The front and its gaits as a matplotlib Figure; with `ax`, a matplotlib Axes, the front there, and the Axes is
        returned."""
        return bound("plot_front")(self) if ax is None else bound("plot_front_values")(ax, self)

    def __repr__(self) -> str:
        first, second = (aim.name for aim in self.objectives)
        verdict = "all certified" if self.certified else "NOT all certified"
        return f"<ParetoFront of {self.problem.name}: {first} against {second}, {len(self.points)} points, {verdict}>"


def pareto_front(
    problem: Problem,
    first: Objective | str = SPEED,
    second: Objective | str = EFFICIENCY,
    points: int = POINTS,
    *,
    starts: int = STARTS,
    progress: Callable[[int, Solution], object] | None = None,
) -> ParetoFront:
    """The gaits of a problem's class that are best in one objective for what they reach in another.

    Parameters
    ----------
    problem : Problem
        Its own objective does not matter; what else it asks for holds for every point.
    first, second : Objective or str
        As for `colloc.gaits.problem.Problem`.
    points : int
        At least 2, the ends; those between are evenly spaced in the second objective.
    starts : int
        From which both ends are the best.
    progress : callable, optional
        Called with the number of a point and its solution, also when it is replaced by a better one.

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
    <ParetoFront of quick: speed against efficiency, 3 points, all certified>
    """
    if not problem.gait.free:
        raise ProblemError("nothing is free in a prescribed motion: it is one point, and no front.")
    aims = objective_from(first), objective_from(second)
    if aims[0].expression == aims[1].expression:
        raise ProblemError(f"a front needs two objectives, not {aims[0].name} twice.")
    check_count(starts=starts)
    if not 2 <= points <= _MOST_POINTS:
        raise ProblemError(f"a front has 2 to {_MOST_POINTS} points, not {points}.")
    found: dict[int, Solution] = {}

    def put(k: int, solution: Solution) -> None:
        """Keep what is the better solution of a point."""
        value = solution.measured.value
        if k not in found or (solution.success, value) > (found[k].success, found[k].measured.value + _BETTER * abs(value)):
            found[k] = solution
            if progress is not None:
                progress(k, solution)

    last = points - 1
    for k, aim in zip((0, last), aims, strict=True):
        put(k, _uninterrupted(problem.with_(objective=aim), starts))
        if not found[k].success:
            raise ProblemError(f"the gait of best {aim.name} is not certified, so there is no front: {found[k].message}")
    least, most = (_value(found[k], aims[1]) for k in (0, last))
    if most - least < _SAME * abs(most):
        return ParetoFront(problem, aims, (found[0], found[last]))
    levels = np.linspace(least, most, points)

    def begun_at(k: int, neighbour: int) -> Solution:
        reached = (*problem.at_least, (aims[1], float(levels[k])))
        gait = found[neighbour].gait
        return _uninterrupted(problem.with_(objective=aims[0], at_least=reached, guess=gait, delta_start=problem.delta), 1)

    for k in range(last - 1, 0, -1):
        put(k, begun_at(k, k + 1))
    for k in range(1, last):
        put(k, begun_at(k, k - 1))
    for k in range(last - 1, -1, -1):  # what reaches more of the second objective and of the first is better here, too
        if k > 0 and _value(found[k + 1], aims[0]) > _value(found[k], aims[0]):
            put(k, begun_at(k, k + 1))
    return ParetoFront(problem, aims, tuple(found[k] for k in range(points)))


def _uninterrupted(problem: Problem, starts: int) -> Solution:
    solution = solve(problem, starts, keep=member_file(problem))
    if solution.interrupted:
        raise KeyboardInterrupt
    return solution


def _value(solution: Solution, aim: Objective) -> float:
    """An objective of a solution, of its certificate or, where that does not hold what it takes, of a replay."""
    known, problem, gait = solution.certificate.values, solution.problem, solution.gait
    if set(aim.uses) <= set(known):
        return aim(known)
    at: Any = (problem.body, problem.law, gait, solution.delta_per_period)
    return replayer(problem.regime)(*at, breaks=gait.corner_phases, objective=aim, turn=problem.rotation or 0.0).value
