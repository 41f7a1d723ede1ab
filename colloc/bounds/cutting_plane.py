"""Exchange of samples for the upper bound: a small program on few samples, checked on many.

Narrow ridges, where a link changes between stick and slip, escape any lattice; so the optimum is
climbed from a fresh lattice every round, and the summits join the samples until none rises above.
"""

from __future__ import annotations

from typing import NamedTuple

import clarabel
import numpy as np
from scipy import sparse

from colloc.bounds.coulomb_motion import CoulombMotion
from colloc.bounds.potential import (
    Measure,
    PotentialSpace,
    Samples,
    largest_ratios,
    with_more_knots,
)
from colloc.bounds.sampling import Domain, climb_from_lattice, near_the_top
from colloc.system.errors import NotConvergedError

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
    cost = np.zeros(n + 1)
    cost[-1] = 1.0
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    settings.max_threads = 1
    settings.tol_gap_abs = settings.tol_gap_rel = settings.tol_feas = _TOLERANCE
    cones = [clarabel.NonnegativeConeT(m)]
    program = sparse.triu(quadratic, format="csc"), cost, left, -constants, cones
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


class Optimum(NamedTuple):
    """The best potential of a space; `converged`: the last climbs stayed within the tolerance, and
    those of a check that knows nothing of the samples within twice of it."""

    space: PotentialSpace
    free: np.ndarray  # coefficients
    floor: float
    top: float  # the largest ratio met anywhere
    summit: CoulombMotion  # its motion
    samples: int  # motions evaluated
    converged: bool
    measure: Measure  # multipliers of the last program


class _Program:
    def __init__(
        self,
        samples: Samples,
        held: list[tuple[np.ndarray, np.ndarray]],
        rng: np.random.Generator,
        smoothing: float,
    ) -> None:
        self.samples, self.rng, self.smoothing = samples, rng, smoothing
        self.rows, self.constants = sparse.csr_matrix((0, samples.space.size)), np.empty(0)
        self.index, self.slack = np.empty(0, dtype=int), np.empty(0, dtype=int)
        self.heading = np.empty(0)
        self._solve(held)

    @classmethod
    def from_samples(cls, samples: Samples, rng: np.random.Generator, smoothing: float) -> _Program:
        """Begin with random samples at headings all round."""
        chosen = np.sort(rng.permutation(samples.motion.size)[: 3 * samples.space.size])
        headings = np.arange(12) * (np.pi / 6)
        held = [(chosen, np.full(chosen.size, heading)) for heading in headings]
        return cls(samples, held, rng, smoothing)

    def with_space(self, space: PotentialSpace) -> _Program:
        """The same inequalities for other potentials."""
        samples = Samples(space, self.samples.motion)
        return _Program(samples, [(self.index, self.heading)], self.rng, self.smoothing)

    def _solve(
        self, added: list[tuple[np.ndarray, np.ndarray]], kept: np.ndarray | slice = slice(None)
    ) -> None:
        """Keep some inequalities, add those of samples at given headings, and solve."""
        new = [self.samples.rows(*each) for each in added]
        self.rows = sparse.vstack([self.rows[kept], *(rows for rows, _ in new)], format="csr")
        self.constants = np.concatenate([self.constants[kept], *(each for _, each in new)])
        self.index = np.concatenate([self.index[kept], *(index for index, _ in added)])
        self.heading = np.concatenate([self.heading[kept], *(heading for _, heading in added)])
        fresh = np.zeros(self.index.size - self.slack[kept].size, dtype=int)
        self.slack = np.concatenate([self.slack[kept], fresh])
        penalty = self.smoothing * self.samples.space.roughness
        self.best = smallest_maximum(self.rows, self.constants, penalty)

    def measure(self) -> Measure:
        weight = self.best.weights / self.best.weights.sum()
        used = weight > _WEIGHTY * weight.max()
        share = weight[used] / weight[used].sum()
        return Measure(self.samples.motion.take(self.index[used]), self.heading[used], share)

    def settle(self, excess: float) -> float:
        """Exchange until no sample exceeds the program's value by more than `excess`; the largest
        ratio."""
        for _ in range(_INNER_ROUNDS):
            ratio, heading = self.samples.ratio(self.best.x)
            if ratio.max() <= self.best.value + excess:
                break
            broken = np.flatnonzero(ratio > self.best.value + 0.5 * _HELD)
            broken = broken[np.argsort(-ratio[broken])[: 4 * _LARGEST_CUT]]
            broken = self.rng.permutation(broken)[:_LARGEST_CUT]
            active = self.rows @ self.best.x + self.constants > self.best.value - _NEAR
            active |= self.best.weights > 1e-6 * self.best.weights.max()
            self.slack = np.where(active, 0, self.slack + 1)
            new = [(broken, heading[broken] + side) for side in _SIDES]
            self._solve(new, self.slack < _PATIENCE)
        return float(self.samples.ratio(self.best.x)[0].max())

    def add(self, motion: CoulombMotion) -> None:
        if motion.size:
            self.samples = self.samples.join(motion)


