r"""How far balanced motions may be from interpolated ones, over whole cells of shapes and rates (research/guarantee/README.md).

A cell is a box of (angle 1, angle 2, s) with rates (1, s), of three links under associated friction with mu_t = 1: dissipation
is the integral of sqrt((sigma vs)^2 + vn^2), sigma = mu_f or mu_b. At its eight corners the balance is solved; the trial motion
interpolates. Two ways say what the gain of the balanced motion may have above the trial motion's, and its power below the
interpolated power: strong convexity of the dissipation (compiled, second order in the size of the cell), and small loads (first
order; where links begin to slide, which is where convexity fails, its excess is small).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from colloc.mechanics.chain import Chain
from colloc.mechanics.friction import Friction
from colloc.mechanics.native_kernel import address
from research.guarantee.kernel import guarantee_kernel
from research.guarantee.loaded_balance import Loaded, loaded_balance

DELTA = 1e-9
"""Regularisation of the certificates' forces: any value is valid, smaller ones are tighter."""
_KAPPA = np.sqrt(2.0) - 1.0
"""The integral of |V| over a link is at least kappa times its length times |V| at either end, as V is affine along it."""
_ROUNDING = 1e-9
CORNERS = np.array([[i, j, k] for i in (0, 1) for j in (0, 1) for k in (0, 1)])
_TORQUE = 0.15
"""Of the loads that are torques, in units of force times the body's length."""


class Cells(NamedTuple):
    """Boxes and the points that are their corners.

    low, size (3, n): of the boxes. points (3, m): corners, each once. at (n, 8): the corners of each box, in the order of
    `CORNERS`.
    """

    low: np.ndarray
    size: np.ndarray
    points: np.ndarray
    at: np.ndarray

    def take(self, chosen: np.ndarray) -> tuple[Cells, np.ndarray]:
        """Some of the boxes, and which of the points their corners are."""
        used, at = np.unique(self.at[chosen], return_inverse=True)
        return Cells(self.low[:, chosen], self.size[:, chosen], self.points[:, used], at.reshape(-1, 8)), used

    @property
    def rates(self) -> np.ndarray:
        """Of the points, ``(2, m)``."""
        return np.stack([np.ones(self.points.shape[1]), self.points[2]])


class Allowance(NamedTuple):
    """How much more the balanced motion's gain may be than the trial motion's, and how much less its power, ``(n,)`` each."""

    gain: np.ndarray
    power: np.ndarray


