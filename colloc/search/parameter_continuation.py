"""Continuation in any scalar parameter of a problem: adaptive steps, back-off on failure, every level kept.

The same driver follows a friction coefficient, the mesh, the joint limit or delta: each level is a whole problem, solved
from the gait of the last level that converged. What it makes of the values is a function from numbers to problems.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from operator import attrgetter

import numpy as np

from colloc.gaits.problem import Problem
from colloc.results.solution import Solution
from colloc.search.optimise import optimum
from colloc.system.errors import ProblemError

_SMALLEST_FRACTION = 1 / 64
_GROWTH = 2.0


@dataclass(frozen=True, eq=False)
class Step:
    """One step of a continuation: the parameter's value, and what solving there gave (failed ones too)."""

    value: float
    solution: Solution

    @property
    def optimal(self) -> bool:
        last = self.solution.last
        return last.optimal and last.delta <= self.solution.problem.delta * (1 + 1e-9)


def with_parameter(problem: Problem, name: str, value: float) -> Problem:
    """The problem with one scalar set: "friction.mu_b", "gait.harmonics", "delta", "intervals", "joint_limit", ...

    Whole-numbered fields are rounded.

    Raises
    ------
    ProblemError
        If there is no such number in a problem, or the value is not allowed.
    """
    owner_name, _, field = name.rpartition(".")
    owner = getattr(problem, owner_name, None) if owner_name else problem
    old = getattr(owner, field, None)
    if owner is None or isinstance(old, bool) or not isinstance(old, (int, float)):
        raise ProblemError(f"{name!r} is not a number of a problem; try delta, intervals, joint_limit or friction.mu_b.")
    new = round(value) if isinstance(old, int) and not owner_name.startswith("friction") else float(value)
    if owner_name:
        return problem.with_(**{owner_name: replace(owner, **{field: new})})
    return problem.with_(**{field: new})


def continue_parameter(
    problem: Problem,
    name: str,
    target: float,
    *,
    first_step: float | None = None,
    on_step: Callable[[Step], None] | None = None,
) -> list[Step]:
    """Follow an optimum from a problem's own value of a parameter to `target`.

    Parameters
    ----------
    problem : Problem
        Solved first, from its guess.
    name : str
        As for `with_parameter`.
    target : float
    first_step : float, optional
        Size of the first step; by default the whole way. Steps double after a success and halve after a failure. Where
        both values are positive and more than a factor of ten apart, steps are measured in the logarithm (of base e).
    on_step : callable, optional
        Called with every step as it ends.

    Returns
    -------
    list of Step
        In the order they were solved. The target was reached if the last one is optimal and has its value.
    """
    with_parameter(problem, name, target)
    start = float(attrgetter(name)(problem))
    logarithmic = min(start, target) > 0 and not 0.1 <= target / start <= 10
    to, back = (np.log, np.exp) if logarithmic else (float, float)
    steps: list[Step] = []

    def solved(value: float, guess: Solution | None) -> Step:
        here = with_parameter(problem, name, value)
        if guess is not None:
            # close to an optimum there is no need to begin at strong regularisation again
            near = 10 * here.delta if name == "delta" else 3 * here.delta
            here = here.with_(guess=guess.gait, delta_start=min(here.delta_start, near))
        step = Step(value, optimum(here))
        steps.append(step)
        if on_step is not None:
            on_step(step)
        return step

    last = solved(start, None)
    if not last.optimal:
        return steps
    whole = to(target) - to(start)
    size = whole if first_step is None else np.sign(whole) * min(abs(first_step), abs(whole))
    at = to(start)
    while at != to(target):
        goal = at + size
        if abs(goal - to(start)) >= abs(whole) * (1 - 1e-9):
            goal = to(target)
        value = target if goal == to(target) else float(back(goal))
        step = solved(value, last.solution)
        if step.optimal:
            at, last, size = goal, step, size * _GROWTH
        else:
            size *= 0.5
            if abs(size) < _SMALLEST_FRACTION * abs(whole):
                break
    return steps
