r"""Potentials over shape and heading: the unknowns of the upper bound (docs/bound.md).

For any function ``phi(q, theta)`` of the joint angles q and the heading theta of the middle link,
the integral of its rate vanishes over a closed gait. So the distance along a fixed direction may be
counted as ``v_x(q, theta, r) + d phi/dt``, and

    efficiency <= max over q, theta, r of ( Re(e^{i theta} v) + d phi/dt ) / P.

As a Fourier series in theta, ``phi = Re sum_k e^{i k theta} c_k(q)``. The harmonic k = 1 alone
follows a point c_1(q) of the body frame (x + i y) from the middle link; k = 0 is a potential on
shape space. Splines in q, parities from the symmetries.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy import sparse

from colloc.bounds.coulomb_motion import CoulombMotion
from colloc.numerics.spline import TensorSpline

_HEADINGS = 48
_NEWTON_STEPS = 3
_AT_ONCE = 50000


@dataclass(frozen=True)
class PotentialSpace:
    """The potentials with given harmonics in the heading and splines in the angles.

    Parameters
    ----------
    spline : TensorSpline
    harmonics : tuple of int
        Those used; odd ones suffice where mu_b = mu_f.
    end_swap : bool
        Whether the body is the same when turned end for end (see
        `colloc.bounds.coulomb_motion.swaps_ends`).
    together : int, optional
        Only sums of functions of so many joint angles each.
    """

    spline: TensorSpline
    harmonics: tuple[int, ...]
    end_swap: bool
    together: int | None = None

    @cached_property
    def bases(self) -> tuple[sparse.csr_matrix, sparse.csr_matrix]:
        """Bases of the real parts (even under the mirror) and of the imaginary parts (odd)."""
        swap = -1 if self.end_swap else None
        return self.spline.symmetric_basis(1, swap, self.together), self.spline.symmetric_basis(
            -1, swap, self.together
        )

    @cached_property
    def layout(self) -> list[tuple[int, int, slice]]:
        """(harmonic, 0 real or 1 imaginary, its slice of the free coefficients)"""
        layout, start = [], 0
        for k in self.harmonics:
            for part in (0,) if k == 0 else (0, 1):
                size = self.bases[part].shape[1]
                layout.append((k, part, slice(start, start + size)))
                start += size
        return layout

    @property
    def size(self) -> int:
        """Number of free coefficients."""
        return self.layout[-1][2].stop

    @cached_property
    def roughness(self) -> sparse.csr_matrix:
        """Quadratic form of the free coefficients: integral of the squared second derivatives,
        harmonic k weighted by k^2."""
        table = self.spline.roughness
        return sparse.block_diag(
            [
                max(k, 1) ** 2 * (self.bases[part].T @ table @ self.bases[part])
                for k, part, _ in self.layout
            ],
            format="csr",
        )

    def coefficients(self, free: np.ndarray) -> dict[int, np.ndarray]:
        """Complex spline coefficients of every c_k, ``(spline.size,)`` each."""
        full = {k: np.zeros(self.spline.size, dtype=complex) for k in self.harmonics}
        for k, part, where in self.layout:
            full[k] += (1, 1j)[part] * (self.bases[part] @ free[where])
        return full

    def turned(self, free: np.ndarray) -> np.ndarray:
        """The same potential for the body turned end for end: ``c_k(q)`` becomes
        ``-conj(c_k(reversed q))``.

        Turning the body and reversing time take angles q to -reversed q and rates r to reversed r;
        the velocity of the middle link in its own axes and its heading stay as they are, the sense
        of its rotation does not. By the mirror image ``c_k(-q) = conj(c_k(q))``.
        """
        found = np.empty_like(free)
        for _, part, where in self.layout:
            basis = self.bases[part]
            table = (basis @ free[where]).reshape((self.spline.per_joint,) * self.spline.n_joint)
            image = (-1, 1)[part] * table.transpose().ravel()
            found[where] = (basis.T @ image) / basis.multiply(basis).sum(axis=0).A1
        return found


class Samples:
    """Motions with what a potential needs to be evaluated on them."""

    def __init__(self, space: PotentialSpace, motion: CoulombMotion) -> None:
        self.space, self.motion = space, motion
        self.value = space.spline.matrix(motion.angles)
        self.slope = space.spline.slope(motion.angles, motion.rates)

    def joined(self, motion: CoulombMotion) -> Samples:
        """These samples and new ones."""
        new = Samples(self.space, motion)
        both = Samples.__new__(Samples)
        both.space, both.motion = self.space, self.motion.joined(motion)
        both.value = sparse.vstack([self.value, new.value], format="csr")
        both.slope = sparse.vstack([self.slope, new.slope], format="csr")
        return both

    def amplitudes(self, free: np.ndarray) -> dict[int, np.ndarray]:
        """Complex amplitudes ``(n,)`` by harmonic k of the gain ``Re sum_k e^{i k theta} a_k`` as a
        function of heading."""
        motion = self.motion
        result = {1: motion.velocity[0] + 1j * motion.velocity[1]}
        for k, c in self.space.coefficients(free).items():
            rate = self.slope @ c + 1j * k * motion.spin * (self.value @ c)
            result[k] = result.get(k, 0) + rate
        return result

    def ratio(self, free: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Largest (gain over heading) / power, and the heading where it is taken, ``(n,)`` each."""
        gain, heading = largest_gain(self.amplitudes(free))
        return gain / self.motion.power, heading

    def rows(self, chosen: np.ndarray, heading: np.ndarray) -> tuple[sparse.csr_matrix, np.ndarray]:
        """The gain of chosen samples at given headings, over power: ``matrix @ free +
        constant``."""
        u, v = self.motion.velocity[:, chosen]
        constant = (np.cos(heading) * u - np.sin(heading) * v) / self.motion.power[chosen]
        scale = 1.0 / self.motion.power[chosen]
        value, slope, spin = self.value[chosen], self.slope[chosen], self.motion.spin[chosen]
        blocks = []
        for k, part, _ in self.space.layout:
            cos, sin = np.cos(k * heading) * scale, np.sin(k * heading) * scale
            along, across = (cos, -sin) if part == 0 else (-sin, -cos)
            full = sparse.diags(along) @ slope + sparse.diags(across * k * spin) @ value
            blocks.append(full @ self.space.bases[part])
        return sparse.hstack(blocks, format="csr"), constant


