"""Balanced motions of a chain at vanishing delta: lattices of shapes and rates, climbs between
them, and what mixtures of them at one shape do.

Velocities are those of the midpoint of the middle link in its axes, or of the middle joint in axes
along the mean heading of its links; turning the body end for end negates them. On feet it is the
centre of pressure, whose speed times min(mu) is at most the power.

Small closed gaits at a shape (docs/bound.md) move ``sum w_i e.v_i`` along e per unit of work ``sum
w_i P_i = 1``, which is of first order, as motions are not linear in the rates.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from colloc.mechanics.balance import instant, total_power
from colloc.mechanics.chain import Chain
from colloc.mechanics.contact import crossing_depth, near_contacts
from colloc.mechanics.fixed_point import solve_balance
from colloc.mechanics.friction import Friction
from colloc.mechanics.law import Law
from colloc.mechanics.solution_branches import all_balanced_velocities
from colloc.numerics.conic import linear_maximum
from colloc.system.errors import ProblemError

_DELTA = 1e-6  # at unit shape speed: the best small gait loses 1.5e-5
_MOST_LINKS = 5  # samples fill all of shape space
_MAX_ITERATIONS = 300  # the few motions that need more are left out
_SINGULAR = 1e-9  # singular value of relative motions along which two links do not move
_BISECTIONS = 30
_EDGE = 1e-9
_FRAMES, _STEADY = 4, 2
"""Directions, and their opposites, that a climb tries at a step; and those in which rates stay."""
_FINER = 3  # lattice of shapes for motions of one joint alone: their peaks are hardest to meet
_SPECIAL = 0.5  # share of joints straight or at their limit in every other random shape
_TRIAL_STEPS = 4
_GROW, _SHRINK = 1.25, 0.5
_WINDOW = 0.03
_STEPS = 30


class CoulombMotion(NamedTuple):
    angles: np.ndarray  # (n_joint, n)
    rates: np.ndarray  # unit directions, (n_joint, n)
    velocity: np.ndarray  # of the middle, or on feet of the centre of pressure, (2, n)
    spin: np.ndarray  # of the middle, (n,)
    power: np.ndarray  # rate of work against friction, (n,)

    @property
    def size(self) -> int:
        return self.spin.size

    def take(self, index: np.ndarray | np.intp) -> CoulombMotion:
        return CoulombMotion(*(each[..., index] for each in self))

    def join(self, *others: CoulombMotion) -> CoulombMotion:
        rows = zip(self, *others, strict=True)
        return CoulombMotion(*(np.concatenate(each, axis=-1) for each in rows))


def all_motions(
    body: Chain,
    friction: Friction,
    angles: np.ndarray,
    rates: np.ndarray,
    delta: float = _DELTA,
    *,
    one_each: bool = False,
) -> tuple[CoulombMotion, np.ndarray]:
    """All balanced motions for shapes and rates ``(n_joint, n)``, or one for each, and the column
    each belongs to; without those that do not converge."""
    at = body, friction, angles, rates, delta
    if one_each or body.law(friction).associated:
        solution = solve_balance(*at, max_iterations=_MAX_ITERATIONS)
        source = np.flatnonzero(solution.converged)
        z = solution.z[:, source]
    else:
        roots = all_balanced_velocities(*at)
        root, source = np.nonzero(roots.sign)
        z = roots.z[root, :, source].T
    angles, rates = angles[:, source], rates[:, source]
    now = instant(body, friction, angles, rates, z, delta)
    link, k, even = now.velocity, body.n_link // 2, 1 - body.n_link % 2
    # for an even number, link k begins at the middle joint, half of its angle ahead of the heading
    ahead, spin = 0.5 * even * angles[k - even], link.w[k] - 0.5 * even * rates[k - even]
    velocity = link.vs[k] + 1j * (link.vn[k] - 0.5 * even * body.lengths[k] * link.w[k])
    if body.feet:
        contact, foot = body.contact, body.contact.velocities(link)
        heading = np.exp(1j * body.tangent_angles(angles))
        direction = (contact.cos + 1j * contact.sin) * heading[contact.links] / heading[k]
        velocity = (contact.weight * (foot.vs + 1j * foot.vn) * direction).sum(axis=0)
    velocity = velocity * np.exp(1j * ahead)
    power = total_power(now.velocity, now.force)[0]
    velocity = np.stack([velocity.real, velocity.imag])
    return CoulombMotion(angles, rates, velocity, spin, power), source


def admissible(body: Chain, angles: np.ndarray, margin: float = 0.0) -> np.ndarray:
    """Mask ``(n,)`` of shapes whose links i, i + 2 do not cross (to within `margin`) and keep their
    width."""
    inside = np.ones(angles.shape[1], dtype=bool)
    for each in near_contacts(body):
        inside &= each.excess(angles)[0] <= margin
    return inside & (crossing_depth(body, angles) <= margin) if body.width else inside


def move_inside(body: Chain, shapes: np.ndarray, towards: np.ndarray) -> np.ndarray:
    """Move shapes ``(n_joint, n)`` towards admissible ones until they are admissible too."""
    inside, beyond = np.zeros(shapes.shape[1]), np.ones(shapes.shape[1])
    inside[admissible(body, shapes, _EDGE)] = 1.0
    for _ in range(_BISECTIONS):
        middle = 0.5 * (inside + beyond)
        keeps = admissible(body, towards + middle * (shapes - towards), _EDGE)
        inside, beyond = np.where(keeps, middle, inside), np.where(keeps, beyond, middle)
    return towards + inside * (shapes - towards)


def fundamental(body: Chain, angles: np.ndarray) -> np.ndarray:
    """Mask ``(n,)`` that keeps one of all shapes that mirror and end swap make equivalent."""
    mask = angles.sum(axis=0) >= -1e-12
    return mask & (angles[0] >= angles[-1] - 1e-12) if body.symmetric else mask


def one_joint(n_joint: int, half: bool) -> np.ndarray:
    """Rates ``(n_joint, count)`` of each joint alone: where the other links stick the ratio of gain
    to power has a peak with a kink, so steep that no lattice of directions sees it."""
    return np.kron([[1.0]] if half else [[1.0, -1.0]], np.eye(n_joint))


def two_resting(
    body: Chain, angles: np.ndarray, rng: np.random.Generator
) -> tuple[np.ndarray, np.ndarray]:
    """Shapes and rates ``(n_joint, count)`` at which two links with others between them may both
    rest.

    Two links between can move if they are parallel (they buckle), three always; the joints outside
    rest or turn at random. The ratio has peaks with kinks there too.
    """
    samples = [(angles[:, :0], angles[:, :0])]
    for i in range(body.n_link):
        for j in range(i + 3, body.n_link):
            # velocity of where link j begins, and its rotation rate, seen from link i, by the rates
            # of the joints between
            turn = np.exp(1j * np.cumsum(angles[i : j - 1], axis=0))
            across = 1j * np.array(body.lengths[i + 1 : j])[:, None] * turn
            begin = np.concatenate([np.cumsum(across[::-1], axis=0)[::-1], 0 * across[:1]])
            rows = np.stack([begin.real, begin.imag, np.ones(begin.shape)]).transpose(2, 0, 1)
            _, size, ways = np.linalg.svd(rows)
            size = np.concatenate([size, np.zeros((len(size), j - i - 3))], axis=1)
            for k in range(2, j - i):
                moves = size[:, k] < _SINGULAR
                count = moves.sum()
                rates = rng.standard_normal((len(angles), count)) * (rng.random(count) < 0.5)
                rates[i:j] = ways[moves, k].T
                samples.append((angles[:, moves], rates / np.linalg.norm(rates, axis=0)))
    shapes, rates = (np.concatenate(each, axis=1) for each in zip(*samples, strict=True))
    return shapes, rates


def random_directions(n_joint: int, count: int, rng: np.random.Generator) -> np.ndarray:
    """Random directions ``(n_joint, count)``; in every other one some joints rest."""
    points = rng.standard_normal((n_joint, count))
    resting = np.where(np.arange(count) % 2, rng.integers(1, n_joint - 1, count), 0)
    points[rng.random((n_joint, count)).argsort(axis=0) < resting] = 0.0
    return points / np.linalg.norm(points, axis=0)


def unit_directions(n_joint: int, count: int, half: bool, shift: float = 0.0) -> np.ndarray:
    """About `count` directions ``(n_joint, count)`` spread over the sphere, or half of it; of two
    joints moved by the part `shift` of their spacing."""
    if n_joint == 1:
        return one_joint(1, half)
    if n_joint == 2:
        turn = (np.arange(count) + shift) * ((np.pi if half else 2 * np.pi) / count)
        return np.stack([np.cos(turn), np.sin(turn)])
    points = np.random.default_rng(n_joint).standard_normal((n_joint, count))
    points /= np.linalg.norm(points, axis=0)
    return np.where(points[-1] < 0, -points, points) if half else points


class SmallGait(NamedTuple):
    efficiency: float  # d/W as its size tends to zero
    heading: float  # direction of travel in the axes of the middle link [rad]
    rates: np.ndarray  # the directions used, (n_joint, m)
    weights: np.ndarray  # time spent in each, for unit work, (m,)

    def path(self, shape: np.ndarray, size: float, *, back: bool = False) -> np.ndarray:
        """Corners ``(n_joint, m)`` of the closed polygon about `shape` through the directions by
        angle."""
        order = np.argsort(np.arctan2(self.rates[-1], self.rates[0]))[:: -1 if back else 1]
        sides = (self.rates * self.weights)[:, order]
        corners = np.cumsum(sides, axis=1)
        corners -= corners.mean(axis=1, keepdims=True)
        return shape[:, None] + size * corners / np.linalg.norm(sides, axis=0).sum()


def gain_along(motion: CoulombMotion, heading: float) -> np.ndarray:
    return np.cos(heading) * motion.velocity[0] + np.sin(heading) * motion.velocity[1]


def best_mixture(motion: CoulombMotion, heading: float) -> tuple[float, np.ndarray, np.ndarray]:
    """Efficiency along `heading`, weights ``(m,)`` for unit work, and multipliers of closure,
    rotation and work."""
    closed = np.vstack([motion.rates, motion.spin, motion.power])
    return linear_maximum(gain_along(motion, heading), closed, np.eye(len(closed))[-1])


def heading_of(motion: CoulombMotion, weights: np.ndarray) -> float:
    """Direction of travel of a mixture [rad]: it is worth more along that than along any other."""
    way = motion.velocity @ weights
    return float(np.arctan2(way[1], way[0]))


@dataclass(frozen=True)
class Domain:
    """The gaits of a bound: |joint angles| <= joint_limit."""

    body: Chain
    friction: Friction
    joint_limit: float

    def __post_init__(self) -> None:
        if not 0 < self.joint_limit <= np.pi + 1e-12:
            raise ProblemError(f"joint_limit must lie in (0, pi], not {self.joint_limit:g}.")
        if self.body.n_link > _MOST_LINKS:
            raise ProblemError(
                f"upper bounds are computed for at most {_MOST_LINKS} links, not "
                f"{self.body.n_link}; there is 1/min(mu)."
            )
        if self.body.feet and not self.law.associated:
            raise ProblemError(
                f"on feet no upper bound is computed for {self.law.label}: its motions are not "
                f"unique; there is 1/min(mu)."
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
        motion, source = all_motions(self.body, self.friction, angles, rates)
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
        every, alone = np.repeat(angles, directions, axis=1), one_joint(n_joint, half)
        if n_joint > 2:
            rates = random_directions(n_joint, every.shape[1], rng)
        else:
            directed = unit_directions(n_joint, directions, half, shift)
            every, rates = _pairs(angles, directed)
        resting, both = two_resting(self.body, finer, rng)
        samples = [(every, rates), _pairs(finer, alone), (resting, both), (resting, -both)]
        first, *others = (self.motions(*each)[0] for each in samples[: 3 if half else 4])
        return first.join(*others)

    def _shapes(self, steps: int, shift: float) -> np.ndarray:
        """Shapes ``(n_joint, n)`` without mirror images, with those where a joint is at its limit,
        and where on its lines links touch, as the ratio has peaks in corners between these.

        Of more than two joints at random, in every other of which some are straight or at their
        limit; none beyond where links cross on the way from the straight body.
        """
        n_joint, limit, body = self.body.n_joint, self.joint_limit, self.body
        if n_joint > 2:
            rng = np.random.default_rng(round(1e9 * shift) + steps)
            angles = rng.uniform(-1.0, 1.0, (n_joint, (steps + 1) ** 3))
            special = (rng.random(angles.shape) < _SPECIAL) & (np.arange(len(angles[0])) % 2 == 1)
            angles = limit * np.where(special, np.rint(angles), angles)
            angles = move_inside(body, angles, np.zeros_like(angles))
            return angles[:, fundamental(body, angles)]
        axis = limit * (2.0 * (np.arange(-1, steps + 1) + shift) / steps - 1.0)
        axis = np.unique(np.clip(axis, -limit, limit))
        grid = np.stack(np.meshgrid(*[axis] * n_joint, indexing="ij"))
        inside = self.holds(grid.reshape(n_joint, -1)).reshape(grid.shape[1:])
        shapes = [grid[:, inside]]
        for joint in range(n_joint):
            ends = [np.delete(grid, end, axis=joint + 1) for end in (-1, 0)]
            holds = [np.delete(inside, end, axis=joint) for end in (-1, 0)]
            for a, b in ((0, 1), (1, 0)):
                touches = holds[a] & ~holds[b]
                shapes.append(move_inside(body, ends[b][:, touches], ends[a][:, touches]))
        angles = np.concatenate(shapes, axis=1)
        return angles[:, fundamental(body, angles)]

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
            move = rng.standard_normal((2 * n_joint, top.size, _FRAMES))
            # along a crease that holds for the same rates at many shapes, as where one joint turns
            move[n_joint:, :, :_STEADY] = 0.0
            # or as long as some joints are straight, as where two links buckle
            move[:n_joint, :, 0] *= top.angles != 0.0
            # along one that holds as long as some joints rest
            move[n_joint:, :, _STEADY] *= top.rates != 0.0
            along = (move[n_joint:] * top.rates[:, :, None]).sum(axis=0)
            move[n_joint:] -= along * top.rates[:, :, None]
            move /= np.maximum(np.linalg.norm(move, axis=0), _EDGE)
            move = np.concatenate([move, -move], axis=2) * size[:, None]
            angles = top.angles[:, :, None] + spacing * move[:n_joint]
            angles = np.clip(angles, -self.joint_limit, self.joint_limit).reshape(n_joint, -1)
            rates = top.rates[:, :, None] + turn * move[n_joint:]
            rates = (rates / np.linalg.norm(rates, axis=0)).reshape(n_joint, -1)
            tried = np.flatnonzero(self.holds(angles))
            motion, source = self.motions(angles[:, tried], rates[:, tried])
            reached = value(motion)
            rising, winner = np.argsort(reached), np.full(top.size, -1)
            # of all motions that a climb tries, the best is written last
            winner[tried[source[rising]] // (2 * _FRAMES)] = rising
            height = np.append(reached, -np.inf)[winner]
            up = height > best
            top = top.join(motion).take(np.where(up, top.size + winner, np.arange(top.size)))
            best, size = np.maximum(height, best), np.where(up, _GROW, _SHRINK) * size
        return top


def _pairs(angles: np.ndarray, rates: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    return np.repeat(angles, rates.shape[1], axis=1), np.tile(rates, angles.shape[1])


def near_the_top(
    motion: CoulombMotion, ratio: np.ndarray, level: float, spacing: float, count: int
) -> np.ndarray:
    """Indices of up to `count` of the largest near `level`, one for each cell of shapes and
    directions."""
    index = np.flatnonzero(ratio > level - _WINDOW)
    index = index[np.argsort(-ratio[index])]
    angles, rates = motion.angles[:, index] / spacing, motion.rates[:, index] * 4.0
    cell = np.concatenate([np.rint(angles), np.rint(rates)]).T
    _, first = np.unique(cell, axis=0, return_index=True)
    return index[np.sort(first)][:count]


def climb_from_lattice(
    domain: Domain,
    ratio: Callable[[CoulombMotion], np.ndarray],
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
    lattice = domain.lattice(shapes, directions, float(rng.uniform(0.1, 0.9)))
    values, spacing = ratio(lattice), 2.0 * domain.joint_limit / shapes
    chosen = near_the_top(lattice, values, min(level, float(values.max())), spacing, starts)
    turn = 0.5 * np.pi / directions
    summit = domain.summits(ratio, lattice.take(chosen), 0.5 * spacing, turn, _STEPS, rng)
    return ratio(summit), summit
