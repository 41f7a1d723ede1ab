r"""A guaranteed upper bound for a three-link body with isotropic friction: certificates for whole cells (docs/bound.md).

Cells are boxes of (angle 1, angle 2, s) with rates (1, s), |s| <= 1; the symmetries give the rest. In link-fixed axes the
dissipation J of a motion does not depend on the shape, and a balanced motion minimises it. For a multiplier M, at every
corner k of a cell let P_k be the minimal dissipation, and phi_k the friction forces in balance under the load ``l_e/M``,
where ``e.V_c = l_e.z + alpha_e.r`` is the speed of the reference point along e, D_k their power, z_k the motion, rho_k what
they leave unbalanced. Interpolated over the cell the P_k stay above and the phi_k below the dissipation, up to terms of second
order in the cell size, so

    e.V_c / P  <=  M (1 + t) - min_k (M D_k + M rho_k.z_k - e.V_c(z_k) - a) / (P_k + b)   for every balanced motion in the cell,

with explicit t, a, b = O(size^2). Both components of V_c are bounded so. Cells that fail are split.
"""

from __future__ import annotations

import dataclasses
import time
from dataclasses import dataclass

import numpy as np

from colloc.bounds.loaded_balance import Loaded, loaded_balance
from colloc.bounds.sampled import Bound
from colloc.mechanics.body import Chain
from colloc.mechanics.friction import Friction
from colloc.numerics.spline import DEGREE
from colloc.system.errors import ProblemError

_KAPPA = np.sqrt(2.0) - 1.0
"""The integral of |V| over a link is at least kappa times its length times |V| at either end, as V is affine along it."""
_ROUNDING = 1e-9
_CHUNK = 20000
_CORNERS = np.array([[i, j, k] for i in (0, 1) for j in (0, 1) for k in (0, 1)])
_LOADS = np.array([[1.0, 0.0], [-1.0, 0.0], [0.0, 1.0], [0.0, -1.0]])


@dataclass(frozen=True)
class Guarantee:
    """What the cells prove.

    Attributes
    ----------
    guaranteed : float
        No balanced motion exceeds this ratio, up to floating-point rounding (1e-9 is allowed for in every cell).
    target : float
        The value that was aimed at; ``guaranteed == target`` if all cells were closed.
    open_cells, cells : int
        Cells left when the time ran out, and cells examined.
    largest_multiplier : float
        The largest M(1 + t) / mu of a closed cell (see `distance_allowance`).
    seconds : float
    """

    guaranteed: float
    target: float
    open_cells: int
    cells: int
    largest_multiplier: float
    seconds: float

    def distance_allowance(self, mu: float, delta: float, period: float = 1.0) -> float:
        """Finite delta: a gait with delta-regularised friction has ``d <= guaranteed W + allowance``.

        Its motions are within delta of minimal dissipation, and its power is at most delta below it (docs/bound.md).
        Valid if no cell is left open.
        """
        return mu * (self.guaranteed + np.sqrt(2.0) * self.largest_multiplier) * delta * period


class _Reference:
    """The reference point c(q), its slopes and bounds of its higher derivatives."""

    def __init__(self, bound: Bound, body: Chain) -> None:
        space = bound.potential_space(body)
        self.spline = space.spline
        c = space.coefficients(np.array(bound.coefficients))[1]
        self.c = np.stack([c.real, c.imag])

    def value(self, angles: np.ndarray) -> np.ndarray:
        return np.asarray((self.spline.matrix(angles) @ self.c.T).T)

    def slopes(self, angles: np.ndarray) -> np.ndarray:
        """``(2, 2, n)``: derivative of component i with respect to angle j."""
        return np.stack([(self.spline.matrix(angles, o) @ self.c.T).T for o in ((1, 0), (0, 1))], axis=1)

    def largest(self, angles: np.ndarray, order: tuple[int, int]) -> np.ndarray:
        """Bound on a partial derivative over the knot cell that contains `angles`, for each component, ``(2, n)``.

        The derivative is a spline of lower degree: inside a knot cell it lies in the hull of its coefficients there.
        """
        n, knots = self.spline.per_joint, self.spline.extended
        table = self.c.reshape(2, n, n)
        for axis, times in enumerate(order):
            for k in range(times):
                degree = DEGREE - k
                width = knots[DEGREE + 1 : -1 - k] - knots[1 + k : -DEGREE - 1]
                table = degree * np.diff(table, axis=axis + 1) / width.reshape((-1, 1) if axis == 0 else (1, -1))
        cell = self.spline.cell(angles)
        best = np.zeros((2, angles.shape[1]))
        for i in range(4 - order[0]):
            for j in range(4 - order[1]):
                best = np.maximum(best, np.abs(table[:, cell[0] + i, cell[1] + j]))
        return best


