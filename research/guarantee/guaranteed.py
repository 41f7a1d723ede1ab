r"""A guaranteed upper bound for a three-link body under associated friction: certificates for whole
cells (docs/bound.md).

Cells are boxes of (angle 1, angle 2, s) with rates (1, s), |s| <= 1; the symmetries give the rest,
or the same cells of the body turned end for end. Over a cell, gain and power
of the balanced motion differ from what interpolates their values at the corners by at most what
`guarantee.enclosure` and `guarantee.potential_range` say, so their ratio is largest at a corner.
Cells that fail are split in eight.
"""

from __future__ import annotations

import dataclasses
import time
from collections import deque
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np

from colloc.bounds.motions import Domain
from colloc.bounds.sampled import Bound, PotentialSpace
from colloc.mechanics.chain import Chain
from colloc.mechanics.contact import near_contacts
from colloc.mechanics.friction import Friction
from colloc.system.environment import available_threads
from colloc.system.errors import ProblemError
from research.guarantee.enclosure import (
    CORNERS,
    WIDER,
    Allowance,
    Cells,
    by_convexity,
    by_loads,
    corner_motions,
    least_power,
)
from research.guarantee.potential_range import PotentialRange, turned

_CHUNK = 8000
_FIRST = 0.07
"""Largest side of the first cells: larger ones are never closed."""
_LAYERS = (1e-9, 1e-6, 1e-4, 1e-3, 4e-3, 8.75e-3, 0.0175, 0.035)
"""Rates of angle 2 between 0 and the first cells' size. Where one joint turns alone two links rest,
and slide with the other joint however slowly it turns. The motion there is homogeneous: what a cell
may not know of it is in proportion to its speed."""
_THIN = 0.5
"""Size in s over that in the angles below which s is not halved: so slow a joint moves all in
proportion."""
_LEAST = 1e-6
"""Share of the power at a corner that has to be left for it to be known to 1e-9 with rounding."""
_LOAD = 4.0
"""Times the root of the cell's size: 1/multiplier of the loads. It balances what they move with
what interpolation loses."""


@dataclass(frozen=True)
class Guarantee:
    """What the cells prove.

    Attributes
    ----------
    guaranteed : float
        No balanced motion exceeds this ratio: proved, with rounding.
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
    """Points between given edges, each interval of an axis halved so many times; cells are named by
    integers."""

    edges: tuple[np.ndarray, ...]
    levels: tuple[int, int, int]

    def coordinate(self, axis: int, index: np.ndarray) -> np.ndarray:
        edges, parts = self.edges[axis], 1 << self.levels[axis]
        first = index // parts
        begin, end = edges[first], edges[np.minimum(first + 1, edges.size - 1)]
        return begin + (end - begin) * ((index - first * parts) / parts)

    def box(self, index: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Low corners and sizes of cells, ``(3, n)`` each."""
        low = np.stack([self.coordinate(axis, index[axis]) for axis in range(3)])
        return low, np.stack([self.coordinate(axis, index[axis] + 1) for axis in range(3)]) - low

    def cells(self, index: np.ndarray) -> Cells:
        """The cells of some names ``(3, n)``."""
        low, size = self.box(index)
        corner = (index[:, :, None] + CORNERS.T[:, None, :]).reshape(3, -1)
        extent = [
            (edges.size << level) + 1 for edges, level in zip(self.edges, self.levels, strict=True)
        ]
        code = (corner[0] * extent[1] + corner[1]) * extent[2] + corner[2]
        _, first, back = np.unique(code, return_index=True, return_inverse=True)
        points = np.stack([self.coordinate(axis, corner[axis, first]) for axis in range(3)])
        return Cells(low, size, points, back.reshape(-1, 8))

    def halved(
        self, index: np.ndarray, parents: np.ndarray
    ) -> list[tuple[_Lattice, np.ndarray, np.ndarray]]:
        """Lattices with parts of some cells, and what is known of each; cells that are thin in s
        are halved in angles only."""
        size, found = self.box(index)[1], []
        thin = size[2] < _THIN * size[:2].min(axis=0)
        for cells, cut in ((thin, np.array([1, 1, 0])), (~thin, np.ones(3, dtype=int))):
            parts = CORNERS[(cut >= CORNERS).all(axis=1)].T
            halves = ((1 + cut)[:, None, None] * index[:, cells, None] + parts[:, None, :]).reshape(
                3, -1
            )
            levels = tuple((np.array(self.levels) + cut).tolist())
            found.append(
                (_Lattice(self.edges, levels), halves, np.repeat(parents[cells], parts.shape[1]))
            )
        return found


