r"""Potentials over shape and heading: the unknowns of the upper bound (docs/bound.md).

For any function ``phi(q, theta)`` of the joint angles q and the heading theta of the middle link,
the integral of its rate vanishes over a closed gait, so

    efficiency <= max over q, theta, r of ( Re(e^{i theta} v) + d phi/dt ) / P,

with ``phi = Re sum_k e^{i k theta} c_k(q)``, c_k splines with the parities of the symmetries. The
harmonic k = 1 alone follows a point c_1(q) of the body from the middle link.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import spsolve

from colloc.bounds.coulomb_motion import CoulombMotion
from colloc.bounds.spline import TensorSpline

_HEADINGS = 48
_NEWTON_STEPS = 3
_AT_ONCE = 50000
_MOST_WORTH = 0.3  # share of the largest worth that a knot needs to be inserted with the best
_SINGULAR = 1e-10  # added to the roughness, of its mean diagonal: affine functions have none


@dataclass(frozen=True)
class PotentialSpace:
    """Potentials with given harmonics in the heading (odd ones suffice where mu_b = mu_f) and
    splines in the angles, `together`: sums of functions of so many angles; `end_swap`: of a
    symmetric body."""

    spline: TensorSpline
    harmonics: tuple[int, ...]
    end_swap: bool
    together: int | None = None

    @cached_property
    def bases(self) -> tuple[sparse.csr_matrix, sparse.csr_matrix]:
        """Bases of the real parts (even under the mirror) and of the imaginary parts (odd)."""
        swap, basis = -1 if self.end_swap else None, self.spline.symmetric_basis
        return basis(1, swap, self.together), basis(-1, swap, self.together)

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
        return self.layout[-1][2].stop

    @cached_property
    def roughness(self) -> sparse.csr_matrix:
        """Integral of the squared second derivatives, harmonic k weighted by k^2."""
        table = self.spline.roughness
        blocks = [
            max(k, 1) ** 2 * (self.bases[part].T @ table @ self.bases[part])
            for k, part, _ in self.layout
        ]
        return sparse.block_diag(blocks, format="csr")

    def coefficients(self, free: np.ndarray) -> dict[int, np.ndarray]:
        """Complex spline coefficients of every c_k."""
        full = {k: np.zeros(self.spline.size, dtype=complex) for k in self.harmonics}
        for k, part, where in self.layout:
            full[k] += (1, 1j)[part] * (self.bases[part] @ free[where])
        return full


class Samples:
    """Motions with what potentials need to be evaluated on them."""

    def __init__(self, space: PotentialSpace, motion: CoulombMotion) -> None:
        self.space, self.motion = space, motion
        self.value = space.spline.matrix(motion.angles)
        self.slope = space.spline.slope(motion.angles, motion.rates)

    def join(self, motion: CoulombMotion) -> Samples:
        new = Samples(self.space, motion)
        both = Samples.__new__(Samples)
        both.space, both.motion = self.space, self.motion.join(motion)
        both.value = sparse.vstack([self.value, new.value], format="csr")
        both.slope = sparse.vstack([self.slope, new.slope], format="csr")
        return both

    def amplitudes(self, free: np.ndarray) -> dict[int, np.ndarray]:
        """Complex amplitudes a_k ``(n,)`` of the gain ``Re sum_k e^{i k theta} a_k``."""
        motion = self.motion
        result = {1: motion.velocity[0] + 1j * motion.velocity[1]}
        for k, c in self.space.coefficients(free).items():
            rate = self.slope @ c + 1j * k * motion.spin * (self.value @ c)
            result[k] = result.get(k, 0) + rate
        return result

    def ratio(self, free: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Largest (gain over heading) / power ``(n,)``, and the heading where it is taken."""
        gain, heading = largest_gain(self.amplitudes(free))
        return gain / self.motion.power, heading

    def rows(self, chosen: np.ndarray, heading: np.ndarray) -> tuple[sparse.csr_matrix, np.ndarray]:
        """Gain over power of chosen samples at headings: ``matrix @ free + constant``."""
        motion = self.motion.take(chosen)
        u, v = motion.velocity
        constant = (np.cos(heading) * u - np.sin(heading) * v) / motion.power
        scale, value, slope = 1.0 / motion.power, self.value[chosen], self.slope[chosen]
        blocks = []
        for k, part, _ in self.space.layout:
            cos, sin = np.cos(k * heading) * scale, np.sin(k * heading) * scale
            along, across = (cos, -sin) if part == 0 else (-sin, -cos)
            full = sparse.diags(along) @ slope + sparse.diags(across * k * motion.spin) @ value
            blocks.append(full @ self.space.bases[part])
        return sparse.hstack(blocks, format="csr"), constant


def largest_ratios(space: PotentialSpace, free: np.ndarray, motion: CoulombMotion) -> np.ndarray:
    """Largest (gain over heading) / power of each motion; `Samples` of a part at a time are
    large."""
    parts = np.array_split(np.arange(motion.size), motion.size // _AT_ONCE + 1)
    return np.concatenate([Samples(space, motion.take(part)).ratio(free)[0] for part in parts])


def largest_gain(amplitudes: dict[int, np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    """Maximum over theta of ``Re sum_k e^{i k theta} a_k`` and its place, ``(n,)`` each."""
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


class Measure(NamedTuple):
    """Multipliers of the program: of all ways to share out work among motions so that they close in
    the mean, the one that travels farthest, along heading 0."""

    motion: CoulombMotion
    heading: np.ndarray  # of the middle link [rad], (n,)
    weight: np.ndarray  # share of the work, of sum 1, (n,)


def worth(space: PotentialSpace, measure: Measure) -> float:
    """What the functions of a space gain over those that the measure closes for, up to a factor:
    ``g.R^-1.g``, g being their mean rates and R the roughness."""
    rows, _ = Samples(space, measure.motion).rows(np.arange(measure.weight.size), measure.heading)
    slope, size = rows.T @ measure.weight, space.roughness.diagonal().mean()
    roughness = space.roughness + _SINGULAR * size * sparse.eye(space.size)
    return float(slope @ spsolve(roughness.tocsc(), slope))


def with_knots(space: PotentialSpace, added: np.ndarray) -> PotentialSpace:
    old = space.spline
    inner = np.unique(np.concatenate([old.knots[1:-1], added, -added]).round(12) + 0.0)
    spline = TensorSpline(old.n_joint, old.limit, inner.size + 1, tuple(inner.tolist()))
    return replace(space, spline=spline)


def with_more_knots(space: PotentialSpace, measure: Measure, intervals: int) -> PotentialSpace:
    """The potentials with knots in the middle of those intervals where they are worth most."""
    knots = space.spline.knots
    middle = 0.5 * (knots[1:] + knots[:-1])
    places = middle[middle > -1e-12]
    values = np.array([worth(with_knots(space, places[[k]]), measure) for k in range(places.size)])
    added: list[float] = []
    for k in np.argsort(-values):
        more = with_knots(space, np.array([*added, places[k]])).spline.intervals
        if added and (values[k] < _MOST_WORTH * values.max() or more > intervals):
            break
        added.append(float(places[k]))
    return with_knots(space, np.array(added))
