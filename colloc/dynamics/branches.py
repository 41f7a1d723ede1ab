"""Branch of the balanced motions that a gait follows, and the spread of the others.

Where the law of friction allows several velocities, a body with a little inertia stays on its
branch until that ends in a fold, and then jumps. So a gait may run through one shape in two ways;
both differ by no more than the solutions do, instant by instant.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from colloc.mechanics.bodies import Body
from colloc.mechanics.chain import Chain
from colloc.mechanics.densities import Instants, JointMap, Quantity
from colloc.mechanics.law import Law
from colloc.mechanics.solution_branches import Branches, all_balanced_velocities
from colloc.system.errors import NotConvergedError

FORWARDS, BACKWARDS = 1, -1
_SAME = 1e-5
"""Relative difference of velocities that are one."""


class FollowedMotion(NamedTuple):
    z: np.ndarray
    """Tail velocities of the branch, ``(3, n_time)``; NaN where no solution exists."""
    apart: np.ndarray
    """Spread of velocities of the centre of mass, rotation rates, powers and densities of k
    quantities among the stable solutions, ``(3 + k, n_time)``."""


def followed_motion(
    body: Body,
    friction: Law,
    angles: np.ndarray,
    rates: np.ndarray,
    delta: float,
    *,
    before: np.ndarray | None = None,
    sense: int = FORWARDS,
    quantities: Sequence[Quantity] = (),
    joint_map: JointMap | None = None,
) -> FollowedMotion | None:
    """The motion of a gait where its law may allow several, and how far `quantities` of the others
    lie apart; None for a body whose other motions are not looked for.

    Angles and rates ``(n_joint, n_time)`` are those of one period in order of time, followed with
    or against it (`sense`), or of instants whose tail velocities shortly before are known
    (`before`, ``(3, n_time)``).
    """
    if not isinstance(body, Chain):
        return None
    found = all_balanced_velocities(body, friction, angles, rates, delta)
    if not found.number.all():
        lost = int((found.number == 0).sum())
        raise NotConvergedError(
            f"no velocity that balances the body was found at {lost} of {found.number.size} "
            f"instants."
        )
    apart = np.zeros((3 + len(quantities), angles.shape[1]))
    several = np.flatnonzero(found.number > 1)
    if not several.size:
        return FollowedMotion(found.z[0], apart)
    chosen = Branches(found.z[:, :, several], found.sign[:, several])
    apart[:, several] = _ranges(
        Instants(body, friction, angles[:, several], rates[:, several], delta, joint_map=joint_map),
        chosen,
        quantities,
    )
    z = found.z[0].copy()
    for now, previous in _order(found.number > 1, sense):
        z[:, now] = _nearest(
            found.z[:, :, now],
            found.sign[:, now],
            z[:, previous] if before is None else before[:, now],
        )
    return FollowedMotion(z, apart)


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
        found = body.solve(
            friction, angles[:, at], rates[:, at], delta, start=followed[:, at - 1]
        ).z
        moved = np.abs(found - followed[:, at]).max(axis=0) > _SAME * np.abs(z).max()
        if not moved.any():
            break
        followed[:, at[moved]], moves[at[moved]] = found[:, moved], True
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
    """Solution nearest to a velocity ``(3,)``, among the stable ones if there are any."""
    distance = np.abs(z - before[:, None].T).max(axis=1)
    stable = np.where(sign > 0, distance, np.inf)
    return z[np.nanargmin(stable if np.isfinite(stable).any() else distance)]


def _ranges(at: Instants, found: Branches, quantities: Sequence[Quantity]) -> np.ndarray:
    rows = []
    for z, sign in zip(found.z, found.sign, strict=True):
        now = at.body.sliding(at.friction, at.angles, at.rates, z, at.delta)
        row = np.concatenate(
            [now.centre, z[2:], now.power, *(each.at(replace(at, z=z)) for each in quantities)]
        )
        rows.append(np.where(sign > 0, row, np.nan))
    apart = np.nanmax(rows, axis=0) - np.nanmin(rows, axis=0)
    return np.stack([np.hypot(apart[0], apart[1]), *apart[2:]])
