"""First-order conditions at a kink: some mean of the gradients around the point vanishes, where no
single one does.

An objective that is the larger of two smooth ones may have its least value where they meet, and
both gradients point away from the kink there. Such a point is stationary in the sense of Clarke and
Goldstein: 0 is a convex combination of gradients at points near it (Goldstein, Math. Program. 13,
1977). With points drawn by chance within a small radius this can be measured (Burke, Lewis and
Overton, SIAM J. Optim. 15, 2005). Where several kinks meet, chance misses sides: points a step down
the mean that is nearest to 0 find them.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from colloc.numerics.nonnegative import nonnegative
from colloc.numerics.sqp import NonlinearProgram, Stationarity, binding

_LOWER = 0.1
"""A kink that bends down has the same gradients. There, points are lower by more than this part of
what they would be higher by where it bends up."""
_STEPS_DOWN = 4
"""Points down the nearest mean, per unknown, at most."""


def stationarity_around(
    program: NonlinearProgram,
    v: np.ndarray,
    at: Stationarity,
    radius: float,
    *,
    enough: float,
    points: int = 4,
    seed: int = 0,
) -> Stationarity:
    """The conditions at v, with the mean of the gradients around it that comes closest to them in
    place of the one at v.

    Parameters
    ----------
    program : NonlinearProgram
    v : (n,)
    at : Stationarity
        At v alone.
    radius : float
        In every unknown, within which the gradients are taken.
    enough : float
        No further gradients are taken once some mean is that close to 0.
    points : int
        How many are drawn, per unknown: on both sides of a kink, and in all corners of a few that
        meet.
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
    ...     objective = staticmethod(lambda v: abs(v[0]))
    ...     gradient = staticmethod(lambda v: np.sign(v) + (v == 0))
    ...     rows = staticmethod(lambda v: np.empty(0))
    ...     row_slopes = staticmethod(lambda v: np.empty((0, 1)))
    >>> at = stationarity(Vee, np.zeros(1))
    >>> around = stationarity_around(Vee, np.zeros(1), at, 1e-6, enough=1e-9)
    >>> at.kkt_error, round(around.kkt_error, 12)
    (1.0, 0.0)
    """
    rows, slopes, columns = program.rows(v), program.row_slopes(v), binding(program, v)[2]
    rng = np.random.default_rng(seed)

    def on_sides(u: np.ndarray) -> tuple[np.ndarray, float]:
        """Gradient and height of the Lagrangian; rows have kinks too: what is not linear in them
        counts, with the multipliers that are known."""
        bent = program.rows(u) - rows - slopes @ (u - v)
        return program.gradient(u) + at.on_rows @ (
            program.row_slopes(u) - slopes
        ), program.objective(u) + at.on_rows @ bent

    drawn = v + radius * rng.uniform(-1.0, 1.0, (points * v.size, v.size))
    places = [*np.clip(np.vstack([v, drawn]), program.lower, program.upper)]
    found = [on_sides(u) for u in places]
    if not all(np.isfinite(gradient).all() and np.isfinite(height) for gradient, height in found):
        return at
    hull = _Hull(np.array([gradient for gradient, _ in found]), columns)
    for step in rng.uniform(0.0, 1.0, _STEPS_DOWN * v.size) ** 2:
        if np.abs(hull.nearest).max() < enough:
            break
        u = np.clip(
            v - radius * step * hull.nearest / np.abs(hull.nearest).max(),
            program.lower,
            program.upper,
        )
        side = on_sides(u)
        if not (np.isfinite(side[0]).all() and np.isfinite(side[1])):
            break
        places.append(u)
        found.append(side)
        hull.add(side[0])
    error, heights = float(np.abs(hull.nearest).max()), np.array([height for _, height in found])
    higher = heights - heights[0] + (np.array(places) - v) @ columns @ hull.multipliers
    bends_down = -higher.min() > _LOWER * higher.max()
    return at if bends_down or error >= at.kkt_error else replace(at, kkt_error=error)


class _Hull:
    """The mean of gradients ``(m, n)``, with the `columns` ``(n, k)`` of what binds, that is
    nearest to 0."""

    def __init__(self, gradients: np.ndarray, columns: np.ndarray) -> None:
        self._gradients, self._columns, self._size = (
            gradients,
            columns,
            float(np.abs(gradients).max()),
        )
        self._solve()

    def add(self, gradient: np.ndarray) -> None:
        """Take one more: those without a share in the nearest mean so far are not needed for a
        nearer one."""
        self._gradients = np.vstack([self._gradients[self._shares > 0], gradient])
        self._solve()

    def _solve(self) -> None:
        m, k = len(self._gradients), self._columns.shape[1]
        # the weight of the last row does not matter: shares and multipliers are divided by the sum
        # of the shares
        matrix = np.vstack(
            [np.hstack([self._gradients.T, self._columns]), np.repeat([self._size, 0.0], [m, k])]
        )
        parts = nonnegative(matrix, np.append(np.zeros(len(matrix) - 1), self._size))
        self._shares = parts[:m] / parts[:m].sum()
        self.multipliers = parts[m:] / parts[:m].sum()
        self.nearest = self._gradients.T @ self._shares + self._columns @ self.multipliers
