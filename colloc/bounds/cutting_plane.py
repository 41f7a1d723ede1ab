"""Exchange of samples for the upper bound: a small program on few samples, checked on many, and
climbed between them.

Narrow ridges, where a link changes between stick and slip, escape any lattice; so the optimum of
the samples held so far is climbed from a fresh lattice every round, the summits join the samples,
and the round is repeated until none rises above.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy import sparse

from colloc.bounds.coulomb_motion import CoulombMotion
from colloc.bounds.knots import with_more_knots
from colloc.bounds.measure import Measure
from colloc.bounds.potential import PotentialSpace, Samples, largest_ratios
from colloc.bounds.recheck import near_the_top, summits_met
from colloc.bounds.sampling import Domain
from colloc.numerics.minimax_program import Minimax, smallest_maximum

_LARGEST_CUT = 500
_INNER_ROUNDS = 15
_HELD = 2e-4
_WEIGHTY = 1e-7
"""Share of the largest multiplier that a motion of the measure needs: without those below 1e-5 it
closes too badly to tell what knots are worth."""
_NEAR = 0.005
_PATIENCE = 3
"""An inequality that is more than `_NEAR` below the program's value, so many programs in a row,
goes. Dropped at once it is missed soon after: the exchange then goes in circles, and samples may
exceed the value tenfold while that creeps."""
_RIPE = 5e-3
"""Surprise at which the multipliers say where knots are wanted."""
_UNKNOWN = 0.1
"""Surprise expected of a program that no climbs have tried."""
_SIDES = (0.0, 0.08, -0.08)
"""A motion enters with the heading of its largest gain and these [rad] to the sides of it, as the
best heading will move."""
_HOPELESS = 0.005
_GOLDEN = 0.5 * (np.sqrt(5.0) - 1.0)


class Optimum(NamedTuple):
    """The best potential found.

    free: its coefficients. floor: value of the program, which no potential of the space undercuts
    by more than the smoothing on the samples held. top, summit: the largest ratio met anywhere, and
    its motion. samples: motions evaluated. rounds: used. converged: whether the last climbs stayed
    within the tolerance, and those of a check that knows nothing of the samples
    (`colloc.bounds.recheck`) within twice of it. measure: the multipliers of the last program.
    space: its potentials.
    """

    space: PotentialSpace
    free: np.ndarray
    floor: float
    top: float
    summit: CoulombMotion
    samples: int
    rounds: int
    converged: bool
    measure: Measure


class _Program:
    """The inequalities in use, and their optimum."""

    def __init__(
        self,
        samples: Samples,
        held: list[tuple[np.ndarray, np.ndarray]],
        rng: np.random.Generator,
        smoothing: float,
    ) -> None:
        self.space, self.roughness, self.smoothing = (
            samples.space,
            samples.space.roughness,
            smoothing,
        )
        self.samples = samples
        self.rng = rng
        self.rows, self.constants = sparse.csr_matrix((0, self.space.size)), np.empty(0)
        self.index, self.heading, self.slack = (
            np.empty(0, dtype=int),
            np.empty(0),
            np.empty(0, dtype=int),
        )
        self._hold(held)
        self.best = self._solved()

    @classmethod
    def begun(cls, samples: Samples, rng: np.random.Generator, smoothing: float) -> _Program:
        """With some of the samples, chosen at random, at headings all round."""
        chosen = np.sort(rng.permutation(samples.motion.size)[: 3 * samples.space.size])
        return cls(
            samples,
            [(chosen, np.full(chosen.size, h)) for h in np.arange(12) * (np.pi / 6)],
            rng,
            smoothing,
        )

    def moved_to(self, space: PotentialSpace) -> _Program:
        """With the same inequalities, as other potentials have them."""
        return _Program(
            Samples(space, self.samples.motion),
            [(self.index, self.heading)],
            self.rng,
            self.smoothing,
        )

    def _matters(self) -> np.ndarray:
        """Mask of inequalities that hold the optimum, or nearly."""
        near = self.rows @ self.best.x + self.constants > self.best.value - _NEAR
        return near | (self.best.weights > 1e-6 * self.best.weights.max())

    def _hold(
        self, added: list[tuple[np.ndarray, np.ndarray]], kept: np.ndarray | slice = slice(None)
    ) -> None:
        """The inequalities kept, and those of more samples at given headings."""
        pieces = [
            (self.rows[kept], self.constants[kept]),
            *(self.samples.rows(*each) for each in added),
        ]
        self.rows = sparse.vstack([p[0] for p in pieces], format="csr")
        self.constants = np.concatenate([p[1] for p in pieces])
        self.index = np.concatenate([self.index[kept], *(index for index, _ in added)])
        self.heading = np.concatenate([self.heading[kept], *(heading for _, heading in added)])
        self.slack = np.concatenate(
            [self.slack[kept], *(np.zeros(index.size, dtype=int) for index, _ in added)]
        )

    def measure(self) -> Measure:
        """The multipliers of the inequalities: the optimal mixture of motions."""
        weight = self.best.weights / self.best.weights.sum()
        used = weight > _WEIGHTY * weight.max()
        share = weight[used] / weight[used].sum()
        return Measure(self.samples.motion.take(self.index[used]), self.heading[used], share)

    def _solved(self) -> Minimax:
        return smallest_maximum(self.rows, self.constants, self.smoothing * self.roughness)

    def _exchange(self, ratio: np.ndarray, heading: np.ndarray) -> None:
        """Add inequalities that are violated, drop those that have not mattered for a while."""
        level = self.best.value
        broken = np.flatnonzero(ratio > level + 0.5 * _HELD)
        broken = broken[np.argsort(-ratio[broken])[: 4 * _LARGEST_CUT]]
        broken = self.rng.permutation(broken)[:_LARGEST_CUT]
        self.slack = np.where(self._matters(), 0, self.slack + 1)
        self._hold([(broken, heading[broken] + side) for side in _SIDES], self.slack < _PATIENCE)
        self.best = self._solved()

    def settle(self, excess: float) -> float:
        """Exchange until no sample exceeds the program's value by more than `excess`; the largest
        ratio over the samples."""
        for _ in range(_INNER_ROUNDS):
            ratio, heading = self.samples.ratio(self.best.x)
            if ratio.max() <= self.best.value + excess:
                break
            self._exchange(ratio, heading)
        return float(self.samples.ratio(self.best.x)[0].max())

    def add(self, motion: CoulombMotion) -> None:
        if motion.size:
            self.samples = self.samples.joined(motion)


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
    seed: int = 0,
) -> Optimum:
    """The potential of `space`, or of one with more knots, whose largest ratio over `domain` is
    smallest.

    Parameters
    ----------
    domain : Domain
    space : PotentialSpace
    intervals : int
        Knots are inserted, where the multipliers ask for them (`colloc.bounds.knots`), until there
        are so many intervals.
    shapes, directions : int
        The first lattice.
    rounds : int
        At most so many rounds of climbs.
    starts : int
        Climbs a round; the final check makes three times as many.
    tolerance : float
        Excess of the summits over the program's value at which it counts as converged.
    smoothing : float
        Weight of the roughness of the potential, which is about 0.2: 1e-5 costs 1e-6 of the bound.
        Coarse lattices leave more of the potential unseen between the samples, and need more of it.
    seed : int
    """
    rng = np.random.default_rng(seed)
    program = _Program.begun(Samples(space, domain.lattice(shapes, directions)), rng, smoothing)
    spacing, turn = 2.0 * domain.joint_limit / shapes, np.pi / directions
    seen, quiet, surprise = program.samples.motion.size, 0, _UNKNOWN
    for count in range(1, rounds + 1):
        # a potential that the next climbs will refute need not be exact
        held = program.settle(float(np.clip(0.1 * surprise, max(_HELD, 0.2 * tolerance), 0.02)))
        free = program.best.x

        def ratio(
            motion: CoulombMotion, space: PotentialSpace = space, free: np.ndarray = free
        ) -> np.ndarray:
            return largest_ratios(space, free, motion)

        last = quiet > 0 or count == rounds
        fresh = domain.lattice(
            shapes * (1 + last), directions * (1 + last), max((count * _GOLDEN) % 1.0, 0.01)
        )
        pooled = fresh.joined(program.samples.motion)
        values = np.concatenate([ratio(fresh), program.samples.ratio(free)[0]])
        chosen = near_the_top(pooled, values, program.best.value, spacing, starts * (1 + 2 * last))
        summit = domain.summits(
            ratio,
            pooled.take(chosen),
            0.5 * spacing,
            0.5 * turn,
            14,
            rng,
            program.best.value - _HOPELESS,
        )
        reached = ratio(summit)
        seen += fresh.size + chosen.size
        top = max(float(reached.max()), float(values.max()))
        # two rounds in a row, the second on a finer lattice, must find nothing
        surprise = top - program.best.value
        quiet = quiet + 1 if top <= program.best.value + tolerance else 0
        coarse = space.spline.intervals < intervals
        best = summit.take(np.array([int(np.argmax(reached))]))
        program.add(summit.take(np.flatnonzero(reached > program.best.value + 0.25 * tolerance)))
        if (quiet == 2 and not coarse) or count == rounds:
            # what a check finds is no more than a sample that was missing
            level, check = (
                program.best.value,
                {"shapes": 3 * shapes, "directions": 2 * directions, "starts": 2 * starts},
            )
            checked, motion = summits_met(
                domain, space, free, seed=seed + count, level=level, **check
            )
            if checked.max() > top:
                top, best = float(checked.max()), motion.take(np.array([int(np.argmax(checked))]))
            quiet = quiet if top <= level + 2 * tolerance else 0
            if quiet or count == rounds:
                break
            program.add(motion.take(np.flatnonzero(checked > level + tolerance)))
        if coarse and surprise < max(_RIPE, tolerance):
            space, quiet, surprise = (
                with_more_knots(space, program.measure(), intervals),
                0,
                _UNKNOWN,
            )
            program = program.moved_to(space)
    assert held <= top
    return Optimum(
        space, free, program.best.value, top, best, seen, count, quiet == 2, program.measure()
    )
