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


@dataclass(frozen=True, eq=False)
class Rates:
    """Velocities at instants, arrays that end in the same shape: tail velocity ``(3, ...)``,
    velocity of the centre of mass in the body frame (complex; turned back evenly by the turn of a
    period), and ``(1 + k, ...)`` power and densities of k quantities."""

    z: np.ndarray
    centre: np.ndarray
    gained: np.ndarray

    def of(self, chosen: np.ndarray) -> Rates:
        """Those of some intervals."""
        return Rates(self.z[:, chosen], self.centre[chosen], self.gained[:, chosen])

    def joined(self, other: Rates) -> Rates:
        """Those of these intervals, then of others."""
        z, gained = (
            np.concatenate(pair, axis=1)
            for pair in ((self.z, other.z), (self.gained, other.gained))
        )
        return Rates(z, np.concatenate([self.centre, other.centre]), gained)


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
        start = on_one_branch(
            body,
            friction,
            angles,
            rates,
            delta,
            body.solve(friction, angles, rates, delta).require().z,
        )
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

    edges: np.ndarray
    """Panel edges, ``(n + 1,)``."""
    rates: Rates
    """At the panel nodes, ``(n, s)``."""
    theta: np.ndarray
    path: np.ndarray
    """Orientation, and displacement in the lab (complex, starting with orientation 0) at the edges,
    ``(n + 1,)`` each."""
    totals: np.ndarray
    """Work and quantities up to the edges, ``(1 + k, n + 1)``."""
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

    def velocity(self, t: np.ndarray) -> np.ndarray:
        """Tail velocities at phases t of any shape by the panels' polynomials, ``(3, ...)``: good
        to start a solve from."""
        k = np.clip(np.searchsorted(self.edges, t, side="right") - 1, 0, self.edges.size - 2)
        weights = PANEL_RULE.lagrange(
            ((t - self.edges[k]) / np.diff(self.edges)[k]).ravel()
        ).reshape(*t.shape, -1)
        return np.einsum("...s,c...s->c...", weights, self.rates.z[:, k])

    def at(self, t: np.ndarray) -> Increments:
        """Orientation, displacement, work and quantities at phases t ``(n_time,)``, by the panels'
        polynomials."""
        k = np.clip(np.searchsorted(self.edges, t, side="right") - 1, 0, self.edges.size - 2)
        h = np.diff(self.edges)
        weights = PANEL_RULE.integrals((t - self.edges[k]) / h[k]) * h[k][:, None]
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
    """Integrate a path between the first and the last of `edges` to a relative error of the
    efficiency, or another objective.

    Parameters
    ----------
    body, friction
    path : callable
        Joint angles and rates at phases.
    delta : float
        Regularisation speed, per period.
    edges : (n + 1,)
        First panels; the mesh to be measured is a good choice.
    tolerance : float
        Panels are halved until the sum of their disagreements is below this. The sum that remains
        is in the result.
    shares : callable
        From way, work, rotation and quantities to what a small change of each changes in the
        objective, relative to it.
    quantities : sequence of Quantity
        What is asked for besides.
    turn : float
        That a period is asked for [rad]: the way is seen from axes that turn evenly
        (`colloc.gaits.period`).

    Raises
    ------
    NotConvergedError
        If the balance cannot be solved at some instant.
    """

    def solved(
        left: np.ndarray, width: np.ndarray, near: np.ndarray | None = None
    ) -> tuple[Rates, Increments]:
        nodes = left[:, None] + width[:, None] * PANEL_RULE.c
        rates = rates_at(
            body, friction, path, delta, nodes, near=near, quantities=quantities, turn=turn
        )
        return rates, increments(PANEL_RULE, width, rates)

    names = "work", *(quantity.name for quantity in quantities)
    left, width = edges[:-1], np.diff(edges)
    rates, parts = solved(left, width)
    gap = np.full(left.size, np.inf)
    while True:
        # halve the panels that hold the excess over the tolerance
        order = np.argsort(gap)[::-1]
        tail = np.cumsum(gap[order][::-1])[::-1]
        chosen = np.sort(order[(tail > tolerance) & (width[order] > _NARROWEST)])
        if chosen.size == 0 or left.size + chosen.size > _MOST_PANELS:
            break
        half = 0.5 * np.repeat(width[chosen], 2)
        start = np.repeat(left[chosen], 2)
        start[1::2] += half[1::2]
        if friction.associated:
            near = (rates.z[:, chosen] @ _TO_HALVES.T).reshape(3, start.size, -1)
        else:  # no mean of branches is near any of them
            nodes = left[:, None] + width[:, None] * PANEL_RULE.c
            wanted = start[:, None] + half[:, None] * PANEL_RULE.c
            before = np.maximum(np.searchsorted(nodes.ravel(), wanted) - 1, 0)
            near = rates.z.reshape(3, -1)[:, before]
        new_rates, new = solved(start, half, near)
        middle = increments(PANEL_RULE, width[chosen], rates.of(chosen), _TO_MIDDLE)
        # the whole panel, and its polynomials half way, against the two halves
        spin, move = (
            new[0][0::2] + new[0][1::2],
            new[1][0::2] + np.exp(1j * new[0][0::2]) * new[1][1::2],
        )
        sums = list(zip(new[2:], parts[2:], strict=True))
        differences = (
            (
                spin - parts[0][chosen],
                move - parts[1][chosen],
                *(n[0::2] + n[1::2] - p[chosen] for n, p in sums),
            ),
            tuple(
                half - polynomial
                for half, polynomial in zip((a[0::2] for a in new), middle, strict=True)
            ),
        )
        kept = np.ones(left.size, dtype=bool)
        kept[chosen] = False
        place = np.argsort(np.concatenate([left[kept], start]))
        rates = rates.of(kept).joined(new_rates).of(place)
        parts = tuple(np.concatenate([a[kept], b])[place] for a, b in zip(parts, new, strict=True))
        turned, travelled, totals = _accumulated(parts)
        known = dict(zip(names, totals[:, -1], strict=True))
        known |= {"distance": max(abs(travelled[-1]), 1e-300), "rotation": turned[-1]}
        share = {k: abs(s) for k, s in shares(known | {"work": max(known["work"], 1e-300)}).items()}
        on_spin = share["distance"] * np.abs(travelled - travelled[-1]).max() + share["rotation"]
        change = sum(
            np.abs(move) * share["distance"]
            + np.abs(spin) * on_spin
            + sum(
                np.abs(part) * share.get(name, 0.0)
                for name, part in zip(names, gained, strict=True)
            )
            for spin, move, *gained in differences
        )
        gap = np.concatenate([gap[kept], np.repeat(0.5 * change, 2)])[place]
        left, width = (
            np.concatenate([left[kept], start])[place],
            np.concatenate([width[kept], half])[place],
        )
    return FineMotion(np.append(left, edges[-1]), rates, *_accumulated(parts), gap)


def _accumulated(parts: Increments) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Orientation, lab displacement, and work and quantities at the edges, from every interval's
    own."""
    theta, *totals = (np.concatenate([[0.0], np.cumsum(a)]) for a in (parts[0], *parts[2:]))
    return (
        theta,
        np.concatenate([[0.0], np.cumsum(np.exp(1j * theta[:-1]) * parts[1])]),
        np.stack(totals),
    )
