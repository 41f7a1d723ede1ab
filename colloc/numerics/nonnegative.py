"""Least squares with unknowns that are not negative: multipliers of what binds."""

from __future__ import annotations

import numpy as np

_FEW = 8
"""Columns up to which the steps are taken here: SciPy's are compiled, in a package that takes a
sixth of a second to load."""


def nonnegative(matrix: np.ndarray, right: np.ndarray) -> np.ndarray:
    """The x >= 0, ``(n,)``, that minimises ``|matrix @ x - right|`` (Lawson and Hanson, Solving
    Least Squares Problems, 1974).

    Examples
    --------
    >>> nonnegative(np.array([[1.0, 1.0], [0.0, 1.0]]), np.array([2.0, -1.0]))
    array([2., 0.])
    """
    n = matrix.shape[1]
    if n > _FEW:
        from scipy.optimize import nnls

        return nnls(matrix, right, maxiter=30 * n)[0]
    x, free = np.zeros(n), np.zeros(n, dtype=bool)
    tolerance = (
        10 * max(matrix.shape) * np.finfo(float).eps * np.abs(matrix).sum(axis=0).max(initial=0.0)
    )
    for _ in range(30 * n):
        falls = np.where(free, -np.inf, matrix.T @ (right - matrix @ x))
        if falls.max() <= tolerance:
            break
        free[np.argmax(falls)] = True
        while True:
            best = np.zeros(n)
            best[free] = np.linalg.lstsq(matrix[:, free], right, rcond=None)[0]
            negative = free & (best <= 0)
            if not negative.any():
                break
            # as far as the first that would turn negative, which stays 0
            shares = np.full(n, np.inf)
            shares[negative] = x[negative] / (x[negative] - best[negative])
            x = x + shares.min() * (best - x)
            free &= shares > shares.min()
            x[~free] = 0.0
        x = best
    return x
