"""All velocities that balance a chain: with unequal coefficients there may be several.

docs/theory.md says why, why solving from every link at rest finds them, and why the signs of the
determinant of minus the derivative of the net force add up to 1 over all solutions.

A body with a little inertia stays on its branch until that ends in a fold, and then jumps. So a
gait may run through one shape in two ways; both differ by no more than the solutions do, instant by
instant.
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

from colloc.mechanics.balance import TAIL, Moving, balance_jacobian
from colloc.mechanics.bodies import Body
from colloc.mechanics.chain import Chain
from colloc.mechanics.damped_newton import groups
from colloc.mechanics.densities import Instants, Quantity
from colloc.mechanics.fixed_point import solve_balance
from colloc.mechanics.law import Law
from colloc.mechanics.native_kernel import kernel_balances, native_kernel
from colloc.system.errors import NotConvergedError

FORWARDS, BACKWARDS = 1, -1
_SAME = 1e-5  # relative difference of velocities that are one
DISTINCT = 1e-5
"""Difference of distinct velocities, in units of the largest rate."""
_TOLERANCE, _ACCEPTED = 1e-12, 1e-11
"""The solver's tolerance, and the residual accepted where rounding stops it."""
_BESIDE = tuple(
    side * size for size in (0.8, 0.4, 0.2, 0.1, 0.05, 0.02, 0.01, 0.005) for side in (-1, 1)
)
"""Starts along the softest direction of a solution, in units of the largest rate."""
_BETWEEN = (0.5, 0.2, 0.8, 0.05, 0.95, 0.02, 0.98, 0.005, 0.995)
"""Starts between two solutions: the third often lies next to one of them."""


class Branches(NamedTuple):
    """Balanced velocities, from one to `n_root` at each time point.

    z: tail velocities ``(n_root, 3, n_time)``; NaN where there are fewer. sign: of the determinant
    of `colloc.mechanics.balance.balance_jacobian`, ``(n_root, n_time)``; 0 where there are fewer.
    """

    z: np.ndarray
    sign: np.ndarray

    @property
    def number(self) -> np.ndarray:
        """Number of solutions; 0 where the solver failed."""
        return (self.sign != 0).sum(axis=0)

    @property
    def complete(self) -> np.ndarray:
        """True if the signs add up to 1, as they do over all solutions."""
        return self.sign.sum(axis=0) == 1


def all_balanced_velocities(
    body: Any,
    friction: Law,
    angles: np.ndarray,
    rates: np.ndarray,
    delta: float,
    load: np.ndarray | None = None,
) -> Branches:
    """Every balanced velocity that can be found, that of `solve_balance` first; arguments as there.

    Three links with friction (1, 0.01, 100), the first joint turning:

    >>> from colloc import Chain, Friction
    >>> at = np.array([[0.78302927], [1.74481885]]), np.array([[-3.0], [0.0]])
    >>> found = all_balanced_velocities(Chain(), Friction(mu_t=1, mu_f=0.01, mu_b=100), *at, 1e-4)
    >>> found.number, found.z[:, 2, 0].round(3), found.sign[:, 0]
    (array([3]), array([2.998, 2.96 , 2.994]), array([ 1.,  1., -1.]))
    """
    friction = body.law(friction)
    moving = Moving(body, friction, angles, rates, delta, load)
    if friction.associated:
        return Branches(*_solve(moving, np.zeros((1, 3, angles.shape[1])), "auto"))
    z, sign = _solve(moving, np.stack([moving.at_rest(link) for link in body.contact.rests]))
    roots = _distinct(z, sign, _largest_rate(rates))
    doubtful = np.flatnonzero((roots.number > 1) | ~roots.complete)
    if doubtful.size:
        # where a branch has just ended the solver may hang with a small residual; the solution
        # then lies beside
        part, known = moving.at(doubtful), (z[:, :, doubtful], sign[:, doubtful])
        more = _solve(part, _between_and_beside(part, known[0]))
        roots = _replace(roots, part, doubtful, *map(np.concatenate, zip(known, more, strict=True)))
    none = np.flatnonzero(roots.number == 0)
    if doubtful.size and none.size:
        part = moving.at(none)  # the long way, which is hardly ever needed
        roots = _replace(roots, part, none, *_solve(part, np.zeros((1, 3, none.size)), "auto"))
    return roots


def _largest_rate(rates: np.ndarray) -> np.ndarray:
    return np.maximum(np.abs(rates).max(axis=0), np.finfo(float).tiny)


