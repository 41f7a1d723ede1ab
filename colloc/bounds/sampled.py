r"""An upper bound on the efficiency of every gait of a body: for any *potential* ``phi(q, theta)``
of the joint angles and the heading of the middle link (docs/bound.md),

    efficiency <= max over q, theta, r of ( Re(e^{i theta} v) + d phi/dt ) / P,

with ``phi = Re sum_k e^{i k theta} c_k(q)``, c_k tensor-product cubic B-splines with the parities
of the symmetries.

A convex program chooses the potential whose largest (gain / power) is smallest, on few samples.
Narrow ridges, where a link changes between stick and slip, escape any lattice; so the optimum is
climbed from a fresh lattice every round, and the summits join the samples until none rises above.
"""

from __future__ import annotations

import os
import time
import warnings
from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from functools import cached_property, partial, reduce
from itertools import combinations
from pathlib import Path
from typing import NamedTuple

import clarabel
import numpy as np
from scipy import sparse
from scipy.interpolate import BSpline
from scipy.linalg import qr
from scipy.sparse.linalg import spsolve

from colloc.bounds.motions import CoulombMotion, Domain, climb_from_lattice, near_the_top
from colloc.gaits.gait_fields import fields, statement_hash
from colloc.mechanics.chain import Chain
from colloc.mechanics.friction import Friction
from colloc.system.errors import NotConvergedError, ProblemError, ReadOnlyRunWarning, StoreError
from colloc.system.row_file import CACHE, put_rows, read_rows

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

    def matrices(self, angles: np.ndarray, rates: np.ndarray) -> tuple[sparse.csr_matrix, ...]:
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
        both = (sparse.csr_matrix((each.ravel(), *places), shape) for each in (value, change))
        return tuple(both)

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
        """`Samples.ratio` of each motion, of so many at once as memory holds."""
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

    def rows(self, index: np.ndarray, heading: np.ndarray) -> tuple[sparse.csr_matrix, np.ndarray]:
        """Gain over power of chosen samples at headings: ``matrix @ free + constant``."""
        motion = self.motion.take(index)
        (u, v), value, slope = motion.velocity, self.value[index], self.slope[index]
        constant, blocks = (np.cos(heading) * u - np.sin(heading) * v) / motion.power, []
        for k, basis, _ in self.space.layout:
            wave = np.exp(1j * k * heading) / motion.power
            turns = sparse.diags(1j * k * motion.spin * wave) @ value
            blocks.append(((sparse.diags(wave) @ slope + turns) @ basis).real)
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

    def terms(theta):
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


VERSION = 6
"""Part of the cache key: raise it when the computation changes its result."""
_LARGEST_CUT = 500
_INNER_ROUNDS = 15
_HELD = 2e-4
_WEIGHTY = 1e-7
"""Share of the largest multiplier that a motion of the measure needs: without those below 1e-5 it
closes too badly to tell what knots are worth."""
_NEAR = 0.005
_PATIENCE = 3
"""Programs in a row after which an inequality more than `_NEAR` below the value goes. Dropped at
once it is missed soon after, and the exchange goes in circles."""
_RIPE = 5e-3  # surprise at which the multipliers say where knots are wanted
_UNKNOWN = 0.1  # surprise expected of a program that no climbs have tried
_SIDES = (0.0, 0.08, -0.08)
"""A motion enters with the heading of its largest gain and these [rad] beside it."""
_HOPELESS = 0.005
_CLIMB_STEPS = 14
_GOLDEN = 0.5 * (np.sqrt(5.0) - 1.0)
_TOLERANCE, _TINY = 1e-7, 1e-10  # of the interior-point solver, and of its penalty


@dataclass(frozen=True)
class Budget:
    intervals: int = 12  # knot intervals of the splines in every joint angle, at most
    harmonics: tuple[int, ...] | None = None  # in the heading; by default those that help
    shapes: int = 20  # steps of every joint angle, and rate directions, of the first lattice
    directions: int = 48
    rounds: int = 60  # of climbs, at most
    starts: int = 250  # climbs a round, thrice as many in the final check
    tolerance: float = 5e-4  # excess of the summits over the program's value that counts as none
    first: int = 6  # even intervals to begin with; more knots go where they are worth most
    smoothing: float = 1e-5
    """Weight of the roughness of the potential, which is about 0.2: costs 1e-6 of the bound."""
    together: int | None = None  # potentials are sums of functions of so many joint angles


