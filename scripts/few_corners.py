"""A relaxed gait as a polygon of few corners: its directions one after the other, in as few and as large loops as may be.

`Mixture.realised` needs many corners: a loop of its own for every piece. Here pieces that follow each other are joined, so that
two small loops become a larger one, or the directions of a piece give way to their mean, so that its loop goes: of all such
steps those first that cost least of the polygon's efficiency for a corner saved. Now and then the polygon is optimised as what
it is, all its corners free, so that the next steps are chosen from a good one.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from scipy.optimize import linear_sum_assignment

from colloc.gaits.control_problem import control_problem
from colloc.gaits.problem import Problem
from colloc.gaits.relaxed import Mixture, Relaxed
from colloc.reduced.mixture_space import MixtureSpace
from colloc.reduced.program import ReducedProgram
from colloc.results.solution import Solution
from colloc.search.converge import converged
from colloc.search.effort import Effort
from colloc.search.optimum import Optimum
from colloc.search.relaxed import realised_solution

_IDLE = 1e-9
_AT_ONCE = 0.12
"""Part of the steps to choose from that is taken before they are judged again."""
_FEWER = 0.7
"""Part of the corners that is left when a polygon is optimised again."""
_LAST, _TRIED = 2, 4
"""Sides that the last steps save, and how many of them are tried."""


class _Step(NamedTuple):
    """What a coarser mixture costs in -d/W for each side that it saves, how many it saves, and the pieces it changes."""

    cost: float
    saved: int
    pieces: range
    replaced: np.ndarray


def polygon_near(problem: Problem, gait: Mixture, corners: int, report: Callable[[str], object] = lambda _: None) -> Solution:
    """The polygon of `few_corners`, certified: a relaxed gait of one direction, which is realised as it is."""
    begin = time.perf_counter()
    solution = realised_solution(few_corners(problem, gait, corners, report), (1,))
    solution.seconds = time.perf_counter() - begin
    return solution


def few_corners(problem: Problem, gait: Mixture, corners: int, report: Callable[[str], object] = lambda _: None) -> Optimum:
    """A polygon with at most so many corners over the period near a relaxed gait, a local optimum among these.

    Parameters
    ----------
    problem : Problem
        Of the relaxed gait: body, friction, limits and delta.
    gait : Mixture
    corners : int
    report : callable, optional
        Told in words what is under way.
    """
    least = max(3, int(corners * problem.gait.fraction))
    stated = problem.with_(gait=Relaxed(1, problem.gait.symmetry))
    # vectors of every piece, ``(n_used, n_joint)`` each
    loops = _used([d[:, None] * r for d, r in zip(gait.durations, gait.directions, strict=True)])
    sense = min((1, -1), key=lambda s: _value(stated, _polygon(loops, gait, s)))
    while True:
        goal = max(least + _LAST, int(_FEWER * _sides(loops)))
        while _sides(loops) > goal:
            loops = _coarser(loops, _steps(stated, gait, loops, sense), _sides(loops) - goal)
        if goal == least + _LAST:
            break
        report(f"optimising a polygon of {_sides(loops)} sides")
        loops, found = _optimised(stated, gait, loops, sense)
        gait = found.gait
    # the last steps decide how many loops are left: some are tried to the end
    ends: list[Optimum] = []
    for first in range(_TRIED):
        few = loops
        if _sides(few) > least:
            steps = _steps(stated, gait, few, sense)
            few = _coarser(few, steps[first : first + 1], np.inf)
        while _sides(few) > least:
            few = _coarser(few, _steps(stated, gait, few, sense)[:1], np.inf)
        report(f"optimising a polygon of {_sides(few)} sides")
        ends.append(_optimised(stated, gait, few, sense)[1])
    return min(ends, key=lambda found: found.objective)


def _optimised(problem: Problem, like: Mixture, loops: list[np.ndarray], sense: int) -> tuple[list[np.ndarray], Optimum]:
    """The polygon with all its corners free; its loops and itself."""
    start = _polygon(loops, like, sense)
    space = MixtureSpace(control_problem(problem), len(start.durations))
    found = converged(space, space.parameters(start), problem.delta, Effort(1e-2))
    gait, ends = found.gait, np.cumsum([len(loop) for loop in loops])[:-1]
    return _used(np.split(gait.durations * gait.directions[:, 0], ends)), found


def _sides(loops: list[np.ndarray]) -> int:
    return sum(len(loop) for loop in loops)


def _used(loops: list[np.ndarray]) -> list[np.ndarray]:
    """Without sides that take no time."""
    sizes = [np.linalg.norm(loop, axis=1) for loop in loops]
    least = _IDLE * sum(size.sum() for size in sizes)
    kept = [loop[size > least] for loop, size in zip(loops, sizes, strict=True)]
    return [loop for loop in kept if len(loop)]


def _polygon(loops: list[np.ndarray], like: Mixture, sense: int) -> Mixture:
    """The sides of all pieces one after the other, each piece's by their angle."""
    most = max(len(loop) for loop in loops)
    durations = np.zeros((len(loops), most))
    directions = np.zeros((len(loops), most, like.n_joint))
    directions[..., 0] = 1.0
    for k, loop in enumerate(loops):
        size = np.linalg.norm(loop, axis=1)
        durations[k, : len(loop)], directions[k, : len(loop)] = size, loop / size[:, None]
    return Mixture(durations, directions, like.start, like.symmetry).unmixed(1, sense)


