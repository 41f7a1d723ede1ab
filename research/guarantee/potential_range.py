"""What a potential can do over whole cells: its gain at their corners from above, and how it varies
between them."""

from __future__ import annotations

from fractions import Fraction
from functools import cached_property

import numpy as np

from colloc.bounds.sampled import DEGREE, Bound, PotentialSpace, TensorSpline
from colloc.mechanics.chain import Chain
from research.guarantee.enclosure import WIDER, Cells, ReferencePoint, spread
from research.guarantee.kernel import call
from research.guarantee.loaded_balance import Loaded

_HEADINGS = 192
_ORDERS = ((1, 0), (0, 1), (2, 0), (0, 2), (3, 0), (2, 1), (1, 2), (0, 3))


def potential_space(bound: Bound, body: Chain) -> PotentialSpace:
    """The space in which a bound's coefficients are those of its potential."""
    spline = TensorSpline(body.n_joint, bound.joint_limit, bound.intervals, bound.graded)
    return PotentialSpace(spline, bound.harmonics, body.symmetric, bound.together)


def gain_bound(amplitudes: dict[int, np.ndarray]) -> np.ndarray:
    """At least the largest ``Re sum_k e^{i k theta} a_k`` over all headings, ``(n,)``.

    Near its maximum a function falls by at most half its largest curvature times the distance
    squared. Waves and sums are off by less than 2^-44, as no k is larger than 8.
    """
    harmonics = np.array(sorted(amplitudes))
    stacked = np.stack([amplitudes[k] for k in harmonics], axis=1)
    waves = np.exp(1j * harmonics[:, None] * np.arange(_HEADINGS) * (2 * np.pi / _HEADINGS))
    on_grid = (stacked.real @ waves.real - stacked.imag @ waves.imag).max(axis=1)
    size = np.abs(stacked)
    return WIDER * (
        on_grid
        + 2.0**-44 * size.sum(axis=1)
        + 0.5 * (np.pi / _HEADINGS) ** 2 * (size @ harmonics**2)
    )


def turned(space: PotentialSpace, free: np.ndarray) -> np.ndarray:
    """The same potential for the body turned end for end: ``c_k(q)`` becomes
    ``-conj(c_k(reversed q))``.

    Turning the body and reversing time take angles q to -reversed q and rates r to reversed r;
    the velocity of the middle link in its own axes and its heading stay, the sense of its
    rotation does not. By the mirror image ``c_k(-q) = conj(c_k(q))``.
    """
    image = np.empty_like(free)
    for _, basis, where in space.layout:
        table = (basis @ free[where]).reshape((space.spline.per_joint,) * space.spline.n_joint)
        swapped = -table.transpose().ravel().conj()
        sizes = basis.multiply(basis.conj()).sum(axis=0).A1
        image[where] = (basis.conj().T @ swapped / sizes).real
    return image


_Near = tuple[np.ndarray, np.ndarray]


