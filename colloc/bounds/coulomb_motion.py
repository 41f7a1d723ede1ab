"""Balanced motions of a chain at vanishing delta: samples of velocity and power over shapes and
rates.

Velocities are those of the midpoint of the middle link in its axes, or of the middle joint in axes
along the mean heading of its links; turning the body end for end negates them. On feet it is the
centre of pressure, whose speed times min(mu) is at most the power.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from colloc.mechanics.balance import instant, total_power
from colloc.mechanics.chain import Chain
from colloc.mechanics.contact import crossing_bounds, gap
from colloc.mechanics.fixed_point import solve_balance
from colloc.mechanics.friction import Friction
from colloc.mechanics.solution_branches import all_balanced_velocities

DELTA = 1e-9
"""At unit shape speed: Coulomb friction to 1e-8, and within reach of the solver."""
MOST_LINKS = 5
"""Samples fill all of shape space."""
_MAX_ITERATIONS = 300  # the few motions that need more are left out
_SINGULAR = 1e-9  # singular value of relative motions along which two links do not move
_BISECTIONS = 30


class CoulombMotion(NamedTuple):
    angles: np.ndarray  # (n_joint, n)
    rates: np.ndarray  # unit directions, (n_joint, n)
    velocity: np.ndarray  # of the middle, or on feet of the centre of pressure, (2, n)
    spin: np.ndarray  # of the middle, (n,)
    power: np.ndarray  # rate of work against friction, (n,)

    @property
    def size(self) -> int:
        return self.spin.size

    def take(self, chosen: np.ndarray) -> CoulombMotion:
        return CoulombMotion(*(each[..., chosen] for each in self))

    def join(self, other: CoulombMotion) -> CoulombMotion:
        return CoulombMotion(
            *(np.concatenate(pair, axis=-1) for pair in zip(self, other, strict=True))
        )


def balanced_motion(
    body: Chain, friction: Friction, angles: np.ndarray, rates: np.ndarray, delta: float = DELTA
) -> CoulombMotion:
    """One motion for each of shapes and rates ``(n_joint, n)``, without those that do not
    converge."""
    return _one_motion(body, friction, angles, rates, delta)[0]


def _one_motion(
    body: Chain, friction: Friction, angles: np.ndarray, rates: np.ndarray, delta: float
) -> tuple[CoulombMotion, np.ndarray]:
    solution = solve_balance(body, friction, angles, rates, delta, max_iterations=_MAX_ITERATIONS)
    source = np.flatnonzero(solution.converged)
    at = angles[:, source], rates[:, source], solution.z[:, source]
    return _motion(body, friction, *at, delta), source


def all_motions(
    body: Chain, friction: Friction, angles: np.ndarray, rates: np.ndarray, delta: float = DELTA
) -> tuple[CoulombMotion, np.ndarray]:
    """All balanced motions for shapes and rates ``(n_joint, n)``, and the column each belongs
    to."""
    if body.law(friction).associated:
        return _one_motion(body, friction, angles, rates, delta)
    roots = all_balanced_velocities(body, friction, angles, rates, delta)
    root, source = np.nonzero(roots.sign)
    at = angles[:, source], rates[:, source], roots.z[root, :, source].T
    return _motion(body, friction, *at, delta), source


def _motion(
    body: Chain,
    friction: Friction,
    angles: np.ndarray,
    rates: np.ndarray,
    z: np.ndarray,
    delta: float,
) -> CoulombMotion:
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
    return CoulombMotion(angles, rates, np.stack([velocity.real, velocity.imag]), spin, power)


def admissible(body: Chain, angles: np.ndarray, margin: float = 0.0) -> np.ndarray:
    """Mask ``(n,)`` of shapes whose links i, i + 2 do not cross (to within `margin`) and keep their
    width."""
    bounds = crossing_bounds(body, angles)
    if bounds is None:
        return np.ones(angles.shape[1], dtype=bool)
    uncrossed = (bounds <= np.pi + margin).all(axis=0)
    return uncrossed & (gap(body, angles) >= body.width - margin) if body.width else uncrossed


def move_inside(
    body: Chain, shapes: np.ndarray, towards: np.ndarray, margin: float = 0.0
) -> np.ndarray:
    """Move shapes ``(n_joint, n)`` towards admissible ones until they are admissible too."""
    inside, beyond = np.zeros(shapes.shape[1]), np.ones(shapes.shape[1])
    inside[admissible(body, shapes, margin)] = 1.0
    for _ in range(_BISECTIONS):
        middle = 0.5 * (inside + beyond)
        keeps = admissible(body, towards + middle * (shapes - towards), margin)
        inside, beyond = np.where(keeps, middle, inside), np.where(keeps, beyond, middle)
    return towards + inside * (shapes - towards)


def fundamental(body: Chain, angles: np.ndarray) -> np.ndarray:
    """Mask ``(n,)`` that keeps one of all shapes that mirror and end swap make equivalent."""
    mask = angles.sum(axis=0) >= -1e-12
    return mask & (angles[0] >= angles[-1] - 1e-12) if body.symmetric else mask


def one_joint(n_joint: int, half: bool) -> np.ndarray:
    """Rates ``(n_joint, count)`` of each joint alone: where the other links stick the ratio of gain
    to power has a peak with a kink, so steep that no lattice of directions sees it."""
    return np.eye(n_joint) if half else np.concatenate([np.eye(n_joint), -np.eye(n_joint)], axis=1)


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
            _, size, ways = np.linalg.svd(_relative_motion(body, angles, i, j))
            size = np.concatenate([size, np.zeros((len(size), j - i - 3))], axis=1)
            for k in range(2, j - i):
                moves = size[:, k] < _SINGULAR
                count = moves.sum()
                rates = rng.standard_normal((len(angles), count)) * (rng.random(count) < 0.5)
                rates[i:j] = ways[moves, k].T
                samples.append((angles[:, moves], rates / np.linalg.norm(rates, axis=0)))
    shapes, rates = (np.concatenate(each, axis=1) for each in zip(*samples, strict=True))
    return shapes, rates


def _relative_motion(body: Chain, angles: np.ndarray, i: int, j: int) -> np.ndarray:
    """Velocity of where link j begins and its rotation rate, seen from link i, by the rates of the
    joints between, ``(n, 3, j - i)``."""
    heading = np.cumsum(angles[i : j - 1], axis=0)
    across = 1j * np.array(body.lengths[i + 1 : j])[:, None] * np.exp(1j * heading)
    still = np.zeros((1, angles.shape[1]))
    velocity = np.concatenate([np.cumsum(across[::-1], axis=0)[::-1], still])
    return np.stack([velocity.real, velocity.imag, np.ones(velocity.shape)]).transpose(2, 0, 1)


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
        return np.array([[1.0]]) if half else np.array([[1.0, -1.0]])
    if n_joint == 2:
        turn = (np.arange(count) + shift) * ((np.pi if half else 2 * np.pi) / count)
        return np.stack([np.cos(turn), np.sin(turn)])
    points = np.random.default_rng(n_joint).standard_normal((n_joint, count))
    points /= np.linalg.norm(points, axis=0)
    return np.where(points[-1] < 0, -points, points) if half else points
