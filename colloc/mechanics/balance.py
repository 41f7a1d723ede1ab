"""A chain at an instant: posture, velocities, forces, and their balance in quasi-static sliding.

In body-frame axes, tail link along +x. The rigid velocity ``z = (u, v, omega)`` is that of a
*reference*, about which torques are taken: the tail point, or the midpoint of a link, which keeps
the relative precision of a link at rest. NumPy and CasADi; bodies are a
`colloc.mechanics.chain.Chain`.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from colloc.mechanics.floor_contact import whole_links
from colloc.mechanics.friction import LinkForce, LinkVelocity, power
from colloc.mechanics.law import Law
from colloc.numerics.arrays import Array, namespace

TAIL = None
"""The reference at the free end of link 0; an integer means a link's midpoint."""


def is_chain(body: Any) -> bool:
    return hasattr(body, "n_link")


class Posture(NamedTuple):
    """Direction cosines of the links, and their midpoints seen from the reference, ``(n_link,
    n_time)`` each."""

    cos: Array
    sin: Array
    x: Array
    y: Array


class Instant(NamedTuple):
    posture: Posture
    velocity: LinkVelocity
    force: LinkForce


class Moving(NamedTuple):
    """A chain whose velocities are unknown: joint angles and rates ``(n_joint, n_time)``, delta,
    and an outside force ``(2, n_time)`` or none."""

    body: Any
    friction: Law
    angles: np.ndarray
    rates: np.ndarray
    delta: float
    load: np.ndarray | None = None

    def at(self, index: np.ndarray) -> Moving:
        load = None if self.load is None else self.load[:, index]
        return self._replace(angles=self.angles[:, index], rates=self.rates[:, index], load=load)

    def at_rest(self, link: int) -> np.ndarray:
        at = self.body.posture(self.angles, link)
        return self.body.tail_velocity(at, self.rates, np.zeros((3, self.angles.shape[1])), link)

    def instant(self, z: np.ndarray, reference: int | None, delta: Array = None) -> Instant:
        delta = self.delta if delta is None else delta
        return instant(self.body, self.friction, self.angles, self.rates, z, delta, reference)


def instant(
    body: Any,
    friction: Law,
    angles: Array,
    rates: Array,
    z: Array,
    delta: Array,
    reference: int | None = TAIL,
) -> Instant:
    posture = body.posture(angles, reference)
    velocity = body.velocity(posture, rates, z, reference)
    return Instant(posture, velocity, body.contact.force(friction, velocity, delta))


def net_force(posture: Posture, force: LinkForce) -> Array:
    """Sum of the link forces and their torque about the reference, ``(3, n_time)`` (paper, eq. ftb;
    zero in balance)."""
    xp = namespace(posture.cos, force.normal)
    fx = force.tangential * posture.cos - force.normal * posture.sin
    fy = force.tangential * posture.sin + force.normal * posture.cos
    torque = posture.x * fy - posture.y * fx + force.couple
    return xp.stack([xp.sum_rows(fx), xp.sum_rows(fy), xp.sum_rows(torque)])


def load_wrench(body: Any, posture: Posture, load: Array) -> Array:
    """Force and torque about the reference of an outside force on the centre of mass."""
    x, y = body.centre_of_mass(posture)
    return namespace(load).stack([load, x * load[1:2, :] - y * load[0:1, :]])


def total_power(velocity: LinkVelocity, force: LinkForce) -> Array:
    """Power dissipated by friction, ``(1, n_time)`` (integrand of the paper's eq. W)."""
    return namespace(velocity.vs, force.normal).sum_rows(power(*velocity, force))


def pull_back(G: np.ndarray, K: np.ndarray) -> np.ndarray:
    """Sum over parts of G' K G, ``(n_time, 3, 3)``, from G = d(velocity of a part)/dz ``(k, 3,
    n_part, n_time)`` and K ``(k, k, n_part, n_time)``."""
    return np.einsum("kipt,kjpt->tij", G, np.einsum("kmpt,mjpt->kjpt", K, G))


def balance_jacobian(
    body: Any,
    friction: Law,
    posture: Posture,
    velocity: LinkVelocity,
    delta: Array,
    *,
    secant: bool = False,
) -> np.ndarray:
    """Minus the derivative of `net_force` with respect to z, ``(n_time, 3, 3)``; for an associated
    law the Hessian of the dissipation potential.

    secant: A(z) instead, with ``net_force(z') ~ net_force(z) - A(z) (z' - z)`` when link speeds are
    frozen; a step of the paper's fixed point (eqs. ftbtilde to deltatilde) is ``z + A(z)^-1
    net_force(z)``.
    """
    c, s, x, y = posture
    zero, one = np.zeros_like(c), np.ones_like(c)
    link_map = np.array(((c, s, x * s - y * c), (-s, c, x * c + y * s), (zero, zero, one)))
    return pull_back(link_map, body.contact.stiffness(friction, velocity, delta, secant=secant))


def joint_moments(body: Any, angles: Array, forces: Array, load: Array | None = None) -> Array:
    """Moments of the joints' actuators, ``(n_joint, n_time)``, from contact forces ``(n_force,
    n_time)`` (`FloorContact.forces`) and an outside force ``(2, n_time)`` on the centre of mass, in
    the body's axes."""
    return moments_of_links(body, angles, body.contact.on_links(forces), load)


def moments_of_links(
    body: Any, angles: Array, force: LinkForce, load: Array | None = None
) -> Array:
    """The same from forces on links, by virtual power: the moment of a joint is the power against
    friction at its unit rate, all others and the tail at rest, less that of the outside force."""
    xp, posture = namespace(angles, force.normal), body.posture(angles)
    still, moments = np.zeros((3, angles.shape[1])), []
    for joint in range(body.n_joint):
        unit = np.zeros(angles.shape)
        unit[joint] = 1.0
        velocity = body.velocity(posture, unit, still)
        moment = total_power(velocity, force)
        if load is not None:
            centre = xp.stack(list(body.centre_velocity(posture, velocity)))
            moment = moment - xp.sum_rows(load * centre)
        moments.append(moment)
    return xp.stack(moments)


def largest_moments(body: Any, friction: Law, grade: float = 0.0) -> np.ndarray:
    """Upper bounds on the joints' moments in slow motion under dry friction, ``(n_joint,)``: on
    either side friction is at most the largest coefficient times the weight, and acts, as a slope's
    pull does, no farther away than on the stretched body."""
    ends = np.concatenate([[0.0], np.cumsum(body.lengths)])
    feet = body.standing_on or whole_links(body.weight_column()[:, 0])
    loads = [
        (f.link, f.place, (f.friction or friction).largest * (f.weight or 0.0), f.offset)
        for f in feet
    ]
    loads += [(link, 0.5, grade * mass, 0.0) for link, mass in enumerate(body.mass_column()[:, 0])]
    moments = np.zeros((2, body.n_joint))
    for link, place, force, offset in loads:
        for joint in range(body.n_joint):
            arm = abs(ends[link] + place * body.lengths[link] - ends[joint + 1]) + abs(offset)
            moments[int(link > joint), joint] += force * arm
    return moments.min(axis=0)
