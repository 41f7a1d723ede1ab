"""The best infinitesimal gait at a shape, and over all shapes: what upper bounds are held against.

The linear program of `colloc.bounds.motions` over rate directions, which column generation
adds.
"""

from __future__ import annotations

import numpy as np

from colloc.bounds.motions import (
    CoulombMotion,
    SmallGait,
    admissible,
    all_motions,
    best_mixture,
    fundamental,
    gain_along,
    heading_of,
    move_inside,
    one_joint,
    random_directions,
    two_resting,
    unit_directions,
)
from colloc.mechanics.chain import Chain
from colloc.mechanics.friction import Friction
from colloc.system.errors import NotConvergedError

_EDGE = 1e-9
_FINE = 1e-3  # step [rad] at which the search for the best shape ends
_DRY, _DELTA = 1e-9, 1e-6
"""At unit shape speed: Coulomb friction to 1e-8, and half the time."""
_CLIMBED, _WAYS = 12, 4
_STEPS = 14
_ROUNDS = 12
_GAIN = 1e-7


def balanced_motion(
    body: Chain, friction: Friction, angles: np.ndarray, rates: np.ndarray, delta: float = _DRY
) -> CoulombMotion:
    """One motion for each of shapes and rates ``(n_joint, n)`` that converges."""
    return all_motions(body, friction, angles, rates, delta, one_each=True)[0]


class _Columns:
    """Motions at one shape that the linear program may use."""

    def __init__(self, body: Chain, friction: Friction, shape: np.ndarray) -> None:
        self.body, self.friction, self.shape = body, friction, np.asarray(shape, dtype=float)

    def motion(self, rates: np.ndarray) -> CoulombMotion:
        angles = np.repeat(self.shape[:, None], rates.shape[1], axis=1)
        return balanced_motion(self.body, self.friction, angles, rates, _DELTA)

    def first(self, count: int) -> CoulombMotion:
        """About `count` directions in all senses; for more than two joints also as many with
        resting joints, those of each joint alone, and those at which two links rest."""
        n_joint = self.body.n_joint
        every = unit_directions(n_joint, count, half=False)
        if n_joint == 2:
            return self.motion(every)
        rng = np.random.default_rng(count)
        resting = two_resting(self.body, np.repeat(self.shape[:, None], 2, axis=1), rng)[1]
        some = random_directions(n_joint, count, rng), one_joint(n_joint, half=False)
        return self.motion(np.concatenate([every, *some, resting, -resting], axis=1))

    def climbed(
        self, motion: CoulombMotion, heading: float, multipliers: np.ndarray, turn: float
    ) -> CoulombMotion:
        """Motions whose reduced gain is locally largest: what the program would most like to
        add."""

        def reduced(some: CoulombMotion) -> np.ndarray:
            cost = multipliers @ np.vstack([some.rates, some.spin, some.power])
            return (gain_along(some, heading) - cost) / some.power

        gain = reduced(motion)
        start = np.argsort(-gain)[:_CLIMBED]
        rates, best, size = motion.rates[:, start], gain[start], np.full(start.size, turn)
        rng = np.random.default_rng(len(rates))
        for _ in range(_STEPS):
            tried = []
            # creases run at any angle to the axes; of two joints there is one way, and back
            for k in range(1 if len(rates) == 2 else _WAYS * (len(rates) - 1)):
                way = rng.standard_normal(rates.shape)
                if k % 2:  # some run where joints rest
                    way *= rates != 0.0
                way -= (way * rates).sum(axis=0) * rates
                way /= np.maximum(np.linalg.norm(way, axis=0), _EDGE)
                tried += [np.cos(size) * rates + np.sin(sign * size) * way for sign in (-1, 1)]
            new = self.motion(np.concatenate(tried, axis=1))
            if new.size != len(tried) * start.size:
                break
            reached = reduced(new).reshape(len(tried), -1)
            up = reached.max(axis=0) > best
            chosen = np.stack(tried)[np.argmax(reached, axis=0), :, np.arange(start.size)].T
            rates, best = np.where(up, chosen, rates), np.where(up, reached.max(axis=0), best)
            size = np.where(up, size, 0.35 * size)
        return self.motion(rates)


