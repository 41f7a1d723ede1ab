"""The motion that follows from a balance, and its derivatives: by the compiled kernel; without it
by NumPy, and by CasADi from the implicit function theorem."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np

from colloc.mechanics.actuators import moments_of_links
from colloc.mechanics.balance import Moving, instant, load_wrench, net_force, total_power
from colloc.mechanics.bodies import BalancedMotion, BalanceSolution, Body
from colloc.mechanics.damped_newton import groups
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
    """The motion of a chain; under a load the actuators' power is that of friction less the
    load's. Arguments as for `colloc.mechanics.fixed_point.solve_balance`."""
    moving = Moving(body, body.law(friction), angles, rates, delta, load)
    if (library := native_kernel(body, moving.friction)) is not None:
        return _motion(compiled_motion(library, moving, solved, derivatives=False)[0])
    return _numpy_motion(moving, solved)


def motion_and_derivatives(
    body: Body | Links,
    friction: Law,
    angles: np.ndarray,
    rates: np.ndarray,
    delta: float,
    solved: BalanceSolution,
    load: np.ndarray | None = None,
) -> tuple[BalancedMotion, np.ndarray]:
    """The motion, and derivatives ``(6, 2 n_joint, n_time)`` of (tail velocity, velocity of the
    centre, power) with respect to (angles, rates); under a load two columns more, with respect to
    its components."""
    y = np.concatenate([angles, rates] if load is None else [angles, rates, load])
    if not isinstance(body, Links):
        slopes = _derivatives(body, friction, None, pulled=False)(y, solved.z, delta)
        return body.motion(friction, angles, rates, delta, solved), slopes
    moving = Moving(body, body.law(friction), angles, rates, delta, load)
    if (library := native_kernel(body, moving.friction)) is not None:
        values, slopes = compiled_motion(library, moving, solved, derivatives=True)
        return _motion(values), slopes
    slopes = np.empty((6, *y.shape))
    for link, at in groups(solved.anchor):
        evaluate = _derivatives(body, moving.friction, link, pulled=load is not None)
        slopes[..., at] = evaluate(y[:, at], solved.anchor_velocity[:, at], delta)
    return _numpy_motion(moving, solved), slopes


def _motion(values: np.ndarray) -> BalancedMotion:
    return BalancedMotion(values[:3], values[3:5], values[5], values[6])


def _numpy_motion(moving: Moving, solved: BalanceSolution) -> BalancedMotion:
    body, friction, _, _, delta, _ = moving
    values = np.empty((4, solved.anchor.size))
    for link, at in groups(solved.anchor):  # seen from what rests, which loses no digits
        there, z = moving.at(at), solved.anchor_velocity[:, at]
        now = instant(body, friction, there.angles, there.rates, z, delta, link)
        moments = moments_of_links(body, there.angles, now.force, there.load)
        spent = (moments * there.rates).sum(axis=0, keepdims=True)
        centre = body.centre_velocity(now.posture, now.velocity)
        values[:, at] = np.concatenate([*centre, total_power(now.velocity, now.force), spent])
    return _motion(np.concatenate([solved.z, values]))


@lru_cache(maxsize=128)
def _derivatives(body: Any, friction: Law, anchor: int | None, *, pulled: bool) -> Any:
    """Derivatives along (angles, rates, load) at the velocity of a chain's anchor, or of a tail."""
    from colloc.numerics.implicit import implicit_derivatives  # loads CasADi

    n = body.n_joint

    def equations(y: Any, z: Any, delta: Any) -> tuple[Any, Any]:
        angles, rates, load = y[:n], y[n : 2 * n], y[2 * n :]
        if anchor is None:
            slides = body.sliding(friction, angles, rates, z, delta)
            return [z, slides.centre, slides.power], slides.force
        posture, velocity, force = instant(body, friction, angles, rates, z, delta, anchor)
        balance = net_force(posture, force)
        if pulled:
            balance += load_wrench(body, posture, load)
        tail = body.tail_velocity(posture, rates, z, anchor)
        centre = body.centre_velocity(posture, velocity)
        return [tail, *centre, total_power(velocity, force)], balance

    return implicit_derivatives(equations, 2 * n + 2 * pulled, 3)
