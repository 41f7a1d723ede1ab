"""Damped Newton with a fixed-point safeguard, batched over instants, for three rigid velocities. No
CasADi.

An associated law (`colloc.mechanics.law`) is the gradient of a strictly convex, coercive
dissipation potential, so Armijo-damped Newton on that potential converges from any start. Other
laws have no potential; there Newton steps are taken while they reduce the residual. In both cases
the paper's fixed point (which minimises a majorant of the potential: iteratively reweighted least
squares) is the safeguard when a Newton step fails. What ends in a valley of the residual goes on by
"natural" steps: one counts if the next one, taken with the same matrix, is shorter (Deuflhard,
Numer. Math. 22, 1974), so the residual may rise.

What a body is made of (links, panels of a smooth curve) is the business of the `Batch`. Velocities
are those of a *reference* of the body, and the iteration moves it to the slowest one, the *anchor*:
a stretch at stick moves at speeds of order delta, which a velocity of order one could only
represent to 1e-16 in absolute terms.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from colloc.mechanics.law import Law

_ARMIJO = 1e-4
_NATURAL_GAIN = 0.25
_BACKTRACKING = (0.5,) * 4 + (0.1,) * 8
_SHORT_BACKTRACKING = (0.5, 0.25)
"""Without a potential a Newton direction may not descend at all, and shorter steps than these creep
along a valley of the residual for a hundred iterations; the fixed point leaves it (2 to 3 times
less time at (10, 1, 1), (0.5, 1, 5), (1.7, 1, 1.3) than with 0.25 and 0.1)."""
_ROUNDING = 8e-16
_FIXED_POINT_STEPS_AFTER_FAILURE = 5
_DIRECT_ITERATIONS = 40
"""Steps before the regularisation is followed down instead."""
_LADDER_ITERATIONS = 240
_DRY, _VISCOUS = 1e-100, 1e8
_TINY, _HUGE = np.finfo(float).tiny, np.finfo(float).max
METHODS = ("auto", "newton", "fixed_point", "direct", "natural")


Evaluated = tuple[np.ndarray, np.ndarray, np.ndarray | None]
"""Body state ``(k, n_body, n)``, net force ``(3, n)`` and, of an associated law, the potential
``(n,)`` whose gradient is minus that force."""


class Batch(Protocol):
    """Instants that share a reference: what the iteration evaluates on subsets of them."""

    @property
    def friction(self) -> Law: ...

    def evaluate(self, select: np.ndarray, z: np.ndarray, delta: np.ndarray) -> Evaluated:
        """What there is at z ``(3, n)`` of the selected instants."""

    def matrix(self, state: np.ndarray, delta: np.ndarray, *, newton: bool) -> np.ndarray:
        """Minus the derivative of the net force, or the matrix of the paper's fixed point, ``(n, 3,
        3)``."""

    def slowest(self, z: np.ndarray, delta: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The slowest reference ``(n,)`` of every instant, and its velocity ``(3, n)``, for z in
        the batch's own."""


def relative_delta(delta: float, speed: np.ndarray) -> np.ndarray:
    """Regularisation ``(1, n_time)`` in units of the largest rate ``(n_time,)``.

    Beyond the limits the law has reached its viscous or its dry limit to the last digit, but its
    squares would overflow.
    """
    with np.errstate(over="ignore", under="ignore"):
        return np.clip(delta / speed, _DRY, _VISCOUS)[None]


def force_unit(friction: Law, delta: np.ndarray) -> np.ndarray:
    """Friction on a body that moves at unit speed: the largest coefficient where delta is small.

    Above unit delta dry friction is viscous and falls with delta; a residual in units of the
    coefficient would then vanish whatever the velocity.
    """
    degree = 1.0 if friction.degree is None else friction.degree
    return friction.largest * np.hypot(1.0, delta) ** (degree - 1.0)


def groups(anchor: np.ndarray) -> Iterator[tuple[int, np.ndarray]]:
    """The anchors ``(n_time,)`` that occur, and the instants that have each."""
    for reference in np.unique(anchor):
        yield int(reference), np.flatnonzero(anchor == reference)


MakeBatch = Callable[[np.ndarray, int], Batch]
"""Makes the batch of some instants (indices) with a given reference."""


