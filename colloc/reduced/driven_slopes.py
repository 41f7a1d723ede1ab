"""Driven power of a balanced body and its derivatives along (angles, rates), from the body's symbolic statement.

The tail velocity z solves balance(z, y) = 0 with y = (angles, rates), so that dz/dy = -R_z^-1 R_y.
"""

from __future__ import annotations

from functools import lru_cache

import casadi as ca
import numpy as np

from colloc.mechanics.bodies import Body
from colloc.mechanics.driven_power import driven_power
from colloc.mechanics.law import Law


@lru_cache(maxsize=32)
def _function(body: Body, friction: Law) -> ca.Function:
    """(y, z, delta) to the driven power and its total derivative along y."""
    angles, rates, z, delta = (ca.SX.sym(*s) for s in (("q", body.n_joint), ("r", body.n_joint), ("z", 3), ("delta", 1)))
    y, balance = ca.vertcat(angles, rates), body.sliding(friction, angles, rates, z, delta).force
    power = driven_power(body, friction, angles, rates, body.forces(friction, angles, rates, z, delta), delta)
    nu = ca.solve(ca.jacobian(balance, z).T, ca.jacobian(power, z).T)
    slope = ca.jacobian(power, y).T - ca.jacobian(balance, y).T @ nu
    return ca.Function("driven", [y, z, delta], [power, ca.densify(slope)], {"cse": True})


def driven_slopes(
    body: Body, friction: Law, angles: np.ndarray, rates: np.ndarray, z: np.ndarray, delta: float
) -> tuple[np.ndarray, np.ndarray]:
    """Driven power ``(n_time,)`` at balanced tail velocities, and its derivatives ``(2 n_joint, n_time)``."""
    power, slope = _function(body, friction)(np.concatenate([angles, rates]), z, delta)
    return power.full().ravel(), slope.full()
