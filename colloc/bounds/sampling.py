"""Where a bound is sampled: lattices of shapes and rate directions, and climbs to the summits
between them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from colloc.bounds.coulomb_motion import (
    CoulombMotion,
    admissible,
    all_motions,
    drawn_in,
    fundamental,
    one_joint,
    random_directions,
    two_resting,
    unit_directions,
)
from colloc.mechanics.chain import Chain
from colloc.mechanics.friction import Friction
from colloc.mechanics.law import Law
from colloc.system.errors import ProblemError

_DELTA = 1e-6
"""Regularisation speed, at unit shape speed: solving costs half of what it does at 1e-9, the best
small gait loses 1.5e-5."""
_EDGE = 1e-9
_FRAMES, _STEADY = 4, 2
"""Directions, and their opposites, that a climb tries at a step; and in how many of them the rates
stay as they are."""
_FINER = 3
"""Motions of one joint alone are sampled so many times as densely in every angle: their peaks are
those hardest to meet."""
_SPECIAL = 0.5
"""Share of joints that are straight or at their limit in every other of the shapes at random."""
_TRIAL_STEPS = 4
_GROW, _SHRINK = 1.25, 0.5


@dataclass(frozen=True)
class Domain:
    """The gaits a bound speaks of.

    Parameters
    ----------
    body : Chain
    friction : Friction
    joint_limit : float
        Largest |joint angle| [rad].
    """

    body: Chain
    friction: Friction
    joint_limit: float

    def __post_init__(self) -> None:
        if self.body.feet and not self.law.associated:
            raise ProblemError(
                f"on feet no upper bound is computed for {self.law.label}: its motions are not "
                f"unique."
            )

    @property
    def law(self) -> Law:
        """That of all that touches the floor."""
        return self.body.law(self.friction)

    def holds(self, angles: np.ndarray) -> np.ndarray:
        """Mask of shapes within the limits whose links do not cross."""
        inside = (np.abs(angles) <= self.joint_limit + 1e-12).all(axis=0)
        return inside & admissible(self.body, angles, _EDGE)

    def solved(self, angles: np.ndarray, rates: np.ndarray) -> tuple[CoulombMotion, np.ndarray]:
        """All balanced motions, and the column of shapes and rates that each is of; but those in
        which all feet hold: they pay nothing, and those beside them say what a potential may gain
        there."""
        motion, source = all_motions(self.body, self.friction, angles, rates, _DELTA)
        slides = np.flatnonzero(motion.power > self.law.smallest * _DELTA)
        return motion.take(slides), source[slides]

    def lattice(self, shapes: int, directions: int, shift: float = 0.0) -> CoulombMotion:
        """Motions on a lattice of `shapes` + 1 values of every joint angle and about `directions`
        rate directions; and of each joint turning alone, and others where two links rest, on a
        finer one.

        One of each class of mirror images; with directed friction the end swap reverses time, so
        both senses of every rate are sampled. `shift` in [0, 1) moves the lattice by that part of
        its spacing (then without its last value). More than two joints have directions at random,
        others at every shape; another shift draws others.
        """
        n_joint, half = self.body.n_joint, self.law.reversible
        angles = self._representatives(shapes, shift)
        rng = np.random.default_rng(round(1e9 * shift))
        if n_joint > 2:
            every = (
                np.repeat(angles, directions, axis=1),
                random_directions(n_joint, directions * angles.shape[1], rng),
            )
        else:
            every = _pairs(angles, unit_directions(n_joint, directions, half, shift))
        finer = self._representatives(_FINER * shapes, shift)
        motion = self.solved(*every)[0].joined(
            self.solved(*_pairs(finer, one_joint(n_joint, half)))[0]
        )
        resting, rates = two_resting(self.body, finer, rng)
        motion = motion.joined(self.solved(resting, rates)[0])
        return motion if half else motion.joined(self.solved(resting, -rates)[0])

    def _shapes(self, steps: int, shift: float) -> np.ndarray:
        """Shapes ``(n_joint, n)`` of a lattice, with those where a joint is at its limit, and where
        on its lines links touch.

        The ratio has peaks in corners between limit and contact, which a potential sees only if
        they are sampled. More than two joints have as many at random as a lattice of three.
        """
        n_joint, limit = self.body.n_joint, self.joint_limit
        if n_joint > 2:
            return self._scattered(
                (steps + 1) ** 3, np.random.default_rng(round(1e9 * shift) + steps)
            )
        axis = np.clip(
            limit * (2.0 * (np.arange(-1, steps + 1) + shift) / steps - 1.0), -limit, limit
        )
        grid = np.stack(np.meshgrid(*[np.unique(axis)] * n_joint, indexing="ij"))
        held = self.holds(grid.reshape(n_joint, -1)).reshape(grid.shape[1:])
        found = [grid[:, held]]
        for joint in range(n_joint):
            one, other = (np.delete(grid, end, axis=joint + 1) for end in (-1, 0))
            of_one, of_other = (np.delete(held, end, axis=joint) for end in (-1, 0))
            for inside, outside, touches in (
                (one, other, of_one & ~of_other),
                (other, one, of_other & ~of_one),
            ):
                found.append(drawn_in(self.body, outside[:, touches], inside[:, touches], _EDGE))
        return np.concatenate(found, axis=1)

    def _scattered(self, count: int, rng: np.random.Generator) -> np.ndarray:
        """`count` shapes at random, in every other of which some joints are straight or at their
        limit; instead of one where links would cross, the last on the way to it from the straight
        body."""
        angles = rng.uniform(-1.0, 1.0, (self.body.n_joint, count))
        special = (rng.random(angles.shape) < _SPECIAL) & (np.arange(count) % 2 == 1)
        angles = self.joint_limit * np.where(special, np.rint(angles), angles)
        return drawn_in(self.body, angles, np.zeros_like(angles), _EDGE)

    def _representatives(self, shapes: int, shift: float) -> np.ndarray:
        """One of each class of mirror images of those."""
        angles = self._shapes(shapes, shift)
        return angles[:, fundamental(self.body, angles)]

    def summits(
        self,
        value: Callable[[CoulombMotion], np.ndarray],
        start: CoulombMotion,
        spacing: float,
        turn: float,
        steps: int,
        rng: np.random.Generator,
        hopeless: float = -np.inf,
    ) -> CoulombMotion:
        """Climb `value` from every motion of `start`, ``(n_joint, n)``, in random directions of
        shape and rates.

        Pattern search: ridges where a link changes between stick and slip are creases, and run at
        any angle to the axes. Steps begin at `spacing` [rad] for shapes and `turn` [rad] for
        directions, and adapt. Climbs that are below `hopeless` after a few steps are given up, and
        not returned.
        """
        n_joint, n = start.angles.shape
        angles, rates = start.angles, start.rates
        best = value(start)
        size = np.ones(n)
        top = start
        for step in range(steps):
            if step == _TRIAL_STEPS and (best < hopeless).any() and (best >= hopeless).any():
                going = np.flatnonzero(best >= hopeless)
                top, best, size, n = top.take(going), best[going], size[going], going.size
                angles, rates = top.angles, top.rates
            move = rng.standard_normal((2 * n_joint, n, _FRAMES))
            # along a crease that holds for the same rates at many shapes, as where one joint turns
            # and the rest sticks;
            move[n_joint:, :, :_STEADY] = 0.0
            # or as long as some joints are straight, as where two links buckle;
            move[:n_joint, :, 0] *= angles != 0.0
            # along one that holds as long as some joints rest
            move[n_joint:, :, _STEADY] *= rates != 0.0
            # a direction of rates means nothing along the rates themselves
            along = (move[n_joint:] * rates[:, :, None]).sum(axis=0)
            move[n_joint:] -= along * rates[:, :, None]
            move /= np.maximum(np.sqrt((move**2).sum(axis=0)), _EDGE)
            move = np.concatenate([move, -move], axis=2) * size[:, None]
            new_angles = np.clip(
                angles[:, :, None] + spacing * move[:n_joint], -self.joint_limit, self.joint_limit
            )
            new_rates = rates[:, :, None] + turn * move[n_joint:]
            new_rates /= np.sqrt((new_rates**2).sum(axis=0))
            flat_angles, flat_rates = (
                new_angles.reshape(n_joint, -1),
                new_rates.reshape(n_joint, -1),
            )
            tried = np.flatnonzero(self.holds(flat_angles))
            motion, source = self.solved(flat_angles[:, tried], flat_rates[:, tried])
            found = np.full(flat_angles.shape[1], -np.inf)
            place = np.zeros(flat_angles.shape[1], dtype=int)
            reached = value(motion)
            rising = np.argsort(reached)  # of several motions the best is written last
            found[tried[source[rising]]] = reached[rising]
            place[tried[source[rising]]] = rising
            choice = np.argmax(found.reshape(n, -1), axis=1) + np.arange(n) * 2 * _FRAMES
            up = found[choice] > best
            both = top.joined(motion.take(place[choice[up]]))
            order = np.arange(n)
            order[up] = n + np.arange(up.sum())
            top = both.take(order)
            angles, rates = top.angles, top.rates
            best = np.where(up, found[choice], best)
            size = np.where(up, _GROW * size, _SHRINK * size)
        return top


def _pairs(angles: np.ndarray, rates: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Every shape with all rates, ``(n_joint, n)`` each."""
    return np.repeat(angles, rates.shape[1], axis=1), np.tile(rates, angles.shape[1])