def cell_bounds(
    body: Chain, friction: Friction, potential: PotentialRange, cells: Cells, goal: float
) -> np.ndarray:
    """Upper bounds of gain over power in the cells, ``(n,)``, under associated friction, mu_t = 1;
    infinite if unknown.

    Loads are tried where convexity alone does not bring the bound below `goal`.
    """
    motions = corner_motions(body, friction, cells)
    gain, power = (
        potential.corner_gain(cells, motions)[cells.at],
        least_power(body, friction, cells, motions)[cells.at],
    )
    beyond, reference = potential.trial_error(cells, motions), potential.reference(cells)

    def largest(chosen: np.ndarray, allowed: Allowance) -> np.ndarray:
        below = power[chosen] - allowed.power[:, None]
        with np.errstate(invalid="ignore", divide="ignore"):
            value = WIDER * ((gain[chosen] + (beyond[chosen] + allowed.gain)[:, None]) / below).max(
                axis=1
            )
        # the rounding of what is left is as small as that of a sum only if much is left
        return np.where((below > _LEAST * power[chosen]).all(axis=1) & (value >= 0), value, np.inf)

    everything = np.arange(cells.low.shape[1])
    value = largest(everything, by_convexity(body, friction, cells, motions, reference))
    still = np.flatnonzero(~(value <= goal))
    if still.size:
        few, used = cells.take(still)
        some = type(motions)(*(field[..., used] for field in motions))
        multiplier = _LOAD / np.sqrt(few.size[:2].max())
        loaded = by_loads(body, friction, few, some, potential.reference(few), multiplier)
        value[still] = np.fmin(value[still], largest(still, loaded))
    return value