def _solve(
    moving: Moving, starts: np.ndarray, method: str = "direct"
) -> tuple[np.ndarray, np.ndarray]:
    """Solutions from starts ``(n_start, 3, n_time)``, NaN where there is no start or a solution is
    repeated, and signs ``(n_start, n_time)``: 0 there, and where none is found."""
    count, n_time = starts.shape[0], starts.shape[2]
    z, largest = np.concatenate(list(starts), axis=1), _largest_rate(moving.rates)
    pending, valid = np.flatnonzero(~np.isnan(z[0])), np.zeros(z.shape[1], dtype=bool)

    def repeated(valid):
        each = np.where(valid, z, np.nan).reshape(3, count, n_time).transpose(1, 0, 2)
        return _repeat(each, largest).ravel()

    library = native_kernel(moving.body, moving.friction)
    if library is not None and method == "direct" and moving.load is None:
        # most starts lead to one velocity, which is solved for to all digits once
        part = moving.at(pending % n_time)
        velocities, valid[pending] = kernel_balances(library, part, z[:, pending], _TOLERANCE)
        z[:, valid] = velocities[:, valid[pending]]
        pending = pending[~repeated(valid)[pending]]
    part, sign = moving.at(pending % n_time), np.zeros(z.shape[1])
    solved = solve_balance(
        *part[:5], load=part.load, start=z[:, pending], tolerance=_TOLERANCE, method=method
    )
    z[:, pending] = solved.z
    valid[pending] = (solved.residual <= _ACCEPTED) | solved.converged
    again = repeated(valid)
    new = np.flatnonzero((valid & ~again)[pending])
    for link, chosen in groups(solved.anchor[new]):  # seen from what rests, which loses no digits
        at = new[chosen]
        jacobian = _jacobian(part.at(at), solved.anchor_velocity[:, at], link)
        sign[pending[at]] = np.sign(np.linalg.det(jacobian))
    z[:, again] = np.nan
    return z.reshape(3, count, n_time).transpose(1, 0, 2), sign.reshape(count, -1)


def _jacobian(moving: Moving, z: np.ndarray, reference: int | None = TAIL) -> np.ndarray:
    posture, velocity, _ = moving.instant(z, reference)
    delta = np.full((1, z.shape[1]), moving.delta)
    return balance_jacobian(moving.body, moving.friction, posture, velocity, delta)


def _between_and_beside(moving: Moving, z: np.ndarray) -> np.ndarray:
    """Starts ``(n_start, 3, n_time)`` between velocities, and along the softest direction of each;
    NaN where a velocity is."""
    starts = [
        z[j] + part * (z[i] - z[j]) for i in range(len(z)) for j in range(i) for part in _BETWEEN
    ]
    for root in z:
        softest = np.linalg.svd(_jacobian(moving, np.nan_to_num(root)))[2][:, 2].T
        starts += [root + size * _largest_rate(moving.rates) * softest for size in _BESIDE]
    return np.stack(starts)


def _distinct(z: np.ndarray, sign: np.ndarray, speed: np.ndarray) -> Branches:
    z = np.where(sign[:, None] == 0, np.nan, z)
    again = _repeat(z, speed)
    z, sign = np.where(again[:, None], np.nan, z), np.where(again, 0.0, sign)
    order = np.argsort(sign == 0, axis=0, kind="stable")
    z, sign = np.take_along_axis(z, order[:, None], axis=0), np.take_along_axis(sign, order, axis=0)
    most = max(1, int((sign != 0).sum(axis=0).max(initial=1)))
    return Branches(z[:most], sign[:most])


def _repeat(z: np.ndarray, speed: np.ndarray) -> np.ndarray:
    """Velocities ``(n, 3, n_time)`` that equal one before, ``(n, n_time)``; NaN equals none."""
    left = np.isfinite(z).all(axis=1)
    again = left.copy()
    while left.any():
        first = np.argmax(left, axis=0)[None]
        off = np.abs(z - np.take_along_axis(z, first[:, None], axis=0))
        np.put_along_axis(again, first, False, axis=0)
        left &= (off >= DISTINCT * speed).any(axis=1)
    return again


def _replace(
    everywhere: Branches, part: Moving, chosen: np.ndarray, z: np.ndarray, sign: np.ndarray
) -> Branches:
    there = _distinct(z, sign, _largest_rate(part.rates))
    more = max(0, len(there.z) - len(everywhere.z))
    z = np.pad(everywhere.z, ((0, more), (0, 0), (0, 0)), constant_values=np.nan)
    sign = np.pad(everywhere.sign, ((0, more), (0, 0)))
    z[:, :, chosen], sign[:, chosen] = np.nan, 0.0
    z[: len(there.z), :, chosen], sign[: len(there.z), chosen] = there
    return Branches(z, sign)