QUICK = Budget()
FOUR_LINKS = Budget(
    5, None, 6, 40, 80, starts=400, tolerance=1e-3, first=5, smoothing=1e-4, together=2
)
"""Functions of two joint angles at a time: 81 unknowns do better than 108 products of three."""
FIVE_LINKS = replace(FOUR_LINKS, intervals=3, first=3, tolerance=3e-3)


@dataclass(frozen=True)
class Bound:
    sampled: float  # largest ratio on any sample, or 1/min(mu) if less
    floor: float
    """Value of the last program: no potential of the space does better on the samples held."""
    converged: bool
    """Last climbs within the budget's tolerance of `floor`, those of a check that knows nothing of
    the samples within twice of it."""
    guaranteed: float | None  # certified between samples too (`research/guarantee`)
    missing: str  # what keeps the sampled value from being a theorem
    angles: tuple[float, ...]  # shape and rates where the sampled value is taken
    rates: tuple[float, ...]
    joint_limit: float
    intervals: int
    harmonics: tuple[int, ...]
    coefficients: tuple[float, ...]  # free ones of the potential
    samples: int
    seconds: float  # processor time
    graded: tuple[float, ...] = ()  # inner knots, if they are not evenly spaced
    together: int | None = None

    def report(self, efficiency: float) -> str:
        """Efficiency, bound, gap, and what is proved, in one line."""
        proved = self.missing if self.guaranteed is None else f"guaranteed {self.guaranteed:.4f}"
        return (
            f"efficiency {efficiency:.4f}, upper bound {self.sampled:.4f}, gap "
            f"{self.sampled - efficiency:.4f} ({proved})"
        )


class Minimax(NamedTuple):
    """Unknowns x ``(n,)``, the largest function there, and multipliers ``(m,)`` of sum 1."""

    x: np.ndarray
    value: float
    weights: np.ndarray


def smallest_maximum(
    rows: sparse.csr_matrix, constants: np.ndarray, penalty: sparse.spmatrix
) -> Minimax:
    """Minimise ``max_i (rows x + constants)_i + x.penalty.x / 2`` by Clarabel; the penalty picks
    the smoothest of nearly equal optima, as the exchange wanders between vertices."""
    m, n = rows.shape
    left = sparse.hstack([rows, -np.ones((m, 1))], format="csc")
    quadratic = sparse.block_diag([penalty + _TINY * sparse.eye(n), sparse.csc_matrix((1, 1))])
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    settings.max_threads = 1
    settings.tol_gap_abs = settings.tol_gap_rel = settings.tol_feas = _TOLERANCE
    cones = [clarabel.NonnegativeConeT(m)]
    program = sparse.triu(quadratic, format="csc"), np.eye(n + 1)[-1], left, -constants, cones
    # refining every linear solve takes a quarter of the time, and is hardly ever needed
    for refine in (False, True):
        settings.iterative_refinement_enable = refine
        answer = clarabel.DefaultSolver(*program, settings).solve()
        if str(answer.status) in ("Solved", "AlmostSolved"):
            x = np.array(answer.x)[:-1]
            return Minimax(x, float((rows @ x + constants).max()), np.array(answer.z))
    raise NotConvergedError(
        f"the program of the bound failed: the interior-point solver reports {answer.status}."
    )