class PotentialRange:
    """A potential ``Re sum_k e^{i k theta} c_k(q)`` over cells that no knot cuts."""

    def __init__(self, space: PotentialSpace, free: np.ndarray) -> None:
        self.space, self.free = space, free
        self.spline = space.spline
        self.c = space.coefficients(free)

    @cached_property
    def largest(self) -> dict[tuple[int, tuple[int, int]], np.ndarray]:
        """Bounds of |derivatives| of c_k, by k and orders, over every knot cell, ``(intervals,
        intervals)``.

        The derivative is a spline of lower degree: inside a knot cell it lies in the hull of its
        coefficients there. These are differences, and so done in fractions.
        """
        n, intervals, exact = (
            self.spline.per_joint,
            self.spline.intervals,
            np.vectorize(Fraction, otypes=[object]),
        )
        tables, knots = {}, exact(self.spline.extend)
        for k, c in self.c.items():
            parts = exact(np.stack([c.real, c.imag], axis=-1)).reshape(n, n, 2)
            for order in _ORDERS:
                table = parts
                for axis, times in enumerate(order):
                    for j in range(times):
                        width = knots[DEGREE + 1 : -1 - j] - knots[1 + j : -DEGREE - 1]
                        table = (
                            (DEGREE - j)
                            * np.diff(table, axis=axis)
                            / width.reshape((-1, 1, 1) if axis == 0 else (1, -1, 1))
                        )
                size = np.hypot(*np.moveaxis(table.astype(float), -1, 0))
                near = [
                    size[i : i + intervals, j : j + intervals]
                    for i in range(4 - order[0])
                    for j in range(4 - order[1])
                ]
                tables[k, order] = np.max(near, axis=0)
        return tables

    def _harmonic(self, k: int, points: np.ndarray, velocity: np.ndarray) -> tuple[_Near, _Near]:
        """c_k at points (angle 1, angle 2, s) ``(3, m)`` and how far off it may be; the same of the
        gain's amplitude there, of motions ``(3, m)`` of the middle link."""
        spline, m = self.spline, points.shape[1]
        coefficients = np.stack([self.c[k].real, self.c[k].imag], axis=-1)
        places = np.stack([spline.cell(angle) for angle in points[:2]], axis=-1)
        rows = (
            np.ascontiguousarray(points.T),
            np.ascontiguousarray(places),
            np.ascontiguousarray(velocity.T),
        )
        value, amplitude = np.empty((2, m, 3))
        call(
            "colloc_harmonic",
            m,
            spline.per_joint,
            spline.extend,
            coefficients,
            k,
            *rows,
            value,
            amplitude,
        )
        return (value[:, 0] + 1j * value[:, 1], value[:, 2]), (
            amplitude[:, 0] + 1j * amplitude[:, 1],
            amplitude[:, 2],
        )

    def corner_gain(self, cells: Cells, motions: Loaded) -> np.ndarray:
        """At least the gain at the corners, ``(m,)``."""
        found = {k: self._harmonic(k, cells.points, motions.velocity)[1] for k in self.c}
        return gain_bound({k: near for k, (near, _) in found.items()}) + WIDER * sum(
            off for _, off in found.values()
        )

    def _over(self, cells: Cells, k: int, order: tuple[int, int]) -> np.ndarray:
        i, j = (self.spline.cell(angle) for angle in cells.low[:2] + 0.5 * cells.size[:2])
        return self.largest[k, order][i, j]

    def trial_error(self, cells: Cells, motions: Loaded) -> np.ndarray:
        """How much more than the interpolated gain of the corners the gain of the interpolated
        motion may be, ``(n,)``."""
        h1, h2, hs = cells.size
        s = np.maximum(np.abs(cells.low[2]), np.abs(cells.low[2] + hs))
        spin = motions.velocity[2:, cells.at]
        fastest = np.abs(spin[0]).max(axis=1)
        total = np.zeros_like(h1)
        for k in self.c:
            for h, axis, second in ((h1, 0, (2, 0)), (h2, 1, (0, 2))):
                slope = self._over(cells, k, (second[0] + 1, second[1])) + s * self._over(
                    cells, k, (second[0], second[1] + 1)
                )
                first = self._over(cells, k, (1 - axis, axis))
                turn = (
                    h / 8 * fastest * self._over(cells, k, second) + spread(spin, axis) / 4 * first
                )
                total += h * (h / 8 * slope + k * turn)
        return WIDER * total

    def reference(self, cells: Cells) -> ReferencePoint:
        """How the gain depends on the motion of the middle link."""
        h1, h2, _ = cells.size
        middle = cells.low + 0.5 * cells.size
        centre = {k: self._harmonic(k, middle, 0.0 * middle)[0] for k in self.c}
        across = {
            k: h1 * self._over(cells, k, (1, 0)) + h2 * self._over(cells, k, (0, 1)) for k in self.c
        }
        beside = sum(
            k * (0.5 * across[k] + off + (np.abs(at) if k != 1 else 0.0))
            for k, (at, off) in centre.items()
        )
        curvature = h1 * h1 / 8 * self._over(cells, 1, (2, 0)) + h2 * h2 / 8 * self._over(
            cells, 1, (0, 2)
        )
        at, off = self._harmonic(1, cells.points, 0.0 * cells.points)[0]
        return ReferencePoint(
            at,
            centre[1][0],
            WIDER * beside,
            WIDER * across[1],
            WIDER * (curvature + off[cells.at].max(axis=1)),
        )
