"""How a balanced body moves and what it pays, sampled: the velocity map at vanishing delta.

Everything that a bound on efficiency needs to know of friction is here: for a shape and joint
rates, the velocity of the *middle* of the body and the power. That is the midpoint of the middle
link, in its own axes; for an even number of links it is the middle joint, in axes along the mean
heading of the two links that meet there. The middle is used, not the tail, because the symmetries
of the body are then plain: turning the body end for end negates that velocity.

On feet it is the centre of pressure, in those axes. Its speed times min(mu) is at most the power,
while near shapes where all feet may hold and joints turn that vanishes, and no spline follows such
a point closely enough.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from colloc.mechanics.balance import instant, total_power
from colloc.mechanics.chain import Chain
from colloc.mechanics.contact import crossing_bounds, gap
from colloc.mechanics.fixed_point import solve_balance
from colloc.mechanics.friction import Friction
from colloc.mechanics.links import LinkVelocity
from colloc.mechanics.solution_branches import all_balanced_velocities

DELTA = 1e-9
"""Regularisation speed at unit shape speed: small enough for Coulomb friction to 1e-8, large enough
for the solver."""
MOST_LINKS = 5
"""Samples fill all of shape space, which has a dimension a joint."""
_MAX_ITERATIONS = 300
"""Steps of an attempt: the few motions that need more are left out, as the samples are many."""
_CLOSED = 1e-9
"""Singular value of the relative motion of two links along which they do not move."""
_BISECTIONS = 30
"""Of the way from an admissible shape to where links touch."""


@dataclass(frozen=True, eq=False)
class CoulombMotion:
    """Balanced motions, one a column.

    Attributes
    ----------
    angles, rates : (n_joint, n)
        Shapes and unit directions of joint rates.
    velocity : (2, n)
        Velocity of the middle, or on feet of the centre of pressure, in the axes of the middle.
    spin : (n,)
        Its rotation rate.
    power : (n,)
        Rate of work against friction.
    """

    angles: np.ndarray
    rates: np.ndarray
    velocity: np.ndarray
    spin: np.ndarray
    power: np.ndarray

    @property
    def size(self) -> int:
        return self.spin.size

    def take(self, chosen: np.ndarray) -> CoulombMotion:
        """The motions of the chosen columns."""
        return CoulombMotion(
            self.angles[:, chosen],
            self.rates[:, chosen],
            self.velocity[:, chosen],
            self.spin[chosen],
            self.power[chosen],
        )

    def joined(self, other: CoulombMotion) -> CoulombMotion:
        """These motions followed by others."""
        return CoulombMotion(
            *(np.concatenate([getattr(self, k), getattr(other, k)], axis=-1) for k in _FIELDS)
        )

    def reversed(self) -> CoulombMotion:
        """The motions for the opposite rates; these are balanced only if mu_b = mu_f."""
        return CoulombMotion(self.angles, -self.rates, -self.velocity, -self.spin, self.power)


_FIELDS = ("angles", "rates", "velocity", "spin", "power")


def balanced_motion(
    body: Chain, friction: Friction, angles: np.ndarray, rates: np.ndarray, delta: float = DELTA
) -> CoulombMotion:
    """One motion for each of some shapes and joint rates ``(n_joint, n)``; those that do not
    converge are left out."""
    return _one_motion(body, friction, angles, rates, delta)[0]


def _one_motion(
    body: Chain, friction: Friction, angles: np.ndarray, rates: np.ndarray, delta: float
) -> tuple[CoulombMotion, np.ndarray]:
    solution = solve_balance(body, friction, angles, rates, delta, max_iterations=_MAX_ITERATIONS)
    kept = np.flatnonzero(solution.converged)
    return _motion(
        body, friction, angles[:, kept], rates[:, kept], solution.z[:, kept], delta
    ), kept


def all_motions(
    body: Chain, friction: Friction, angles: np.ndarray, rates: np.ndarray, delta: float = DELTA
) -> tuple[CoulombMotion, np.ndarray]:
    """All balanced motions for shapes and joint rates ``(n_joint, n)``, and of which of these each
    is, ``(n_motion,)``."""
    if body.law(friction).associated:
        return _one_motion(body, friction, angles, rates, delta)
    found = all_balanced_velocities(body, friction, angles, rates, delta)
    root, source = np.nonzero(found.sign)
    return _motion(
        body, friction, angles[:, source], rates[:, source], found.z[root, :, source].T, delta
    ), source


def _motion(
    body: Chain,
    friction: Friction,
    angles: np.ndarray,
    rates: np.ndarray,
    z: np.ndarray,
    delta: float,
) -> CoulombMotion:
    now = instant(body, friction, angles, rates, z, delta)
    velocity, spin = _of_the_middle(body, angles, rates, now.velocity)
    return CoulombMotion(angles, rates, velocity, spin, total_power(now.velocity, now.force)[0])


def _of_the_middle(
    body: Chain, angles: np.ndarray, rates: np.ndarray, link: LinkVelocity
) -> tuple[np.ndarray, np.ndarray]:
    """Velocity ``(2, n)`` and rotation rate ``(n,)`` of the middle (see above)."""
    k, even = body.n_link // 2, 1 - body.n_link % 2
    # link k begins at the joint of an even number, and is half of its angle ahead of the mean
    # heading
    ahead, spin = 0.5 * even * angles[k - even], link.w[k] - 0.5 * even * rates[k - even]
    velocity = link.vs[k] + 1j * (link.vn[k] - 0.5 * even * body.lengths[k] * link.w[k])
    if body.feet:
        contact, foot, heading = (
            body.contact,
            body.contact.velocities(link),
            np.exp(1j * body.tangent_angles(angles)),
        )
        direction = (contact.cos + 1j * contact.sin) * heading[contact.links] / heading[k]
        velocity = (contact.weight * (foot.vs + 1j * foot.vn) * direction).sum(axis=0)
    velocity = velocity * np.exp(1j * ahead)
    return np.stack([velocity.real, velocity.imag]), spin


def admissible(body: Chain, angles: np.ndarray, margin: float = 0.0) -> np.ndarray:
    """Shapes where links i and i + 2 do not cross (to within an angle `margin`), and all keep their
    width, a mask ``(n,)``."""
    bounds = crossing_bounds(body, angles)
    if bounds is None:
        return np.ones(angles.shape[1], dtype=bool)
    uncrossed = (bounds <= np.pi + margin).all(axis=0)
    return uncrossed & (gap(body, angles) >= body.width - margin) if body.width else uncrossed


def drawn_in(
    body: Chain, shapes: np.ndarray, towards: np.ndarray, margin: float = 0.0
) -> np.ndarray:
    """Shapes ``(n_joint, n)``, those that are not admissible moved towards ones that are, until
    they are."""
    inside, beyond = np.zeros(shapes.shape[1]), np.ones(shapes.shape[1])
    inside[admissible(body, shapes, margin)] = 1.0
    for _ in range(_BISECTIONS):
        middle = 0.5 * (inside + beyond)
        keeps = admissible(body, towards + middle * (shapes - towards), margin)
        inside, beyond = np.where(keeps, middle, inside), np.where(keeps, beyond, middle)
    return towards + inside * (shapes - towards)


def fundamental(body: Chain, angles: np.ndarray) -> np.ndarray:
    """One of the shapes that mirror and end swap make equivalent, a mask ``(n,)`` that keeps at
    least one of each."""
    kept = angles.sum(axis=0) >= -1e-12
    if swaps_ends(body):
        kept &= angles[0] >= angles[-1] - 1e-12
    return kept


def swaps_ends(body: Chain) -> bool:
    """Whether turning the body end for end maps it onto itself."""
    return body.symmetric


def one_joint(n_joint: int, half: bool) -> np.ndarray:
    """Rates of each joint turning alone, forwards, and unless `half` backwards, ``(n_joint,
    count)``.

    The other links may stick then, and the ratio of gain to power has a peak with a kink there,
    which falls so steeply (by 3 a radian and more) that no lattice of directions sees it.
    """
    return np.eye(n_joint) if half else np.concatenate([np.eye(n_joint), -np.eye(n_joint)], axis=1)


def two_resting(
    body: Chain, angles: np.ndarray, rng: np.random.Generator
) -> tuple[np.ndarray, np.ndarray]:
    """Shapes and rates ``(n_joint, count)`` at which two links with others between them may rest
    both, at those of some shapes where the links between can move.

    Two links between can if they are parallel: they buckle. Three always can. The joints outside of
    the two rest, or turn at random. The ratio has peaks with kinks there, as where one joint turns
    alone; four straight links are best so.
    """
    found = [(angles[:, :0], angles[:, :0])]
    for i in range(body.n_link):
        for j in range(i + 3, body.n_link):
            _, size, ways = np.linalg.svd(_relative_motion(body, angles, i, j))
            size = np.concatenate([size, np.zeros((len(size), j - i - 3))], axis=1)
            for k in range(2, j - i):
                moves = size[:, k] < _CLOSED
                rates = rng.standard_normal((len(angles), moves.sum())) * (
                    rng.random(moves.sum()) < 0.5
                )
                rates[i:j] = ways[moves, k].T
                found.append((angles[:, moves], rates / np.linalg.norm(rates, axis=0)))
    shapes, rates = (np.concatenate(each, axis=1) for each in zip(*found, strict=True))
    return shapes, rates


def _relative_motion(body: Chain, angles: np.ndarray, i: int, j: int) -> np.ndarray:
    """Velocity of where link j begins and its rotation rate, seen from link i, by the rates of the
    joints between, ``(n, 3, j - i)``."""
    heading = np.cumsum(angles[i : j - 1], axis=0)
    across = 1j * np.array(body.lengths[i + 1 : j])[:, None] * np.exp(1j * heading)
    velocity = np.concatenate(
        [np.cumsum(across[::-1], axis=0)[::-1], np.zeros((1, angles.shape[1]))]
    )
    return np.stack([velocity.real, velocity.imag, np.ones(velocity.shape)]).transpose(2, 0, 1)


def random_directions(n_joint: int, count: int, rng: np.random.Generator) -> np.ndarray:
    """Directions of joint rates at random, in every other of which some joints rest, ``(n_joint,
    count)``; for three joints and more.

    Where joints rest links may stick together to the floor, and the ratio has creases there, as
    where one joint turns alone.
    """
    points = rng.standard_normal((n_joint, count))
    resting = np.where(np.arange(count) % 2, rng.integers(1, n_joint - 1, count), 0)
    points[rng.random((n_joint, count)).argsort(axis=0) < resting] = 0.0
    return points / np.linalg.norm(points, axis=0)


def unit_directions(n_joint: int, count: int, half: bool, shift: float = 0.0) -> np.ndarray:
    """About `count` directions of joint rates spread evenly over the sphere, or over half of it,
    ``(n_joint, count)``; of two joints moved by the part `shift` of their spacing."""
    if n_joint == 1:
        return np.array([[1.0]]) if half else np.array([[1.0, -1.0]])
    if n_joint == 2:
        turn = (np.arange(count) + shift) * ((np.pi if half else 2 * np.pi) / count)
        return np.stack([np.cos(turn), np.sin(turn)])
    points = np.random.default_rng(n_joint).standard_normal((n_joint, count))
    points /= np.linalg.norm(points, axis=0)
    return np.where(points[-1] < 0, -points, points) if half else points
