"""What a potential can do over whole cells: its gain at their corners from above, and how it varies between them."""

from __future__ import annotations

from functools import cached_property

import numpy as np

from colloc.bounds.coulomb_motion import CoulombMotion
from colloc.bounds.potential import PotentialSpace, Samples
from colloc.numerics.spline import DEGREE
from research.guarantee.enclosure import Cells, ReferencePoint, spread
from research.guarantee.loaded_balance import Loaded

_HEADINGS = 192
_ORDERS = ((1, 0), (0, 1), (2, 0), (0, 2), (3, 0), (2, 1), (1, 2), (0, 3))


def gain_bound(amplitudes: dict[int, np.ndarray]) -> np.ndarray:
    """At least the largest ``Re sum_k e^{i k theta} a_k`` over all headings, ``(n,)``.

    Near its maximum a function falls by at most half its largest curvature times the distance squared.
    """
    harmonics = np.array(sorted(amplitudes))
    stacked = np.stack([amplitudes[k] for k in harmonics], axis=1)
    waves = np.exp(1j * harmonics[:, None] * np.arange(_HEADINGS) * (2 * np.pi / _HEADINGS))
    on_grid = (stacked.real @ waves.real - stacked.imag @ waves.imag).max(axis=1)
    return on_grid + 0.5 * (np.pi / _HEADINGS) ** 2 * (np.abs(stacked) @ harmonics**2)


class PotentialRange:
    """A potential ``Re sum_k e^{i k theta} c_k(q)`` over cells that no knot cuts."""

    def __init__(self, space: PotentialSpace, free: np.ndarray) -> None:
        self.space, self.free = space, free
        self.spline = space.spline
        self.c = space.coefficients(free)

    @cached_property
    def largest(self) -> dict[tuple[int, tuple[int, int]], np.ndarray]:
        """Bounds of |derivatives| of c_k, by k and orders, over every knot cell, ``(intervals, intervals)``.

        The derivative is a spline of lower degree: inside a knot cell it lies in the hull of its coefficients there.
        """
        n, intervals, knots = self.spline.per_joint, self.spline.intervals, self.spline.extended
        tables = {}
        for k, c in self.c.items():
            for order in _ORDERS:
                table = c.reshape(n, n)
                for axis, times in enumerate(order):
                    for j in range(times):
                        width = knots[DEGREE + 1 : -1 - j] - knots[1 + j : -DEGREE - 1]
                        table = (DEGREE - j) * np.diff(table, axis=axis) / width.reshape((-1, 1) if axis == 0 else (1, -1))
                parts = [
                    np.abs(table[i : i + intervals, j : j + intervals])
                    for i in range(4 - order[0])
                    for j in range(4 - order[1])
                ]
                tables[k, order] = np.max(parts, axis=0)
        return tables

    def corner_gain(self, cells: Cells, motions: Loaded) -> np.ndarray:
        """At least the gain at the corners, ``(m,)``."""
        found = CoulombMotion(cells.points[:2], cells.rates, motions.velocity[:2], motions.velocity[2], motions.potential)
        return gain_bound(Samples(self.space, found).amplitudes(self.free))

    def _over(self, cells: Cells, k: int, order: tuple[int, int]) -> np.ndarray:
        i, j = (self.spline.cell(angle) for angle in cells.low[:2] + 0.5 * cells.size[:2])
        return self.largest[k, order][i, j]

    def trial_error(self, cells: Cells, motions: Loaded) -> np.ndarray:
        """How much more than the interpolated gain of the corners the gain of the interpolated motion may be, ``(n,)``."""
        h1, h2, hs = cells.size
        s = np.maximum(np.abs(cells.low[2]), np.abs(cells.low[2] + hs))
        spin = motions.velocity[2:, cells.at]
        fastest = np.abs(spin[0]).max(axis=1)
        total = np.zeros_like(h1)
        for k in self.c:
            for h, axis, second in ((h1, 0, (2, 0)), (h2, 1, (0, 2))):
                slope = self._over(cells, k, (second[0] + 1, second[1])) + s * self._over(cells, k, (second[0], second[1] + 1))
                first = self._over(cells, k, (1 - axis, axis))
                turn = h / 8 * fastest * self._over(cells, k, second) + spread(spin, axis) / 4 * first
                total += h * (h / 8 * slope + k * turn)
        return total

    def reference(self, cells: Cells) -> ReferencePoint:
        """How the gain depends on the motion of the middle link."""
        centre = self.spline.matrix(cells.low[:2] + 0.5 * cells.size[:2])
        h1, h2, _ = cells.size
        beside = np.zeros_like(h1)
        for k, c in self.c.items():
            change = h1 * self._over(cells, k, (1, 0)) + h2 * self._over(cells, k, (0, 1))
            beside += k * (0.5 * change + (np.abs(centre @ c) if k != 1 else 0.0))
        one = self.c[1]
        return ReferencePoint(
            self.spline.matrix(cells.points[:2]) @ one,
            centre @ one,
            beside,
            h1 * self._over(cells, 1, (1, 0)) + h2 * self._over(cells, 1, (0, 1)),
            h1 * h1 / 8 * self._over(cells, 1, (2, 0)) + h2 * h2 / 8 * self._over(cells, 1, (0, 2)),
        )
