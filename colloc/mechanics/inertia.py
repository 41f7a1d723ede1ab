r"""Inertia of a chain: its momenta, and their rates under friction.

The states are the velocity (Vx, Vy) of the centre of mass in the axes of the tail link, and the
angular momentum H about it, of a body of mass 1. With friction's force F and moment M about the
centre of mass, the Froude number Fr = L/(g T^2), the moment of inertia I, and the angular momentum
H_0 of the joints' motion while the tail rests,

    Fr (dVx/dt - omega Vy) = Fx, Fr (dVy/dt + omega Vx) = Fy, Fr dH/dt = M, omega = (H - H_0) / I.

For Fr = 0 this is the balance of forces.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from colloc.mechanics.balance import Posture, moments_of_links
from colloc.mechanics.bodies import Body
from colloc.mechanics.chain import Chain
from colloc.mechanics.friction import LinkForce, LinkVelocity
from colloc.mechanics.law import Law
from colloc.numerics.arrays import Array, namespace
from colloc.system.errors import ProblemError

GRAVITY = 9.81
"""[m/s^2]"""
STATES = ("Vx", "Vy", "H")
Path = Callable[[np.ndarray], tuple[np.ndarray, ...]]


class MomentumRates(NamedTuple):
    rates: Array
    z: Array
    power: Array


def momenta(body: Chain, posture: Posture, link: LinkVelocity) -> Array:
    """Velocity of the centre of mass and angular momentum about it, ``(3, n_time)``."""
    xp, mass = namespace(link.vs), body.mass_column()
    (x, y), (vx, vy) = body.centre_of_mass(posture), body.centre_velocity(posture, link)
    link_vx = link.vs * posture.cos - link.vn * posture.sin
    link_vy = link.vs * posture.sin + link.vn * posture.cos
    swing = (posture.x - x) * link_vy - (posture.y - y) * link_vx
    return xp.stack([vx, vy, xp.sum_rows(mass * swing + body.inertia_column() * link.w)])


def kinetic_energy(body: Chain, angles: Array, rates: Array, z: Array) -> Array:
    link = body.velocity(body.posture(angles), rates, z)
    twice = body.mass_column() * (link.vs**2 + link.vn**2) + body.inertia_column() * link.w**2
    return 0.5 * namespace(link.vs).sum_rows(twice)


def inertial_moments(
    body: Chain, angles: np.ndarray, link: LinkVelocity, growth: LinkVelocity
) -> np.ndarray:
    """Joint moments of mass times acceleration, by virtual power, of a body of mass 1, ``(n_joint,
    n_time)``; `growth` is the rate of the velocities `link` in the turning axes of the links."""
    mass = body.mass_column()
    along, across = growth.vs - link.w * link.vn, growth.vn + link.w * link.vs
    spin = body.inertia_column() * growth.w
    return -moments_of_links(body, angles, LinkForce(mass * along, mass * across, spin))


def tail_velocity(body: Chain, angles: Array, rates: Array, states: Array) -> Array:
    """Tail velocity of a chain with momenta `states`."""
    posture = body.posture(angles)
    x, y = body.centre_of_mass(posture)
    left = states - momenta(body, posture, body.velocity(posture, rates, 0 * states))
    square = (posture.x - x) ** 2 + (posture.y - y) ** 2
    inertia = namespace(square).sum_rows(body.mass_column() * square + body.inertia_column())
    omega = left[2:3, :] / inertia
    return namespace(angles, states).stack(
        [left[0:1, :] + omega * y, left[1:2, :] - omega * x, omega]
    )


def momentum_rates(
    body: Chain,
    friction: Law,
    angles: Array,
    rates: Array,
    states: Array,
    *,
    delta: Array,
    froude: Array,
) -> MomentumRates:
    """Rates under friction; NumPy and CasADi."""
    z = tail_velocity(body, angles, rates, states)
    slides = body.sliding(friction, angles, rates, z, delta)
    growth = about_centre(body, angles, slides.force) / froude + turning(z, states)
    return MomentumRates(growth, z, slides.power)


def about_centre(body: Chain, angles: Array, force: Array, sign: float = 1.0) -> Array:
    """Force and moment about the centre of mass, from force and torque about the tail, ``(3,
    n_time)`` both; with `sign` -1 the other way round."""
    x, y = body.centre_of_mass(body.posture(angles))
    torque = x * force[1:2, :] - y * force[0:1, :]
    return namespace(angles, force).stack([force[0:2, :], force[2:3, :] - sign * torque])


def turning(z: Array, states: Array) -> Array:
    """Rates of the momenta because their axes turn with the tail link."""
    omega = z[2:3, :]
    return namespace(z, states).stack([omega * states[1:2, :], -omega * states[0:1, :], 0 * omega])


def checked_mass(body: Body) -> Chain:
    if not isinstance(body, Chain) or type(body).solve is not Chain.solve:
        raise ProblemError(
            f"inertia is known of a Chain, whose links have masses, not of a {type(body).__name__}."
        )
    return body
