"""Balance of chains and the motion that follows: by the compiled kernel, or by NumPy and CasADi.

The NumPy solver (`colloc.mechanics.damped_newton`) and the compiled kernel take the same steps.
Velocities are solved for at the midpoint of the slowest link, the *anchor*, so forces stay accurate
down to delta = 1e-14.
"""

from __future__ import annotations

from functools import lru_cache, partial
from typing import Any

import numpy as np

from colloc.mechanics.balance import (
    TAIL,
    Instant,
    Moving,
    Posture,
    balance_jacobian,
    is_chain,
    load_wrench,
    moments_of_links,
    net_force,
    total_power,
)
from colloc.mechanics.bodies import BalancedMotion, BalanceSolution
from colloc.mechanics.damped_newton import METHODS, State, groups, relative_delta, solve
from colloc.mechanics.friction import LinkVelocity
from colloc.mechanics.law import Law
from colloc.mechanics.native_kernel import call_for_all, native_kernel
from colloc.system.arguments import check_finite, shown
from colloc.system.errors import ProblemError

_SMOOTHER = 2.0
"""Factor on delta for an initial guess where a balance cannot be solved directly."""
_AWAY = (100.0, 30.0, 10.0, 3.0, 1.0, 0.3, 0.1)
"""Steps by which a balance is followed to a time point, in the time in which velocities change by
about delta."""
Attempt = tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray]
"""Tail velocity, residual, iterations, anchor, its velocity."""


def solve_balance(
    body: Any,
    friction: Law,
    angles: np.ndarray,
    rates: np.ndarray,
    delta: float,
    *,
    load: np.ndarray | None = None,
    start: np.ndarray | None = None,
    tolerance: float = 1e-11,
    max_iterations: int = 2000,
    method: str = "auto",
) -> BalanceSolution:
    """Return the tail velocities that put a chain in force and torque balance.

    Parameters
    ----------
    body : Chain
    friction : Law
    angles, rates : (n_joint, n_time)
        Joint angles [rad] and their rates [rad/time].
    delta : float
        Regularisation speed, > 0.
    load : (2, n_time), optional
        Outside force on the body in body-frame axes [weight], shared by its links as they share the
        mass. Friction may be too weak to hold it: then no balance is found.
    start : (3, n_time), optional
        Tail velocities to start from; by default a body at rest, less its links' mean rotation.
    tolerance : float
        Largest `BalanceSolution.residual` of a converged time point.
    max_iterations : int
        Steps of a time point in each attempt.
    method : {"auto", "newton", "fixed_point", "direct", "natural"}
        "auto" damps Newton and falls back on the paper's fixed point: from the start, by natural
        steps, with each link at rest, from the balance of a larger delta, followed from
        neighbouring time points, and at last from afar. The others are single attempts, for
        comparison.

    Returns
    -------
    BalanceSolution
        With ``converged`` per time point; see `BalanceSolution.require`.

    Raises
    ------
    ProblemError
        For arrays of wrong shape or kind, non-finite numbers, or delta or tolerance that are not
        positive.

    Examples
    --------
    >>> import colloc
    >>> import numpy as np
    >>> angles, rates = np.array([[0.5], [0.2]]), np.array([[1.0], [0.0]])
    >>> solved = colloc.solve_balance(colloc.Chain(), colloc.Friction(), angles, rates, delta=1e-6)
    >>> solved.require().z.round(3).ravel().tolist()
    [0.02, 0.255, -0.887]
    """
    if isinstance(body, type) or not is_chain(body):
        raise ProblemError(f"body must be a Chain, not {shown(body)}.")
    if body.n_joint != body.n_link - 1:
        raise ProblemError(
            f"the shape coordinates of {type(body).__name__} are not its {body.n_link - 1} joints: "
            f"use its solve()."
        )
    angles = _check_array("angles", angles, body.n_joint)
    n_time = angles.shape[1]
    rates = _check_array("rates", rates, body.n_joint, n_time)
    check_finite(positive=True, delta=delta, tolerance=tolerance)
    if method not in METHODS:
        raise ProblemError(f"method must be one of {METHODS}, not {method!r}.")
    start = None if start is None else _check_array("start", start, 3, n_time)
    load = None if load is None else _check_array("load", load, 2, n_time)
    moving = Moving(body, body.law(friction), angles, rates, float(delta), load)
    search = _search if method == "auto" else _attempt
    z, residual, iterations, anchor, velocity = search(
        moving, start, float(tolerance), int(max_iterations), method
    )
    converged = residual <= _reachable(moving, tolerance)
    return BalanceSolution(z, residual, iterations, converged, anchor, velocity)


def _check_array(name: str, values: np.ndarray, rows: int, n_time: int | None = None) -> np.ndarray:
    try:
        array = np.atleast_2d(np.asarray(values))
    except ValueError:  # rows of different lengths
        array = np.array([[None]])
    shape = rows, array.shape[-1] if n_time is None else n_time
    is_real = array.dtype.kind in "iuf"
    if not is_real or array.shape != shape or not np.isfinite(array).all():
        given = f"shape {array.shape}" if is_real and array.shape != shape else f"{values!r:.80}"
        raise ProblemError(
            f"{name} must be finite real numbers of shape ({rows}, {n_time or 'n_time'}), "
            f"not {given}."
        )
    return array.astype(float)