@dataclass(eq=False)
class State:
    """Current anchors, anchor velocities, residuals and step counts of all instants; updated in
    place."""

    anchor: np.ndarray  # (n_time,)
    velocity: np.ndarray  # (3, n_time)
    residual: np.ndarray
    """Largest of |net force| and |torque about the anchor| / body length, in units of the friction
    at unit speed (see `force_unit`), ``(n_time,)``."""
    iterations: np.ndarray  # (n_time,)


def starting_state(anchor: np.ndarray, velocity: np.ndarray) -> State:
    """The state before any step."""
    return State(anchor, velocity, np.full(anchor.size, np.inf), np.zeros(anchor.size, dtype=int))


def solve(
    state: State,
    make_batch: MakeBatch,
    n_reference: int,
    delta: np.ndarray,
    tolerance: float,
    budget: int,
    method: str,
) -> None:
    """Bring every instant of `state` to a residual below `tolerance`, in up to four attempts of
    `budget` steps each.

    "auto" first damps Newton from where the state is; then, for instants that fail, from rest; then
    it follows the regularisation down from 1 to `delta` ``(1, n_time)``, and at last takes
    fixed-point steps only. The second attempt begins with the first anchor, since the failed one
    may have moved it to a link from which nothing converges. "direct" is the first attempt alone;
    the other methods are for comparison.
    """
    everything, first_anchor = np.arange(state.residual.size), state.anchor.copy()
    direct = min(budget, _DIRECT_ITERATIONS) if method in ("auto", "direct", "natural") else budget
    at_rest = ~state.velocity.any(axis=0)
    _advance(state, make_batch, n_reference, everything, delta, tolerance, direct, method)
    if method != "auto":
        return

    bad = np.flatnonzero((state.residual > tolerance) & ~at_rest)
    if bad.size:
        state.velocity[:, bad], state.anchor[bad] = 0.0, first_anchor[bad]
        _advance(state, make_batch, n_reference, bad, delta, tolerance, direct, method)
    bad = np.flatnonzero(state.residual > tolerance)
    if bad.size:
        state.velocity[:, bad] = 0.0
        for level in _ladder(float(delta[0, bad].min())):
            now = np.maximum(delta, level)
            _advance(
                state,
                make_batch,
                n_reference,
                bad,
                now,
                tolerance,
                min(budget, _LADDER_ITERATIONS),
                method,
            )
        bad = np.flatnonzero(state.residual > tolerance)
        if bad.size:
            _advance(state, make_batch, n_reference, bad, delta, tolerance, budget, "fixed_point")


def _ladder(delta: float) -> np.ndarray:
    """Regularisations from 1 down to delta, for instants that do not converge directly."""
    count = max(2, int(np.ceil(-np.log10(delta) / 0.5)) + 1)
    return np.geomspace(1.0, delta, count)


def _advance(
    state: State,
    make_batch: MakeBatch,
    n_reference: int,
    chosen: np.ndarray,
    delta: np.ndarray,
    tolerance: float,
    max_iterations: int,
    method: str,
) -> None:
    """Iterate the chosen instants, moving the anchor to the slowest reference as long as that still
    helps."""
    todo = chosen
    for _ in range(n_reference):
        moved = []
        for reference, chosen_of_todo in groups(state.anchor[todo]):
            members = todo[chosen_of_todo]
            batch = make_batch(members, reference)
            z, residual, iterations = iterate(
                batch,
                state.velocity[:, members],
                delta[:, members],
                tolerance,
                max_iterations,
                method,
            )
            state.iterations[members] += iterations
            state.residual[members] = residual
            state.velocity[:, members] = z
            failed = residual > tolerance
            if failed.any():
                anchor, velocity = batch.slowest(z, delta[:, members])
                change = failed & (anchor != reference)
                state.anchor[members[change]] = anchor[change]
                state.velocity[:, members[change]] = velocity[:, change]
                moved.append(members[change])
        todo = np.concatenate(moved) if moved else np.array([], dtype=int)
        if not todo.size:
            return


