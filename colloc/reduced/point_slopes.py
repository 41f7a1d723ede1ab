"""Velocities and power of a balanced body as functions of its shape and shape velocity alone, with exact first derivatives.

The balance R(z; y) = 0, y = (angles, rates), gives the tail velocity z(y). By the implicit function theorem

    dz/dy = -R_z^-1 R_y,      d out(y, z(y))/dy = out_y + out_z dz/dy.
"""

from __future__ import annotations

from functools import lru_cache

import casadi as ca
import numpy as np

from colloc.mechanics.balance import instant, net_force, total_power
from colloc.mechanics.body import Chain
from colloc.mechanics.friction import Friction
from colloc.numerics.machine_code import machine_code

OMEGA, ADVANCE, ACROSS, POWER = range(2, 6)
"""Rows of `point_slopes` beside the tail's velocity: rotation rate, velocity of the centre of mass in the body frame, power."""
N_ROW = 6


@lru_cache(maxsize=32)
def _expressions(body: Chain, friction: Friction) -> tuple[ca.Function, ca.Function]:
    sizes = (("q", body.n_joint), ("r", body.n_joint), ("z", 3), ("delta", 1))
    angles, rates, z, delta = (ca.SX.sym(name, size) for name, size in sizes)
    now = instant(body, friction, angles, rates, z, delta)
    balance = net_force(now.posture, now.force)
    out = ca.vertcat(z, *body.centre_velocity(now.posture, now.velocity), total_power(now.velocity, now.force))
    y = ca.vertcat(angles, rates)
    slope = -ca.solve(ca.jacobian(balance, z), ca.jacobian(balance, y))
    total = ca.jacobian(out, y) + ca.jacobian(out, z) @ slope
    arguments, options = [angles, rates, z, delta], {"cse": True}
    value = ca.Function("point_rates", arguments, [out], options)
    slopes = ca.Function("point_slopes", arguments, [ca.densify(ca.vec(total))], options)
    found = machine_code([value, slopes])
    return found[0], found[1]


def point_rates(
    body: Chain, friction: Friction, angles: np.ndarray, rates: np.ndarray, z: np.ndarray, delta: float
) -> np.ndarray:
    """Rows ``(6, n_time)``: tail velocity, velocity of the centre of mass in the body frame, power.

    Parameters
    ----------
    body, friction
    angles, rates : (n_joint, n_time)
    z : (3, n_time)
        Tail velocities in balance.
    delta : float
    """
    return _expressions(body, friction)[0](angles, rates, z, np.full((1, z.shape[1]), delta)).full()


def point_slopes(
    body: Chain, friction: Friction, angles: np.ndarray, rates: np.ndarray, z: np.ndarray, delta: float
) -> np.ndarray:
    """Total derivatives ``(n_time, 6, 2 n_joint)`` of `point_rates` with respect to angles, then rates."""
    flat = _expressions(body, friction)[1](angles, rates, z, np.full((1, z.shape[1]), delta)).full()
    return flat.T.reshape(z.shape[1], -1, N_ROW).transpose(0, 2, 1)
