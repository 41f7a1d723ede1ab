"""What follows from a balance of a chain: velocities of tail and centre of mass, powers, first
derivatives. No CasADi."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from colloc.mechanics.balance import Moving, balance_jacobian, instant, link_stiffness, total_power
from colloc.mechanics.balance_results import BalancedMotion, BalanceSolution
from colloc.mechanics.damped_newton import groups
from colloc.mechanics.implicit_slopes import Load, implicit_changes
from colloc.mechanics.law import Law
from colloc.mechanics.links import Links
from colloc.mechanics.native_kernel import compiled_motion, native_kernel


def chain_motion(
    body: Links,
    friction: Law,
    angles: np.ndarray,
    rates: np.ndarray,
    delta: float,
    solved: BalanceSolution,
    load: np.ndarray | None = None,
) -> BalancedMotion:
    """The motion at instants that were solved for; arguments as for
    `colloc.mechanics.fixed_point.solve_balance`.

    Under a load the actuators' power is that of friction less the load's.
    """
    friction = body.law(friction)
    library, moving = (
        native_kernel(body, friction),
        Moving(body, friction, angles, rates, delta, load),
    )
    if library is None:
        return _named(_by_anchor(_values, (7,), moving, solved))
    return _named(
        compiled_motion(library, moving, solved.anchor, solved.anchor_velocity, with_slopes=False)[
            0
        ]
    )


def chain_slopes(
    body: Links,
    friction: Law,
    angles: np.ndarray,
    rates: np.ndarray,
    delta: float,
    solved: BalanceSolution,
    load: np.ndarray | None = None,
) -> tuple[BalancedMotion, np.ndarray]:
    """The motion, and derivatives ``(6, 2 n_joint, n_time)`` of (z, centre, power) with respect to
    (angles, rates); under a load two columns more, with respect to its components."""
    friction = body.law(friction)
    library, moving = (
        native_kernel(body, friction),
        Moving(body, friction, angles, rates, delta, load),
    )
    if library is not None:
        values, slopes = compiled_motion(
            library, moving, solved.anchor, solved.anchor_velocity, with_slopes=True
        )
        return _named(values), slopes
    slopes = _by_anchor(_slopes, (6, 2 * body.n_joint + 2), moving, solved)
    values = _by_anchor(_values, (7,), moving, solved)
    return _named(values), slopes[:, : 2 * body.n_joint] if load is None else slopes


def _named(values: np.ndarray) -> BalancedMotion:
    return BalancedMotion(values[:3], values[3:5], values[5], values[6])


def _by_anchor(
    of_one: Callable[[Moving, np.ndarray, int, np.ndarray], np.ndarray],
    rows: tuple[int, ...],
    moving: Moving,
    solved: BalanceSolution,
) -> np.ndarray:
    """What a function says of instants with a common anchor: of them, their load, the anchor and
    its velocity."""
    load = np.zeros((2, solved.anchor.size)) if moving.load is None else moving.load
    found = np.empty((*rows, solved.anchor.size))
    for link, at in groups(solved.anchor):
        found[..., at] = of_one(moving.at(at), load[:, at], link, solved.anchor_velocity[:, at])
    return found


def _values(moving: Moving, load: np.ndarray, anchor: int, z: np.ndarray) -> np.ndarray:
    body, friction, angles, rates, delta, _ = moving
    now = instant(body, friction, angles, rates, z, delta, anchor)
    (c, s, x, y), force, mass = now.posture, now.force, body.mass_column()
    fx = force.tangential * c - force.normal * s + mass * load[0]
    fy = force.tangential * s + force.normal * c + mass * load[1]
    half = 0.5 * body.length_column()
    actuator = np.zeros(z.shape[1])
    for joint in range(body.n_joint):
        ahead, at = slice(joint + 1, None), joint + 1
        arm_x, arm_y = x[ahead] - x[at] + half[at] * c[at], y[ahead] - y[at] + half[at] * s[at]
        actuator -= (arm_x * fy[ahead] - arm_y * fx[ahead] + force.couple[ahead]).sum(
            axis=0
        ) * rates[joint]
    tail = body.tail_velocity(now.posture, rates, z, anchor)
    centre = body.centre_velocity(now.posture, now.velocity)
    return np.concatenate([tail, *centre, total_power(now.velocity, force), actuator[None]])


def _slopes(moving: Moving, load: np.ndarray, anchor: int, z: np.ndarray) -> np.ndarray:
    body, friction, angles, rates, delta, _ = moving
    now = instant(body, friction, angles, rates, z, delta, anchor)
    n_joint, n_time = angles.shape
    behind = np.tril(np.ones((body.n_link, n_joint)), -1)
    none, mass = np.zeros_like(behind), body.mass_column()[:, :, None]
    still = np.zeros((body.n_link, 2))
    dphi = np.concatenate([behind, none, still], axis=1)[:, :, None]
    dw = np.repeat(
        np.concatenate([none, behind - behind[anchor], still], axis=1)[:, :, None], n_time, axis=2
    )
    along = np.concatenate([np.zeros((2 * n_joint, 2)), np.eye(2)])[None, :, :, None]
    path = body.weighted_path(anchor)
    d = implicit_changes(
        now.posture,
        now.velocity,
        now.force,
        link_stiffness(body, friction, now.velocity, np.full((1, n_time), delta)),
        balance_jacobian(body, friction, now.posture, now.velocity, np.full((1, n_time), delta)),
        lambda a: np.einsum("ik,kjt->ijt", path, a),
        dphi,
        dw,
        Load(mass * load[0], mass * load[1], mass * along[:, :, 0], mass * along[:, :, 1]),
    )
    tail = (d.vs[0], d.vn[0] - 0.5 * body.lengths[0] * d.w[0], d.w[0])
    return np.stack([*tail, (mass * d.vx).sum(axis=0), (mass * d.vy).sum(axis=0), d.power])
