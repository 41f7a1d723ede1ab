r"""Potentials over shape and heading: the unknowns of the upper bound (docs/bound.md).

For any function ``phi(q, theta)`` of the joint angles q and the heading theta of the middle link,
the integral of its rate vanishes over a closed gait, so

    efficiency <= max over q, theta, r of ( Re(e^{i theta} v) + d phi/dt ) / P,

with ``phi = Re sum_k e^{i k theta} c_k(q)``, c_k tensor-product cubic B-splines with the parities
of the symmetries. The harmonic k = 1 alone follows a point c_1(q) of the body from the middle link.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property, reduce
from itertools import combinations
from typing import NamedTuple

import numpy as np
from scipy import sparse
from scipy.interpolate import BSpline
from scipy.linalg import qr
from scipy.sparse.linalg import spsolve

from colloc.bounds.motions import CoulombMotion
from colloc.system.errors import ProblemError

DEGREE = 3
_DEPENDENT = 1e-9  # pivot, relative, below which a function is a sum of others
_HEADINGS = 48
_NEWTON_STEPS = 3
_AT_ONCE = 50000
_MOST_WORTH = 0.3  # share of the largest worth that a knot needs to be inserted with the best
_SINGULAR = 1e-10  # added to the roughness, of its mean diagonal: affine functions have none


@dataclass(frozen=True)
class TensorSpline:
    """Tensor-product cubic splines on the cube |angle| <= limit [rad].

    A function is a vector of (intervals + 3)^n_joint coefficients, last joint fastest. Symmetries
    permute these, so a function with given parities has fewer free ones: ``full = E @ free``.
    """

    n_joint: int
    limit: float
    intervals: int
    graded: tuple[float, ...] = ()
    """Inner knots, ascending and symmetric about 0; evenly spaced if empty."""

    def __post_init__(self) -> None:
        inner, knots = np.array(self.graded), self.knots
        graded = not self.graded or (
            inner.size == self.intervals - 1 and np.abs(inner + inner[::-1]).max() < 1e-9
        )
        if self.intervals < 1 or not graded or (np.diff(knots) <= 0).any():
            raise ProblemError(
                f"a spline needs a positive limit and an interval, and graded knots must be "
                f"{self.intervals - 1} angles, ascending, symmetric and within the limit."
            )

    @cached_property
    def knots(self) -> np.ndarray:
        if not self.graded:
            return np.linspace(-self.limit, self.limit, self.intervals + 1)
        return np.array([-self.limit, *self.graded, self.limit])

    @cached_property
    def extend(self) -> np.ndarray:
        beyond = np.arange(1, DEGREE + 1) * (self.knots[1] - self.knots[0])
        return np.concatenate([self.knots[0] - beyond[::-1], self.knots, self.knots[-1] + beyond])

    @property
    def per_joint(self) -> int:
        return self.intervals + DEGREE

    @property
    def size(self) -> int:
        return self.per_joint**self.n_joint

    def cell(self, angle: np.ndarray) -> np.ndarray:
        return np.clip(np.searchsorted(self.knots, angle, side="right") - 1, 0, self.intervals - 1)

    def matrices(
        self, angles: np.ndarray, rates: np.ndarray
    ) -> tuple[sparse.csr_matrix, sparse.csr_matrix]:
        """All functions at angles ``(n_joint, n)``, and their rates of change, ``(n, size)``."""
        n, one = angles.shape[1], BSpline(self.extend, np.eye(self.per_joint), DEGREE)
        value, change, column = np.ones((n, 1)), np.zeros((n, 1)), np.zeros((n, 1), dtype=np.int32)
        for angle, rate in zip(angles, rates, strict=True):
            alive = self.cell(angle)[:, None] + np.arange(DEGREE + 1)
            at, steepness = (np.take_along_axis(one(angle, nu=k), alive, axis=1) for k in (0, 1))
            change = _products(change, at) + _products(value, rate[:, None] * steepness)
            value = _products(value, at)
            column = (column[:, :, None] * self.per_joint + alive[:, None]).reshape(n, -1)
        places, shape = (column.ravel(), np.arange(n + 1) * column.shape[1]), (n, self.size)
        first, second = (
            sparse.csr_matrix((entries.ravel(), *places), shape) for entries in (value, change)
        )
        return first, second

    @cached_property
    def roughness(self) -> sparse.csr_matrix:
        """Gram matrix of the second derivatives: ``c.roughness.c`` is about the integral of |D^2
        f|^2."""
        half, one = 0.5 * np.diff(self.knots), BSpline(self.extend, np.eye(self.per_joint), DEGREE)
        places = (self.knots[:-1, None] + half[:, None] * np.array([0.5, 1.5])).ravel()
        of_joint = (one(places, nu=order) for order in range(3))
        grams = [sparse.csr_matrix(each.T * np.repeat(half, 2) @ each) for each in of_joint]
        unit = np.eye(self.n_joint, dtype=int)
        pairs = (a + b for a in unit for b in unit)
        return sum(reduce(sparse.kron, [grams[k] for k in orders]) for orders in pairs).tocsr()

    def symmetric_basis(
        self, mirror: int, swap: int | None, together: int | None = None
    ) -> sparse.csr_matrix:
        """Basis ``(size, n_free)`` of functions with f(-q) = mirror f(q), f(-reversed q) = swap
        f(q); with `together`, of sums of functions of so many joints."""
        index = np.arange(self.size).reshape((self.per_joint,) * self.n_joint)
        flipped = index[(slice(None, None, -1),) * self.n_joint]
        group = [(index.ravel(), 1), (flipped.ravel(), mirror)]
        if swap is not None:
            turned = flipped.transpose().ravel()
            group += [(turned, swap), (flipped.ravel()[turned], mirror * swap)]
        every, average = np.arange(self.size), sparse.csr_matrix((self.size, self.size))
        for image, sign in group:
            average = average + sparse.csr_matrix((np.full(self.size, float(sign)), (every, image)))
        if together is not None and together < self.n_joint:
            of = sparse.csc_matrix(np.ones((self.per_joint, 1))), sparse.eye(self.per_joint)
            some = combinations(range(self.n_joint), together)
            choices = [[of[k in each] for k in range(self.n_joint)] for each in some]
            products = sparse.hstack([reduce(sparse.kron, each) for each in choices], format="csc")
            summands = average @ products
            _, r, order = qr(summands.toarray(), mode="economic", pivoting=True)
            rank = np.sum(np.abs(np.diag(r)) > _DEPENDENT * np.abs(r[0, 0]))
            basis = summands.tocsc()[:, np.sort(order[:rank])]
        else:
            # orbits: one free coefficient for each, unless the signs cancel
            representative = np.min([image for image, _ in group], axis=0)
            alive = (representative == every) & (abs(average.diagonal()) > 0)
            basis = average.tocsc()[:, np.flatnonzero(alive)]
        return (basis @ sparse.diags(1.0 / abs(basis).max(axis=0).toarray().ravel())).tocsr()


def _products(values: np.ndarray, more: np.ndarray) -> np.ndarray:
    return (values[:, :, None] * more[:, None]).reshape(len(values), -1)


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
    def layout(self) -> list[tuple[int, sparse.csr_matrix, slice]]:
        """Harmonic, complex basis, of real parts even under the mirror and imaginary ones that are
        odd, and its slice of the free coefficients."""
        swap, layout, stop = -1 if self.end_swap else None, [], 0
        even, odd = (self.spline.symmetric_basis(m, swap, self.together) for m in (1, -1))
        for k in self.harmonics:
            basis = sparse.hstack([even, 1j * odd], format="csr") if k else even
            start, stop = stop, stop + basis.shape[1]
            layout.append((k, basis, slice(start, stop)))
        return layout

    @property
    def size(self) -> int:
        return self.layout[-1][2].stop

    @cached_property
    def roughness(self) -> sparse.csr_matrix:
        """Integral of the squared second derivatives, harmonic k weighted by k^2."""
        table = self.spline.roughness
        parts = (max(k, 1) ** 2 * (b.conj().T @ table @ b).real for k, b, _ in self.layout)
        return sparse.block_diag([*parts], format="csr")

    def coefficients(self, free: np.ndarray) -> dict[int, np.ndarray]:
        """Complex spline coefficients of every c_k."""
        return {k: basis @ free[where] + 0j for k, basis, where in self.layout}

    def largest_ratios(self, free: np.ndarray, motion: CoulombMotion) -> np.ndarray:
        """Largest (gain over heading) / power of each motion; `Samples` of a part at a time are
        large."""
        parts = np.array_split(np.arange(motion.size), motion.size // _AT_ONCE + 1)
        ratios = (Samples(self, motion.take(part)).ratio(free)[0] for part in parts)
        return np.concatenate([*ratios])

    def with_knots(self, added: np.ndarray) -> PotentialSpace:
        old = self.spline
        inner = np.unique(np.concatenate([old.knots[1:-1], added, -added]).round(12) + 0.0)
        spline = TensorSpline(old.n_joint, old.limit, inner.size + 1, tuple(inner.tolist()))
        return replace(self, spline=spline)

    def worth(self, measure: Measure) -> float:
        """What its functions gain over those that the measure closes for, up to a factor:
        ``g.R^-1.g``, g being their mean rates and R the roughness."""
        samples = Samples(self, measure.motion)
        rows, _ = samples.rows(np.arange(measure.weight.size), measure.heading)
        slope, size = rows.T @ measure.weight, self.roughness.diagonal().mean()
        roughness = self.roughness + _SINGULAR * size * sparse.eye(self.size)
        return float(slope @ spsolve(roughness.tocsc(), slope))

    def with_more_knots(self, measure: Measure, intervals: int) -> PotentialSpace:
        """The potentials with knots in the middle of those intervals where they are worth most."""
        knots = self.spline.knots
        middle = 0.5 * (knots[1:] + knots[:-1])
        places = middle[middle > -1e-12]
        values = np.array([self.with_knots(each).worth(measure) for each in places[:, None]])
        added: list[float] = []
        for k in np.argsort(-values):
            more = self.with_knots(np.array([*added, places[k]])).spline.intervals
            if added and (values[k] < _MOST_WORTH * values.max() or more > intervals):
                break
            added.append(float(places[k]))
        return self.with_knots(np.array(added))


class Samples:
    """Motions with what potentials need to be evaluated on them."""

    def __init__(self, space: PotentialSpace, motion: CoulombMotion) -> None:
        self.space, self.motion = space, motion
        self.value, self.slope = space.spline.matrices(motion.angles, motion.rates)

    def add(self, motion: CoulombMotion) -> None:
        new = Samples(self.space, motion)
        self.motion = self.motion.join(motion)
        self.value = sparse.vstack([self.value, new.value], format="csr")
        self.slope = sparse.vstack([self.slope, new.slope], format="csr")

    def amplitudes(self, free: np.ndarray) -> dict[int, np.ndarray]:
        """Complex amplitudes a_k ``(n,)`` of the gain ``Re sum_k e^{i k theta} a_k``."""
        motion = self.motion
        amplitudes = {1: motion.velocity[0] + 1j * motion.velocity[1]}
        for k, c in self.space.coefficients(free).items():
            rate = self.slope @ c + 1j * k * motion.spin * (self.value @ c)
            amplitudes[k] = amplitudes.get(k, 0) + rate
        return amplitudes

    def ratio(self, free: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Largest (gain over heading) / power ``(n,)``, and the heading where it is taken."""
        gain, heading = largest_gain(self.amplitudes(free))
        return gain / self.motion.power, heading

    def rows(self, chosen: np.ndarray, heading: np.ndarray) -> tuple[sparse.csr_matrix, np.ndarray]:
        """Gain over power of chosen samples at headings: ``matrix @ free + constant``."""
        motion = self.motion.take(chosen)
        (u, v), value, slope = motion.velocity, self.value[chosen], self.slope[chosen]
        constant, blocks = (np.cos(heading) * u - np.sin(heading) * v) / motion.power, []
        for k, basis, _ in self.space.layout:
            wave = np.exp(1j * k * heading) / motion.power
            turned = sparse.diags(1j * k * motion.spin * wave) @ value
            blocks.append(((sparse.diags(wave) @ slope + turned) @ basis).real)
        return sparse.hstack(blocks, format="csr"), constant


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