def _reachable(moving: Moving, tolerance: float) -> np.ndarray | float:
    """The tolerance, or what rounding leaves of the forces where that is more, ``(n_time,)``."""
    rounding = moving.body.contact.rounding(moving.friction)
    if not rounding:
        return tolerance
    speed = np.maximum(np.abs(moving.rates).max(axis=0), np.finfo(float).tiny)
    return np.maximum(tolerance, rounding / relative_delta(moving.delta, speed)[0])


def _search(
    moving: Moving, start: np.ndarray | None, tolerance: float, max_iterations: int, method: str
) -> Attempt:
    best = _attempt(moving, start, tolerance, max_iterations, "direct")
    enough, contact = _reachable(moving, tolerance), moving.body.contact

    def direct(there, start):
        return _search(there, start, tolerance, max_iterations, "direct")[0]

    def continuation(there, side):
        fastest, z = np.maximum(np.abs(there.rates).max(axis=0), there.delta), None
        for away in _AWAY:
            shift = side * away * there.delta / fastest**2 * there.rates
            z = direct(there._replace(angles=there.angles + shift), z)
        return z

    def guesses():
        # beside a fold, or with feet nearly on a line, the residual has valleys in which it must
        # rise before it falls
        yield lambda there: best[0][:, failed], "natural"
        for how in ("direct", "natural"):
            for link in contact.rests:
                yield partial(Moving.at_rest, link=link), how
        if moving.load is None and moving.delta < np.abs(moving.rates).max(initial=0.0):
            # several rest nearly, each where the others let it
            smoother = moving.delta * _SMOOTHER
            yield lambda there: direct(there._replace(delta=smoother), None), "natural"
        if method != "direct":
            # past a fold there is another balance, of which neighbouring times may know more
            for side in (-1.0, 1.0):
                yield partial(continuation, side=side), "natural"
            yield lambda there: None, method

    for guess, how in guesses():
        failed = np.flatnonzero(~(best[1] <= enough))
        if not failed.size:
            break
        there = moving.at(failed)
        new = _attempt(there, guess(there), tolerance, max_iterations, how)
        better = new[1] < best[1][failed]
        for old, some in zip(best, new, strict=True):
            old[..., failed[better]] = some[..., better]
    return best


