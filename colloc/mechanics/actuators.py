r"""What the actuators of a body's shape coordinates do: moments, powers, and how these compare with what real ones can do.

With forces on the body's parts, the power is bilinear in them and in the velocities, and these are linear in the rates: so the
moment of a shape coordinate is the power at its unit rate, all others and the body at rest.

Work against friction is the sum of what all actuators do, and one that is driven backwards counts as a gain there. A real one
brakes: it gives nothing back. The positive part of a power P has a corner at 0, which is smoothed at the scale of the
regularised friction: below the speed delta friction is viscous, and so a power of delta times friction at that speed tells
nothing about who drives whom,

    (P + sqrt(P^2 + (mu delta)^2)) / 2.

It vanishes with delta like friction's own regularisation, and the certificate's limit for delta -> 0 covers both.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from colloc.mechanics.bodies import Body
from colloc.mechanics.law import Law
from colloc.numerics.arrays import Array, namespace


def joint_moments(body: Body, friction: Law, angles: Array, forces: Array, delta: Array) -> Array:
    """Moment that every shape coordinate's actuator exerts, ``(n_joint, n_time)``, for a body with a full formulation, from
    angles ``(n_joint, n_time)`` and forces ``(n_force, n_time)`` on its parts (`colloc.mechanics.bodies.Body.forces`)."""
    still, moments = np.zeros((3, angles.shape[1])), []
    for joint in range(body.n_joint):
        unit = np.zeros(angles.shape)
        unit[joint] = 1.0
        moments.append(body.with_forces(friction, angles, unit, still, forces, delta).power)
    return namespace(angles, forces).stack(moments)


def actuator_powers(body: Body, friction: Law, angles: Array, rates: Array, forces: Array, delta: Array) -> Array:
    """Power of every shape coordinate's actuator, ``(n_joint, n_time)``; arguments as for `joint_moments`."""
    return joint_moments(body, friction, angles, forces, delta) * rates


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


class ActuatorLimits(NamedTuple):
    """The most that actuators can do, one value for each shape coordinate; nothing where there is no limit.

    Attributes
    ----------
    torque : tuple of float
        On the magnitude of the moments [weight x body length].
    power : tuple of float
        On the powers that are delivered [weight x body length / period]; nothing limits a brake.

    Examples
    --------
    >>> ActuatorLimits(torque=(0.1, 0.1)).names
    ('torque of joint 1', 'torque of joint 2')
    """

    torque: tuple[float, ...] = ()
    power: tuple[float, ...] = ()

    @property
    def names(self) -> tuple[str, ...]:
        """What the rows of `shares` are."""
        kinds = ("torque", self.torque), ("power", self.power)
        return tuple(f"{kind} of joint {j + 1}" for kind, limits in kinds for j in range(len(limits)))

    @property
    def least(self) -> np.ndarray:
        """Of the shares, that are allowed ``(n_share,)``; the most is 1."""
        return np.array([-1.0] * len(self.torque) + [-np.inf] * len(self.power))

    def shares(self, body: Body, friction: Law, angles: Array, rates: Array, forces: Array, delta: Array) -> Array:
        """Moments, then powers, over their limits, ``(n_share, n_time)``; arguments as for `actuator_powers`."""
        moments = joint_moments(body, friction, angles, forces, delta)
        rows = [moments / np.array(self.torque)[:, None]] if self.torque else []
        rows += [moments * rates / np.array(self.power)[:, None]] if self.power else []
        return namespace(moments).stack(rows)

    def shares_in_balance(
        self, body: Body, friction: Law, angles: np.ndarray, rates: np.ndarray, z: np.ndarray, delta: float
    ) -> np.ndarray:
        """The same for balanced tail velocities z ``(3, n_time)``."""
        return self.shares(body, friction, angles, rates, body.forces(friction, angles, rates, z, delta), delta)


UNLIMITED = ActuatorLimits()