def _uncrossed(body: Chain, low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """Mask of boxes of angles ``(2, n)``, none of which holds both signs of an angle, that may hold
    a shape without crossing.

    Links cross where two sums exceed pi (`colloc.mechanics.contact`). The first rises with angle 2,
    and with angle 1 it rises, or rises and then falls: over a box of positive angles it is least at
    a corner. So is the second.
    """
    low, high = np.where(low.sum(axis=0) < 0, (-high, -low), (low, high))
    to_the_left = near_contacts(body)[0]
    near, turned, other = (
        to_the_left.pair(np.stack(each))  # over pi
        for each in ((low[0], low[1]), (high[0], low[1]), (low[0], high[1]))
    )
    crossed = (np.minimum(near[0], turned[0]) > 1e-9) & (np.minimum(near[1], other[1]) > 1e-9)
    return ~(crossed[0] & (low >= 0.0).all(axis=0))


def _first_edges(knots: np.ndarray, reversible: bool) -> tuple[np.ndarray, ...]:
    """Of angle 1, of angle 2 and of s: with all knots, and no interval longer than `_FIRST`.

    Mirror image and reversal in time together change the signs of the angles and not of their
    rates.
    """
    knots = np.unique(np.concatenate([knots, [0.0]]))
    counts = np.ceil(np.diff(knots) / _FIRST).astype(int)
    edges = np.concatenate(
        [
            np.linspace(a, b, m, endpoint=False)
            for a, b, m in zip(knots, knots[1:], counts, strict=False)
        ]
    )
    edges = np.append(edges, knots[-1])
    thin = np.array(_LAYERS)
    rates = np.concatenate([thin, np.linspace(_FIRST, 1.0, int(np.ceil(1.0 / _FIRST)))])
    return (
        edges[edges >= 0.0] if reversible else edges,
        edges,
        np.concatenate([-rates[::-1], [0.0], rates]),
    )


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
    """Prove that no gait of a three-link body exceeds `target`, or as low a value as the time
    allows.

    Parameters
    ----------
    domain : Domain
        Three links, and associated friction: equal coefficients, or
        `colloc.laws.resistance.Elliptic`.
    space, free
        The potential, as `colloc.bounds.sampled.Bound` or a kept one has it.
    target : float
    seconds : float
        No new batch of cells is begun after this processor time.
    deepest : int
        Number of times a cell may be halved.
    part : (int, int)
        (k, n): the k-th of n parts of the first cells, so that several processes, or several runs,
        may share them. What is guaranteed is the largest value of all parts.

    Raises
    ------
    ProblemError
        For a body or friction without a proof, or without a C compiler.
    """
    body, friction = domain.body, domain.friction
    odd = not friction.reversible or all(k % 2 for k in space.harmonics)
    if (
        not friction.associated
        or body.n_link != 3
        or body.weights
        or body.feet
        or not (odd and 1 in space.harmonics)
    ):
        raise ProblemError(
            "a bound is guaranteed only for three links without feet or weights of their own, "
            "associated friction (equal "
            "coefficients, or the elliptic law), and harmonics from 1 on, odd ones where mu_b = "
            "mu_f; otherwise the sampled "
            "value stands."
        )
    begin, unit = time.process_time(), friction.in_units_of(friction.mu_t)
    views = [(body, free)]
    if not space.end_swap:
        views.append((Chain(body.lengths[::-1]), turned(space, free)))
    left, examined, deepened = [np.empty(0)], 0, 0
    for view, potential in views:
        cover = _Cover(
            view,
            unit,
            PotentialRange(space, potential),
            target * friction.mu_t,
            begin + seconds,
            deepest,
        )
        values, count, level = cover.closed(part)
        left.append(values)
        examined, deepened = examined + count, max(deepened, level)
    still = np.concatenate(left)
    worst = float(still.max(initial=0.0)) / friction.mu_t
    return Guarantee(
        max(target, worst), target, int(still.size), examined, deepened, time.process_time() - begin
    )


@dataclass(frozen=True, eq=False)
class _Cover:
    """Cells of one view of a body, under friction of mu_t = 1, and what they have to prove until
    when [processor time]."""

    body: Chain
    friction: Friction
    potential: PotentialRange
    goal: float
    end: float
    deepest: int

    def closed(self, part: tuple[int, int]) -> tuple[np.ndarray, int, int]:
        """What is known of the cells that stay open, the number of cells examined, and how often
        they were halved."""
        edges = _first_edges(self.potential.spline.knots, self.friction.reversible)
        index = np.stack(
            [a.ravel() for a in np.meshgrid(*(np.arange(e.size - 1) for e in edges), indexing="ij")]
        )
        index = np.array_split(index, part[1], axis=1)[part[0] - 1]
        work = deque([(_Lattice(edges, (0, 0, 0)), index, np.full(index.shape[1], np.inf))])
        left, examined, level = [np.empty(0)], 0, 0
        with ThreadPoolExecutor(available_threads()) as pool:
            while work:
                lattice, index, values = work.popleft()
                low, size = lattice.box(index)
                kept = _uncrossed(self.body, low[:2], low[:2] + size[:2])
                index, values, level = index[:, kept], values[kept], lattice.levels[0]

                def bounds(
                    first: int, lattice: _Lattice = lattice, index: np.ndarray = index
                ) -> np.ndarray | None:
                    if time.process_time() > self.end:
                        return None
                    cells = lattice.cells(index[:, first : first + _CHUNK])
                    return cell_bounds(self.body, self.friction, self.potential, cells, self.goal)

                starts = range(0, index.shape[1], _CHUNK)
                for first, found in zip(starts, pool.map(bounds, starts), strict=True):
                    if found is not None:
                        values[first : first + _CHUNK] = np.fmin(
                            values[first : first + _CHUNK], found
                        )
                        examined += found.size
                still = ~(values <= self.goal)
                if level == self.deepest or time.process_time() > self.end:
                    left.append(values[still])
                elif still.any():
                    work.extend(lattice.halved(index[:, still], values[still]))
        return np.concatenate(left), examined, level


def with_guarantee(bound: Bound, certificate: Guarantee) -> Bound:
    """The bound together with what was proved; what is still missing is named if cells were left
    open."""
    missing = (
        ""
        if certificate.open_cells == 0
        else f"{certificate.open_cells} of {certificate.cells} cells left open"
    )
    return dataclasses.replace(bound, guaranteed=certificate.guaranteed, missing=missing)
