"""Samples of a bound: lattices of shapes and rate directions, and climbs between them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from colloc.bounds.coulomb_motion import (
    CoulombMotion,
    admissible,
    all_motions,
    fundamental,
    move_inside,
    one_joint,
    random_directions,
    two_resting,
    unit_directions,
)
from colloc.bounds.potential import PotentialSpace, largest_ratios
from colloc.mechanics.chain import Chain
from colloc.mechanics.friction import Friction
from colloc.mechanics.law import Law
from colloc.system.errors import ProblemError

_DELTA = 1e-6
"""At unit shape speed: half the cost of 1e-9; the best small gait loses 1.5e-5."""
_EDGE = 1e-9
_FRAMES, _STEADY = 4, 2
"""Directions, and their opposites, that a climb tries at a step; and those in which rates stay."""
_FINER = 3  # lattice of shapes for motions of one joint alone: their peaks are hardest to meet
_SPECIAL = 0.5  # share of joints straight or at their limit in every other random shape
_TRIAL_STEPS = 4
_GROW, _SHRINK = 1.25, 0.5
_WINDOW = 0.03
_STEPS = 30


@dataclass(frozen=True)
class Domain:
    """The gaits of a bound: |joint angles| <= joint_limit."""

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
        return self.body.law(self.friction)

    def holds(self, angles: np.ndarray) -> np.ndarray:
        """Mask of shapes within the limits whose links do not cross."""
        inside = (np.abs(angles) <= self.joint_limit + 1e-12).all(axis=0)
        return inside & admissible(self.body, angles, _EDGE)

    def motions(self, angles: np.ndarray, rates: np.ndarray) -> tuple[CoulombMotion, np.ndarray]:
        """All balanced motions, and the column each belongs to; not those in which all feet stick,
        which pay nothing: those beside them say what a potential may gain there."""
        motion, source = all_motions(self.body, self.friction, angles, rates, _DELTA)
        slides = np.flatnonzero(motion.power > self.law.smallest * _DELTA)
        return motion.take(slides), source[slides]

    def lattice(self, shapes: int, directions: int, shift: float = 0.0) -> CoulombMotion:
        """Motions on a lattice of `shapes` + 1 values of every joint angle and about `directions`
        rates; on a finer one of each joint alone, and where two links rest.

        One of each class of mirror images; with directed friction both senses of every rate.
        `shift` in [0, 1) moves the lattice by that part of its spacing. More than two joints have
        random directions.
        """
        n_joint, half = self.body.n_joint, self.law.reversible
        angles, finer = (self._shapes(n * shapes, shift) for n in (1, _FINER))
        rng = np.random.default_rng(round(1e9 * shift))
        if n_joint > 2:
            every = np.repeat(angles, directions, axis=1)
            motion, _ = self.motions(every, random_directions(n_joint, every.shape[1], rng))
        else:
            rates = unit_directions(n_joint, directions, half, shift)
            motion, _ = self.motions(*_pairs(angles, rates))
        motion = motion.join(self.motions(*_pairs(finer, one_joint(n_joint, half)))[0])
        resting, rates = two_resting(self.body, finer, rng)
        motion = motion.join(self.motions(resting, rates)[0])
        return motion if half else motion.join(self.motions(resting, -rates)[0])

    def _shapes(self, steps: int, shift: float) -> np.ndarray:
        """Shapes ``(n_joint, n)`` without mirror images, with those where a joint is at its limit,
        and where on its lines links touch, as the ratio has peaks in corners between these."""
        n_joint, limit = self.body.n_joint, self.joint_limit
        if n_joint > 2:
            rng = np.random.default_rng(round(1e9 * shift) + steps)
            angles = self._random_shapes((steps + 1) ** 3, rng)
            return angles[:, fundamental(self.body, angles)]
        axis = limit * (2.0 * (np.arange(-1, steps + 1) + shift) / steps - 1.0)
        axis = np.unique(np.clip(axis, -limit, limit))
        grid = np.stack(np.meshgrid(*[axis] * n_joint, indexing="ij"))
        held = self.holds(grid.reshape(n_joint, -1)).reshape(grid.shape[1:])
        shapes = [grid[:, held]]
        for joint in range(n_joint):
            ends = [np.delete(grid, end, axis=joint + 1) for end in (-1, 0)]
            holds = [np.delete(held, end, axis=joint) for end in (-1, 0)]
            for a, b in ((0, 1), (1, 0)):
                touches = holds[a] & ~holds[b]
                shapes.append(
                    move_inside(self.body, ends[b][:, touches], ends[a][:, touches], _EDGE)
                )
        angles = np.concatenate(shapes, axis=1)
        return angles[:, fundamental(self.body, angles)]

    def _random_shapes(self, count: int, rng: np.random.Generator) -> np.ndarray:
        """`count` shapes, in every other of which some joints are straight or at their limit; none
        beyond where links cross on the way from the straight body."""
        angles = rng.uniform(-1.0, 1.0, (self.body.n_joint, count))
        special = (rng.random(angles.shape) < _SPECIAL) & (np.arange(count) % 2 == 1)
        angles = self.joint_limit * np.where(special, np.rint(angles), angles)
        return move_inside(self.body, angles, np.zeros_like(angles), _EDGE)

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
        """Climb `value` from every motion of `start` by pattern search in random directions, as
        ridges of stick and slip are creases at any angle to the axes.

        Steps begin at `spacing` [rad] for shapes and `turn` [rad] for directions, and adapt. Climbs
        below `hopeless` after a few steps are given up.
        """
        n_joint, top = len(start.angles), start
        best, size = value(start), np.ones(start.size)
        for step in range(steps):
            if step == _TRIAL_STEPS and (best < hopeless).any() and (best >= hopeless).any():
                going = np.flatnonzero(best >= hopeless)
                top, best, size = top.take(going), best[going], size[going]
            move = self._moves(top, rng) * size[:, None]
            angles = top.angles[:, :, None] + spacing * move[:n_joint]
            angles = np.clip(angles, -self.joint_limit, self.joint_limit).reshape(n_joint, -1)
            rates = top.rates[:, :, None] + turn * move[n_joint:]
            rates = (rates / np.sqrt((rates**2).sum(axis=0))).reshape(n_joint, -1)
            tried = np.flatnonzero(self.holds(angles))
            motion, source = self.motions(angles[:, tried], rates[:, tried])
            height = np.full(angles.shape[1], -np.inf)
            place = np.zeros(angles.shape[1], dtype=int)
            reached = value(motion)
            rising = np.argsort(reached)  # of several motions the best is written last
            height[tried[source[rising]]] = reached[rising]
            place[tried[source[rising]]] = rising
            choice = np.argmax(height.reshape(top.size, -1), axis=1)
            choice += np.arange(top.size) * 2 * _FRAMES
            up = height[choice] > best
            order = np.arange(top.size)
            order[up] = top.size + np.arange(up.sum())
            top = top.join(motion.take(place[choice[up]])).take(order)
            best = np.where(up, height[choice], best)
            size = np.where(up, _GROW * size, _SHRINK * size)
        return top

    @staticmethod
    def _moves(at: CoulombMotion, rng: np.random.Generator) -> np.ndarray:
        """Random unit directions of angles and rates, and opposites, ``(2 n_joint, n, 2
        _FRAMES)``."""
        n_joint, n = at.angles.shape
        move = rng.standard_normal((2 * n_joint, n, _FRAMES))
        # along a crease that holds for the same rates at many shapes, as where one joint turns
        move[n_joint:, :, :_STEADY] = 0.0
        # or as long as some joints are straight, as where two links buckle
        move[:n_joint, :, 0] *= at.angles != 0.0
        # along one that holds as long as some joints rest
        move[n_joint:, :, _STEADY] *= at.rates != 0.0
        along = (move[n_joint:] * at.rates[:, :, None]).sum(axis=0)
        move[n_joint:] -= along * at.rates[:, :, None]
        move /= np.maximum(np.sqrt((move**2).sum(axis=0)), _EDGE)
        return np.concatenate([move, -move], axis=2)


def _pairs(angles: np.ndarray, rates: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    return np.repeat(angles, rates.shape[1], axis=1), np.tile(rates, angles.shape[1])


def near_the_top(
    motion: CoulombMotion, ratio: np.ndarray, level: float, spacing: float, count: int
) -> np.ndarray:
    """Indices of up to `count` of the largest near `level`, one for each cell of shapes and
    directions."""
    near = np.flatnonzero(ratio > level - _WINDOW)
    near = near[np.argsort(-ratio[near])]
    angles, rates = motion.angles[:, near] / spacing, motion.rates[:, near] * 4.0
    cell = np.concatenate([np.rint(angles), np.rint(rates)]).T
    _, first = np.unique(cell, axis=0, return_index=True)
    return near[np.sort(first)][:count]


def climb_from_lattice(
    domain: Domain,
    space: PotentialSpace,
    free: np.ndarray,
    *,
    shapes: int = 60,
    directions: int = 120,
    starts: int = 1000,
    seed: int = 0,
    level: float = np.inf,
) -> tuple[np.ndarray, CoulombMotion]:
    """Ratios of a potential where climbs from the best of a lattice end, near `level` or above, and
    the motions; they know nothing of how the potential was found."""
    rng = np.random.default_rng(seed)

    def ratio(motion: CoulombMotion) -> np.ndarray:
        return largest_ratios(space, free, motion)

    lattice = domain.lattice(shapes, directions, float(rng.uniform(0.1, 0.9)))
    values, spacing = ratio(lattice), 2.0 * domain.joint_limit / shapes
    chosen = near_the_top(lattice, values, min(level, float(values.max())), spacing, starts)
    turn = 0.5 * np.pi / directions
    summit = domain.summits(ratio, lattice.take(chosen), 0.5 * spacing, turn, _STEPS, rng)
    return ratio(summit), summit
