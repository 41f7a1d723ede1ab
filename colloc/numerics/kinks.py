"""First-order conditions at a kink: some mean of the gradients around a point vanishes.

Stationarity in the sense of Clarke and Goldstein (Math. Program. 13, 1977) by gradient sampling
(Burke, Lewis and Overton, SIAM J. Optim. 15, 2005); where several kinks meet chance misses sides,
and steps down the mean that is nearest to 0 find them.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from colloc.numerics.sqp import NonlinearProgram, Stationarity, binding, nonnegative

_LOWER = 0.1
"""A kink that bends down has the same gradients; there points are lower by more than this part of
what they would be higher by."""
_STEPS_DOWN = 4  # steps down the nearest mean, per variable, at most


def stationarity_around(
    program: NonlinearProgram,
    v: np.ndarray,
    at: Stationarity,
    radius: float,
    *,
    enough: float,
    points: int = 4,
) -> Stationarity:
    """Replace the KKT error at v by that of the best mean of the gradients within `radius`; `at`
    itself if none is closer to 0, or some point around is clearly lower. `points` are drawn per
    variable, until a mean is within `enough` of 0."""
    rows, slopes, columns = program.rows(v), program.row_slopes(v), binding(program, v)[2]
    rng = np.random.default_rng(0)

    def lagrangian(u: np.ndarray) -> np.ndarray:
        """Gradient and value ``(n + 1,)``; rows count by what is not linear in them."""
        bent = program.rows(u) - rows - slopes @ (u - v)
        gradient = program.gradient(u) + at.on_rows @ (program.row_slopes(u) - slopes)
        return np.append(gradient, program.objective(u) + at.on_rows @ bent)

    drawn = v + radius * rng.uniform(-1.0, 1.0, (points * v.size, v.size))
    places = [*np.clip(np.vstack([v, drawn]), program.lower, program.upper)]
    sampled = [lagrangian(u) for u in places]
    if not np.isfinite(sampled).all():
        return at
    gradients = np.array(sampled)[:, :-1]
    size = float(np.abs(gradients).max())
    weights, multipliers = _nearest_mean(gradients, columns, size)
    nearest = gradients.T @ weights + columns @ multipliers
    for step in rng.uniform(0.0, 1.0, _STEPS_DOWN * v.size) ** 2:
        if np.abs(nearest).max() < enough:
            break
        u = v - radius * step * nearest / np.abs(nearest).max()
        u = np.clip(u, program.lower, program.upper)
        below = lagrangian(u)
        if not np.isfinite(below).all():
            break
        places.append(u)
        sampled.append(below)
        # gradients without a weight in the nearest mean are not needed for a nearer one
        gradients = np.vstack([gradients[weights > 0], below[:-1]])
        weights, multipliers = _nearest_mean(gradients, columns, size)
        nearest = gradients.T @ weights + columns @ multipliers
    error, heights = float(np.abs(nearest).max()), np.array(sampled)[:, -1]
    higher = heights - heights[0] + (np.array(places) - v) @ columns @ multipliers
    bends_down = -higher.min() > _LOWER * higher.max()
    return at if bends_down or error >= at.kkt_error else replace(at, kkt_error=error)


def _nearest_mean(
    gradients: np.ndarray, columns: np.ndarray, size: float
) -> tuple[np.ndarray, np.ndarray]:
    """Weights of gradients ``(m, n)`` and multipliers of columns ``(n, k)`` with the sum nearest to
    0."""
    m, k = len(gradients), columns.shape[1]
    # the last row's size does not matter: all is divided by the sum of the weights
    matrix = np.vstack([np.hstack([gradients.T, columns]), np.repeat([size, 0.0], [m, k])])
    parts = nonnegative(matrix, np.append(np.zeros(len(matrix) - 1), size))
    return parts[:m] / parts[:m].sum(), parts[m:] / parts[:m].sum()
