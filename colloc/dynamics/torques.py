"""Joint torques of a chain with inertia.

With the kinetic energy T(q, r, z) of a body of mass 1 that moves with joint angles q, rates r and
tail velocity z, the equation of joint j is

    Fr (d/dt dT/dr_j - dT/dq_j) = M_j - (virtual power of friction, the tail resting).

A uniform pull, as that of a slope, accelerates all links alike and takes no torque. Replays take
the accelerations of the links by differences in time, programs by derivatives of z(q, r, momenta);
the two share no formula.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np

from colloc.mechanics.actuators import joint_moments
from colloc.mechanics.chain import Chain
from colloc.mechanics.densities import Instants, PathLimits
from colloc.mechanics.inertia import (
    STATES,
    Path,
    inertial_moments,
    kinetic_energy,
    momentum_rates,
    tail_velocity,
)
from colloc.mechanics.law import Law
from colloc.mechanics.links import LinkVelocity

_STEP = 1e-5  # of differences in time, in phase


def joint_torques(
    body: Chain,
    friction: Law,
    path: Path,
    t: np.ndarray,
    momenta: np.ndarray,
    *,
    delta: float,
    froude: float,
) -> np.ndarray:
    """Joint torques ``(n_joint, n_time)`` of a gait with momenta ``(3, n_time)`` at phases t."""
    angles, rates = path(t)
    z = tail_velocity(body, angles, rates, momenta)
    how: Any = {"delta": delta, "froude": froude}
    changes = momentum_rates(body, friction, angles, rates, momenta, **how).rates

    def link_velocity(by: float) -> LinkVelocity:
        angles, rates = path(t + by)
        tail = tail_velocity(body, angles, rates, momenta + by * changes)
        return body.velocity(body.posture(angles), rates, tail)

    pairs = zip(link_velocity(-_STEP), link_velocity(_STEP), strict=True)
    growth = LinkVelocity(*((after - before) / (2 * _STEP) for before, after in pairs))
    link = body.velocity(body.posture(angles), rates, z)
    forces = body.forces(friction, angles, rates, z, delta)
    inertial = froude * inertial_moments(body, angles, link, growth)
    return joint_moments(body, angles, forces) + inertial


@lru_cache(maxsize=32)
def torque_function(body: Chain, friction: Law) -> Any:
    """CasADi function (q, r, q'', momenta, delta, Froude number) to the joint torques ``(n_joint,
    1)`` at one time, in any unit of time."""
    import casadi as ca

    n = body.n_joint
    sizes = (("q", n), ("r", n), ("a", n), ("momenta", len(STATES)), ("delta", 1), ("froude", 1))
    q, r, accelerations, momenta, delta, froude = symbols = [ca.SX.sym(*each) for each in sizes]
    z = tail_velocity(body, q, r, momenta)
    changes = momentum_rates(body, friction, q, r, momenta, delta=delta, froude=froude).rates
    z_rate = ca.jtimes(z, ca.vertcat(q, r, momenta), ca.vertcat(r, accelerations, changes))
    tail, tail_rate = ca.SX.sym("z", 3), ca.SX.sym("z_rate", 3)
    energy = kinetic_energy(body, q, r, tail)
    way = ca.vertcat(q, r, tail), ca.vertcat(r, accelerations, tail_rate)
    inertia = ca.jtimes(ca.gradient(energy, r), *way) - ca.gradient(energy, q)
    inertia = ca.substitute(inertia, ca.vertcat(tail, tail_rate), ca.vertcat(z, z_rate))
    forces = body.forces(friction, q, r, z, delta)
    torques = joint_moments(body, q, forces) + froude * inertia
    return ca.Function("torques", symbols, [torques], {"cse": True})


@lru_cache(maxsize=32)
def _shares(body: Chain, friction: Law, limits: PathLimits) -> Any:
    """((q, r, q'', momenta, Froude number), delta) to shares of limits, and their derivatives."""
    import casadi as ca

    n = body.n_joint
    sizes = (("q", n), ("r", n), ("a", n), ("momenta", len(STATES)), ("froude", 1))
    q, r, accelerations, momenta, froude = parts = [ca.SX.sym(*each) for each in sizes]
    y, delta = ca.vertcat(*parts), ca.SX.sym("delta")
    moments = torque_function(body, friction)(q, r, accelerations, momenta, delta, froude)
    out = limits.at(Instants(body, friction, q, r, delta, moments=moments))
    slope = ca.vec(ca.densify(ca.jacobian(out, y).T))
    values = ca.Function("shares", [y, delta], [out], {"cse": True})
    return values, ca.Function("share_slopes", [y, delta], [slope], {"cse": True})


def limit_shares(
    body: Chain, friction: Law, limits: PathLimits, y: np.ndarray, delta: float
) -> np.ndarray:
    """Shares of limits ``(n_share, n_time)`` at y = (q, r, q'', momenta, Froude number) ``(n_y,
    n_time)``."""
    return np.asarray(_shares(body, friction, limits)[0](y, delta).full())


def limit_share_slopes(
    body: Chain, friction: Law, limits: PathLimits, y: np.ndarray, delta: float
) -> np.ndarray:
    """Derivatives of the shares along y, ``(n_share, n_y, n_time)``."""
    slopes = _shares(body, friction, limits)[1](y, delta).full()
    return np.asarray(slopes).reshape(-1, *y.shape)
