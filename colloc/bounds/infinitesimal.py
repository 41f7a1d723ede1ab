"""The best infinitesimal gait at a shape: a linear program over rate directions.

Dry friction lets a small closed path in shape space move the body in first order: motions are
homogeneous of degree 1 in the rates but not linear. A small gait spends times w_i in rate
directions r_i, with ``sum w_i r_i = 0`` (the path closes) and ``sum w_i omega_i = 0`` (so does the
rotation); per unit of work ``sum w_i P_i = 1`` it moves ``sum w_i e.v_i`` along e.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from colloc.bounds.coulomb_motion import (
    CoulombMotion,
    admissible,
    balanced_motion,
    drawn_in,
    fundamental,
    one_joint,
    random_directions,
    two_resting,
    unit_directions,
)
from colloc.mechanics.chain import Chain
from colloc.mechanics.friction import Friction
from colloc.numerics.linear_program import linear_maximum
from colloc.system.errors import NotConvergedError

_EDGE = 1e-9
_FINE = 1e-3
"""Steps of the search for the best shape at which it ends [rad]: a width of links or a limit binds
somewhere between."""


class SmallGait(NamedTuple):
    """The best small gait at a shape.

    efficiency: d/W as its size tends to zero. heading: direction of travel in the axes of the
    middle link [rad]. rates ``(n_joint, m)``, weights ``(m,)``: the directions used, and the time
    spent in each, for unit work.
    """

    efficiency: float
    heading: float
    rates: np.ndarray
    weights: np.ndarray

    def path(self, shape: np.ndarray, size: float, *, back: bool = False) -> np.ndarray:
        """Corners ``(n_joint, m)`` of the closed polygon about `shape` that runs through the
        directions by angle, or `back`."""
        order = np.argsort(np.arctan2(self.rates[-1], self.rates[0]))[:: -1 if back else 1]
        sides = (self.rates * self.weights)[:, order]
        corners = np.cumsum(sides, axis=1)
        corners = corners - corners.mean(axis=1, keepdims=True)
        return shape[:, None] + size * corners / np.linalg.norm(sides, axis=0).sum()


_DELTA = 1e-6
_CLIMBED, _WAYS = 12, 4
_STEPS = 14
_ROUNDS = 12
_GAIN = 1e-7


def best_mixture(motion: CoulombMotion, heading: float) -> tuple[float, np.ndarray, np.ndarray]:
    """The linear program over motions at one shape: efficiency along `heading`, weights ``(m,)``
    for unit work, and multipliers of closure, rotation and work."""
    along = np.cos(heading) * motion.velocity[0] + np.sin(heading) * motion.velocity[1]
    closed = np.vstack([motion.rates, motion.spin, motion.power])
    right = np.zeros(len(closed))
    right[-1] = 1.0
    return linear_maximum(along, closed, right)


def heading_of(motion: CoulombMotion, weights: np.ndarray) -> float:
    """The way a mixture travels, in the axes of its velocities [rad]. Along it the mixture is worth
    more than along any other, and the best mixture there at least as much."""
    way = motion.velocity @ weights
    return float(np.arctan2(way[1], way[0]))


class _Columns:
    """Motions at one shape that the linear program may use."""

    def __init__(self, body: Chain, friction: Friction, shape: np.ndarray, delta: float) -> None:
        self.body, self.friction, self.shape, self.delta = (
            body,
            friction,
            np.asarray(shape, dtype=float),
            delta,
        )

    def motion(self, rates: np.ndarray) -> CoulombMotion:
        angles = np.repeat(self.shape[:, None], rates.shape[1], axis=1)
        return balanced_motion(self.body, self.friction, angles, rates, self.delta)

    def climbed(
        self, motion: CoulombMotion, heading: float, multipliers: np.ndarray, turn: float
    ) -> np.ndarray:
        """Rate directions whose reduced gain is locally largest: what the program would most like
        to add."""

        def reduced(some: CoulombMotion) -> np.ndarray:
            along = np.cos(heading) * some.velocity[0] + np.sin(heading) * some.velocity[1]
            return (
                along - multipliers @ np.vstack([some.rates, some.spin, some.power])
            ) / some.power

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
            found = reduced(new).reshape(len(tried), -1)
            choice = np.argmax(found, axis=0)
            up = found.max(axis=0) > best
            rates = np.where(up, np.stack(tried)[choice, :, np.arange(start.size)].T, rates)
            best = np.where(up, found.max(axis=0), best)
            size = np.where(up, size, 0.35 * size)
        return rates


def _first_directions(body: Chain, shape: np.ndarray, count: int) -> np.ndarray:
    """About `count` directions in all senses; of more than two joints also as many of which in
    every other one some joints rest, those of each joint alone, and those at which two links
    rest."""
    every = unit_directions(body.n_joint, count, half=False)
    if body.n_joint == 2:
        return every
    rng = np.random.default_rng(count)
    resting = two_resting(body, np.repeat(shape[:, None], 2, axis=1), rng)[1]
    some = random_directions(body.n_joint, count, rng)
    return np.concatenate(
        [every, some, one_joint(body.n_joint, half=False), resting, -resting], axis=1
    )


def small_gait(
    body: Chain,
    friction: Friction,
    shape: np.ndarray,
    directions: int = 180,
    headings: int = 12,
    rounds: int = _ROUNDS,
) -> SmallGait:
    """Best infinitesimal gait at one shape ``(n_joint,)``, any order of the directions being
    equivalent at first order.

    `directions` are spread over all senses of the rates, `headings` over half a turn (a whole one
    where mu_b differs from mu_f). Then columns are generated: the directions with the largest
    reduced gain, found by climbing, join the program, and the heading becomes the direction of
    travel of its optimum, until neither gains. Sharp stick-slip creases are found so, which no
    fixed set of directions does.
    """
    columns = _Columns(body, friction, shape, _DELTA)
    motion = columns.motion(_first_directions(body, columns.shape, directions))
    turn = np.pi if body.law(friction).reversible else 2 * np.pi
    value, heading = max(
        (best_mixture(motion, h)[0], h) for h in np.arange(headings) * (turn / headings)
    )
    for _ in range(rounds):
        new_value, weights, multipliers = best_mixture(motion, heading)
        if new_value > value:
            value = new_value
        way = heading_of(motion, weights)
        more = columns.motion(columns.climbed(motion, heading, multipliers, np.pi / directions))
        motion = motion.joined(more)
        trial = best_mixture(motion, way)[0]
        heading = way if trial >= best_mixture(motion, heading)[0] else heading
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
    """The best small gait found over all admissible shapes, and its shape ``(n_joint,)``.

    A lattice of `steps` + 1 values of every joint angle (by default 11, of three joints 7, of four
    5), then pattern searches from the `refined` best of it (3; of two joints, where a search takes
    a third of a second, 12). Values of two joints on the lattice are rough ones; of more those of a
    few fixed directions say nothing, 0.37 where 0.86 is best.
    """
    steps = steps or {3: 6, 4: 4}.get(body.n_joint, 10)
    refined = refined or (12 if body.n_joint < 3 else 3)
    axis = np.linspace(-joint_limit, joint_limit, steps + 1)
    shapes = np.stack([a.ravel() for a in np.meshgrid(*[axis] * body.n_joint, indexing="ij")])
    shapes = shapes[:, fundamental(body, shapes)]
    shapes = drawn_in(body, shapes, np.zeros_like(shapes), _EDGE)

    def value_at(shape: np.ndarray, directions: int, headings: int, rounds: int) -> float:
        try:
            return small_gait(body, friction, shape, directions, headings, rounds).efficiency
        # no mixture of a few directions closes: with three joints and directed friction it happens
        except NotConvergedError:
            return -np.inf

    def rough(shape: np.ndarray) -> float:
        return value_at(shape, 180, 4, 0 if body.n_joint < 3 else 2)

    values = np.array([value_at(s, 36, 3, 0) if body.n_joint < 3 else rough(s) for s in shapes.T])
    rng, found = np.random.default_rng(steps), []
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
        found += [shapes[:, start], shape]
    # what is rough may lead away from a start that is better, as from the straight body
    return max(
        ((small_gait(body, friction, shape), shape) for shape in found),
        key=lambda item: item[0].efficiency,
    )
