"""What the actuators of a balanced body do, and its derivatives along (angles, rates), from the body's symbolic statement.

The tail velocity z solves balance(z, y) = 0 with y = (angles, rates), so that dz/dy = -R_z^-1 R_y.
"""

from __future__ import annotations

from functools import lru_cache

import casadi as ca
import numpy as np

from colloc.mechanics.actuators import ActuatorLimits, driven_power
from colloc.mechanics.bodies import Body
from colloc.mechanics.law import Law


@lru_cache(maxsize=32)
def _function(body: Body, friction: Law, limits: ActuatorLimits | None) -> ca.Function:
    """(y, z, delta) to the shares of the limits, or without limits the driven power, and their total derivatives along y."""
    angles, rates, z, delta = (ca.SX.sym(*s) for s in (("q", body.n_joint), ("r", body.n_joint), ("z", 3), ("delta", 1)))
    y, balance = ca.vertcat(angles, rates), body.sliding(friction, angles, rates, z, delta).force
    at = body, friction, angles, rates, body.forces(friction, angles, rates, z, delta), delta
    done = driven_power(*at) if limits is None else limits.shares(*at)
    nu = ca.solve(ca.jacobian(balance, z).T, ca.jacobian(done, z).T)
    slope = ca.jacobian(done, y).T - ca.jacobian(balance, y).T @ nu
    return ca.Function("actuators", [y, z, delta], [done, ca.vec(ca.densify(slope))], {"cse": True})


def _evaluated(
    body: Body, friction: Law, limits: ActuatorLimits | None, angles: np.ndarray, rates: np.ndarray, z: np.ndarray, delta: float
) -> tuple[np.ndarray, np.ndarray]:
    done, slope = _function(body, friction, limits)(np.concatenate([angles, rates]), z, delta)
    return done.full(), slope.full().reshape(-1, 2 * len(angles), angles.shape[1])


def driven_slopes(
    body: Body, friction: Law, angles: np.ndarray, rates: np.ndarray, z: np.ndarray, delta: float
) -> tuple[np.ndarray, np.ndarray]:
    """Driven power ``(n_time,)`` at balanced tail velocities, and its derivatives ``(2 n_joint, n_time)``."""
    power, slope = _evaluated(body, friction, None, angles, rates, z, delta)
    return power[0], slope[0]


def share_slopes(
    body: Body, friction: Law, limits: ActuatorLimits, angles: np.ndarray, rates: np.ndarray, z: np.ndarray, delta: float
) -> np.ndarray:
    """Derivatives ``(n_share, 2 n_joint, n_time)`` of `ActuatorLimits.shares` at balanced tail velocities."""
    return _evaluated(body, friction, limits, angles, rates, z, delta)[1]