def exchanged_optimum(
    domain: Domain,
    space: PotentialSpace,
    *,
    intervals: int = 0,
    shapes: int,
    directions: int,
    rounds: int,
    starts: int,
    tolerance: float,
    smoothing: float = 1e-5,
) -> Optimum:
    """The potential whose largest ratio over `domain` is smallest, with knots inserted up to
    `intervals`.

    `shapes` and `directions` are those of the first lattice; `rounds` of climbs from `starts`
    motions, thrice as many in the final check, end when summits exceed the value by less than
    `tolerance`. `smoothing` weighs the roughness, about 0.2: 1e-5 costs 1e-6 of the bound.
    """
    rng = np.random.default_rng(0)
    program = _Program.from_samples(
        Samples(space, domain.lattice(shapes, directions)), rng, smoothing
    )
    spacing, turn = 2.0 * domain.joint_limit / shapes, np.pi / directions
    seen, quiet, surprise = program.samples.motion.size, 0, _UNKNOWN
    for count in range(1, rounds + 1):
        # a potential that the next climbs will refute need not be exact
        held = program.settle(float(np.clip(0.1 * surprise, max(_HELD, 0.2 * tolerance), 0.02)))
        free, level = program.best.x, program.best.value

        def ratio(
            motion: CoulombMotion, space: PotentialSpace = space, free: np.ndarray = free
        ) -> np.ndarray:
            return largest_ratios(space, free, motion)

        last = quiet > 0 or count == rounds
        shift = max((count * _GOLDEN) % 1.0, 0.01)
        fresh = domain.lattice(shapes * (1 + last), directions * (1 + last), shift)
        pooled = fresh.join(program.samples.motion)
        values = np.concatenate([ratio(fresh), program.samples.ratio(free)[0]])
        chosen = near_the_top(pooled, values, level, spacing, starts * (1 + 2 * last))
        steps = 0.5 * spacing, 0.5 * turn, _CLIMB_STEPS
        summit = domain.summits(ratio, pooled.take(chosen), *steps, rng, level - _HOPELESS)
        reached = ratio(summit)
        seen += fresh.size + chosen.size
        top = max(float(reached.max()), float(values.max()))
        # two rounds in a row, the second on a finer lattice, must find nothing
        surprise = top - level
        quiet = quiet + 1 if top <= level + tolerance else 0
        coarse = space.spline.intervals < intervals
        best = summit.take(np.array([int(np.argmax(reached))]))
        program.add(summit.take(np.flatnonzero(reached > level + 0.25 * tolerance)))
        if (quiet == 2 and not coarse) or count == rounds:
            # what a check finds is no more than a sample that was missing
            finer = {"shapes": 3 * shapes, "directions": 2 * directions, "starts": 2 * starts}
            checked, motion = climb_from_lattice(
                domain, space, free, seed=count, level=level, **finer
            )
            if checked.max() > top:
                top, best = float(checked.max()), motion.take(np.array([int(np.argmax(checked))]))
            quiet = quiet if top <= level + 2 * tolerance else 0
            if quiet or count == rounds:
                break
            program.add(motion.take(np.flatnonzero(checked > level + tolerance)))
        if coarse and surprise < max(_RIPE, tolerance):
            space = with_more_knots(space, program.measure(), intervals)
            program, quiet, surprise = program.with_space(space), 0, _UNKNOWN
    assert held <= top
    at, converged, measure = (top, best, seen), quiet == 2, program.measure()
    return Optimum(space, free, program.best.value, *at, converged, measure)
