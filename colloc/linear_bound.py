"""The linear program of the bound, solved by constraint generation with HiGHS."""

from __future__ import annotations

import numpy as np
from scipy import sparse
from scipy.optimize import linprog

from colloc.errors import NotConvergedError
from colloc.potential import Samples

_LARGEST_CUT = 1000
_SMALLEST_RADIUS, _LARGEST_RADIUS = 1e-3, 10.0


def linear_optimum(samples: Samples, free: np.ndarray, rounds: int, tolerance: float = 3e-4) -> tuple[np.ndarray, float]:
    """Constraint generation from a good start: coefficients, and a lower bound for every potential of the space.

    The programs are confined to a box around the best point so far; it grows while steps succeed. A last program without
    it gives the lower bound, on the samples used.
    """
    ratio, heading = samples.ratio(free)
    best, value = free, ratio.max()
    radius = 0.02
    rows, constants = [], []

    def cut(ratio: np.ndarray, heading: np.ndarray, window: float) -> None:
        chosen = np.flatnonzero(ratio > ratio.max() - window)
        if chosen.size > _LARGEST_CUT:
            chosen = chosen[np.argsort(-ratio[chosen])[:: -(-chosen.size // _LARGEST_CUT)]]
        matrix, constant = samples.rows(chosen, heading[chosen])
        rows.append(matrix)
        constants.append(constant)

    def program(radius: float) -> tuple[np.ndarray, float]:
        matrix, constant = sparse.vstack(rows, format="csr"), np.concatenate(constants)
        cost = np.zeros(free.size + 1)
        cost[-1] = 1.0
        left = sparse.hstack([matrix, -np.ones((matrix.shape[0], 1))], format="csr")
        box = [(c - radius, c + radius) for c in best] + [(0.0, None)]
        result = linprog(cost, A_ub=left, b_ub=-constant, bounds=box, method="highs")
        if result.status != 0:
            raise NotConvergedError(f"the linear program of the bound failed: {result.message}")
        if matrix.shape[0] > 4 * _LARGEST_CUT:
            tight = matrix @ result.x[:-1] + constant > result.x[-1] - 0.01
            rows[:], constants[:] = [matrix[tight]], [constant[tight]]
        return result.x[:-1], float(result.x[-1])

    cut(ratio, heading, 0.05)
    for _ in range(rounds):
        trial, predicted = program(radius)
        ratio, heading = samples.ratio(trial)
        cut(ratio, heading, 0.02)
        if ratio.max() < value:
            if value - ratio.max() > 0.5 * (value - predicted):
                radius *= 2.0
            best, value = trial, ratio.max()
        else:
            radius = max(0.5 * radius, _SMALLEST_RADIUS)
        if value - predicted < tolerance:
            break
    return best, program(_LARGEST_RADIUS)[1]
