"""Continuation in delta: from strongly regularised friction, which converges from poor guesses, to nearly dry friction.

Every level starts from the last converged gait, projected back onto the balance at the new delta by the fixed-point
solver, with the last multipliers. A level that fails is tried again closer to the one that converged.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from colloc.nlp import NlpResult, Solver
from colloc.problem import Problem
from colloc.solution import Level, Solution
from colloc.transcription import transcribe
from colloc.warm_start import feasible_point

FIRST_FACTOR = 0.1
_SMALLEST_STEP = 0.8
_EXCHANGES = 4
_ADMISSIBLE = 1e-8

Report = Callable[[Level], None]


@dataclass
class _Guess:
    """Where the next level starts: gait parameters and multipliers."""

    parameters: np.ndarray
    multipliers: tuple[np.ndarray, np.ndarray] | None = None


def _level(problem: Problem, delta: float, result: NlpResult, distance: float, work: float) -> Level:
    periods = 1.0 / problem.gait.fraction
    return Level(
        delta,
        result.x,
        result.lam_x,
        result.lam_g,
        -result.objective,
        periods * distance,
        periods * work,
        result.kkt_error,
        result.violation,
        result.complementarity,
        result.status,
        result.optimal,
        result.iterations,
        result.seconds,
        result.evaluation_seconds,
    )


def continue_delta(problem: Problem, on_level: Report | None = None, solver: Solver | None = None) -> Solution:
    """Solve a problem through falling delta, from ``delta_start`` to ``delta``.

    Parameters
    ----------
    problem : Problem
    on_level : callable, optional
        Called with each `Level` as it ends, also with failed ones.
    solver : Solver, optional
        Built for the same problem before, to save building it again.

    Returns
    -------
    Solution
        Without a certificate; the last level is the one at ``problem.delta`` only if all went well.
    """
    begin = time.perf_counter()
    solver = solver or Solver(transcribe(problem))
    layout = solver.transcription.layout
    start = problem.gait.parameters(problem.guess)
    guess = _Guess(start)
    levels: list[Level] = []

    def attempt(delta: float, guess: _Guess) -> NlpResult:
        x = feasible_point(solver.transcription, guess.parameters, delta)
        result = solver.solve(x, delta, guess.multipliers)
        if delta == problem.delta:
            # move the checks between nodes to the new gait's worst instants until none is exceeded
            for _ in range(_EXCHANGES):
                if not result.optimal or solver.check_excess(result.x) <= _ADMISSIBLE:
                    break
                again = solver.solve(result.x, delta, (result.lam_x, result.lam_g))
                result = again.accumulated(result)
        level = _level(problem, delta, result, result.x[layout.distance[0, -1]], result.x[layout.work[0, -1]])
        levels.append(level)
        if on_level is not None:
            on_level(level)
        return result

    delta, factor, reached = problem.delta_start, FIRST_FACTOR, None
    while True:
        result = attempt(delta, guess)
        if result.optimal:
            guess = _Guess(result.x[layout.parameters[:, 0]], (result.lam_x, result.lam_g))
            reached = delta
            if delta <= problem.delta:
                break
            factor = max(FIRST_FACTOR, factor**2)
        else:
            if reached is None or factor > _SMALLEST_STEP:
                break
            factor = factor**0.5
        delta = max(problem.delta, reached * factor) if reached * factor > 1.2 * problem.delta else problem.delta
    solution = Solution(problem, levels, seconds=time.perf_counter() - begin)
    if not (result.optimal and delta <= problem.delta):
        group, size = max(result.group_violation.items(), key=lambda item: item[1])
        where = f"largest violation {size:.1e} in '{group}'" if size > _ADMISSIBLE else f"KKT error {result.kkt_error:.1e}"
        solution.message = (
            f"no optimum at delta = {delta:.1e} ({result.status}; {where}). "
            "Try another guess, a smaller delta_start, or more intervals."
        )
    return solution
