r"""How far balanced motions may be from interpolated ones, over whole cells of shapes and rates
(research/guarantee/README.md).

A cell is a box of (angle 1, angle 2, s) with rates (1, s), of three links under associated friction
with mu_t = 1: dissipation is the integral of sqrt((sigma vs)^2 + vn^2), sigma = mu_f or mu_b. At
its eight corners the balance is solved; the trial motion interpolates. Two ways say what the gain
of the balanced motion may have above the trial motion's, and its power below the interpolated
power: strong convexity of the dissipation (second order in the size of the cell), and small loads
(first order; where links begin to slide, which is where convexity fails, its excess is small). Both
are compiled, in interval arithmetic: whatever motions the solver finds, what is stated of the cell
is proved.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from colloc.mechanics.chain import Chain
from colloc.mechanics.friction import Friction
from research.guarantee.kernel import call
from research.guarantee.loaded_balance import Loaded, loaded_balance

DELTA = 1e-9
"""Regularisation of the certificates' forces: any value is valid, smaller ones are tighter."""
WIDER = 1.0 + 2.0**-30
"""More than a million roundings can change a sum or product of numbers of one sign; such are done
in floating point."""
CORNERS = np.array([[i, j, k] for i in (0, 1) for j in (0, 1) for k in (0, 1)])
_TORQUE = 0.15
"""Of the loads that are torques, in units of force times the body's length."""


class Cells(NamedTuple):
    """Boxes and the points that are their corners.

    low, size (3, n): of the boxes. points (3, m): corners, each once. at (n, 8): the corners of
    each box, in the order of `CORNERS`.
    """

    low: np.ndarray
    size: np.ndarray
    points: np.ndarray
    at: np.ndarray

    def take(self, chosen: np.ndarray) -> tuple[Cells, np.ndarray]:
        """Some of the boxes, and which of the points their corners are."""
        used, at = np.unique(self.at[chosen], return_inverse=True)
        return Cells(
            self.low[:, chosen], self.size[:, chosen], self.points[:, used], at.reshape(-1, 8)
        ), used

    @property
    def rates(self) -> np.ndarray:
        """Of the points, ``(2, m)``."""
        return np.stack([np.ones(self.points.shape[1]), self.points[2]])


class Allowance(NamedTuple):
    """How much more the balanced motion's gain may be than the trial motion's, and how much less
    its power, ``(n,)`` each."""

    gain: np.ndarray
    power: np.ndarray


class ReferencePoint(NamedTuple):
    """How the gain depends on the motion z of the middle link: at most by |z_xy + i point z_spin| +
    beside |z_spin|.

    at (m,): the point at the corners. centre, beside (n,): the point at the centres of the cells,
    and what covers the rest. change, curvature (n,): how much the point changes over a cell, and
    may differ from its interpolant there.
    """

    at: np.ndarray
    centre: np.ndarray
    beside: np.ndarray
    change: np.ndarray
    curvature: np.ndarray


def corner_motions(body: Chain, friction: Friction, cells: Cells) -> Loaded:
    """The balance at the corners."""
    start = np.zeros((3, cells.points.shape[1]))
    start[2] = (1.0 - cells.points[2]) / 3.0
    return loaded_balance(
        body, friction, cells.points[:2], cells.rates, np.zeros_like(start), start, DELTA
    )


def spread(values: np.ndarray, axis: int) -> np.ndarray:
    """Largest difference of ``(d, n, 8)`` corner values along one axis of the cells, ``(n,)``."""
    changes = np.diff(values.reshape(*values.shape[:2], 2, 2, 2), axis=2 + axis)
    return np.sqrt((changes**2).sum(axis=0)).max(axis=(1, 2, 3))


def states(
    body: Chain, friction: Friction, points: np.ndarray, velocity: np.ndarray, load: np.ndarray
) -> np.ndarray:
    """What the friction at velocities ``(3, m)`` proves, of points and loads of that shape, ``(m,
    26)``: intervals, as `native/state.hpp` has them. First the regularised dissipation; not finite
    for what is no motion."""
    found = np.empty((points.shape[1], 26))
    rows = [np.ascontiguousarray(each.T, dtype=float) for each in (points, velocity, load)]
    call(
        "colloc_states", len(found), np.array(body.lengths), _stretch(friction), *rows, DELTA, found
    )
    return found


def least_power(body: Chain, friction: Friction, cells: Cells, free: Loaded) -> np.ndarray:
    """The dissipation of motions is no less, ``(m,)``: the regularised one is at most delta
    above."""
    known = states(body, friction, cells.points, free.velocity, np.zeros_like(free.velocity))
    return known[:, 0] - WIDER * DELTA


def by_convexity(
    body: Chain, friction: Friction, cells: Cells, free: Loaded, reference: ReferencePoint
) -> Allowance:
    """From strong convexity, which is of second order in the size of the cell."""
    point = np.stack([reference.centre.real, reference.centre.imag, reference.beside], axis=1)
    found = np.empty((len(point), 2))
    call(
        "colloc_by_convexity",
        len(point),
        *_corners(body, friction, cells, free),
        cells.at,
        point,
        DELTA,
        found,
    )
    return Allowance(*found.T)


def by_loads(
    body: Chain,
    friction: Friction,
    cells: Cells,
    free: Loaded,
    reference: ReferencePoint,
    multiplier: float,
) -> Allowance:
    """From balances under loads of the size 1/multiplier: a minimiser cannot be changed much by a
    small force.

    The multiplier is made a power of 2, so that nothing is lost where a load is divided by it.
    """
    multiplier, c = float(2.0 ** np.round(np.log2(multiplier))), reference.at
    loads, under = np.empty((c.size, 6, 3)), np.empty((6, c.size, 26))
    turns = ((1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0), (0, 0, _TORQUE), (0, 0, -_TORQUE))
    for n, (fx, fy, turn) in enumerate(turns):
        load = np.stack(np.broadcast_arrays(fx, fy, fy * c.real - fx * c.imag + turn))
        each = load / multiplier
        state = loaded_balance(
            body, friction, cells.points[:2], cells.rates, each, free.velocity, DELTA
        )
        loads[:, n], under[n] = load.T, states(body, friction, cells.points, state.velocity, each)
    off, found = reference.beside + reference.curvature, np.empty((cells.low.shape[1], 2))
    given = *_corners(body, friction, cells, free), cells.at, under, loads, off, reference.change
    call("colloc_by_loads", len(found), c.size, *given, multiplier, _TORQUE, found)
    return Allowance(*found.T)


def _corners(body: Chain, friction: Friction, cells: Cells, free: Loaded) -> tuple[np.ndarray, ...]:
    """Lengths and sigma; points, motions and states at the corners."""
    known = states(body, friction, cells.points, free.velocity, np.zeros_like(free.velocity))
    rows = np.ascontiguousarray(cells.points.T), np.ascontiguousarray(free.velocity.T)
    return np.array(body.lengths), _stretch(friction), *rows, known


def _stretch(friction: Friction) -> np.ndarray:
    return np.array([friction.mu_f, friction.mu_b], dtype=float)
