r"""What the actuators of a body deliver while none takes energy back: the positive parts of their powers.

Work against friction is the sum of what all actuators do, and one that is driven backwards counts as a gain there. A real one
brakes: it gives nothing back. With forces on the body's parts, the power is bilinear in them and in the velocities, and these
are linear in the rates: so the moment of a shape coordinate is the power at its unit rate, all others and the body at rest.

The positive part of a power P has a corner at 0, which is smoothed at the scale of the regularised friction: below the speed
delta friction is viscous, and so a power of delta times friction at that speed tells nothing about who drives whom,

    (P + sqrt(P^2 + (mu delta)^2)) / 2.

It vanishes with delta like friction's own regularisation, and the certificate's limit for delta -> 0 covers both.
"""

from __future__ import annotations

import numpy as np

from colloc.mechanics.bodies import Body
from colloc.mechanics.law import Law
from colloc.numerics.arrays import Array, namespace


def actuator_powers(body: Body, friction: Law, angles: Array, rates: Array, forces: Array, delta: Array) -> Array:
    """Power of every shape coordinate's actuator, ``(n_joint, n_time)``, for a body with a full formulation.

    Parameters
    ----------
    body, friction
    angles, rates : (n_joint, n_time)
    forces : (n_force, n_time)
        On the body's parts (`colloc.mechanics.bodies.Body.forces`).
    delta : float
    """
    still, powers = np.zeros((3, angles.shape[1])), []
    for joint in range(body.n_joint):
        unit = np.zeros(angles.shape)
        unit[joint] = 1.0
        powers.append(body.with_forces(friction, angles, unit, still, forces, delta).power * rates[joint : joint + 1, :])
    return namespace(angles, rates, forces).stack(powers)


def driven_power(body: Body, friction: Law, angles: Array, rates: Array, forces: Array, delta: Array) -> Array:
    """Sum of the positive parts of the actuators' powers, ``(1, n_time)``; arguments as for `actuator_powers`."""
    powers = actuator_powers(body, friction, angles, rates, forces, delta)
    xp, idle = namespace(powers, delta), friction.largest * delta ** (1.0 + (friction.degree or 0.0))
    return xp.sum_rows(0.5 * (powers + xp.sqrt(powers**2 + idle**2)))


def driven_power_in_balance(
    body: Body, friction: Law, angles: np.ndarray, rates: np.ndarray, z: np.ndarray, delta: float
) -> np.ndarray:
    """The same, ``(n_time,)``, for balanced tail velocities z ``(3, n_time)``."""
    forces = body.forces(friction, angles, rates, z, delta)
    return driven_power(body, friction, angles, rates, forces, delta)[0]
