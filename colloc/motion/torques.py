"""Joint torques of a chain with inertia.

With the kinetic energy T(q, r, z) of a body of mass 1 that moves with joint angles q, rates r and
tail velocity z, the equation of joint j is

    Fr (d/dt dT/dr_j - dT/dq_j) = M_j - (virtual power of friction and load, the tail resting).

Replays take the accelerations of the links by differences in time, programs by derivatives of z(q,
r, momenta); the two share no formula.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np

from colloc.gaits.regime import Regime
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


def accelerating_torques(
    body: Chain,
    friction: Law,
    path: Path,
    t: np.ndarray,
    states: np.ndarray,
    load: np.ndarray | None,
    *,
    delta: float,
    froude: float,
) -> np.ndarray:
    """Joint torques ``(n_joint, n_time)`` that accelerate the links of a gait with momenta `states`
    ``(3, n_time)`` at phases t; `load` ``(2, n_time)`` is a force on the centre of mass in body
    axes."""
    angles, rates = path(t)
    posture = body.posture(angles)
    link = body.velocity(posture, rates, tail_velocity(body, angles, rates, states))
    how: Any = {"delta": delta, "froude": froude}
    changes = momentum_rates(body, friction, angles, rates, states, **how).rates
    if load is not None:
        changes[:2] += load / froude

    def link_velocity(by: float) -> LinkVelocity:
        angles, rates = path(t + by)
        tail = tail_velocity(body, angles, rates, states + by * changes)
        return body.velocity(body.posture(angles), rates, tail)

    pairs = zip(link_velocity(-_STEP), link_velocity(_STEP), strict=True)
    growth = LinkVelocity(*((after - before) / (2 * _STEP) for before, after in pairs))
    return froude * inertial_moments(body, angles, link, growth)


def joint_torques(
    body: Chain,
    friction: Law,
    path: Path,
    t: np.ndarray,
    states: np.ndarray,
    load: np.ndarray | None,
    *,
    delta: float,
    froude: float,
) -> np.ndarray:
    """Joint torques ``(n_joint, n_time)`` against friction, load and inertia; arguments as of
    `accelerating_torques`."""
    angles, rates = path(t)
    forces = body.forces(friction, angles, rates, tail_velocity(body, angles, rates, states), delta)
    how: Any = {"delta": delta, "froude": froude}
    inertial = accelerating_torques(body, friction, path, t, states, load, **how)
    return joint_moments(body, angles, forces, load) + inertial


@lru_cache(maxsize=32)
def torque_function(body: Chain, friction: Law, regime: Regime, n_state: int) -> Any:
    """CasADi function (q, r, q'', states, delta, Froude number) to the joint torques ``(n_joint,
    1)`` at one time, in any unit of time; `states` are the momenta and, on a slope, the
    orientation."""
    import casadi as ca

    n = body.n_joint
    sizes = (("q", n), ("r", n), ("a", n), ("states", n_state), ("delta", 1), ("froude", 1))
    q, r, accelerations, states, delta, froude = symbols = [ca.SX.sym(*each) for each in sizes]
    momenta, theta = states[: len(STATES)], states[len(STATES) :]
    z = tail_velocity(body, q, r, momenta)
    changes = momentum_rates(body, friction, q, r, momenta, delta=delta, froude=froude).rates
    load = regime.pull(theta) if theta.numel() else None
    if load is not None:
        changes = changes + ca.vertcat(load / froude, 0)
    tail = ca.SX.sym("z", 3)
    energy = kinetic_energy(body, q, r, tail)
    momentum = ca.gradient(energy, r)
    z_rate = ca.jtimes(
        z, ca.vertcat(q, r, states), ca.vertcat(r, accelerations, changes, 0 * theta)
    )
    way = ca.vertcat(q, r, tail), ca.vertcat(r, accelerations, ca.SX.sym("z_rate", 3))
    inertia = ca.jtimes(momentum, *way) - ca.gradient(energy, q)
    inertia = ca.substitute(inertia, ca.vertcat(tail, way[1][-3:]), ca.vertcat(z, z_rate))
    forces = body.forces(friction, q, r, z, delta)
    torques = joint_moments(body, q, forces, load) + froude * inertia
    return ca.Function("torques", symbols, [torques], {"cse": True})


@lru_cache(maxsize=32)
def _shares(body: Chain, friction: Law, regime: Regime, limits: PathLimits, n_state: int) -> Any:
    """((q, r, q'', states, Froude number), delta) to shares of limits, and their derivatives."""
    import casadi as ca

    n = body.n_joint
    names = (("q", n), ("r", n), ("a", n), ("states", n_state), ("froude", 1))
    q, r, accelerations, states, froude = parts = [ca.SX.sym(*each) for each in names]
    y, delta = ca.vertcat(*parts), ca.SX.sym("delta")
    torques = torque_function(body, friction, regime, n_state)
    moments = torques(q, r, accelerations, states, delta, froude)
    out = limits.at(Instants(body, friction, q, r, delta, moments=moments))
    slope = ca.vec(ca.densify(ca.jacobian(out, y).T))
    values = ca.Function("shares", [y, delta], [out], {"cse": True})
    return values, ca.Function("share_slopes", [y, delta], [slope], {"cse": True})


def limit_shares(
    motion: tuple[Chain, Law, Regime], limits: PathLimits, y: tuple, delta: float
) -> np.ndarray:
    """Shares of limits ``(n_share, n_time)`` at (angles, rates, accelerations, states, Froude
    number)."""
    values, _ = _shares(*motion, limits, len(y[3]))
    return np.asarray(values(_stack(y), delta).full())


def limit_share_slopes(
    motion: tuple[Chain, Law, Regime], limits: PathLimits, y: tuple, delta: float
) -> np.ndarray:
    """Derivatives of the shares, ``(n_share, 3 n_joint + n_state + 1, n_time)``."""
    _, slopes = _shares(*motion, limits, len(y[3]))
    rows = _stack(y)
    return np.asarray(slopes(rows, delta).full()).reshape(-1, *rows.shape)


def _stack(y: tuple) -> np.ndarray:
    *rows, froude = y
    return np.concatenate([*rows, np.full((1, rows[0].shape[1]), froude)])