def largest_ratios(space: PotentialSpace, free: np.ndarray, motion: CoulombMotion) -> np.ndarray:
    """Largest (gain over heading) / power of each motion, ``(n,)``; `Samples` of a part at a time,
    as they are large."""
    parts = np.array_split(np.arange(motion.size), motion.size // _AT_ONCE + 1)
    return np.concatenate([Samples(space, motion.take(part)).ratio(free)[0] for part in parts])


def largest_gain(amplitudes: dict[int, np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    """Maximum over theta of ``Re sum_k e^{i k theta} a_k`` and its place, ``(n,)`` each.

    Closed form if only k = 0 and 1 occur; else the best of a grid of headings, polished by Newton
    steps.
    """
    if set(amplitudes) <= {0, 1}:
        first = amplitudes[1]
        return np.abs(first) + np.real(amplitudes.get(0, 0.0)), -np.angle(first)

    harmonics = np.array(sorted(amplitudes))
    stacked = np.stack([amplitudes[k] for k in harmonics], axis=1)
    grid = np.arange(_HEADINGS) * (2 * np.pi / _HEADINGS)
    waves = np.exp(1j * harmonics[:, None] * grid)
    heading = grid[np.argmax(stacked.real @ waves.real - stacked.imag @ waves.imag, axis=1)]

    def terms(theta: np.ndarray) -> np.ndarray:
        return stacked * np.exp(1j * harmonics * theta[:, None])

    best = terms(heading).real.sum(axis=1)
    for _ in range(_NEWTON_STEPS):
        now = terms(heading)
        slope, curvature = -now.imag @ harmonics, -now.real @ harmonics**2
        step = np.where(curvature < 0, -slope / np.where(curvature < 0, curvature, 1.0), 0.0)
        trial = heading + np.clip(step, -np.pi / _HEADINGS, np.pi / _HEADINGS)
        gain = terms(trial).real.sum(axis=1)
        heading, best = np.where(gain > best, trial, heading), np.maximum(gain, best)
    return best, heading