class _Program:
    """Inequalities of samples at headings that are held, for how many programs in a row each was
    slack, and the optimum."""

    def __init__(
        self,
        samples: Samples,
        index: np.ndarray,
        heading: np.ndarray,
        rng: np.random.Generator,
        smoothing: float,
    ) -> None:
        self.samples, self.index, self.heading, self.rng = samples, index, heading, rng
        self.slack, self.penalty = np.zeros_like(index), smoothing * samples.space.roughness
        self.rows, self.constants = samples.rows(index, heading)
        self.best = smallest_maximum(self.rows, self.constants, self.penalty)

    def settle(self, excess: float) -> None:
        for _ in range(_INNER_ROUNDS):
            ratio, heading = self.samples.ratio(self.best.x)
            if ratio.max() <= self.best.value + excess:
                break
            broken = np.flatnonzero(ratio > self.best.value + 0.5 * _HELD)
            broken = broken[np.argsort(-ratio[broken])[: 4 * _LARGEST_CUT]]
            broken = self.rng.permutation(broken)[:_LARGEST_CUT]
            active = self.rows @ self.best.x + self.constants > self.best.value - _NEAR
            active |= self.best.weights > 1e-6 * self.best.weights.max()
            slack = np.where(active, 0, self.slack + 1)
            keep = slack < _PATIENCE
            index = np.tile(broken, len(_SIDES))
            heading = np.concatenate([heading[broken] + side for side in _SIDES])
            rows, constants = self.samples.rows(index, heading)
            self.rows = sparse.vstack([self.rows[keep], rows], format="csr")
            self.constants = np.append(self.constants[keep], constants)
            self.index = np.append(self.index[keep], index)
            self.heading = np.append(self.heading[keep], heading)
            self.slack = np.append(slack[keep], np.zeros_like(index))
            self.best = smallest_maximum(self.rows, self.constants, self.penalty)

    def measure(self) -> Measure:
        weight = self.best.weights / self.best.weights.sum()
        used = weight > _WEIGHTY * weight.max()
        share = weight[used] / weight[used].sum()
        return Measure(self.samples.motion.take(self.index[used]), self.heading[used], share)


def compute_bound(domain: Domain, budget: Budget) -> tuple[Bound, Measure]:
    """The bound of the potential whose largest ratio is smallest, and the multipliers of the last
    program; more knots are inserted as they are worth it."""
    begin, body, law = time.process_time(), domain.body, domain.law
    usual = ((1, 3) if body.n_joint <= 2 else (1,)) if law.reversible else (0, 1)
    harmonics, tolerance = budget.harmonics or usual, budget.tolerance
    shapes, directions, starts = budget.shapes, budget.directions, budget.starts
    even = min(budget.first, budget.intervals)
    spline = TensorSpline(body.n_joint, domain.joint_limit, even)
    space = PotentialSpace(spline, harmonics, body.symmetric, budget.together)
    rng = np.random.default_rng(0)
    samples = Samples(space, domain.lattice(shapes, directions))
    # random samples at headings all round
    chosen = np.sort(rng.permutation(samples.motion.size)[: 3 * space.size])
    headings = np.repeat(np.arange(12) * (np.pi / 6), chosen.size)
    program = _Program(samples, np.tile(chosen, 12), headings, rng, budget.smoothing)
    spacing, turn = 2.0 * domain.joint_limit / shapes, np.pi / directions
    n_sample, quiet, surprise = samples.motion.size, 0, _UNKNOWN
    for count in range(1, budget.rounds + 1):
        # a potential that the next climbs will refute need not be exact
        program.settle(float(np.clip(0.1 * surprise, max(_HELD, 0.2 * tolerance), 0.02)))
        free, level = program.best.x, program.best.value
        ratio: Callable[[CoulombMotion], np.ndarray] = partial(space.largest_ratios, free)
        is_end = count == budget.rounds
        last = quiet > 0 or is_end
        shift = max((count * _GOLDEN) % 1.0, 0.01)
        fresh = domain.lattice(shapes * (1 + last), directions * (1 + last), shift)
        pooled = fresh.join(program.samples.motion)
        values = np.concatenate([ratio(fresh), program.samples.ratio(free)[0]])
        chosen = near_the_top(pooled, values, level, spacing, starts * (1 + 2 * last))
        steps = 0.5 * spacing, 0.5 * turn, _CLIMB_STEPS
        summit = domain.summits(ratio, pooled.take(chosen), *steps, rng, level - _HOPELESS)
        reached = ratio(summit)
        n_sample += fresh.size + chosen.size
        top, best = float(max(reached.max(), values.max())), summit.take(reached.argmax())
        # two rounds in a row, the second on a finer lattice, must find nothing
        surprise = top - level
        quiet = quiet + 1 if top <= level + tolerance else 0
        coarse = space.spline.intervals < budget.intervals
        if (more := reached > level + 0.25 * tolerance).any():
            program.samples.add(summit.take(more))
        if (quiet == 2 and not coarse) or is_end:
            # what a check finds is no more than a sample that was missing
            finer = {"shapes": 3 * shapes, "directions": 2 * directions, "starts": 2 * starts}
            checked, motion = climb_from_lattice(domain, ratio, seed=count, level=level, **finer)
            if checked.max() > top:
                top, best = float(checked.max()), motion.take(checked.argmax())
            quiet = quiet if top <= level + 2 * tolerance else 0
            if quiet or is_end:
                break
            if (more := checked > level + tolerance).any():
                program.samples.add(motion.take(more))
        if coarse and surprise < max(_RIPE, tolerance):
            space = space.with_more_knots(program.measure(), budget.intervals)
            start = Samples(space, program.samples.motion), program.index, program.heading
            program, quiet, surprise = _Program(*start, rng, budget.smoothing), 0, _UNKNOWN
    proof = (
        "not certified between them"
        if law.associated
        else "for this law the balance has no convex potential, so neither uniqueness of the "
        "motion nor a margin between samples is known"
    )
    bound = Bound(
        sampled=min(top, 1.0 / law.smallest),
        floor=program.best.value,
        converged=quiet == 2,
        guaranteed=None,
        missing=f"sampled at {n_sample} motions: {proof}",
        angles=tuple(best.angles.tolist()),
        rates=tuple(best.rates.tolist()),
        joint_limit=domain.joint_limit,
        intervals=space.spline.intervals,
        harmonics=harmonics,
        coefficients=tuple(free.tolist()),
        samples=n_sample,
        seconds=time.process_time() - begin,
        graded=space.spline.graded,
        together=budget.together,
    )
    return bound, program.measure()