def _value(problem: Problem, polygon: Mixture) -> float:
    space = MixtureSpace(control_problem(problem), len(polygon.durations))
    return ReducedProgram(space, problem.delta).objective(space.parameters(polygon))


def _joined(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """Two pieces as one: sides of either that are most alike are added, so that what both sum up to stays."""
    if len(first) < len(second):
        first, second = second, first
    alike = (first / np.linalg.norm(first, axis=1)[:, None]) @ (second / np.linalg.norm(second, axis=1)[:, None]).T
    rows, columns = linear_sum_assignment(-alike)
    both = first.copy()
    both[rows] += second[columns]
    return both


def _steps(problem: Problem, like: Mixture, loops: list[np.ndarray], sense: int) -> list[_Step]:
    """All that make the loops coarser, by what they cost."""
    now = _value(problem, _polygon(loops, like, sense))
    steps = []
    for k, loop in enumerate(loops):
        tried = [(range(k, k + 2), _joined(loop, loops[k + 1]))] if k + 1 < len(loops) else []
        tried += [(range(k, k + 1), loop.sum(axis=0)[None])] if len(loop) > 1 else []
        for pieces, replaced in tried:
            changed = [*loops[: pieces.start], replaced, *loops[pieces.stop :]]
            if np.linalg.norm(replaced, axis=1).min() > 0:
                saved = _sides(loops) - _sides(changed)
                cost = (_value(problem, _polygon(changed, like, sense)) - now) / saved
                steps.append(_Step(cost, saved, pieces, replaced))
    return sorted(steps, key=lambda step: step.cost)


def _coarser(loops: list[np.ndarray], steps: list[_Step], most: float) -> list[np.ndarray]:
    """The loops after the first few of these steps that do not change the same pieces, and save at most about `most` sides."""
    taken: dict[int, _Step] = {}
    touched: set[int] = set()
    for step in steps[: max(1, int(_AT_ONCE * len(steps)))]:
        if touched.isdisjoint(step.pieces) and (not taken or most > 0):
            taken[step.pieces.start] = step
            touched.update(step.pieces)
            most -= step.saved
    coarser: list[np.ndarray] = []
    for k, loop in enumerate(loops):
        if k in taken:
            coarser.append(taken[k].replaced)
        elif k not in touched:
            coarser.append(loop)
    return coarser
