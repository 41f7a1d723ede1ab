r"""Inertia of a chain: its momenta, and how friction changes them.

The states are the velocity (Vx, Vy) of the centre of mass in the axes of the tail link, and the angular momentum H about it, of
a body of mass 1. With friction's force F and moment M about the centre of mass, and the Froude number Fr = L/(g T^2),

    Fr (dVx/dt - omega Vy) = Fx,    Fr (dVy/dt + omega Vx) = Fy,    Fr dH/dt = M,    omega = (H - H_0) / I,

where H_0 is the angular momentum that the joints' motion has while the tail rests, and I the moment of inertia. For Fr = 0 this
is the balance of forces. Links are as heavy as they press on the floor, evenly along their lengths.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from colloc.mechanics.bodies import Body
from colloc.mechanics.chain import Chain
from colloc.mechanics.law import Law
from colloc.mechanics.links import LinkVelocity, Posture
from colloc.system.errors import ProblemError

Path = Callable[[np.ndarray], tuple[np.ndarray, ...]]


class MomentumRates(NamedTuple):
    """A chain with given momenta: how they change, and what it does meanwhile."""

    rates: np.ndarray
    """Of the momenta, ``(3, n_time)``."""
    z: np.ndarray
    """Tail velocity, ``(3, n_time)``."""
    power: np.ndarray
    """Dissipated by friction, ``(n_time,)``."""


def momenta(body: Chain, posture: Posture, link: LinkVelocity) -> np.ndarray:
    """Velocity of the centre of mass and angular momentum about it, of links that move so, ``(3, n_time)``."""
    mass, length = body.weight_column(), body.length_column()
    (x, y), (vx, vy) = body.centre_of_mass(posture), body.centre_velocity(posture, link)
    own_x = link.vs * posture.cos - link.vn * posture.sin
    own_y = link.vs * posture.sin + link.vn * posture.cos
    spin = (posture.x - x) * (own_y - vy) - (posture.y - y) * (own_x - vx) + length**2 / 12 * link.w
    return np.concatenate([vx, vy, (mass * spin).sum(axis=0, keepdims=True)])


def moment_of_inertia(body: Chain, posture: Posture) -> np.ndarray:
    """Of the body about its centre of mass, ``(n_time,)``."""
    x, y = body.centre_of_mass(posture)
    square = (posture.x - x) ** 2 + (posture.y - y) ** 2 + body.length_column() ** 2 / 12
    return np.asarray((body.weight_column() * square).sum(axis=0))


def tail_velocity(body: Chain, angles: np.ndarray, rates: np.ndarray, states: np.ndarray) -> np.ndarray:
    """Tail velocity ``(3, n_time)`` of a chain with momenta `states`, ``(3, n_time)``."""
    posture = body.posture(angles)
    vx, vy, h = states - momenta(body, posture, body.velocity(posture, rates, np.zeros_like(states)))
    omega = h / moment_of_inertia(body, posture)
    (x,), (y,) = body.centre_of_mass(posture)
    return np.stack([vx + omega * y, vy - omega * x, omega])


def momentum_rates(
    body: Chain, friction: Law, angles: np.ndarray, rates: np.ndarray, states: np.ndarray, *, delta: float, froude: float
) -> MomentumRates:
    """How friction changes the momenta `states` ``(3, n_time)`` of a chain with such joint angles and rates."""
    z = tail_velocity(body, angles, rates, states)
    slides = body.sliding(friction, angles, rates, z, delta)
    (x,), (y,) = body.centre_of_mass(body.posture(angles))
    fx, fy, about_tail = slides.force
    force = np.stack([fx, fy, about_tail - (x * fy - y * fx)])
    turning = np.stack([z[2] * states[1], -z[2] * states[0], np.zeros_like(z[2])])
    return MomentumRates(force / froude + turning, z, slides.power[0])


def checked_inertia(body: Body, gait: Path) -> Chain:
    """The body, if it can play the gait with inertia; else a `ProblemError` that says why not."""
    if not isinstance(body, Chain):
        raise ProblemError(f"inertia is known of a Chain, whose links have masses, not of a {type(body).__name__}.")
    if len(gait(np.zeros(1))) != 2:
        raise ProblemError("a relaxed gait changes direction in no time at all, so it cannot be played with inertia.")
    return body
