"""Damped Newton with a fixed-point safeguard for three rigid velocities, batched over time points.

Armijo-damped Newton on the potential of an associated law converges from any start
(docs/theory.md). Under other laws Newton steps are taken while they reduce the residual. Where a
step fails the paper's fixed point (iteratively reweighted least squares on a majorant) goes on.
"Natural" steps count if the next one, taken with the same matrix, is shorter (Deuflhard, Numer.
Math. 22, 1974): the residual may rise.

Velocities are those of a *reference* of the body, which moves to the slowest part, the *anchor*: at
stick, speeds of order delta keep their relative precision there. Time points that share a reference
are a *batch*, with the law `friction` and the methods

    evaluate(select, z, delta)       the body's state ``(k, n_body, n)`` at the selected time points
                                     and z ``(3, n)``, the net force ``(3, n)`` and, of an
                                     associated law, the potential ``(n,)`` whose gradient is minus
                                     that force, else None
    matrix(state, delta, newton)     minus the derivative of the net force, or the fixed point's
                                     matrix, ``(n, 3, 3)``
    slowest(z, delta)                the slowest reference ``(n,)``, and its velocity ``(3, n)``
"""

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np

from colloc.mechanics.law import Law

_ARMIJO = 1e-4
_NATURAL_GAIN = 0.25
_BACKTRACKING = (0.5,) * 4 + (0.1,) * 8
_SHORT_BACKTRACKING = (0.5, 0.25)
"""Without a potential shorter steps creep along a valley of the residual; the fixed point leaves it
(2 to 3 times faster at (10, 1, 1), (0.5, 1, 5), (1.7, 1, 1.3) than with 0.25 and 0.1)."""
_ROUNDING = 8e-16
_FIXED_POINT_STEPS_AFTER_FAILURE = 5
_DIRECT_ITERATIONS = 40
_LADDER_ITERATIONS = 240
_DRY, _VISCOUS = 1e-100, 1e8
_TINY, _HUGE = np.finfo(float).tiny, np.finfo(float).max
METHODS = ("auto", "newton", "fixed_point", "direct", "natural")
MakeBatch = Callable[[np.ndarray, int], Any]


def relative_delta(delta: float, speed: np.ndarray) -> np.ndarray:
    """Delta ``(1, n_time)`` in units of the largest rate ``(n_time,)``."""
    # beyond the limits the law is viscous or dry to the last digit, but its squares would overflow
    with np.errstate(over="ignore", under="ignore"):
        return np.clip(delta / speed, _DRY, _VISCOUS)[None]


def groups(anchor: np.ndarray) -> Iterator[tuple[int, np.ndarray]]:
    for reference in np.unique(anchor):
        yield int(reference), np.flatnonzero(anchor == reference)


class State:
    """Anchors ``(n_time,)``, their velocities ``(3, n_time)``, residuals (as of `BalanceSolution`)
    and step counts; updated in place."""

    def __init__(self, anchor: np.ndarray, velocity: np.ndarray) -> None:
        self.anchor, self.velocity = anchor, velocity
        self.residual = np.full(anchor.size, np.inf)
        self.iterations = np.zeros(anchor.size, dtype=np.int64)


def solve(
    state: State,
    make_batch: MakeBatch,
    n_reference: int,
    delta: np.ndarray,
    tolerance: float,
    budget: int,
    method: str,
) -> None:
    """Bring residuals below `tolerance`, in up to four attempts of `budget` steps each.

    "auto": damped Newton from the state; from rest and the first anchor, since a failed attempt may
    have moved it to a bad one; down a ladder of regularisations from 1 to `delta` ``(1, n_time)``;
    fixed-point steps only. "direct" is the first attempt alone; the other methods are for
    comparison.
    """

    def attempt(todo, delta, budget, method=method):
        # anchors move to the slowest part as long as that helps
        for _ in range(n_reference):
            moved = []
            for reference, at in groups(state.anchor[todo]):
                members = todo[at]
                batch, d = make_batch(members, reference), delta[:, members]
                z, residual, iterations = _iterate(
                    batch, state.velocity[:, members], d, tolerance, budget, method
                )
                state.iterations[members] += iterations
                state.residual[members], state.velocity[:, members] = residual, z
                failed = residual > tolerance
                if failed.any():
                    anchor, velocity = batch.slowest(z, d)
                    change = failed & (anchor != reference)
                    state.anchor[members[change]] = anchor[change]
                    state.velocity[:, members[change]] = velocity[:, change]
                    moved.append(members[change])
            todo = np.concatenate(moved) if moved else todo[:0]
            if not todo.size:
                return

    everything, first_anchor = np.arange(state.residual.size), state.anchor.copy()
    direct = min(budget, _DIRECT_ITERATIONS) if method in ("auto", "direct", "natural") else budget
    at_rest = ~state.velocity.any(axis=0)
    attempt(everything, delta, direct)
    if method != "auto":
        return
    if (bad := np.flatnonzero((state.residual > tolerance) & ~at_rest)).size:
        state.velocity[:, bad], state.anchor[bad] = 0.0, first_anchor[bad]
        attempt(bad, delta, direct)
    if (bad := np.flatnonzero(state.residual > tolerance)).size:
        state.velocity[:, bad] = 0.0
        least = float(delta[0, bad].min())
        count = max(2, int(np.ceil(-np.log10(least) / 0.5)) + 1)
        for level in np.geomspace(1.0, least, count):
            attempt(bad, np.maximum(delta, level), min(budget, _LADDER_ITERATIONS))
        if (bad := np.flatnonzero(state.residual > tolerance)).size:
            attempt(bad, delta, budget, "fixed_point")