@dataclass
class _Corners:
    """Solutions at the corners of cells: minimal dissipation, and a loaded state for each of the four directions e."""

    free: Loaded
    loaded: list[Loaded]
    gain: np.ndarray
    """``(4, n)``: e.V_c in the loaded states."""


def _solve_corners(body: Chain, reference: _Reference, points: np.ndarray, multiplier: float, delta: float) -> _Corners:
    angles, rates = points[:2], np.stack([np.ones(points.shape[1]), points[2]])
    start = np.stack([np.zeros_like(points[2]), np.zeros_like(points[2]), (1.0 - points[2]) / 3.0])
    free = loaded_balance(body, angles, rates, np.zeros_like(start), start, delta)
    c, slopes = reference.value(angles), reference.slopes(angles)
    along = np.einsum("ijn,jn->in", slopes, rates)
    loaded, gain = [], np.empty((4, points.shape[1]))
    for k, e in enumerate(_LOADS):
        load = np.stack([np.full_like(points[2], e[0]), np.full_like(points[2], e[1]), e[1] * c[0] - e[0] * c[1]])
        state = loaded_balance(body, angles, rates, load / multiplier, free.velocity, delta)
        loaded.append(state)
        gain[k] = (load * state.velocity).sum(axis=0) + e @ along
    return _Corners(free, loaded, gain)


def _spread(values: np.ndarray, axis: int) -> np.ndarray:
    """Largest difference of ``(d, n_cell, 8)`` corner values along one axis of the cells, ``(n_cell,)``."""
    low = _CORNERS[:, axis] == 0
    return np.sqrt(((values[:, :, ~low] - values[:, :, low]) ** 2).sum(axis=0)).max(axis=1)


def _cell_bounds(
    body: Chain, reference: _Reference, low: np.ndarray, size: np.ndarray, multiplier: float, delta: float
) -> tuple[np.ndarray, np.ndarray]:
    """Upper bounds of |V_c|/P over cells with low corners ``(3, n)`` and size ``(3,)``, infinite if unknown; M(1 + t)."""
    n = low.shape[1]
    corner = low[:, :, None] + size[:, None, None] * _CORNERS.T[:, None, :]
    index = np.rint((corner - low.min(axis=1)[:, None, None]) / size[:, None, None]).astype(np.int64)
    flat = index.reshape(3, -1)
    extent = flat.max(axis=1) + 1
    code = (flat[0] * extent[1] + flat[1]) * extent[2] + flat[2]
    _, first, back = np.unique(code, return_index=True, return_inverse=True)
    at = back.reshape(n, 8)
    solved = _solve_corners(body, reference, corner.reshape(3, -1)[:, first], multiplier, delta)

    l1, l2, l3 = body.lengths
    h1, h2, hs = size
    z = solved.free.velocity[:, at]
    ends = [np.stack([z[0], z[1] - 0.5 * l2 * z[2]]), np.stack([z[0], z[1] + 0.5 * l2 * z[2]])]
    rise = np.zeros(n)
    for length, h, end, axis in ((l1, h1, ends[0], 0), (l3, h2, ends[1], 1)):
        largest = np.sqrt((end**2).sum(axis=0)).max(axis=1)
        rise += length * (h * h / 8 * largest + h / 4 * _spread(end, axis))
    P = solved.free.potential[at] + rise[:, None] + _ROUNDING

    centre = low + 0.5 * size[:, None]
    squares = ((h1 * h1 / 8, (2, 0)), (h2 * h2 / 8, (0, 2)))
    c_error = sum(f * reference.largest(centre[:2], o) for f, o in squares)
    slope_error = sum(
        f * reference.largest(centre[:2], (o[0] + d[0], o[1] + d[1])) for f, o in squares for d in ((1, 0), (0, 1))
    )
    spin = (4.0 * P.max(axis=1) + l1 * l1 + l3 * l3) / (l1 * l1 + l2 * l2 + l3 * l3)

    sides, factors = np.empty((4, n, 8)), np.empty((4, n))
    for k, e in enumerate(_LOADS):
        state = solved.loaded[k]
        forces = state.forces[:, :, at]
        t = np.zeros(n)
        for link, length, h, axis in ((0, l1, h1, 0), (2, l3, h2, 1)):
            t += (h * h / 8 * length + h / 4 * _spread(forces[link, :2], axis)) / (_KAPPA * (length + l2))
        left = state.residual[:, at].max(axis=2)
        t += left[0] / l2 + 4.0 * left[1] / l2**2 + _ROUNDING
        # the loaded forces' moment about the head joint does not commute with interpolation in s
        moment = forces[2, 1] * (0.5 * l3) + forces[2, 2]
        component = int(np.flatnonzero(e)[0])
        error = multiplier * hs / 4 * _spread(moment[None], 2) + slope_error[component] + spin * c_error[1 - component]
        lower = multiplier * (state.power + state.leftover_power)[at] - solved.gain[k][at] - error[:, None]
        # the linear-fractional bound needs the sign of its numerator
        sides[k] = multiplier * (1 + t)[:, None] - lower / P
        sides[k][lower.min(axis=1) < 0] = np.inf
        factors[k] = multiplier * (1 + t)
    x, y = np.maximum(sides[:2], 0.0), np.maximum(sides[2:], 0.0)
    value = np.zeros(n)
    for a in x:
        for b in y:
            value = np.maximum(value, np.sqrt(a * a + b * b).max(axis=1))
    # where a solve ended in NaN nothing is proved
    return np.where(np.isnan(value), np.inf, value + _ROUNDING), factors.max(axis=0)