class _Batch:
    def __init__(self, moving: Moving, reference: int) -> None:
        self.moving, self.friction, self.reference = moving, moving.friction, reference

    def evaluate(
        self, select: np.ndarray, z: np.ndarray, delta: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray | None]:
        """Posture and velocity of the links ``(7, n_link, n)``; net force and potential."""
        moving, potential = self.moving.at(select), None
        body, load = moving.body, moving.load
        posture, velocity, link_force = moving.instant(z, self.reference, delta)
        force = net_force(posture, link_force)
        if self.friction.associated:
            potential = body.contact.potential(self.friction, velocity, delta).sum(axis=0)
        if load is not None:
            force += load_wrench(body, posture, load)
            if potential is not None:
                vx, vy = body.centre_velocity(posture, velocity)
                potential = potential - (load[0] * vx + load[1] * vy)[0]
        return np.stack([*posture, *velocity]), force, potential

    def matrix(self, links: np.ndarray, delta: np.ndarray, *, newton: bool) -> np.ndarray:
        at = Posture(*links[:4]), LinkVelocity(*links[4:])
        return balance_jacobian(self.moving.body, self.friction, *at, delta, secant=not newton)

    def slowest(self, z: np.ndarray, delta: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        now = self.moving.instant(z, self.reference, delta)
        anchor = np.argmin(self.moving.body.contact.slowest(now.velocity), axis=0)
        return anchor, _midpoint_velocity(now, anchor)


def _midpoint_velocity(now: Instant, link: np.ndarray) -> np.ndarray:
    c, s, *_, vs, vn, w = (
        np.take_along_axis(row, link[None], 0)[0] for row in (*now.posture, *now.velocity)
    )
    return np.stack([vs * c - vn * s, vs * s + vn * c, w])


def _attempt(
    moving: Moving, start: np.ndarray | None, tolerance: float, max_iterations: int, method: str
) -> Attempt:
    """By the compiled kernel, or the same steps by NumPy."""
    if (library := native_kernel(moving.body, moving.friction)) is not None:
        n_time = moving.angles.shape[1]
        z, velocity, residual = np.empty((3, n_time)), np.empty((3, n_time)), np.empty(n_time)
        iterations, anchor = np.empty((2, n_time), dtype=np.int64)
        settings = moving.load, start, tolerance, max_iterations, METHODS.index(method)
        outputs = z, residual, iterations, anchor, velocity
        call_for_all(library.colloc_balance, moving, *settings, *outputs)
        return outputs
    body, friction, angles, rates, delta, load = moving
    n_time = angles.shape[1]
    # work in units of the largest rate, where the law is homogeneous once delta scales along
    speed = np.abs(rates).max(axis=0)
    if load is not None:
        # a body creeps under a load at the speed delta, though its joints rest
        speed = np.maximum(speed, delta)
    speed[(speed == 0) | (friction.degree is None)] = 1.0
    if load is not None:
        load = load / speed ** (friction.degree or 0.0)
    scaled = moving._replace(rates=rates / speed, load=load)
    scaled_delta = relative_delta(delta, speed)
    anchor, velocity = np.full(n_time, body.n_link // 2), np.zeros((3, n_time))
    if start is not None:
        velocity = _midpoint_velocity(scaled.instant(start / speed, TAIL, scaled_delta), anchor)
    state = State(anchor, velocity)

    def batch(members, link):
        return _Batch(scaled.at(members), link)

    solve(state, batch, body.n_link, scaled_delta, tolerance, max_iterations, method)
    z = np.empty((3, n_time))
    for link, at in groups(state.anchor):
        posture, velocity = body.posture(angles[:, at], link), state.velocity[:, at]
        z[:, at] = body.tail_velocity(posture, scaled.rates[:, at], velocity, link)
    return z * speed, state.residual, state.iterations, state.anchor, state.velocity * speed


def chain_motion(
    body: Any,
    friction: Law,
    angles: np.ndarray,
    rates: np.ndarray,
    delta: float,
    solved: BalanceSolution,
    load: np.ndarray | None = None,
) -> BalancedMotion:
    """The motion of a chain; the power of a load counts for the actuators'."""
    return _following(Moving(body, body.law(friction), angles, rates, delta, load), solved)[0]


def motion_and_derivatives(
    body: Any,
    friction: Law,
    angles: np.ndarray,
    rates: np.ndarray,
    delta: float,
    solved: BalanceSolution,
    load: np.ndarray | None = None,
) -> tuple[BalancedMotion, np.ndarray]:
    """The motion of a `Body`, and derivatives ``(6, 2 n_joint, n_time)`` of (tail velocity,
    velocity of the centre, power) with respect to (angles, rates); under a load two columns more,
    with respect to its components."""
    if is_chain(body):
        moving = Moving(body, body.law(friction), angles, rates, delta, load)
        return _following(moving, solved, differentiated=True)
    slopes = _derivatives(body, friction, TAIL, pulled=False)
    motion = body.motion(friction, angles, rates, delta, solved)
    return motion, slopes(np.concatenate([angles, rates]), solved.z, delta)


def _following(
    moving: Moving, solved: BalanceSolution, *, differentiated: bool = False
) -> tuple[BalancedMotion, np.ndarray]:
    body, friction, angles, rates, delta, load = moving
    n_time, columns = angles.shape[1], 2 * len(angles) + 2 * (load is not None)
    load = None if load is None else np.asarray(load, dtype=float)
    values = np.empty((7, n_time))
    slopes = np.empty((6, columns, n_time) if differentiated else 0)
    if (library := native_kernel(body, friction)) is not None:
        arguments = load, solved.anchor, solved.anchor_velocity, values
        call_for_all(library.colloc_motion, moving, *arguments, slopes if differentiated else None)
        return BalancedMotion(values[:3], values[3:5], values[5], values[6]), slopes
    y = np.concatenate([angles, rates] if load is None else [angles, rates, load])
    values[:3] = solved.z
    for link, at in groups(solved.anchor):  # seen from what rests, which loses no digits
        there, z = moving.at(at), solved.anchor_velocity[:, at]
        posture, velocity, force = there.instant(z, link)
        moments = moments_of_links(body, there.angles, force, there.load)
        values[3:5, at] = np.concatenate(body.centre_velocity(posture, velocity))
        values[5, at] = total_power(velocity, force)
        values[6, at] = (moments * there.rates).sum(axis=0)
        if differentiated:
            evaluate = _derivatives(body, friction, link, pulled=load is not None)
            slopes[..., at] = evaluate(y[:, at], z, delta)
    return BalancedMotion(values[:3], values[3:5], values[5], values[6]), slopes


@lru_cache(maxsize=128)
def _derivatives(body: Any, friction: Law, anchor: int | None, *, pulled: bool) -> Any:
    """By the implicit function theorem, at the velocity of a chain's anchor, or of a tail."""
    from colloc.numerics.repeated import implicit_derivatives  # loads CasADi

    n = body.n_joint

    def equations(y, z, delta):
        angles, rates, load = y[:n], y[n : 2 * n], y[2 * n :]
        if anchor is TAIL:
            slides = body.sliding(friction, angles, rates, z, delta)
            return [z, slides.centre, slides.power], slides.force
        slides = body.sliding(friction, angles, rates, z, delta, anchor)
        posture = body.posture(angles, anchor)
        balance = slides.force + (load_wrench(body, posture, load) if pulled else 0.0)
        return [body.tail_velocity(posture, rates, z, anchor), slides.centre, slides.power], balance

    return implicit_derivatives(equations, 2 * n + 2 * pulled, 3)
