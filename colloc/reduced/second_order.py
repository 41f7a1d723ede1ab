"""Second-order conditions: the smallest curvature of the Lagrangian on the critical subspace.

The reduced Hessian Z' (grad L(v + h Z) - grad L(v - h Z)) / 2h has to be positive, Z spanning the
directions along which no active row changes. A path constraint stands at a worst instant that moves
with the gait, which adds to the Hessian (`colloc.numerics.peaks`). Second derivatives jump where
stick and slip move over a mesh point; that shows in the part that is not symmetric and in a change
with h. So a negative curvature counts only where it is still there at a step a thousand times as
long.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from colloc.numerics.peaks import curvature_of_moving
from colloc.numerics.sqp import stationarity
from colloc.reduced.program import ReducedProgram

_STEP, _LONG_STEP = 1e-6, 1e-3
"""Steps of the differences over the norm of v, and of those that confirm a negative curvature."""
_SHIFT = 1e-3
"""Shift of rows, as a part of a mesh cell, for their derivatives in time."""
_HELD = 1e-7
"""Multiplier from which a bound is active."""
_ONE_ROW = 1e-2
"""Unit slopes that differ by less are one: a constraint may stand on both sides of one instant."""


@dataclass(frozen=True, eq=False)
class Curvature:
    """Second-order conditions of a reduced program at a point."""

    smallest: float
    """Smallest eigenvalue of the reduced Hessian, a negative one as far as it is confirmed;
    infinite if no direction is free."""
    error: float
    """Change of it with half the step, and by the part of the Hessian that is not symmetric."""
    n_free: int
    direction: np.ndarray
    """Unit vector of smallest curvature, ``(n,)``."""
    kkt_error: float
    lagrangian: Callable[[np.ndarray], float]
    """With the rows at the worst instants of a point."""


def curvature(program: ReducedProgram, v: np.ndarray) -> Curvature:
    """Smallest curvature of the Lagrangian at a stationary point v; ``2 n_free + 2`` gradients."""
    program.move_checks(v)
    conditions = stationarity(program, v)
    rows, slopes, on_rows = program.rows(v), program.row_slopes(v), conditions.on_rows
    bound = [(name, k) for k, name in enumerate(program.row_names) if on_rows[k]]

    def value(at):
        program.move_checks(at)
        lagrangian, now = program.objective(at), program.rows(at)
        place = {name: k for k, name in enumerate(program.row_names)}
        for name, k in bound:
            here = place.get(name)
            row = now[here] if here is not None else rows[k] + slopes[k] @ (at - v)
            lagrangian += on_rows[k] * row
        program.move_checks(v)
        return float(lagrangian)

    active_rows = (program.row_lower == program.row_upper) | (np.abs(on_rows) > _HELD)
    fixed = np.eye(v.size)[np.abs(conditions.on_bounds) > _HELD]
    active = np.vstack([slopes[active_rows], fixed])
    active = active / np.maximum(np.linalg.norm(active, axis=1, keepdims=True), 1e-300)
    _, sizes, directions = np.linalg.svd(active)
    free = directions[int((sizes > _ONE_ROW * sizes.max(initial=0.0)).sum()) :].T
    if free.shape[1] == 0:
        return Curvature(np.inf, 0.0, 0, np.zeros(v.size), conditions.kkt_error, value)

    # the part of the Hessian that is due to instants that move with the gait
    around = []
    for later in (-_SHIFT, 0.0, _SHIFT):
        program.move_checks(v, later)
        around.append((program.rows(v), program.row_slopes(v)))
    program.move_checks(v)
    moving = program.of_moving_peaks(v, on_rows)
    moving += curvature_of_moving(on_rows, *map(np.array, zip(*around, strict=True)))

    def slope(at):
        return program.gradient(at) + on_rows @ program.row_slopes(at)

    def product(z, step):
        return (slope(v + step * z) - slope(v - step * z)) / (2 * step) + moving @ z

    step = _STEP * (float(np.linalg.norm(v)) or 1.0)
    hessian = free.T @ np.stack([product(z, step) for z in free.T], axis=1)
    values, vectors = np.linalg.eigh(0.5 * (hessian + hessian.T))
    confirmed, far, here = values.copy(), step * _LONG_STEP / _STEP, value(v)
    for k in np.flatnonzero(values < 0):
        along = far * free @ vectors[:, k]
        confirmed[k] = max(values[k], (value(v + along) - 2 * here + value(v - along)) / far**2)
    first = int(np.argmin(confirmed))
    least = free @ vectors[:, first]
    # what a wrong coupling of two directions does to the smaller eigenvalue
    coupling = vectors.T @ (0.5 * (hessian - hessian.T)) @ vectors[:, first]
    apart = np.maximum(np.abs(values - values[first]), 1e-300)
    mixed = np.minimum(np.abs(coupling), coupling**2 / apart)
    error = abs(float(least @ product(least, 0.5 * step)) - values[first]) + mixed.sum()
    return Curvature(
        float(confirmed[first]), float(error), values.size, least, conditions.kkt_error, value
    )
