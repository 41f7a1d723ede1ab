"""From class to class: an optimum of one class of gaits is where the search in the next begins.

Harmonics n to n + 1, a curvature bound to a larger one, harmonics to a free path to a polygon and back: any gait is laid
into any class (`reduced.spaces.nearest_parameters`), and into a chain of other links (`colloc.gaits.laid_gaits`). What
does not carry over by itself is delta, which harmonic gaits measure per period and paths at unit shape speed.

An optimum is worth keeping. Regularised friction at a large delta prefers other gaits, so a search that begins there leaves
it: with six harmonics from the optimum of five (0.4004), one that begins at 100 times the final delta ends at 0.3998, one at
10 times at 0.4013. But entered at a small delta, kinks stop many a search. So the first is tried, then the other.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable

import numpy as np

from colloc.gaits.gait_fields import AnyClass, AnyGait
from colloc.gaits.harmonic import Harmonic
from colloc.gaits.laid_gaits import laid_into
from colloc.gaits.path_samples import path_length
from colloc.gaits.problem import Problem
from colloc.results.solution import SOLVED, Solution
from colloc.search.optimise import Report, maximise_efficiency, optimum

RESTARTS = (10.0, 100.0)
"""A search from an optimum of another class begins at so many times the final delta; the second if the first one lost it."""
_KEPT = 1e-4
"""Relative loss of efficiency by which an optimum counts as lost."""


def delta_in(gait_class: AnyClass, gait: AnyGait, at_unit_speed: float) -> float:
    """Delta in the units of a class, from delta at unit shape speed, for a gait of the same path length."""
    return at_unit_speed * (path_length(gait) if isinstance(gait_class, Harmonic) else 1.0)


def delta_at_unit_speed(problem: Problem) -> float:
    """The final delta of a problem in body lengths per radian of path, for a path as long as its guess."""
    return problem.delta / (path_length(problem.guess) if isinstance(problem.gait, Harmonic) else 1.0)


def prolonged(
    problem: Problem, gait: AnyGait, gait_class: AnyClass, restart: float = RESTARTS[0], **changes: object
) -> Problem:
    """The problem in another class of gaits, to be searched from a known gait of any class.

    Delta stays what it is relative to the shape speed, and the search begins at `restart` times that; other fields may be
    changed too (``intervals=...``).
    """
    delta = delta_in(gait_class, gait, delta_at_unit_speed(problem))
    guess = laid_into(gait_class, gait, problem.body, problem.joint_limit, problem.smallest_shape_speed)
    stated = {"guess": guess, "gait": gait_class, "delta": delta, "delta_start": restart * delta}
    return problem.with_(**(stated | changes))


def maximise_from(
    problem: Problem,
    gait: AnyGait,
    gait_class: AnyClass,
    known: float,
    on_level: Report | None = None,
    *,
    certified: bool = True,
    **changes: object,
) -> Solution:
    """The best of the searches in a class of gaits that begin at a known optimum, at the deltas of `RESTARTS`.

    Parameters
    ----------
    problem : Problem
    gait : Fourier, ArcPath or Corners
        The optimum.
    gait_class : Harmonic, FreePath or Polygon
    known : float
        Its efficiency: a search that keeps it ends the trials. Only a class that contains the gait can be sure to.
    on_level : callable, optional
        As for `colloc.search.optimise.maximise_efficiency`.
    certified : bool
        Whether solutions are replayed; otherwise first-order conditions decide.
    **changes
        As for `prolonged`.
    """
    solve = maximise_efficiency if certified else optimum

    def value(solution: Solution) -> float:
        return efficiency_of(solution) if found(solution, certified) else -np.inf

    best: Solution | None = None
    for restart in RESTARTS:
        solution = solve(prolonged(problem, gait, gait_class, restart, **changes), on_level)
        if best is None or value(solution) > value(best):
            best = solution
        if value(best) > known * (1 - _KEPT):
            break
    assert best is not None
    return best


def found(solution: Solution, certified: bool) -> bool:
    """Whether a search ended in an optimum: one whose certificate holds, or else one with first-order conditions."""
    return solution.status == SOLVED if certified else solution.last.optimal


def efficiency_of(solution: Solution) -> float:
    """The efficiency of the replay, or that of the mesh where there is no certificate."""
    return solution.measured.efficiency


def continue_classes(
    problem: Problem,
    classes: Iterable[AnyClass],
    *,
    certified: bool = True,
    on_step: Callable[[Solution], None] | None = None,
) -> list[Solution]:
    """Solve a problem in its own class, then in one class after another, each from the last optimum found.

    Parameters
    ----------
    problem : Problem
    classes : iterable of Harmonic, FreePath or Polygon
    certified : bool
        Whether every step is replayed and only certified optima are passed on.
    on_step : callable, optional
        Called with every solution as it is found.

    Returns
    -------
    list of Solution
        In the order they were solved, failed ones too; a class that fails passes on what it was given.
    """
    solve = maximise_efficiency if certified else optimum
    solutions: list[Solution] = []
    gait: AnyGait = problem.guess
    known: float | None = None

    def took(solution: Solution) -> None:
        nonlocal gait, known
        solutions.append(solution)
        if found(solution, certified):
            gait, known = solution.gait, efficiency_of(solution)
        if on_step is not None:
            on_step(solution)

    took(solve(problem))
    for gait_class in classes:
        if known is None:
            took(solve(prolonged(problem, gait, gait_class, RESTARTS[-1])))
        else:
            took(maximise_from(problem, gait, gait_class, known, certified=certified))
    return solutions
