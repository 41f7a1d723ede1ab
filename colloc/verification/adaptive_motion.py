"""A gait's motion by adaptive quadrature: orientation, displacement and work to a given accuracy,
at any phase.

Velocities are solved for at Gauss nodes of panels; a panel is halved until its two halves agree
with it. Stick and slip give the velocities kinks whose width is of order delta, so the panels
shrink towards them and show where they are. The panels know nothing of a collocation mesh; this is
what a mesh is measured against.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from colloc.gaits.objective import EFFICIENCY
from colloc.mechanics.bodies import Body
from colloc.mechanics.densities import Instants, Quantity
from colloc.mechanics.law import Law
from colloc.motion.followed_motion import on_one_branch
from colloc.numerics.schemes import Scheme, scheme
from colloc.verification.played import Path

PANEL_RULE = scheme("gauss-5")
_TO_MIDDLE = PANEL_RULE.integrals(np.array([0.5]))[0]
_TO_HALVES = PANEL_RULE.lagrange(0.5 * np.concatenate([PANEL_RULE.c, 1.0 + PANEL_RULE.c]))
_NARROWEST = 1e-9
_MOST_PANELS = 20_000


class Rates(NamedTuple):
    """Velocities at instants, arrays that end in the same shape: tail velocity ``(3, ...)``,
    velocity of the centre of mass in the body frame (complex; turned back evenly by the turn of a
    period), and ``(1 + k, ...)`` power and densities of k quantities."""

    z: np.ndarray
    centre: np.ndarray
    gained: np.ndarray

    def of(self, panels: np.ndarray) -> Rates:
        """Those at the nodes of some panels."""
        return Rates(*(each[..., panels, :] for each in self))


def rates_at(
    body: Body,
    friction: Law,
    path: Path,
    delta: float,
    t: np.ndarray,
    *,
    near: np.ndarray | None = None,
    quantities: Sequence[Quantity] = (),
    turn: float = 0.0,
) -> Rates:
    """Solved velocities of a path at phases t of any shape, per period, and densities; `near` ``(3,
    ...)``: tail velocities to start from. Without them phases ascend, and one branch is followed in
    time where several motions are balanced."""
    angles, rates = path(t.ravel())
    if near is None:
        z = body.solve(friction, angles, rates, delta).require().z
        start = on_one_branch(body, friction, angles, rates, delta, z)
    else:
        start = near.reshape(3, -1)
    solved = body.solve(friction, angles, rates, delta, start=start).require()
    now = body.motion(friction, angles, rates, delta, solved)
    at = Instants(
        body, friction, angles, rates, delta, z=now.z, joint_map=getattr(path, "joint_map", None)
    )
    gained = np.stack([now.power, *(quantity.at(at)[0] for quantity in quantities)])
    rows = now.z, (now.centre[0] + 1j * now.centre[1]) * np.exp(-1j * turn * t.ravel()), gained
    return Rates(*(row.reshape(*row.shape[:-1], *t.shape) for row in rows))


_PIECES = 400, 200
"""Of a whole path, in which a quantity is summed up, and once more for the error."""


def totals_along(
    quantity: Quantity, path: Path, left: np.ndarray, right: np.ndarray, pieces: int
) -> np.ndarray:
    """A quantity of shapes and their rates alone over intervals, ``(n,)``, by Gauss quadrature on
    so many pieces of each."""
    h = (right - left) / pieces
    starts = left[:, None] + h[:, None] * np.arange(pieces)
    t = starts[:, :, None] + h[:, None, None] * PANEL_RULE.c
    driven = getattr(path, "driven", path)
    densities = quantity.of_shapes(*driven(t.ravel()))[0].reshape(t.shape)
    return h * (densities @ PANEL_RULE.b).sum(axis=1)


def whole_totals(
    quantities: Iterable[Quantity], path: Path
) -> tuple[dict[str, float], dict[str, float]]:
    """Quantities of shapes and their rates alone over a period, and their errors."""
    values, errors = {}, {}
    for each in quantities:
        value, rougher = (
            float(totals_along(each, path, np.zeros(1), np.ones(1), pieces)[0])
            for pieces in _PIECES
        )
        values[each.name], errors[each.name] = value, abs(value - rougher)
    return values, errors


Increments = tuple[np.ndarray, ...]
"""Rotation, displacement in the initial body frame (complex), work and quantities of intervals,
``(n,)`` each."""


def increments(
    rule: Scheme, h: np.ndarray, rates: Rates, weights: np.ndarray | None = None
) -> Increments:
    """Increments of intervals of length h ``(n,)``, from rates at the nodes of the rule ``(n, s)``.

    `weights` are those of the rule, or of its integral over a part of the interval.
    """
    omega, b = rates.z[2], rule.b if weights is None else weights
    turn = np.exp(1j * h[:, None] * (omega @ rule.A.T))
    return h * (omega @ b), h * ((turn * rates.centre) @ b), *(h * (rates.gained @ b))


@dataclass(frozen=True, eq=False)
class FineMotion:
    """The motion of a gait over its solved part."""

    edges: np.ndarray  # of panels, (n + 1,)
    rates: Rates  # at the panel nodes, (n, s)
    theta: np.ndarray  # orientation at the edges
    path: np.ndarray  # displacement in the lab there (complex, starting with orientation 0)
    totals: np.ndarray  # work and quantities up to the edges, (1 + k, n + 1)
    unresolved: np.ndarray
    """``(n,)``: relative error of the objective that a panel may still hold: what halving it last
    changed, at its end and half way."""

    @property
    def work(self) -> np.ndarray:
        """Up to the edges."""
        return np.asarray(self.totals[0])

    @property
    def nodes(self) -> np.ndarray:
        """Phases of the panel nodes, ``(n, s)``."""
        return self.edges[:-1, None] + np.diff(self.edges)[:, None] * PANEL_RULE.c

    def _locate(self, t: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Panels of phases, where in these they lie, from 0 to 1, and the lengths of all panels."""
        k = np.clip(np.searchsorted(self.edges, t, side="right") - 1, 0, self.edges.size - 2)
        h = np.diff(self.edges)
        return k, (t - self.edges[k]) / h[k], h

    def velocity(self, t: np.ndarray) -> np.ndarray:
        """Tail velocities at phases t of any shape by the panels' polynomials, ``(3, ...)``: good
        to start a solve from."""
        k, place, _ = self._locate(t)
        weights = PANEL_RULE.lagrange(place.ravel()).reshape(*t.shape, -1)
        return np.einsum("...s,c...s->c...", weights, self.rates.z[:, k])

    def at(self, t: np.ndarray) -> Increments:
        """Orientation, displacement, work and quantities at phases t ``(n_time,)``, by the panels'
        polynomials."""
        k, place, h = self._locate(t)
        weights = PANEL_RULE.integrals(place) * h[k][:, None]
        omega = self.rates.z[2]
        turn = np.exp(1j * (self.theta[:-1, None] + h[:, None] * (omega @ PANEL_RULE.A.T)))
        moved = turn * self.rates.centre
        return (
            self.theta[k] + (weights * omega[k]).sum(axis=1),
            self.path[k] + (weights * moved[k]).sum(axis=1),
            *(self.totals[:, k] + (weights * self.rates.gained[:, k]).sum(axis=2)),
        )


