"""Solver of the balance, batched over instants: tail velocities from shape and shape rates. No
CasADi.

The method is that of `colloc.mechanics.damped_newton`. Velocities are solved for at the midpoint of
the slowest link, the *anchor*: a link at stick moves at speeds of order delta, which the tail
velocity could only represent to 1e-16 in absolute terms. So forces stay accurate down to delta =
1e-14.

The steps are stated here in NumPy, for batches; the kernel (`colloc.mechanics.native_kernel`) takes
the same ones.
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
from colloc.mechanics.balance_results import BalanceSolution
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
"""Times delta, at which a balance is solved first that cannot be solved at delta itself."""
_AWAY = (100.0, 30.0, 10.0, 3.0, 1.0, 0.3, 0.1)
"""How far from an instant a balance is followed to it, in the time in which velocities change by
about delta."""


Found = tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray]
"""Tail velocity ``(3, n_time)``, residual, iterations, anchor ``(n_time,)``, its velocity ``(3,
n_time)``."""


class _Batch:
    """Instants that share a reference link: what an iteration evaluates on subsets of them, at
    deltas that are given."""

    def __init__(self, moving: Moving, reference: int | None) -> None:
        self.body, self.friction, self.angles, self.rates, _, self.load = moving
        self.reference = reference

    def at(self, select: np.ndarray, z: np.ndarray, delta: np.ndarray) -> Instant:
        return instant(
            self.body,
            self.friction,
            self.angles[:, select],
            self.rates[:, select],
            z,
            delta,
            self.reference,
        )

    def evaluate(self, select: np.ndarray, z: np.ndarray, delta: np.ndarray) -> Evaluated:
        """Links ``(7, n_link, n)``, posture, then velocity; net force and potential at z, those of
        the load with them."""
        now, body = self.at(select, z, delta), self.body
        force = net_force(now.posture, now.force)
        potential = (
            dissipation_potential(body, self.friction, now.velocity, delta)
            if self.friction.associated
            else None
        )
        if self.load is not None:
            load = self.load[:, select]
            force += load_wrench(body, now.posture, load)
            potential = (
                None
                if potential is None
                else potential - load_power(body, now.posture, now.velocity, load)
            )
        return np.stack([*now.posture, *now.velocity]), force, potential

    def matrix(self, links: np.ndarray, delta: np.ndarray, *, newton: bool) -> np.ndarray:
        matrix = balance_jacobian if newton else secant_matrix
        return matrix(
            self.body, self.friction, Posture(*links[:4]), LinkVelocity(*links[4:]), delta
        )

    def slowest(self, z: np.ndarray, delta: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The slowest link of every instant, and the velocity of its midpoint, for z in the batch's
        own reference."""
        velocity = self.at(np.arange(z.shape[1]), z, delta).velocity
        anchor = np.argmin(self.body.contact.slowest(velocity), axis=0)
        return anchor, self.rereferenced(z, delta, anchor)

    def rereferenced(self, z: np.ndarray, delta: np.ndarray, anchor: np.ndarray) -> np.ndarray:
        """Velocity ``(3, n)`` of the midpoints of the links `anchor`, for z in the batch's own
        reference."""
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
    """Tail velocities that put the body in force and torque balance, for a batch of instants.

    Parameters
    ----------
    body : Links
    friction : Law
    angles, rates : (n_joint, n_time)
        Joint angles [rad] and their rates [rad/time].
    delta : float
        Regularisation speed, > 0.
    load : (2, n_time), optional
        An outside force on the body in body-frame axes [weight], which its links share as they
        share the weight. Friction may be too weak to hold it: then nothing is found.
    start : (3, n_time), optional
        Tail velocities to start from; by default the links' mean rotation is taken out of a body at
        rest.
    tolerance : float
        Largest `BalanceSolution.residual` at which an instant counts as converged.
    max_iterations : int
        Steps allowed to an instant in each attempt.
    method : {"auto", "newton", "fixed_point", "direct", "natural"}
        "auto" damps Newton and falls back on the paper's fixed point: from the start, by natural
        steps, with each link at rest, from the balance of a larger delta, followed from instants
        beside it, and at last from afar. "direct" and "natural" are single attempts, the others are
        for comparison.

    Returns
    -------
    BalanceSolution
        With ``converged`` per instant; nothing is raised for an instant that fails (see
        `BalanceSolution.require`).

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
    settings = float(tolerance), int(max_iterations), method
    friction = body.law(friction)
    library = native_kernel(body, friction)

    solved = _numpy_balance if library is None else partial(compiled_balance, library)
    moving = Moving(body, friction, angles, rates, float(delta), load)
    found = (
        _balanced(solved, moving, start, *settings)
        if method == "auto"
        else solved(moving, start, *settings)
    )
    z, residual, iterations, anchor, velocity = found
    return BalanceSolution(
        z, residual, iterations, residual <= _reachable(moving, tolerance), anchor, velocity
    )


def _reachable(moving: Moving, tolerance: float) -> np.ndarray | float:
    """The tolerance, or what rounding leaves of the forces where that is more, ``(n_time,)``."""
    rounding = moving.body.contact.rounding
    if not rounding:
        return tolerance
    speed = np.maximum(np.abs(moving.rates).max(axis=0), np.finfo(float).tiny)
    return np.maximum(tolerance, rounding / relative_delta(moving.delta, speed)[0])


def _balanced(
    solved: Callable[..., Found],
    moving: Moving,
    start: np.ndarray | None,
    tolerance: float,
    max_iterations: int,
    method: str,
) -> Found:
    """What `solved` finds directly, then by natural steps, with each link at rest, from where
    friction is smoother, from beside it, and last by the method given."""
    found = solved(moving, start, tolerance, max_iterations, "direct")
    enough, contact = _reachable(moving, tolerance), moving.body.contact

    def smoother(there: Moving) -> np.ndarray:
        return _balanced(
            solved,
            there._replace(delta=_SMOOTHER * there.delta),
            None,
            tolerance,
            max_iterations,
            "direct",
        )[0]

    def followed(there: Moving, side: float) -> np.ndarray | None:
        fastest, z = np.maximum(np.abs(there.rates).max(axis=0), there.delta), None
        for away in _AWAY:
            beside = there._replace(
                angles=there.angles + side * away * there.delta / fastest**2 * there.rates
            )
            z = _balanced(solved, beside, z, tolerance, max_iterations, "direct")[0]
        return z

    def ways() -> Iterator[tuple[Callable[[Moving], np.ndarray | None], str]]:
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
            # past a fold there is another balance, of which instants before or after it may know
            # more
            for side in (-1.0, 1.0):
                yield partial(followed, side=side), "natural"
            yield lambda there: None, method

    for begun, how in ways():
        failed = np.flatnonzero(~(found[1] <= enough))
        if not failed.size:
            break
        there = moving.at(failed)
        new = solved(there, begun(there), tolerance, max_iterations, how)
        better = new[1] < found[1][failed]
        for old, some in zip(found, new, strict=True):
            old[..., failed[better]] = some[..., better]
    return found


def _numpy_balance(
    moving: Moving, start: np.ndarray | None, tolerance: float, max_iterations: int, method: str
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Arguments and results as those of `colloc.mechanics.native_kernel.compiled_balance`, which it
    is the reference of."""
    body, friction, angles, rates, delta, load = moving
    n_time = angles.shape[1]
    # work in units of the largest rate, where the law is homogeneous once delta scales along
    speed = np.abs(rates).max(axis=0)
    if load is not None:
        # at which a body creeps under a load, though its joints rest
        speed = np.maximum(speed, delta)
    speed[(speed == 0) | (friction.degree is None)] = 1.0
    if load is not None:
        load = load / speed ** (friction.degree or 0.0)
    scaled, scaled_delta = (
        moving._replace(rates=rates / speed, load=load),
        relative_delta(delta, speed),
    )
    anchor = np.full(n_time, body.n_link // 2)
    velocity = np.zeros((3, n_time))
    if start is not None:
        velocity = _Batch(scaled, TAIL).rereferenced(start / speed, scaled_delta, anchor)
    state = starting_state(anchor, velocity)

    def batch(members: np.ndarray, link: int) -> _Batch:
        return _Batch(scaled.at(members), link)

    solve(state, batch, body.n_link, scaled_delta, tolerance, max_iterations, method)

    tail_z = np.empty((3, n_time))
    for link, chosen in groups(state.anchor):
        posture = body.posture(angles[:, chosen], link)
        tail_z[:, chosen] = body.tail_velocity(
            posture, scaled.rates[:, chosen], state.velocity[:, chosen], link
        )
    return tail_z * speed, state.residual, state.iterations, state.anchor, state.velocity * speed