def followed_motion(
    at: Instants,
    quantities: Sequence[Quantity] = (),
    *,
    before: np.ndarray | None = None,
    sense: int = FORWARDS,
) -> tuple[np.ndarray, np.ndarray]:
    """Tail velocities ``(3, n_time)`` of the branch that a chain follows where its law may allow
    several, and the spread of velocities of the centre of mass, rotation rates, powers and k
    quantities among the stable solutions, ``(3 + k, n_time)``.

    Instants are those of one period in order of time, followed with or against it (`sense`), or
    such that tail velocities shortly before are known (`before`, ``(3, n_time)``).
    """
    roots = all_balanced_velocities(at.body, at.friction, at.angles, at.rates, at.delta)
    if not roots.number.all():
        lost = int((roots.number == 0).sum())
        raise NotConvergedError(
            f"no velocity that balances the body was found at {lost} of {roots.number.size} "
            f"time points."
        )
    z, several = roots.z[0].copy(), np.flatnonzero(roots.number > 1)
    apart = np.zeros((3 + len(quantities), z.shape[1]))
    if several.size:
        some = Branches(roots.z[:, :, several], roots.sign[:, several])
        apart[:, several] = _ranges(at.take(several), some, quantities)
    for now, previous in _order(roots.number > 1, sense):
        last = z[:, previous] if before is None else before[:, now]
        z[:, now] = _nearest(roots.z[:, :, now], roots.sign[:, now], last)
    return z, apart


def on_one_branch(
    body: Body, friction: Law, angles: np.ndarray, rates: np.ndarray, delta: float, z: np.ndarray
) -> np.ndarray:
    """Tail velocities ``(3, n_time)`` continued in time, from balanced ones that were solved for
    one by one.

    Each is solved for again from the one before, round the period, until none changes; of those
    that change, the nearest stable solution is taken. Where none changes, z itself is returned.
    """
    if friction.associated or not isinstance(body, Chain):
        return z
    followed, at, moves = z.copy(), np.arange(z.shape[1]), np.zeros(z.shape[1], dtype=bool)
    for _ in range(2 * z.shape[1]):
        solved = body.solve(
            friction, angles[:, at], rates[:, at], delta, start=followed[:, at - 1]
        ).z
        moved = np.abs(solved - followed[:, at]).max(axis=0) > _SAME * np.abs(z).max()
        if not moved.any():
            break
        followed[:, at[moved]], moves[at[moved]] = solved[:, moved], True
        # what comes after these began at another velocity
        at = (at[moved] + 1) % z.shape[1]
    if not moves.any():
        return z
    # a step from a branch that ends may come to a motion that does not last
    chosen = np.flatnonzero(moves)
    chosen = np.roll(chosen, -int(np.searchsorted(chosen, np.argmin(moves))))
    all_of = all_balanced_velocities(body, friction, angles[:, chosen], rates[:, chosen], delta)
    for k, now in enumerate(chosen):
        if all_of.number[k]:
            followed[:, now] = _nearest(all_of.z[:, :, k], all_of.sign[:, k], followed[:, now - 1])
    return followed


def _order(several: np.ndarray, sense: int) -> Iterator[tuple[int, int]]:
    """(instant, instant before) of those with several motions, from one with a single one on."""
    certain = np.flatnonzero(~several)
    first = certain[0] if certain.size else 0
    for previous, now in pairwise((first + sense * np.arange(several.size + 1)) % several.size):
        if several[now]:
            yield now, previous


def _nearest(z: np.ndarray, sign: np.ndarray, before: np.ndarray) -> np.ndarray:
    distance = np.abs(z - before[:, None].T).max(axis=1)
    stable = np.where(sign > 0, distance, np.inf)
    return z[np.nanargmin(stable if np.isfinite(stable).any() else distance)]


def _ranges(at: Instants, roots: Branches, quantities: Sequence[Quantity]) -> np.ndarray:
    rows = []
    for z, sign in zip(roots.z, roots.sign, strict=True):
        now = at.body.sliding(at.friction, at.angles, at.rates, z, at.delta)
        row = np.concatenate(
            [now.centre, z[2:], now.power, *(each.at(replace(at, z=z)) for each in quantities)]
        )
        rows.append(np.where(sign > 0, row, np.nan))
    apart = np.nanmax(rows, axis=0) - np.nanmin(rows, axis=0)
    return np.stack([np.hypot(apart[0], apart[1]), *apart[2:]])
