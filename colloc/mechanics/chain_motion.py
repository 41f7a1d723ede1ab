r"""What follows from a balance: velocities of tail and centre of mass, powers, and their first derivatives. No CasADi.

A balanced velocity z solves R(z, y) = 0 with y = (joint angles, joint rates) and R the net force and torque, so

    dz/dy = -R_z^-1 R_y

and whatever depends on (z, y) changes by the chain rule (implicit function theorem). R and z are those of the anchor, the
slowest link, whose speed keeps its relative precision at any delta. The switch of a directional law is differentiated on
its current side.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from colloc.mechanics.balance import balance_jacobian, instant, total_power
from colloc.mechanics.body import Chain
from colloc.mechanics.compiled_balance import motion
from colloc.mechanics.damped_newton import solve3
from colloc.mechanics.fixed_point import BalanceSolution
from colloc.mechanics.friction import Friction
from colloc.mechanics.link_friction import link_force_jacobian
from colloc.mechanics.native_kernel import native_kernel

N_SLOPES = 6
"""Rows of `ChainMotion` that are differentiated: tail velocity, centre velocity, power."""


class ChainMotion(NamedTuple):
    """Motion of a balanced chain at instants.

    Attributes
    ----------
    z : (3, n_time)
        Tail velocity (u, v, omega) in the body frame.
    centre : (2, n_time)
        Velocity of the centre of mass, in the body frame.
    power : (n_time,)
        Power dissipated by friction.
    actuator_power : (n_time,)
        Power of the joints, from the moments of the friction on all links ahead; equals `power` in balance.
    """

    z: np.ndarray
    centre: np.ndarray
    power: np.ndarray
    actuator_power: np.ndarray


def chain_motion(
    body: Chain, friction: Friction, angles: np.ndarray, rates: np.ndarray, delta: float, solved: BalanceSolution
) -> ChainMotion:
    """The motion at instants that were solved for; arguments as for `colloc.mechanics.fixed_point.solve_balance`."""
    library, arguments = native_kernel(body), (body, friction, angles, rates, delta, solved.anchor, solved.anchor_velocity)
    values = _numpy_values(*arguments) if library is None else motion(library, *arguments, with_slopes=False)[0]
    return _named(values)


def chain_slopes(
    body: Chain, friction: Friction, angles: np.ndarray, rates: np.ndarray, delta: float, solved: BalanceSolution
) -> tuple[ChainMotion, np.ndarray]:
    """The motion, and derivatives ``(6, 2 n_joint, n_time)`` of (z, centre, power) with respect to (angles, rates)."""
    library, arguments = native_kernel(body), (body, friction, angles, rates, delta, solved.anchor, solved.anchor_velocity)
    if library is None:
        return _named(_numpy_values(*arguments)), _numpy_slopes(*arguments)
    values, slopes = motion(library, *arguments, with_slopes=True)
    assert slopes is not None
    return _named(values), slopes


def _named(values: np.ndarray) -> ChainMotion:
    return ChainMotion(values[:3], values[3:5], values[5], values[6])


def _by_anchor(
    of_one: Callable[..., np.ndarray],
    rows: tuple[int, ...],
    body: Chain,
    friction: Friction,
    angles: np.ndarray,
    rates: np.ndarray,
    delta: float,
    anchor: np.ndarray,
    anchor_velocity: np.ndarray,
) -> np.ndarray:
    result = np.empty((*rows, anchor.size))
    for link in np.unique(anchor):
        at = anchor == link
        result[..., at] = of_one(body, friction, angles[:, at], rates[:, at], delta, int(link), anchor_velocity[:, at])
    return result


def _numpy_values(body: Chain, *arguments) -> np.ndarray:
    return _by_anchor(_values, (7,), body, *arguments)


def _numpy_slopes(body: Chain, *arguments) -> np.ndarray:
    return _by_anchor(_slopes, (N_SLOPES, 2 * body.n_joint), body, *arguments)


def _values(
    body: Chain, friction: Friction, angles: np.ndarray, rates: np.ndarray, delta: float, anchor: int, z: np.ndarray
) -> np.ndarray:
    now = instant(body, friction, angles, rates, z, delta, anchor)
    (c, s, x, y), force = now.posture, now.force
    fx, fy = force.tangential * c - force.normal * s, force.tangential * s + force.normal * c
    half = 0.5 * body.length_column()
    actuator = np.zeros(z.shape[1])
    for joint in range(body.n_joint):
        ahead, at = slice(joint + 1, None), joint + 1
        arm_x, arm_y = x[ahead] - x[at] + half[at] * c[at], y[ahead] - y[at] + half[at] * s[at]
        actuator -= (arm_x * fy[ahead] - arm_y * fx[ahead] + force.couple[ahead]).sum(axis=0) * rates[joint]
    tail = body.tail_velocity(now.posture, rates, z, anchor)
    centre = body.centre_velocity(now.posture, now.velocity)
    return np.concatenate([tail, *centre, total_power(now.velocity, force), actuator[None]])


def _slopes(
    body: Chain, friction: Friction, angles: np.ndarray, rates: np.ndarray, delta: float, anchor: int, z: np.ndarray
) -> np.ndarray:
    """Axes of all arrays: (link, joint angle or joint rate, time)."""
    now = instant(body, friction, angles, rates, z, delta, anchor)
    c, s, x, y = (a[:, None] for a in now.posture)
    vs, vn, w = (a[:, None] for a in now.velocity)
    fs, fn, couple = (a[:, None] for a in now.force)
    n_joint, n_time = angles.shape
    behind = np.tril(np.ones((body.n_link, n_joint)), -1)
    none = np.zeros_like(behind)
    dphi = np.concatenate([behind, none], axis=1)[:, :, None]
    dw = np.concatenate([none, behind - behind[anchor]], axis=1)[:, :, None] * np.ones(n_time)
    path = body.weighted_path(anchor)

    def summed(a: np.ndarray) -> np.ndarray:
        return np.einsum("ik,kjt->ijt", path, a)

    dx, dy = -summed(s * dphi), summed(c * dphi)
    dvx, dvy = -summed(dw * s + w * c * dphi), summed(dw * c - w * s * dphi)
    dvs, dvn = dvx * c + dvy * s + vn * dphi, dvy * c - dvx * s - vs * dphi
    K = [[a[:, None] for a in row] for row in link_force_jacobian(*now.velocity, body.length_column(), delta, friction)]

    def force_change(*d: np.ndarray) -> list[np.ndarray]:
        return [-(row[0] * d[0] + row[1] * d[1] + row[2] * d[2]) for row in K]

    fx, fy = fs * c - fn * s, fs * s + fn * c
    dfs, dfn, dcouple = force_change(dvs, dvn, dw)
    dfx, dfy = dfs * c - dfn * s - fy * dphi, dfs * s + dfn * c + fx * dphi
    torque = dx * fy - dy * fx + x * dfy - y * dfx + dcouple
    net = np.stack([dfx.sum(axis=0), dfy.sum(axis=0), torque.sum(axis=0)])
    left = balance_jacobian(body, friction, now.posture, now.velocity, np.full((1, n_time), delta))
    dz = np.stack([solve3(left, net[:, j]) for j in range(2 * n_joint)], axis=1)

    dvx, dvy = dvx + dz[0] - y * dz[2], dvy + dz[1] + x * dz[2]
    dvs, dvn = dvs + c * dz[0] + s * dz[1] + (x * s - y * c) * dz[2], dvn + c * dz[1] - s * dz[0] + (x * c + y * s) * dz[2]
    dw = dw + dz[2]
    dfs, dfn, dcouple = force_change(dvs, dvn, dw)
    power = -(dfs * vs + dfn * vn + dcouple * w + fs * dvs + fn * dvn + couple * dw).sum(axis=0)
    length = body.length_column()[:, :, None]
    tail = (dvs[0], dvn[0] - 0.5 * body.lengths[0] * dw[0], dw[0])
    return np.stack([*tail, (length * dvx).sum(axis=0), (length * dvy).sum(axis=0), power])
