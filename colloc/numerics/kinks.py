"""First-order conditions at a kink: some mean of the gradients around the point vanishes, where no single one does.

An objective that is the larger of two smooth ones may have its least value where they meet, and both gradients point away from
the kink there. Such a point is stationary in the sense of Clarke and Goldstein: 0 is a convex combination of gradients at
points near it (Goldstein, Math. Program. 13, 1977). With points drawn by chance within a small radius this can be measured
(Burke, Lewis and Overton, SIAM J. Optim. 15, 2005). Where several kinks meet, chance misses sides: points a step down the mean
that is nearest to 0 find them.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.optimize import nnls

from colloc.numerics.sqp import NonlinearProgram, Stationarity, binding

_LOWER = 0.1
"""A kink that bends down has the same gradients. There, points are lower by more than this part of what they would be higher by
where it bends up."""
_STEPS_DOWN, _NOTHING = 2, 1e-10
"""Points down the nearest mean, per unknown, and the part of the largest gradient that is none."""


def stationarity_around(
    program: NonlinearProgram, v: np.ndarray, at: Stationarity, radius: float, points: int = 4, seed: int = 0
) -> Stationarity:
    """The conditions at v, with the mean of the gradients around it that comes closest to them in place of the one at v.

    Parameters
    ----------
    program : NonlinearProgram
    v : (n,)
    at : Stationarity
        At v alone.
    radius : float
        In every unknown, within which the gradients are taken.
    points : int
        How many are drawn, per unknown: on both sides of a kink, and in all corners of a few that meet.
    seed : int
        Of the points.

    Returns
    -------
    Stationarity
        `at` itself if no mean is closer, or if some point around is clearly lower.

    Examples
    --------
    >>> from colloc.numerics.sqp import stationarity
    >>> class Vee:  # |v| is least at 0
    ...     lower, upper = -np.ones(1), np.ones(1)
    ...     row_lower = row_upper = np.empty(0)
    ...     objective, gradient = staticmethod(lambda v: abs(v[0])), staticmethod(lambda v: np.sign(v) + (v == 0))
    ...     rows, row_slopes = staticmethod(lambda v: np.empty(0)), staticmethod(lambda v: np.empty((0, 1)))
    >>> at = stationarity(Vee, np.zeros(1))
    >>> at.kkt_error, round(stationarity_around(Vee, np.zeros(1), at, 1e-6).kkt_error, 12)
    (1.0, 0.0)
    """
    rows, slopes, columns = program.rows(v), program.row_slopes(v), binding(program, v)[2]
    rng = np.random.default_rng(seed)

    def on_sides(u: np.ndarray) -> tuple[np.ndarray, float]:
        """Gradient and height of the Lagrangian; rows have kinks too: what is not linear in them counts, with the multipliers
        that are known."""
        bent = program.rows(u) - rows - slopes @ (u - v)
        return program.gradient(u) + at.on_rows @ (program.row_slopes(u) - slopes), program.objective(u) + at.on_rows @ bent

    def nearest() -> tuple[np.ndarray, np.ndarray]:
        """The mean of the gradients so far, with those of what binds, that is nearest to 0; and their multipliers."""
        gradients = np.array([gradient for gradient, _ in found]).T
        # the weight of the last row does not matter: shares and multipliers are divided by the sum of the shares
        matrix = np.vstack([np.hstack([gradients, columns]), np.repeat([size, 0.0], [len(found), columns.shape[1]])])
        parts, _ = nnls(matrix, np.append(np.zeros(v.size), size), maxiter=30 * matrix.shape[1])
        shares, multipliers = np.split(parts, [len(found)])
        return matrix[:-1] @ parts / shares.sum(), multipliers / shares.sum()

    drawn = v + radius * rng.uniform(-1.0, 1.0, (points * v.size, v.size))
    places = [*np.clip(np.vstack([v, drawn]), program.lower, program.upper)]
    found = [on_sides(u) for u in places]
    if not all(np.isfinite(gradient).all() and np.isfinite(height) for gradient, height in found):
        return at
    size = max(float(np.abs(gradient).max()) for gradient, _ in found)
    mean, multipliers = nearest()
    for step in rng.uniform(0.0, 1.0, _STEPS_DOWN * v.size) ** 2:
        if not np.abs(mean).max() > _NOTHING * size:
            break
        u = np.clip(v - radius * step * mean / np.abs(mean).max(), program.lower, program.upper)
        side = on_sides(u)
        if not (np.isfinite(side[0]).all() and np.isfinite(side[1])):
            break
        places.append(u)
        found.append(side)
        mean, multipliers = nearest()
    error, heights = float(np.abs(mean).max()), np.array([height for _, height in found])
    higher = heights - heights[0] + (np.array(places) - v) @ columns @ multipliers
    bends_down = -higher.min() > _LOWER * higher.max()
    return at if bends_down or error >= at.kkt_error else replace(at, kkt_error=error)