def _iterate(
    batch: Any, z: np.ndarray, delta: np.ndarray, tolerance: float, max_iterations: int, method: str
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Damped Newton from z ``(3, n)``, with fixed-point steps where one fails: z, residual, number
    of steps."""
    friction: Law = batch.friction

    def evaluate(select, z, delta):
        # the merit that a step has to reduce: the potential, or half the squared residual
        with np.errstate(over="ignore", invalid="ignore"):  # such far steps are not taken
            state, force, potential = batch.evaluate(select, z, delta)
            squared = 0.5 * np.sum(force * force, axis=0)
            return [state, force, squared if potential is None else potential]

    long = friction.associated or method == "natural"
    n_time, z = z.shape[1], z.copy()
    residual, iterations = np.full(n_time, np.inf), np.zeros(n_time, dtype=int)
    fixed_point_steps_due = np.full(n_time, np.iinfo(int).max if method == "fixed_point" else 0)
    # friction on a body that moves at unit speed; above unit delta dry friction is viscous, and
    # falls with delta
    degree = 1.0 if friction.degree is None else friction.degree
    unit = friction.largest * np.hypot(1.0, delta[0]) ** (degree - 1.0)
    active = np.arange(n_time)
    now = evaluate(active, z, delta)
    while True:
        residual[active] = np.abs(now[1]).max(axis=0) / unit[active]
        keep = (residual[active] > tolerance) & (iterations[active] < max_iterations)
        if not keep.any():
            return z, residual, iterations
        active, now = active[keep], [each[..., keep] for each in now]
        state, force, merit = now
        d, newton = delta[:, active], fixed_point_steps_due[active] == 0
        matrix = np.empty((active.size, 3, 3))
        for by_newton, some in ((True, newton), (False, ~newton)):
            if some.any():
                matrix[some] = batch.matrix(state[..., some], d[:, some], newton=by_newton)
        step = solve3(matrix, force)
        if friction.associated:
            slope, slack = -np.sum(force * step, axis=0), _ROUNDING * merit
        else:
            slope, slack = -2.0 * merit, np.zeros_like(merit)
        alpha, failed = np.ones(active.size), np.ones(active.size, dtype=bool)
        here = z[:, active]
        trial, new = here.copy(), [each.copy() for each in now]
        for shrink in (1.0, *(_BACKTRACKING if long else _SHORT_BACKTRACKING)):
            retry = np.flatnonzero(failed)
            if not retry.size:
                break
            alpha[retry] *= shrink
            trial[:, retry] = here[:, retry] + alpha[retry] * step[:, retry]
            again = evaluate(active[retry], trial[:, retry], d[:, retry])
            for each, some in zip(new, again, strict=True):
                each[..., retry] = some
            if method == "natural":
                following = np.abs(solve3(matrix, new[1])).max(axis=0)
                fell = following <= (1 - _NATURAL_GAIN * alpha) * np.abs(step).max(axis=0)
            else:
                fell = new[2] <= merit + _ARMIJO * alpha * slope + slack
            failed = newton & ~fell
        for each, before in zip((trial, *new), (here, *now), strict=True):
            each[..., failed] = before[..., failed]
        z[:, active], now = trial, new
        iterations[active] += 1
        fixed_point_steps_due[active[~newton]] -= 1
        fixed_point_steps_due[active[failed]] = _FIXED_POINT_STEPS_AFTER_FAILURE
        if method == "newton":
            iterations[active[failed]] = max_iterations


def solve3(matrix: np.ndarray, right: np.ndarray) -> np.ndarray:
    """Solve ``matrix[t] x[:, t] = right[:, t]`` after symmetric scaling; zero where singular."""
    diagonal = np.sqrt(np.clip(np.abs(np.einsum("tii->ti", matrix)), _TINY, _HUGE))
    with np.errstate(over="ignore", invalid="ignore"):
        scaled = matrix / diagonal[:, :, None] / diagonal[:, None, :]
        singular = ~(np.abs(np.linalg.det(scaled)) > _TINY)
        scaled[singular] = np.eye(3)
        x = (np.linalg.solve(scaled, (right.T / diagonal)[:, :, None])[:, :, 0] / diagonal).T
    x[:, singular | ~np.isfinite(x).all(axis=0)] = 0.0
    return x
