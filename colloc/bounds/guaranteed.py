r"""A guaranteed upper bound for a three-link body with isotropic friction: certificates for whole cells (docs/bound.md).

Cells are boxes of (angle 1, angle 2, s) with rates (1, s), |s| <= 1; the symmetries give the rest. Over a cell, gain and power
of the balanced motion differ from what interpolates their values at the corners by at most what `bounds.enclosure` and
`bounds.potential_range` say, so their ratio is largest at a corner. Cells that fail are split in eight.
"""

from __future__ import annotations

import dataclasses
import time
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np

from colloc.bounds.enclosure import CORNERS, DELTA, Allowance, Cells, by_convexity, by_loads, corner_motions
from colloc.bounds.potential import PotentialSpace
from colloc.bounds.potential_range import PotentialRange
from colloc.bounds.sampled import Bound
from colloc.bounds.sampling import Domain
from colloc.mechanics.chain import Chain
from colloc.system.errors import ProblemError
from colloc.system.processors import available_threads

_CHUNK = 8000
_FIRST = 0.07
"""Largest side of the first cells: larger ones are never closed."""
_LAYERS = (1e-9, 1e-6, 1e-4, 1e-3, 4e-3, 8.75e-3, 0.0175, 0.035)
"""Rates of angle 2 between 0 and the first cells' size. Where one joint turns alone two links rest, and slide with the other
joint however slowly it turns. The motion there is homogeneous: what a cell may not know of it is in proportion to its speed."""
_LOAD = 4.0
"""Times the root of the cell's size: 1/multiplier of the loads. It balances what they move with what interpolation loses."""


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
    levels : int
        How often cells were halved.
    seconds : float
        Processor time, of all threads.
    """

    guaranteed: float
    target: float
    open_cells: int
    cells: int
    levels: int
    seconds: float


@dataclass(frozen=True, eq=False)
class _Lattice:
    """Points between given edges, each interval halved so many times; cells are named by integers."""

    edges: tuple[np.ndarray, ...]
    level: int

    def coordinate(self, axis: int, index: np.ndarray) -> np.ndarray:
        edges, parts = self.edges[axis], 1 << self.level
        interval = np.minimum(index // parts, edges.size - 2)
        return edges[interval] + (edges[interval + 1] - edges[interval]) * ((index - interval * parts) / parts)

    def cells(self, index: np.ndarray) -> Cells:
        """The cells with low corners ``(3, n)``."""
        low = np.stack([self.coordinate(axis, index[axis]) for axis in range(3)])
        size = np.stack([self.coordinate(axis, index[axis] + 1) for axis in range(3)]) - low
        corner = (index[:, :, None] + CORNERS.T[:, None, :]).reshape(3, -1)
        extent = [(edges.size << self.level) + 1 for edges in self.edges]
        code = (corner[0] * extent[1] + corner[1]) * extent[2] + corner[2]
        _, first, back = np.unique(code, return_index=True, return_inverse=True)
        points = np.stack([self.coordinate(axis, corner[axis, first]) for axis in range(3)])
        return Cells(low, size, points, back.reshape(-1, 8))


def cell_bounds(body: Chain, potential: PotentialRange, cells: Cells, goal: float) -> np.ndarray:
    """Upper bounds of gain over power in the cells, ``(n,)``, for unit friction; infinite if nothing is known.

    Loads are tried where convexity alone does not bring the bound below `goal`.
    """
    motions = corner_motions(body, cells)
    gain, power = potential.corner_gain(cells, motions)[cells.at], (motions.potential - DELTA)[cells.at]
    beyond, reference = potential.trial_error(cells, motions), potential.reference(cells)

    def largest(chosen: np.ndarray, allowed: Allowance) -> np.ndarray:
        below = power[chosen] - allowed.power[:, None]
        with np.errstate(invalid="ignore", divide="ignore"):
            value = ((gain[chosen] + (beyond[chosen] + allowed.gain)[:, None]) / below).max(axis=1)
        return np.where((below.min(axis=1) > 0) & (value >= 0), value, np.inf)

    everything = np.arange(cells.low.shape[1])
    value = largest(everything, by_convexity(body, cells, motions, reference))
    still = np.flatnonzero(~(value <= goal))
    if still.size:
        few, used = cells.take(still)
        some = type(motions)(*(field[..., used] for field in motions))
        multiplier = _LOAD / np.sqrt(few.size[:2].max())
        value[still] = np.fmin(value[still], largest(still, by_loads(body, few, some, potential.reference(few), multiplier)))
    return value


def _touches(body: Chain, low: np.ndarray) -> np.ndarray:
    """Mask of cells above `low`, where angle 1 is positive, that may hold a shape where links 1 and 3 do not cross."""
    if len(set(body.lengths)) > 1:
        return np.ones(low.shape[1], dtype=bool)
    return np.minimum(2 * low[0] + low[1], low[0] + 2 * low[1]) <= 2 * np.pi + 1e-9


def _first_edges(knots: np.ndarray) -> tuple[np.ndarray, ...]:
    """Of angle 1, which is not negative, of angle 2 and of s: with all knots, and no interval longer than `_FIRST`."""
    knots = np.unique(np.concatenate([knots, [0.0]]))
    counts = np.ceil(np.diff(knots) / _FIRST).astype(int)
    edges = np.concatenate([np.linspace(a, b, m, endpoint=False) for a, b, m in zip(knots, knots[1:], counts, strict=False)])
    edges = np.append(edges, knots[-1])
    thin = np.array(_LAYERS)
    rates = np.concatenate([thin, np.linspace(_FIRST, 1.0, int(np.ceil(1.0 / _FIRST)))])
    return edges[edges >= 0.0], edges, np.concatenate([-rates[::-1], [0.0], rates])


def certify(
    domain: Domain,
    space: PotentialSpace,
    free: np.ndarray,
    target: float,
    *,
    seconds: float = 1200.0,
    deepest: int = 12,
    part: tuple[int, int] = (1, 1),
) -> Guarantee:
    """Prove that no gait of a three-link body exceeds `target`, or as low a value as the time allows.

    Parameters
    ----------
    domain : Domain
        Three links, the outer ones of the same length; isotropic friction.
    space, free
        The potential, as `colloc.bounds.sampled.Bound` or a kept one has it.
    target : float
    seconds : float
        No new batch of cells is begun after this processor time.
    deepest : int
        Number of times a cell may be halved.
    part : (int, int)
        (k, n): the k-th of n parts of the first cells, so that several processes, or several runs, may share them. What is
        guaranteed is the largest value of all parts.

    Raises
    ------
    ProblemError
        For a body or friction without a proof, or without a C compiler.
    """
    body, friction = domain.body, domain.friction
    odd = 1 in space.harmonics and all(k % 2 for k in space.harmonics)
    if not friction.isotropic or body.n_link != 3 or body.weights or not space.end_swap or not odd:
        raise ProblemError(
            "a bound is guaranteed only for three links, the outer ones alike, without weights of their own; isotropic "
            "friction and odd harmonics from 1 on; "
            "otherwise the sampled value stands."
        )
    begin, goal = time.process_time(), target * friction.mu_t
    potential = PotentialRange(space, free)
    edges = _first_edges(space.spline.knots)
    index = np.stack([a.ravel() for a in np.meshgrid(*(np.arange(e.size - 1) for e in edges), indexing="ij")])
    index = np.array_split(index, part[1], axis=1)[part[0] - 1]
    parents, examined, level = np.full(index.shape[1], np.inf), 0, 0
    with ThreadPoolExecutor(available_threads()) as pool:
        while True:
            lattice = _Lattice(edges, level)
            kept = _touches(body, np.stack([lattice.coordinate(axis, index[axis]) for axis in (0, 1)]))
            index, values = index[:, kept], parents[kept]

            def bounds(first: int, lattice: _Lattice = lattice, index: np.ndarray = index) -> np.ndarray | None:
                if time.process_time() - begin > seconds:
                    return None
                return cell_bounds(body, potential, lattice.cells(index[:, first : first + _CHUNK]), goal)

            starts = range(0, index.shape[1], _CHUNK)
            out_of_time = False
            for first, found in zip(starts, pool.map(bounds, starts), strict=True):
                if found is None:
                    out_of_time = True
                else:
                    values[first : first + _CHUNK] = np.fmin(values[first : first + _CHUNK], found)
                    examined += found.size
            still = ~(values <= goal)
            index, parents = index[:, still], values[still]
            if out_of_time or not still.any() or level == deepest:
                break
            index = (2 * index[:, :, None] + CORNERS.T[:, None, :]).reshape(3, -1)
            parents, level = np.repeat(parents, 8), level + 1
    worst = float(parents.max(initial=0.0)) / friction.mu_t
    return Guarantee(max(target, worst), target, int(parents.size), examined, level, time.process_time() - begin)


def with_guarantee(bound: Bound, certificate: Guarantee) -> Bound:
    """The bound together with what was proved; what is still missing is named if cells were left open."""
    missing = "" if certificate.open_cells == 0 else f"{certificate.open_cells} of {certificate.cells} cells left open"
    return dataclasses.replace(bound, guaranteed=certificate.guaranteed, missing=missing)