def fine_motion(
    body: Body,
    friction: Law,
    path: Path,
    delta: float,
    edges: np.ndarray,
    tolerance: float,
    shares: Callable[[Mapping[str, float]], Mapping[str, float]] = EFFICIENCY.shares,
    quantities: Sequence[Quantity] = (),
    turn: float = 0.0,
) -> FineMotion:
    """Integrate a path between the first and the last of `edges`, which are those of the first
    panels, to a relative error of the efficiency, or another objective.

    Panels are halved until the sum of their disagreements is below the tolerance; what remains is
    in the result. `shares` makes of way, work, rotation and quantities what a small change of each
    changes in the objective, relative to it. The way is seen from axes that turn evenly, by `turn`
    a period (`colloc.gaits.period`). `NotConvergedError` if the balance cannot be solved at some
    instant.
    """
    asked: Any = {"quantities": quantities, "turn": turn}

    def evaluate(
        left: np.ndarray, width: np.ndarray, near: np.ndarray | None = None
    ) -> tuple[Rates, Increments]:
        nodes = left[:, None] + width[:, None] * PANEL_RULE.c
        rates = rates_at(body, friction, path, delta, nodes, near=near, **asked)
        return rates, increments(PANEL_RULE, width, rates)

    def error_weights(parts: Increments) -> tuple[list[float], float, float]:
        """What a change of the work and quantities, of displacement and of rotation in a panel
        changes in the objective, relative."""
        turned, travelled, totals = _cumulative(parts)
        period = dict(zip(names, totals[:, -1], strict=True))
        period |= {"distance": max(abs(travelled[-1]), 1e-300), "rotation": turned[-1]}
        period["work"] = max(period["work"], 1e-300)
        share = {name: abs(value) for name, value in shares(period).items()}
        reach = np.abs(travelled - travelled[-1]).max()
        on_spin = share["distance"] * reach + share["rotation"]
        return [share.get(name, 0.0) for name in names], share["distance"], on_spin

    names = "work", *(quantity.name for quantity in quantities)
    left, width = edges[:-1], np.diff(edges)
    rates, parts = evaluate(left, width)
    gap = np.full(left.size, np.inf)
    while True:
        # halve the panels that hold the excess over the tolerance
        order = np.argsort(gap)[::-1]
        tail = np.cumsum(gap[order][::-1])[::-1]
        chosen = np.sort(order[(tail > tolerance) & (width[order] > _NARROWEST)])
        if chosen.size == 0 or left.size + chosen.size > _MOST_PANELS:
            break
        half, start = 0.5 * np.repeat(width[chosen], 2), np.repeat(left[chosen], 2)
        start[1::2] += half[1::2]
        if friction.associated:
            near = (rates.z[:, chosen] @ _TO_HALVES.T).reshape(3, start.size, -1)
        else:  # no mean of branches is near any of them
            nodes = left[:, None] + width[:, None] * PANEL_RULE.c
            wanted = start[:, None] + half[:, None] * PANEL_RULE.c
            before = np.maximum(np.searchsorted(nodes.ravel(), wanted) - 1, 0)
            near = rates.z.reshape(3, -1)[:, before]
        new_rates, new = evaluate(start, half, near)
        middle = increments(PANEL_RULE, width[chosen], rates.of(chosen), _TO_MIDDLE)
        # the whole panel, and its polynomials half way, against the two halves
        first, second = ([part[k::2] for part in new] for k in (0, 1))
        second[1] = np.exp(1j * first[0]) * second[1]
        both = [one + other for one, other in zip(first, second, strict=True)]
        pairs = zip(both, (part[chosen] for part in parts), strict=True)
        differences = (
            [halves - whole for halves, whole in pairs],
            [half_way - polynomial for half_way, polynomial in zip(first, middle, strict=True)],
        )
        kept = np.setdiff1d(np.arange(left.size), chosen)
        place = np.argsort(np.concatenate([left[kept], start]))

        def merge(old: np.ndarray, new: np.ndarray, kept: Any = kept, place: Any = place) -> Any:
            return np.concatenate([old[kept], new])[place]

        joined = zip(rates.of(kept), new_rates, strict=True)
        rates = Rates(*(np.concatenate(pair, axis=-2) for pair in joined)).of(place)
        parts = tuple(merge(old, added) for old, added in zip(parts, new, strict=True))
        on_sums, on_move, on_spin = error_weights(parts)
        change = sum(
            np.abs(move) * on_move
            + np.abs(spin) * on_spin
            + sum(np.abs(part) * share for share, part in zip(on_sums, gained, strict=True))
            for spin, move, *gained in differences
        )
        gap = merge(gap, np.repeat(0.5 * change, 2))
        left, width = merge(left, start), merge(width, half)
    return FineMotion(np.append(left, edges[-1]), rates, *_cumulative(parts), gap)


def _cumulative(parts: Increments) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Orientation, lab displacement, and work and quantities at the edges, from every interval's
    own."""
    theta, *totals = (np.append(0.0, np.cumsum(part)) for part in (parts[0], *parts[2:]))
    moved = np.exp(1j * theta[:-1]) * parts[1]
    return theta, np.append(0.0, np.cumsum(moved)), np.stack(totals)
