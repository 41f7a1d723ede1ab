"""From class to class: an optimum of one class of gaits is where the search in the next begins.

Harmonics n to n + 1, a curvature bound to a larger one, harmonics to a free path to a polygon and back: any gait is laid
into any class (`colloc.path_start.nearest_parameters`). What does not carry over by itself is delta, which harmonic gaits
measure per period and paths at unit shape speed.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable

from colloc.continuation import continue_delta
from colloc.gait import Harmonic
from colloc.gait_fields import AnyClass, AnyGait
from colloc.optimise import maximise_efficiency
from colloc.path_samples import path_length
from colloc.problem import Problem
from colloc.solution import SOLVED, Solution

_RESTART = 10.0
"""A search from an optimum of another class begins at this many times the final delta."""


def delta_in(gait_class: AnyClass, gait: AnyGait, at_unit_speed: float) -> float:
    """Delta in the units of a class, from delta at unit shape speed, for a gait of the same path length."""
    return at_unit_speed * (path_length(gait) if isinstance(gait_class, Harmonic) else 1.0)


def delta_at_unit_speed(problem: Problem) -> float:
    """The final delta of a problem in body lengths per radian of path, for a path as long as its guess."""
    return problem.delta / (path_length(problem.guess) if isinstance(problem.gait, Harmonic) else 1.0)


def prolonged(problem: Problem, gait: AnyGait, gait_class: AnyClass, **changes: object) -> Problem:
    """The problem in another class of gaits, to be searched from a known gait of any class.

    Delta stays what it is relative to the shape speed; other fields may be changed too (``intervals=...``).
    """
    delta = delta_in(gait_class, gait, delta_at_unit_speed(problem))
    stated = {"guess": gait, "gait": gait_class, "delta": delta, "delta_start": _RESTART * delta}
    return problem.with_(**(stated | changes))


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
    solve = maximise_efficiency if certified else continue_delta
    solutions: list[Solution] = []
    gait: AnyGait = problem.guess

    def step(stated: Problem) -> None:
        nonlocal gait
        solution = solve(stated)
        solutions.append(solution)
        good = solution.status == SOLVED if certified else solution.last.optimal
        gait = solution.gait if good else gait
        if on_step is not None:
            on_step(solution)

    step(problem)
    for gait_class in classes:
        step(prolonged(problem, gait, gait_class))
    return solutions
