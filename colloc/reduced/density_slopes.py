"""Total derivatives of densities and of limited quantities along (angles, rates, orientation).

The tail velocity z solves balance(z, y) = 0 with y = (angles, rates, outside force), so that dz/dy
= -R_z^-1 R_y.
"""

from __future__ import annotations

from functools import lru_cache

import casadi as ca
import numpy as np

from colloc.mechanics.balance import load_wrench
from colloc.mechanics.bodies import Body
from colloc.mechanics.densities import Instants, PathLimits, Quantity
from colloc.mechanics.joint_map import JointMap
from colloc.mechanics.law import Law


@lru_cache(maxsize=32)
def _function(
    body: Body,
    friction: Law,
    joint_map: JointMap | None,
    of: Quantity | PathLimits,
    *,
    pulled: bool,
) -> ca.Function:
    """(y, z, delta) to the total derivatives along y."""
    sizes = {"q": body.n_joint, "r": body.n_joint, "z": 3, "delta": 1, "load": 2 * pulled}
    angles, rates, z, delta, load = (ca.SX.sym(*each) for each in sizes.items())
    y = ca.vertcat(angles, rates, load)
    pull = load if pulled else None
    out = of.at(Instants(body, friction, angles, rates, delta, z=z, load=pull, joint_map=joint_map))
    slope = ca.jacobian(out, y).T
    if of.needs_forces:
        balance = body.sliding(friction, angles, rates, z, delta).force
        if pulled:
            balance += load_wrench(body, body.posture(angles), load)  # type: ignore[attr-defined, arg-type]
        slope -= ca.jacobian(balance, y).T @ ca.solve(
            ca.jacobian(balance, z).T, ca.jacobian(out, z).T
        )
    return ca.Function("slopes", [y, z, delta], [ca.vec(ca.densify(slope))], {"cse": True})


def density_slopes(of: Quantity | PathLimits, now: Instants) -> np.ndarray:
    """Derivatives ``(n_row, 2 n_joint + 1, n_time)`` at balanced tail velocities."""
    pulled, n, n_time = now.load is not None, 2 * len(now.angles), now.angles.shape[1]
    y = np.concatenate([now.angles, now.rates, now.load if pulled else np.empty((0, n_time))])
    slope = (
        _function(now.body, now.friction, now.joint_map, of, pulled=pulled)(y, now.z, now.delta)
        .full()
        .reshape(-1, len(y), n_time)
    )
    # an outside force turns against the body
    on_theta = (
        slope[:, n] * now.load[1] - slope[:, n + 1] * now.load[0]
        if pulled
        else np.zeros((len(slope), n_time))
    )
    return np.concatenate([slope[:, :n], on_theta[:, None]], axis=1)
