"""Derivatives of densities and of what is limited along (angles, rates), where forces follow from the balance.

The tail velocity z solves balance(z, y) = 0 with y = (angles, rates), so that dz/dy = -R_z^-1 R_y.
"""

from __future__ import annotations

from functools import lru_cache

import casadi as ca
import numpy as np

from colloc.mechanics.bodies import Body
from colloc.mechanics.densities import Instants, PathLimits, Quantity
from colloc.mechanics.law import Law


@lru_cache(maxsize=32)
def _function(body: Body, friction: Law, of: Quantity | PathLimits) -> ca.Function:
    """(y, z, delta) to the total derivatives along y."""
    angles, rates, z, delta = (ca.SX.sym(*s) for s in (("q", body.n_joint), ("r", body.n_joint), ("z", 3), ("delta", 1)))
    y, out = ca.vertcat(angles, rates), of.at(Instants(body, friction, angles, rates, delta, z=z))
    slope = ca.jacobian(out, y).T
    if of.needs_forces:
        balance = body.sliding(friction, angles, rates, z, delta).force
        slope -= ca.jacobian(balance, y).T @ ca.solve(ca.jacobian(balance, z).T, ca.jacobian(out, z).T)
    return ca.Function("slopes", [y, z, delta], [ca.vec(ca.densify(slope))], {"cse": True})


def density_slopes(of: Quantity | PathLimits, now: Instants) -> np.ndarray:
    """Derivatives ``(n_row, 2 n_joint, n_time)`` of a density, or of the shares of limits, at balanced tail velocities."""
    slope = _function(now.body, now.friction, of)(np.concatenate([now.angles, now.rates]), now.z, now.delta)
    return slope.full().reshape(-1, 2 * len(now.angles), now.angles.shape[1])
