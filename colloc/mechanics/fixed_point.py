"""Solver of the balance of chains: tail velocities from shapes and shape rates.

The NumPy solver (`colloc.mechanics.damped_newton`) and the compiled kernel take the same steps.
Velocities are solved for at the midpoint of the slowest link, the *anchor*, so forces stay accurate
down to delta = 1e-14.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial

import numpy as np

from colloc.mechanics.balance import (
    Instant,
    Moving,
    balance_jacobian,
    dissipation_potential,
    instant,
    load_power,
    load_wrench,
    net_force,
    secant_matrix,
)
from colloc.mechanics.bodies import BalanceSolution
from colloc.mechanics.damped_newton import (
    METHODS,
    Evaluated,
    groups,
    relative_delta,
    solve,
    starting_state,
)
from colloc.mechanics.law import Law
from colloc.mechanics.links import TAIL, Links, LinkVelocity, Posture
from colloc.mechanics.native_kernel import compiled_balance, native_kernel
from colloc.system.arguments import check_finite
from colloc.system.errors import ProblemError

_SMOOTHER = 2.0
"""Factor on delta for an initial guess where a balance cannot be solved directly."""
_AWAY = (100.0, 30.0, 10.0, 3.0, 1.0, 0.3, 0.1)
"""Steps by which a balance is followed to a time point, in the time in which velocities change by
about delta."""
Found = tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray]
"""Tail velocity ``(3, n_time)``, residual, iterations, anchor ``(n_time,)``, its velocity ``(3,
n_time)``."""


class _Batch:
    """Time points that share a reference link."""

    def __init__(self, moving: Moving, reference: int | None) -> None:
        self.moving, self.friction, self.reference = moving, moving.friction, reference

    def at(self, select: np.ndarray, z: np.ndarray, delta: np.ndarray) -> Instant:
        body, friction, angles, rates, *_ = self.moving
        return instant(
            body, friction, angles[:, select], rates[:, select], z, delta, self.reference
        )

    def evaluate(self, select: np.ndarray, z: np.ndarray, delta: np.ndarray) -> Evaluated:
        """Posture and velocity of the links ``(7, n_link, n)``; net force and potential."""
        now, body = self.at(select, z, delta), self.moving.body
        force, potential = net_force(now.posture, now.force), None
        if self.friction.associated:
            potential = dissipation_potential(body, self.friction, now.velocity, delta)
        if self.moving.load is not None:
            load = self.moving.load[:, select]
            force += load_wrench(body, now.posture, load)
            if potential is not None:
                potential = potential - load_power(body, now.posture, now.velocity, load)
        return np.stack([*now.posture, *now.velocity]), force, potential

    def matrix(self, links: np.ndarray, delta: np.ndarray, *, newton: bool) -> np.ndarray:
        matrix = balance_jacobian if newton else secant_matrix
        at = Posture(*links[:4]), LinkVelocity(*links[4:])
        return matrix(self.moving.body, self.friction, *at, delta)

    def slowest(self, z: np.ndarray, delta: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        velocity = self.at(np.arange(z.shape[1]), z, delta).velocity
        anchor = np.argmin(self.moving.body.contact.slowest(velocity), axis=0)
        return anchor, self.rereference(z, delta, anchor)

    def rereference(self, z: np.ndarray, delta: np.ndarray, anchor: np.ndarray) -> np.ndarray:
        """Velocity ``(3, n)`` of the midpoints of the links `anchor`."""
        now = self.at(np.arange(z.shape[1]), z, delta)
        vs, vn, w = (np.take_along_axis(a, anchor[None], 0)[0] for a in now.velocity)
        c, s = (np.take_along_axis(a, anchor[None], 0)[0] for a in now.posture[:2])
        return np.stack([vs * c - vn * s, vs * s + vn * c, w])


def _real(name: str, values: np.ndarray) -> np.ndarray:
    """A two-dimensional array of floats, or a `ProblemError`."""
    try:
        array = np.atleast_2d(np.asarray(values))
    except ValueError:  # rows of different lengths
        array = np.array([[None]])
    if array.dtype.kind not in "iuf":
        raise ProblemError(f"{name} must be an array of real numbers, not {values!r:.80}.")
    return array.astype(float)


def solve_balance(
    body: Links,
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
    angles, rates = _real("angles", angles), _real("rates", rates)
    n_time = angles.shape[1]
    if body.n_joint != body.n_link - 1:
        raise ProblemError(
            f"the shape coordinates of {type(body).__name__} are not its {body.n_link - 1} joints: "
            f"use its solve()."
        )
    if angles.shape != (body.n_joint, n_time) or rates.shape != angles.shape:
        raise ProblemError(
            f"angles and rates must both have shape (n_joint, n_time) = ({body.n_joint}, n), "
            f"not {angles.shape} and {rates.shape}."
        )
    check_finite(positive=True, delta=delta, tolerance=tolerance)
    if method not in METHODS:
        raise ProblemError(f"method must be one of {METHODS}, not {method!r}.")
    if not (np.isfinite(angles).all() and np.isfinite(rates).all()):
        raise ProblemError("angles and rates must be finite.")
    if start is not None:
        start = _real("start", start)
        if start.shape != (3, n_time) or not np.isfinite(start).all():
            raise ProblemError(f"start must be finite with shape (3, {n_time}).")
    if load is not None:
        load = _real("load", load)
        if load.shape != (2, n_time) or not np.isfinite(load).all():
            raise ProblemError(f"load must be finite with shape (2, {n_time}).")
    friction = body.law(friction)
    library = native_kernel(body, friction)
    attempt = _numpy_balance if library is None else partial(compiled_balance, library)
    moving = Moving(body, friction, angles, rates, float(delta), load)
    search = partial(_search, attempt) if method == "auto" else attempt
    z, residual, iterations, anchor, velocity = search(
        moving, start, float(tolerance), int(max_iterations), method
    )
    converged = residual <= _reachable(moving, tolerance)
    return BalanceSolution(z, residual, iterations, converged, anchor, velocity)


def _reachable(moving: Moving, tolerance: float) -> np.ndarray | float:
    """The tolerance, or what rounding leaves of the forces where that is more, ``(n_time,)``."""
    rounding = moving.body.contact.rounding
    if not rounding:
        return tolerance
    speed = np.maximum(np.abs(moving.rates).max(axis=0), np.finfo(float).tiny)
    return np.maximum(tolerance, rounding / relative_delta(moving.delta, speed)[0])


def _search(
    attempt: Callable[..., Found],
    moving: Moving,
    start: np.ndarray | None,
    tolerance: float,
    max_iterations: int,
    method: str,
) -> Found:
    """Attempts from one initial guess after another, until all time points converge."""
    found = attempt(moving, start, tolerance, max_iterations, "direct")
    enough, contact = _reachable(moving, tolerance), moving.body.contact

    def direct(there: Moving, start: np.ndarray | None) -> np.ndarray:
        return _search(attempt, there, start, tolerance, max_iterations, "direct")[0]

    def smoother(there: Moving) -> np.ndarray:
        return direct(there._replace(delta=_SMOOTHER * there.delta), None)

    def followed(there: Moving, side: float) -> np.ndarray | None:
        fastest, z = np.maximum(np.abs(there.rates).max(axis=0), there.delta), None
        for away in _AWAY:
            shift = side * away * there.delta / fastest**2 * there.rates
            z = direct(there._replace(angles=there.angles + shift), z)
        return z

    def guesses() -> Iterator[tuple[Callable[[Moving], np.ndarray | None], str]]:
        # beside a fold, or with feet nearly on a line, the residual has valleys in which it must
        # rise before it falls
        yield lambda there: found[0][:, failed], "natural"
        for how in ("direct", "natural"):
            for link in contact.rests:
                yield partial(Moving.at_rest, link=link), how
        if moving.load is None and moving.delta < np.abs(moving.rates).max(initial=0.0):
            # several rest nearly, each where the others let it
            yield smoother, "natural"
        if method != "direct":
            # past a fold there is another balance, of which neighbouring times may know more
            for side in (-1.0, 1.0):
                yield partial(followed, side=side), "natural"
            yield lambda there: None, method

    for guess, how in guesses():
        failed = np.flatnonzero(~(found[1] <= enough))
        if not failed.size:
            break
        there = moving.at(failed)
        new = attempt(there, guess(there), tolerance, max_iterations, how)
        better = new[1] < found[1][failed]
        for old, some in zip(found, new, strict=True):
            old[..., failed[better]] = some[..., better]
    return found


def _numpy_balance(
    moving: Moving, start: np.ndarray | None, tolerance: float, max_iterations: int, method: str
) -> Found:
    """The reference of `colloc.mechanics.native_kernel.compiled_balance`."""
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
        velocity = _Batch(scaled, TAIL).rereference(start / speed, scaled_delta, anchor)
    state = starting_state(anchor, velocity)

    def batch(members: np.ndarray, link: int) -> _Batch:
        return _Batch(scaled.at(members), link)

    solve(state, batch, body.n_link, scaled_delta, tolerance, max_iterations, method)
    z = np.empty((3, n_time))
    for link, at in groups(state.anchor):
        posture, velocity = body.posture(angles[:, at], link), state.velocity[:, at]
        z[:, at] = body.tail_velocity(posture, scaled.rates[:, at], velocity, link)
    return z * speed, state.residual, state.iterations, state.anchor, state.velocity * speed