def _touches(body: Chain, low: np.ndarray, size: np.ndarray) -> np.ndarray:
    """Mask of cells that may hold an admissible shape of three equal links."""
    high = low[:2] + size[:2, None]
    crossed = np.minimum(2 * low[0] + low[1], low[0] + 2 * low[1]) > 2 * np.pi + 1e-9
    mirrored = np.maximum(2 * high[0] + high[1], high[0] + 2 * high[1]) < -2 * np.pi - 1e-9
    return ~(crossed | mirrored)


def certify(
    body: Chain,
    friction: Friction,
    bound: Bound,
    target: float,
    *,
    seconds: float = 300.0,
    multiplier: float = 4.0,
    deepest: int = 9,
    delta: float = 1e-7,
) -> Guarantee:
    """Prove that no gait of a three-link body exceeds `target`, or as low a value as the time allows.

    Parameters
    ----------
    body : Chain
        Three equal links.
    friction : Friction
        Isotropic.
    bound : Bound
        Provides the reference point (harmonic 1 only) and the joint limit.
    target : float
    seconds : float
        No new batch of cells is begun after this processor time.
    multiplier : float
        M of the first level; it doubles with every second level.
    deepest : int
        Number of times a cell may be halved.
    delta : float
        Regularisation of the certificates' forces; any value is valid, smaller ones are tighter.

    Raises
    ------
    ProblemError
        For a body or friction without a proof.
    """
    equal = body.n_link == 3 and len(set(body.lengths)) == 1 and not body.weights
    if not friction.isotropic or not equal or bound.harmonics != (1,):
        raise ProblemError(
            "a bound is guaranteed only for three links of equal lengths and weights, isotropic friction and harmonic 1; "
            "otherwise the sampled value stands."
        )
    if bound.graded:
        raise ProblemError("cells have to keep to the knots of the reference point: give a bound whose knots are even.")
    begin = time.process_time()
    reference = _Reference(bound, body)
    goal = target * friction.mu_t
    count = bound.intervals
    size = np.array([bound.joint_limit, bound.joint_limit, 2.0]) * np.array([2 / count, 2 / count, 1 / 4])
    axes = [np.arange(count // 2, count), np.arange(count), np.arange(4)]
    low = np.stack([a.ravel() for a in np.meshgrid(*axes, indexing="ij")]) * size[:, None]
    low -= np.array([bound.joint_limit, bound.joint_limit, 1.0])[:, None]
    parents = np.full(low.shape[1], np.inf)
    examined, largest = 0, 0.0
    for level in range(deepest + 1):
        kept = _touches(body, low, size)
        low, parents = low[:, kept], parents[kept]
        values = parents.copy()
        out_of_time = False
        for first in range(0, low.shape[1], _CHUNK):
            if time.process_time() - begin > seconds:
                out_of_time = True
                break
            chosen = slice(first, first + _CHUNK)
            cell_values, factors = _cell_bounds(body, reference, low[:, chosen], size, multiplier * 2.0 ** (0.5 * level), delta)
            values[chosen] = np.fmin(parents[chosen], cell_values)
            closed = values[chosen] <= goal
            largest = max(largest, float(factors[closed].max(initial=0.0)))
            examined += cell_values.size
        still = ~(values <= goal)
        low, parents = low[:, still], values[still]
        if out_of_time or not still.any() or level == deepest:
            break
        size = 0.5 * size
        low = (low[:, :, None] + size[:, None, None] * _CORNERS.T[:, None, :]).reshape(3, -1)
        parents = np.repeat(parents, 8)
    worst = float(parents.max(initial=0.0)) / friction.mu_t
    return Guarantee(
        max(target, worst), target, int(parents.size), examined, largest / friction.mu_t, time.process_time() - begin
    )


def with_guarantee(bound: Bound, certificate: Guarantee) -> Bound:
    """The bound together with what was proved; what is still missing is named if cells were left open."""
    missing = "" if certificate.open_cells == 0 else f"{certificate.open_cells} of {certificate.cells} cells left open"
    return dataclasses.replace(bound, guaranteed=certificate.guaranteed, missing=missing)