def small_gait(
    body: Chain,
    friction: Friction,
    shape: np.ndarray,
    directions: int = 180,
    headings: int = 12,
    rounds: int = _ROUNDS,
) -> SmallGait:
    """Best infinitesimal gait at one shape ``(n_joint,)``; any order of the directions is
    equivalent at first order.

    `directions` are spread over all senses of the rates, `headings` over half a turn (a whole one
    where mu_b differs from mu_f). Then columns are generated: the directions with the largest
    reduced gain join the program, and the heading becomes the direction of travel of its optimum,
    until neither gains. So sharp stick-slip creases are found, which no fixed set of directions
    does.
    """
    columns = _Columns(body, friction, shape)
    motion = columns.first(directions)
    turn = np.pi if body.law(friction).reversible else 2 * np.pi
    angles = np.arange(headings) * (turn / headings)
    value, heading = max((best_mixture(motion, h)[0], h) for h in angles)
    for _ in range(rounds):
        new_value, weights, multipliers = best_mixture(motion, heading)
        value = max(value, new_value)
        way = heading_of(motion, weights)
        more = columns.climbed(motion, heading, multipliers, np.pi / directions)
        motion = motion.join(more)
        if best_mixture(motion, way)[0] >= best_mixture(motion, heading)[0]:
            heading = way
        if best_mixture(motion, heading)[0] < value + _GAIN:
            break
    value, weights, _ = best_mixture(motion, heading)
    used = weights > 1e-9 * weights.max()
    return SmallGait(float(value), heading, motion.rates[:, used], weights[used])


def best_small_gait(
    body: Chain,
    friction: Friction,
    joint_limit: float = np.pi,
    steps: int | None = None,
    refined: int | None = None,
) -> tuple[SmallGait, np.ndarray]:
    """The best small gait over all admissible shapes, and its shape ``(n_joint,)``.

    A lattice of `steps` + 1 values of every joint angle (by default 11, of three joints 7, of four
    5), then pattern searches from the `refined` best of it (3; of two joints 12). Values of two
    joints on the lattice are rough; of more, a few fixed directions say nothing (0.37 where 0.86 is
    best).
    """
    steps = steps or {3: 6, 4: 4}.get(body.n_joint, 10)
    refined = refined or (12 if body.n_joint < 3 else 3)
    axis = np.linspace(-joint_limit, joint_limit, steps + 1)
    shapes = np.stack([a.ravel() for a in np.meshgrid(*[axis] * body.n_joint, indexing="ij")])
    shapes = shapes[:, fundamental(body, shapes)]
    shapes = move_inside(body, shapes, np.zeros_like(shapes))

    def value_at(shape: np.ndarray, directions: int, headings: int, rounds: int) -> float:
        try:
            return small_gait(body, friction, shape, directions, headings, rounds).efficiency
        # no mixture of a few directions closes: with three joints and directed friction it happens
        except NotConvergedError:
            return -np.inf

    def rough(shape: np.ndarray) -> float:
        return value_at(shape, 180, 4, 0 if body.n_joint < 3 else 2)

    values = np.array([value_at(s, 36, 3, 0) if body.n_joint < 3 else rough(s) for s in shapes.T])
    rng, candidates = np.random.default_rng(steps), []
    for start in np.argsort(-values)[:refined]:
        shape, value, size = shapes[:, start], rough(shapes[:, start]), joint_limit / steps
        while size > _FINE:
            # ridges run at any angle to the axes: along contacts, and where links lie alike
            turned = np.linalg.qr(rng.standard_normal((body.n_joint, body.n_joint)))[0]
            moves = np.concatenate([np.eye(body.n_joint), -np.eye(body.n_joint), turned, -turned])
            tried = np.clip(shape + size * moves, -joint_limit, joint_limit)
            tried = tried[admissible(body, tried.T, _EDGE)]
            tried = tried[np.abs(tried - shape).max(axis=1) > 1e-9]
            reached = [rough(s) for s in tried]
            if max(reached, default=-np.inf) > value + 1e-6:
                shape, value = tried[int(np.argmax(reached))], max(reached)
            else:
                size *= 0.4
        candidates += [shapes[:, start], shape]
    # rough values may lead away from a start that is better, as from the straight body
    gaits = [(small_gait(body, friction, shape), shape) for shape in candidates]
    return max(gaits, key=lambda pair: pair[0].efficiency)
