"""The force and torque balance of a body in quasi-static sliding, and the power it dissipates.

Everything is in body-frame axes; the torque is taken about the body's chosen reference (see
`colloc.mechanics.links`). The same functions run on NumPy arrays and on CasADi matrices.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from colloc.mechanics.law import Law, Matrix
from colloc.mechanics.link_friction import LinkForce, power
from colloc.mechanics.links import TAIL, Links, LinkVelocity, Posture
from colloc.numerics.arrays import Array, namespace


class Instant(NamedTuple):
    """A body at given instants: its posture, how its links move, and the friction on them."""

    posture: Posture
    velocity: LinkVelocity
    force: LinkForce


class Moving(NamedTuple):
    """A chain whose velocities are asked for: joint angles and rates ``(n_joint, n_time)``, the
    regularisation speed, and an outside force ``(2, n_time)``, or none."""

    body: Links
    friction: Law
    angles: np.ndarray
    rates: np.ndarray
    delta: float
    load: np.ndarray | None = None

    def at(self, chosen: np.ndarray) -> Moving:
        """Some of the instants."""
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
    """Posture, link velocities and friction for joint angles, joint rates ``(n_joint, n_time)`` and
    z ``(3, n_time)``."""
    posture = body.posture(angles, reference)
    velocity = body.velocity(posture, rates, z, reference)
    return Instant(posture, velocity, body.contact.force(friction, velocity, delta))


def link_stiffness(body: Links, friction: Law, velocity: LinkVelocity, delta: Array) -> Matrix:
    """Minus the derivative of the friction on the links with respect to (vs, vn, w), 3 x 3 of
    ``(n_link, n_time)``."""
    return body.contact.stiffness(friction, velocity, delta)


def dissipation_potential(
    body: Links, friction: Law, velocity: LinkVelocity, delta: Array
) -> np.ndarray:
    """The function of z whose gradient is minus `net_force`, ``(n_time,)``; of associated laws
    only."""
    return body.contact.potential(friction, velocity, delta).sum(axis=0)


def net_force(posture: Posture, force: LinkForce) -> Array:
    """Sum of the link forces and their torque about the reference, ``(3, n_time)`` (paper, eq. ftb;
    zero in balance)."""
    xp = namespace(posture.cos, force.normal)
    fx = force.tangential * posture.cos - force.normal * posture.sin
    fy = force.tangential * posture.sin + force.normal * posture.cos
    torque = posture.x * fy - posture.y * fx + force.couple
    return xp.stack([xp.sum_rows(fx), xp.sum_rows(fy), xp.sum_rows(torque)])


def load_wrench(body: Links, posture: Posture, load: Array) -> Array:
    """An outside force ``(2, n_time)``, in body-frame axes, that acts at the centre of mass: force
    and torque about the reference, ``(3, n_time)``, to be added to `net_force`."""
    x, y = body.centre_of_mass(posture)
    return namespace(load).stack([load, x * load[1:2, :] - y * load[0:1, :]])


def load_power(
    body: Links, posture: Posture, velocity: LinkVelocity, load: np.ndarray
) -> np.ndarray:
    """What that force does on the body, ``(n_time,)``."""
    vx, vy = body.centre_velocity(posture, velocity)
    return (load[0] * vx + load[1] * vy)[0]


def total_power(velocity: LinkVelocity, force: LinkForce) -> Array:
    """Power dissipated by friction, ``(1, n_time)`` (integrand of the paper's eq. W)."""
    return namespace(velocity.vs, force.normal).sum_rows(power(*velocity, force))


def _pulled_back(posture: Posture, blocks: Matrix) -> np.ndarray:
    """``sum over links of G^T K G``, ``(n_time, 3, 3)``, with G = d(vs, vn, w)/dz and K the given 3
    x 3 of link arrays."""
    c, s, x, y = posture
    arm_s, arm_n = x * s - y * c, x * c + y * s
    columns = [
        [row[0] * c - row[1] * s, row[0] * s + row[1] * c, row[0] * arm_s + row[1] * arm_n + row[2]]
        for row in blocks
    ]
    result = np.empty((c.shape[1], 3, 3))
    for j in range(3):
        k0, k1, k2 = columns[0][j], columns[1][j], columns[2][j]
        result[:, 0, j] = (c * k0 - s * k1).sum(axis=0)
        result[:, 1, j] = (s * k0 + c * k1).sum(axis=0)
        result[:, 2, j] = (arm_s * k0 + arm_n * k1 + k2).sum(axis=0)
    return result


def balance_jacobian(
    body: Links, friction: Law, posture: Posture, velocity: LinkVelocity, delta: Array
) -> np.ndarray:
    """Minus the derivative of `net_force` with respect to z, ``(n_time, 3, 3)``.

    Symmetric positive definite for an associated law: the Hessian of the dissipation potential.
    """
    return _pulled_back(posture, link_stiffness(body, friction, velocity, delta))


def secant_matrix(
    body: Links, friction: Law, posture: Posture, velocity: LinkVelocity, delta: Array
) -> np.ndarray:
    """Matrix A(z) with ``net_force(z') ~ net_force(z) - A(z) (z' - z)`` when link speeds are
    frozen, ``(n_time, 3, 3)``.

    One step of the paper's fixed point (eqs. ftbtilde to deltatilde) is ``z + A(z)^-1
    net_force(z)``.
    """
    return _pulled_back(posture, body.contact.secant(friction, velocity, delta))
