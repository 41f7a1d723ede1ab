"""Balances by the compiled kernel: the answers of `mechanics.fixed_point` and `chain_motion`, instant by instant."""

from __future__ import annotations

import ctypes

import numpy as np

from colloc.mechanics.damped_newton import METHODS
from colloc.mechanics.law import Law
from colloc.mechanics.links import Links
from colloc.mechanics.native_kernel import address, each_piece


def body_arguments(body: Links, friction: Law) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Lengths, pressures and numbers of the law as the kernel takes them."""
    return np.array(body.lengths), body.pressure_column().ravel(), np.array(friction.kernel_numbers, dtype=float)


def balance(
    library: ctypes.CDLL,
    body: Links,
    friction: Law,
    angles: np.ndarray,
    rates: np.ndarray,
    delta: float,
    load: np.ndarray | None,
    start: np.ndarray | None,
    tolerance: float,
    max_iterations: int,
    method: str,
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Tail velocity ``(3, n_time)``, residual, iterations, anchor ``(n_time,)``, its velocity ``(3, n_time)``."""
    n_time = angles.shape[1]
    chain = body_arguments(body, friction)
    angles, rates = np.ascontiguousarray(angles), np.ascontiguousarray(rates)
    load, start = (None if a is None else np.ascontiguousarray(a) for a in (load, start))
    z, anchor_velocity, residual = np.empty((3, n_time)), np.empty((3, n_time)), np.empty(n_time)
    iterations, anchor = np.empty(n_time, dtype=np.int64), np.empty(n_time, dtype=np.int64)
    before = (body.n_link, *map(address, chain), n_time)
    after = (
        *map(address, (angles, rates)),
        delta,
        *map(address, (load, start)),
        tolerance,
        max_iterations,
        METHODS.index(method),
        *map(address, (z, residual, iterations, anchor, anchor_velocity)),
    )
    each_piece(n_time, lambda first, last: library.colloc_balance(*before, first, last, *after))
    return z, residual, iterations, anchor, anchor_velocity


_ROWS, _DIFFERENTIATED_ROWS = 7, 6


def motion(
    library: ctypes.CDLL,
    body: Links,
    friction: Law,
    angles: np.ndarray,
    rates: np.ndarray,
    delta: float,
    load: np.ndarray | None,
    anchor: np.ndarray,
    anchor_velocity: np.ndarray,
    *,
    with_slopes: bool,
) -> tuple[np.ndarray, np.ndarray | None]:
    """What `colloc.mechanics.chain_motion` speaks of: values ``(7, n_time)``, and derivatives ``(6, n, n_time)``."""
    n_time = angles.shape[1]
    chain = body_arguments(body, friction)
    angles, rates, velocity = (np.ascontiguousarray(a, dtype=float) for a in (angles, rates, anchor_velocity))
    load = None if load is None else np.ascontiguousarray(load)
    anchor = np.ascontiguousarray(anchor, dtype=np.int64)
    values = np.empty((_ROWS, n_time))
    columns = 2 * body.n_joint + (0 if load is None else 2)
    slopes = np.empty((_DIFFERENTIATED_ROWS, columns, n_time)) if with_slopes else None
    before = (body.n_link, *map(address, chain), n_time)
    after = (*map(address, (angles, rates)), delta, *map(address, (load, anchor, velocity, values, slopes)))
    each_piece(n_time, lambda first, last: library.colloc_motion(*before, first, last, *after))
    return values, slopes


def loaded(
    library: ctypes.CDLL,
    body: Links,
    friction: Law,
    angles: np.ndarray,
    rates: np.ndarray,
    load: np.ndarray,
    start: np.ndarray,
    delta: float,
    steps: int,
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """The fields of `colloc.bounds.loaded_balance.Loaded`."""
    n_time = angles.shape[1]
    chain = body_arguments(body, friction)
    given = [np.ascontiguousarray(a, dtype=float) for a in (angles, rates, load, start)]
    velocity, potential, power = np.empty((3, n_time)), np.empty(n_time), np.empty(n_time)
    forces, residual, leftover_power = np.empty((body.n_link, 3, n_time)), np.empty((2, n_time)), np.empty(n_time)
    found = velocity, potential, power, forces, residual, leftover_power
    before = (body.n_link, *map(address, chain), n_time)
    after = (*map(address, given), delta, steps, *map(address, found))
    each_piece(n_time, lambda first, last: library.colloc_loaded(*before, first, last, *after))
    return found
