"""Force and torque balance of a chain in quasi-static sliding, and the power it dissipates.

In body-frame axes, torque about the chosen reference (`colloc.mechanics.links`); NumPy and CasADi.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from colloc.mechanics.friction import LinkForce, power
from colloc.mechanics.law import Law
from colloc.mechanics.links import TAIL, Links, LinkVelocity, Posture
from colloc.numerics.arrays import Array, namespace


class Instant(NamedTuple):
    """Posture, link velocities and friction on the links of a sliding chain."""

    posture: Posture
    velocity: LinkVelocity
    force: LinkForce


class Moving(NamedTuple):
    """A chain whose velocities are unknown: joint angles and rates ``(n_joint, n_time)``, delta,
    and an outside force ``(2, n_time)`` or none."""

    body: Links
    friction: Law
    angles: np.ndarray
    rates: np.ndarray
    delta: float
    load: np.ndarray | None = None

    def at(self, chosen: np.ndarray) -> Moving:
        """Some of the time points."""
        load = None if self.load is None else self.load[:, chosen]
        return self._replace(angles=self.angles[:, chosen], rates=self.rates[:, chosen], load=load)

    def at_rest(self, link: int) -> np.ndarray:
        """Tail velocity ``(3, n_time)`` when a link rests."""
        at = self.body.posture(self.angles, link)
        return self.body.tail_velocity(at, self.rates, np.zeros((3, self.angles.shape[1])), link)


def instant(
    body: Links,
    friction: Law,
    angles: Array,
    rates: Array,
    z: Array,
    delta: Array,
    reference: int | None = TAIL,
) -> Instant:
    """A chain with joint angles and rates ``(n_joint, n_time)`` whose reference moves with z
    ``(3, n_time)``."""
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


def load_wrench(body: Links, posture: Posture, load: Array) -> Array:
    """Force and torque about the reference, ``(3, n_time)``, of an outside force ``(2, n_time)`` at
    the centre of mass, in body-frame axes."""
    x, y = body.centre_of_mass(posture)
    return namespace(load).stack([load, x * load[1:2, :] - y * load[0:1, :]])


def load_power(
    body: Links, posture: Posture, velocity: LinkVelocity, load: np.ndarray
) -> np.ndarray:
    """Power of that force on the body, ``(n_time,)``."""
    vx, vy = body.centre_velocity(posture, velocity)
    return (load[0] * vx + load[1] * vy)[0]


def total_power(velocity: LinkVelocity, force: LinkForce) -> Array:
    """Power dissipated by friction, ``(1, n_time)`` (integrand of the paper's eq. W)."""
    return namespace(velocity.vs, force.normal).sum_rows(power(*velocity, force))


def dissipation_potential(
    body: Links, friction: Law, velocity: LinkVelocity, delta: Array
) -> np.ndarray:
    """The function of z whose gradient is minus `net_force`, ``(n_time,)``; of associated laws."""
    return body.contact.potential(friction, velocity, delta).sum(axis=0)


def pull_back(G: np.ndarray, K: np.ndarray) -> np.ndarray:
    """Sum over parts of G' K G, ``(n_time, 3, 3)``, from G = d(velocity of a part)/dz ``(k, 3,
    n_part, n_time)`` and K ``(k, k, n_part, n_time)``."""
    return np.einsum("kipt,kjpt->tij", G, np.einsum("kmpt,mjpt->kjpt", K, G))


def _link_map(posture: Posture) -> np.ndarray:
    """d(vs, vn, w)/dz of the links, ``(3, 3, n_link, n_time)``."""
    c, s, x, y = posture
    zero, one = np.zeros_like(c), np.ones_like(c)
    return np.array(((c, s, x * s - y * c), (-s, c, x * c + y * s), (zero, zero, one)))


def balance_jacobian(
    body: Links, friction: Law, posture: Posture, velocity: LinkVelocity, delta: Array
) -> np.ndarray:
    """Minus the derivative of `net_force` with respect to z, ``(n_time, 3, 3)``; for an associated
    law the Hessian of the dissipation potential."""
    return pull_back(_link_map(posture), body.contact.stiffness(friction, velocity, delta))


def secant_matrix(
    body: Links, friction: Law, posture: Posture, velocity: LinkVelocity, delta: Array
) -> np.ndarray:
    """A(z) with ``net_force(z') ~ net_force(z) - A(z) (z' - z)`` when link speeds are frozen,
    ``(n_time, 3, 3)``; one step of the paper's fixed point (eqs. ftbtilde to deltatilde) is ``z +
    A(z)^-1 net_force(z)``."""
    stiffness = body.contact.stiffness(friction, velocity, delta, secant=True)
    return pull_back(_link_map(posture), stiffness)