def usual_budget(domain: Domain) -> Budget:
    return {3: FOUR_LINKS, 4: FIVE_LINKS}.get(domain.body.n_joint, QUICK)


def bound_key(domain: Domain, budget: Budget) -> str:
    """SHA-256 of what a bound depends on."""
    parts = {
        "body": fields(domain.body),
        "friction": fields(domain.friction),
        "joint_limit": domain.joint_limit,
    }
    return statement_hash({"version": VERSION, "domain": parts, "budget": asdict(budget)})


def known_bound(domain: Domain, budget: Budget, cache: Path) -> Bound | None:
    """The bound of an earlier run in the cache, or None."""
    if (entry := read_rows(cache, CACHE).get(bound_key(domain, budget))) is None:
        return None
    try:
        stored = {k: tuple(v) if isinstance(v, list) else v for k, v in entry.items()}
        return Bound(**stored)  # type: ignore[arg-type]
    except (TypeError, AttributeError):
        raise StoreError(f"{cache} holds something else than bounds; move it away.") from None


def efficiency_bound(
    body: Chain,
    friction: Friction,
    joint_limit: float = float(np.pi),
    *,
    budget: Budget | None = None,
    cache: str | os.PathLike[str] | None = None,
) -> Bound:
    """An upper bound on d/W over all gaits with |joint angles| <= joint_limit whose links do not
    cross, for delta -> 0; kept in an SQLite file `cache`, which if it cannot be written costs a
    warning."""
    domain = Domain(body, friction, float(joint_limit))
    budget = budget or usual_budget(domain)
    if cache is not None and (bound := known_bound(domain, budget, Path(cache))) is not None:
        return bound
    if domain.law.reversible and any(k % 2 == 0 for k in budget.harmonics or ()):
        raise ProblemError(
            "even harmonics do nothing where mu_b = mu_f (reversal in time): name odd ones only."
        )
    bound, _ = compute_bound(domain, budget)
    if cache is not None:
        try:
            put_rows(Path(cache), CACHE, {bound_key(domain, budget): asdict(bound)})
        except StoreError as error:
            warnings.warn(f"{error} The bound is not kept.", ReadOnlyRunWarning, stacklevel=2)
    return bound