def iterate(
    batch: Batch,
    z: np.ndarray,
    delta: np.ndarray,
    tolerance: float,
    max_iterations: int,
    method: str,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Damped Newton from z ``(3, n)``, with fixed-point steps where a Newton step fails; returns z,
    residual, iterations."""

    def evaluated(
        select: np.ndarray, z: np.ndarray, delta: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """With the merit ``(n,)`` that a step has to reduce: the potential if there is one, else
        half the squared residual."""
        with np.errstate(
            over="ignore", invalid="ignore"
        ):  # a step that leads so far away is not taken
            state, force, potential = batch.evaluate(select, z, delta)
            return (
                state,
                force,
                0.5 * np.sum(force * force, axis=0) if potential is None else potential,
            )

    shares = (
        _BACKTRACKING if batch.friction.associated or method == "natural" else _SHORT_BACKTRACKING
    )
    n_time = z.shape[1]
    z = z.copy()
    residual, iterations = np.full(n_time, np.inf), np.zeros(n_time, dtype=int)
    fixed_point_steps_due = np.full(n_time, np.iinfo(int).max if method == "fixed_point" else 0)
    active = np.arange(n_time)
    links, force, merit = evaluated(active, z, delta)
    while True:
        residual[active] = np.abs(force).max(axis=0) / force_unit(batch.friction, delta[0, active])
        keep = (residual[active] > tolerance) & (iterations[active] < max_iterations)
        if not keep.any():
            return z, residual, iterations
        active, links, force, merit = active[keep], links[:, :, keep], force[:, keep], merit[keep]
        d, newton = delta[:, active], fixed_point_steps_due[active] == 0
        step, matrix = _step(batch, links, force, d, newton)
        if batch.friction.associated:
            slope, slack = -np.sum(force * step, axis=0), _ROUNDING * merit
        else:
            slope, slack = -2.0 * merit, np.zeros_like(merit)
        alpha, failed = np.ones(active.size), np.ones(active.size, dtype=bool)
        trial, new_links, new_force, new_merit = (
            z[:, active],
            links.copy(),
            force.copy(),
            merit.copy(),
        )
        for shrink in (1.0, *shares):
            retry = np.flatnonzero(failed)
            if not retry.size:
                break
            alpha[retry] *= shrink
            trial[:, retry] = z[:, active[retry]] + alpha[retry] * step[:, retry]
            again = evaluated(active[retry], trial[:, retry], d[:, retry])
            new_links[:, :, retry], new_force[:, retry], new_merit[retry] = again
            if method == "natural":
                following = np.abs(solve3(matrix, new_force)).max(axis=0)
                fell = following <= (1 - _NATURAL_GAIN * alpha) * np.abs(step).max(axis=0)
            else:
                fell = new_merit <= merit + _ARMIJO * alpha * slope + slack
            failed = newton & ~fell
        trial[:, failed], new_links[:, :, failed] = z[:, active[failed]], links[:, :, failed]
        new_force[:, failed], new_merit[failed] = force[:, failed], merit[failed]
        z[:, active], links, force, merit = trial, new_links, new_force, new_merit
        iterations[active] += 1
        fixed_point_steps_due[active[~newton]] -= 1
        fixed_point_steps_due[active[failed]] = _FIXED_POINT_STEPS_AFTER_FAILURE
        if method == "newton":
            iterations[active[failed]] = max_iterations


def _step(
    batch: Batch, state: np.ndarray, force: np.ndarray, delta: np.ndarray, newton: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Newton steps where `newton`, the paper's fixed-point steps elsewhere, ``(3, n)``, and their
    matrices ``(n, 3, 3)``."""
    matrix = np.empty((newton.size, 3, 3))
    for by_newton, chosen in ((True, newton), (False, ~newton)):
        if chosen.any():
            matrix[chosen] = batch.matrix(state[:, :, chosen], delta[:, chosen], newton=by_newton)
    return solve3(matrix, force), matrix


def solve3(matrix: np.ndarray, right: np.ndarray) -> np.ndarray:
    """Solve ``matrix[t] x[:, t] = right[:, t]`` after symmetric scaling; where that is singular,
    the step is zero."""
    diagonal = np.sqrt(np.clip(np.abs(np.einsum("tii->ti", matrix)), _TINY, _HUGE))
    with np.errstate(over="ignore", invalid="ignore"):
        scaled = matrix / diagonal[:, :, None] / diagonal[:, None, :]
        singular = ~(np.abs(np.linalg.det(scaled)) > _TINY)
        scaled[singular] = np.eye(3)
        x = (np.linalg.solve(scaled, (right.T / diagonal)[:, :, None])[:, :, 0] / diagonal).T
    x[:, singular | ~np.isfinite(x).all(axis=0)] = 0.0
    return x