class ReferencePoint(NamedTuple):
    """How the gain depends on the motion z of the middle link: at most by |z_xy + i point z_spin| + beside |z_spin|.

    at (m,): the point at the corners. centre, beside (n,): the point at the centres of the cells, and what covers the rest.
    change, curvature (n,): how much the point changes over a cell, and may differ from its interpolant there.
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
    return loaded_balance(body, friction, cells.points[:2], cells.rates, np.zeros_like(start), start, DELTA)


def spread(values: np.ndarray, axis: int) -> np.ndarray:
    """Largest difference of ``(d, n, 8)`` corner values along one axis of the cells, ``(n,)``."""
    changes = np.diff(values.reshape(*values.shape[:2], 2, 2, 2), axis=2 + axis)
    return np.sqrt((changes**2).sum(axis=0)).max(axis=(1, 2, 3))


def by_convexity(body: Chain, friction: Friction, cells: Cells, free: Loaded, reference: ReferencePoint) -> Allowance:
    """From strong convexity; compiled, as the motions at the corners are that it is given."""
    library = guarantee_kernel(body)
    assert library is not None
    n = cells.low.shape[1]
    point = np.stack([reference.centre.real, reference.centre.imag, reference.beside], axis=1)
    given = (
        np.array(body.lengths),
        np.array([friction.mu_f, friction.mu_b]),
        cells.low.T,
        cells.size.T,
        free.velocity.T[cells.at],
        free.forces[::2, :2].transpose(2, 0, 1)[cells.at],
        free.residual[:, cells.at].max(axis=2).T,
        point,
    )
    length, stretch, *arrays = (np.ascontiguousarray(each, dtype=float) for each in given)
    found = np.empty((n, 2))
    library.colloc_enclosure(address(length), address(stretch), 0, n, *map(address, arrays), DELTA, address(found))
    return Allowance(found[:, 0] + _ROUNDING, found[:, 1] + _ROUNDING)


def _unbalanced(body: Chain, friction: Friction, cells: Cells, state: Loaded) -> tuple[np.ndarray, np.ndarray]:
    """What interpolated forces leave unbalanced, as a share of the dissipation; and the error of their power, ``(n,)`` each."""
    l1, l2, l3 = body.lengths
    h1, h2, hs = cells.size
    # the dissipation of a velocity V is at least `smallest` |V|, and a force at most `largest`
    kappa, most = friction.smallest * _KAPPA, friction.largest
    forces = state.forces[:, :, cells.at]
    left = state.residual[:, cells.at].max(axis=2)
    share = (left[0] / l2 + 4.0 * left[1] / l2**2) / friction.smallest + _ROUNDING
    for link, length, h, axis in ((0, l1, h1, 0), (2, l3, h2, 1)):
        share = share + (h * h / 8 * most * length + h / 4 * spread(forces[link, :2], axis)) / (kappa * (length + l2))
    # the moment about the head joint times s is bilinear
    moment = forces[2, 1] * (0.5 * l3) + forces[2, 2]
    return share, hs / 4 * spread(moment[None], 2)


def by_loads(
    body: Chain,
    friction: Friction,
    cells: Cells,
    free: Loaded,
    reference: ReferencePoint,
    multiplier: np.ndarray | float,
) -> Allowance:
    """From balances under loads of the size 1/multiplier: a minimiser cannot be changed much by a small force."""
    l1, l2, l3 = body.lengths
    h1, h2, _ = cells.size
    z = free.velocity[:, cells.at]
    rise = np.full(cells.low.shape[1], _ROUNDING)
    for length, h, side, axis in ((l1, h1, -0.5, 0), (l3, h2, 0.5, 1)):
        joint = np.stack([z[0], z[1] + side * l2 * z[2]])
        moved = h * h / 8 * np.sqrt((joint**2).sum(axis=0)).max(axis=1) + h / 4 * spread(joint, axis)
        rise += friction.largest * length * moved
    above = free.potential[cells.at] + rise[:, None]
    spins = z[2].max(axis=1) - z[2].min(axis=1)
    excess = []
    c = reference.at
    for fx, fy, turn in ((1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0), (0, 0, _TORQUE), (0, 0, -_TORQUE)):
        load = np.stack(np.broadcast_arrays(fx, fy, fy * c.real - fx * c.imag + turn))
        state = loaded_balance(body, friction, cells.points[:2], cells.rates, load / multiplier, free.velocity, DELTA)
        share, bilinear = _unbalanced(body, friction, cells, state)
        below = multiplier * (state.power + state.leftover_power) - (load * state.velocity).sum(axis=0)
        trial = (load * free.velocity).sum(axis=0)
        each = (multiplier * (1.0 + share)[:, None] * above - (below + trial)[cells.at]).max(axis=1) + multiplier * bilinear
        # the interpolated load times the interpolated motion
        excess.append(np.maximum(each + (0.25 * reference.change * spins if turn == 0 else 0.0), 0.0))
    forward, back, left, right, spin, counter = excess
    turned = np.maximum(spin, counter) / _TORQUE
    share, bilinear = _unbalanced(body, friction, cells, free)
    lost = np.maximum(free.potential - free.power - free.leftover_power, 0.0)[cells.at].max(axis=1)
    return Allowance(
        np.hypot(np.maximum(forward, back), np.maximum(left, right))
        + (reference.beside + reference.curvature) * turned
        + _ROUNDING,
        share * above.max(axis=1) + bilinear + lost + _ROUNDING,
    )
