r"""Whether a gait that satisfies the first-order conditions is an optimum: the curvature of its Lagrangian.

On the free directions Z, along which no equation and no bound that carries a multiplier changes to first order, the Hessian

    Z' (grad L(v + h Z) - grad L(v - h Z)) / 2h,      L = -d/W + multipliers . rows,

has to be positive. It is formed from exact gradients by differences. Stick and slip make second derivatives jump as they
move over a mesh point; that shows in the part that is not symmetric, and in a change with the step h.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import null_space

from colloc.numerics.sqp import NonlinearProgram, stationarity

_STEP = 1e-6
"""Of the differences, over the length of the parameters' vector."""
_HELD = 1e-7
"""Multiplier from which a bound counts as held."""
_ONE_ROW = 1e-2
"""Rows whose unit slopes differ by less are one: a shape check may be placed on both sides of one worst instant."""


@dataclass(frozen=True, eq=False)
class Curvature:
    """Second-order conditions of a reduced program at a point.

    Attributes
    ----------
    smallest : float
        Smallest eigenvalue of the Hessian of the Lagrangian on the free directions; infinite if there are none.
    error : float
        Of it: what half the step changes along its direction, and the part of the Hessian that is not symmetric.
    n_free : int
    direction : (n,)
        Unit vector of parameters along which the curvature is smallest.
    kkt_error : float
        What the multipliers leave over of the gradient: the rest means something only where this is small.
    """

    smallest: float
    error: float
    n_free: int
    direction: np.ndarray
    kkt_error: float


def curvature(program: NonlinearProgram, v: np.ndarray) -> Curvature:
    """Smallest curvature of the Lagrangian at v, a point that satisfies the first-order conditions; ``2 n_free + 2`` gradients.

    Examples
    --------
    The gait between the two ways of bending of three equal links is a saddle:

    >>> from colloc import Harmonic, Problem, ellipse
    >>> from colloc.reduced.program import ReducedProgram
    >>> from colloc.reduced.spaces import space_near
    >>> space, v = space_near(Problem("saddle", gait=Harmonic(1, "bilateral")), ellipse(0.0, 0.307347, 0.767811))
    >>> round(curvature(ReducedProgram(space, 1e-4), v).smallest, 1)
    -0.8
    """
    conditions = stationarity(program, v)
    equations = program.row_lower == program.row_upper
    held = equations | (np.abs(conditions.on_rows) > _HELD)
    fixed = np.eye(v.size)[np.abs(conditions.on_bounds) > _HELD]
    active = np.vstack([program.row_slopes(v)[held], fixed])
    active = active / np.maximum(np.linalg.norm(active, axis=1, keepdims=True), 1e-300)
    free = null_space(active, rcond=_ONE_ROW) if active.size else np.eye(v.size)
    if free.shape[1] == 0:
        return Curvature(np.inf, 0.0, 0, np.zeros(v.size), conditions.kkt_error)

    def slope(at: np.ndarray) -> np.ndarray:
        return program.gradient(at) + conditions.on_rows @ program.row_slopes(at)

    def product(z: np.ndarray, step: float) -> np.ndarray:
        return (slope(v + step * z) - slope(v - step * z)) / (2 * step)

    step = _STEP * max(float(np.linalg.norm(v)), 1e-300)
    hessian = free.T @ np.stack([product(z, step) for z in free.T], axis=1)
    values, vectors = np.linalg.eigh(0.5 * (hessian + hessian.T))
    least = free @ vectors[:, 0]
    # what a wrong coupling of two directions does to the smaller eigenvalue
    coupling = vectors.T @ (0.5 * (hessian - hessian.T)) @ vectors[:, 0]
    mixed = np.minimum(np.abs(coupling), coupling**2 / np.maximum(values - values[0], 1e-300))
    error = abs(float(least @ product(least, 0.5 * step)) - values[0]) + mixed.sum()
    return Curvature(float(values[0]), float(error), values.size, least, conditions.kkt_error)
