"""A gait's motion by adaptive Gauss quadrature, at any phase.

Panels are halved until both halves agree with them, so they shrink towards the kinks of stick and
slip. Knowing nothing of a collocation mesh, they are what meshes are measured against.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from colloc.dynamics.branches import on_one_branch
from colloc.gaits.objective import EFFICIENCY
from colloc.mechanics.bodies import Body
from colloc.mechanics.densities import Instants, Quantity
from colloc.mechanics.law import Law
from colloc.numerics.schemes import Scheme, scheme
from colloc.verification.replay_record import Path

PANEL_RULE = scheme("gauss-5")
_TO_MIDDLE = PANEL_RULE.integrals(np.array([0.5]))[0]
_TO_HALVES = PANEL_RULE.lagrange(0.5 * np.concatenate([PANEL_RULE.c, 1.0 + PANEL_RULE.c]))
_NARROWEST = 1e-9
_MOST_PANELS = 20_000
_PIECES = 400, 200
"""Pieces of a path in which a quantity is summed up, and once more for the error."""

Increments = tuple[np.ndarray, ...]
"""Rotation, displacement in the initial body frame (complex), work and quantities of intervals."""


class Rates(NamedTuple):
    z: np.ndarray  # tail velocity, (3, ...)
    centre: np.ndarray
    """Velocity of the centre of mass in the body frame (complex), turned back evenly by the
    turn."""
    gained: np.ndarray  # power and densities of k quantities, (1 + k, ...)

    def of(self, panels: np.ndarray) -> Rates:
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
    """Solve for the velocities of a path at phases t, from tail velocities `near` ``(3, ...)``;
    without them at ascending phases, on one branch in time where several motions are balanced."""
    angles, rates = path(t.ravel())
    at = body, friction, angles, rates, delta
    if near is None:
        z = body.solve(*at[1:]).require().z
        start = on_one_branch(*at, z)
    else:
        start = near.reshape(3, -1)
    now = body.motion(*at[1:], body.solve(*at[1:], start=start).require())
    seen = Instants(*at, z=now.z, joint_map=getattr(path, "joint_map", None))
    gained = np.stack([now.power, *(quantity.at(seen)[0] for quantity in quantities)])
    rows = now.z, (now.centre[0] + 1j * now.centre[1]) * np.exp(-1j * turn * t.ravel()), gained
    return Rates(*(row.reshape(*row.shape[:-1], *t.shape) for row in rows))


def totals_along(
    quantity: Quantity, path: Path, left: np.ndarray, right: np.ndarray, pieces: int
) -> np.ndarray:
    """A quantity of shapes and rates alone over intervals, ``(n,)``, by Gauss quadrature."""
    h = (right - left) / pieces
    starts = left[:, None] + h[:, None] * np.arange(pieces)
    t = starts[:, :, None] + h[:, None, None] * PANEL_RULE.c
    driven = getattr(path, "driven", path)
    densities = quantity.of_shapes(*driven(t.ravel()))[0].reshape(t.shape)
    return h * (densities @ PANEL_RULE.b).sum(axis=1)


def whole_totals(
    quantities: Iterable[Quantity], path: Path
) -> tuple[dict[str, float], dict[str, float]]:
    """Quantities of shapes and rates alone over a period, and their errors."""
    values, errors = {}, {}
    for each in quantities:
        value, rougher = (
            float(totals_along(each, path, np.zeros(1), np.ones(1), pieces)[0])
            for pieces in _PIECES
        )
        values[each.name], errors[each.name] = value, abs(value - rougher)
    return values, errors


def increments(
    rule: Scheme, h: np.ndarray, rates: Rates, weights: np.ndarray | None = None
) -> Increments:
    """Increments of intervals of length h ``(n,)`` from rates at the nodes of the rule ``(n, s)``;
    other weights are those of an integral over a part of the interval."""
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
    """Relative error of the objective that a panel may still hold: what halving it last changed, at
    its end and half way, ``(n,)``."""

    @property
    def nodes(self) -> np.ndarray:
        return self.edges[:-1, None] + np.diff(self.edges)[:, None] * PANEL_RULE.c

    def _locate(self, t: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Panels of phases, fractions of these, and the lengths of all panels."""
        k = np.clip(np.searchsorted(self.edges, t, side="right") - 1, 0, self.edges.size - 2)
        h = np.diff(self.edges)
        return k, (t - self.edges[k]) / h[k], h

    def velocity(self, t: np.ndarray) -> np.ndarray:
        """Tail velocities ``(3, ...)`` at phases t by the panels' polynomials."""
        k, fraction, _ = self._locate(t)
        weights = PANEL_RULE.lagrange(fraction.ravel()).reshape(*t.shape, -1)
        return np.einsum("...s,c...s->c...", weights, self.rates.z[:, k])

    def at(self, t: np.ndarray) -> Increments:
        """Orientation, displacement, work and quantities at phases t ``(n_time,)``."""
        k, fraction, h = self._locate(t)
        weights = PANEL_RULE.integrals(fraction) * h[k][:, None]
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
    """Integrate a path over panels that begin as those of `edges`, to a relative error of an
    objective.

    `shares` gives its relative change per unit of way, work, rotation and quantities; the way is
    seen from axes that turn evenly, by `turn` a period. `NotConvergedError` without a balance.
    """
    names = "work", *(quantity.name for quantity in quantities)
    asked: Any = {"quantities": quantities, "turn": turn}
    left, width = edges[:-1], np.diff(edges)
    nodes = left[:, None] + width[:, None] * PANEL_RULE.c
    rates, gap = rates_at(body, friction, path, delta, nodes, **asked), np.full(left.size, np.inf)
    parts = increments(PANEL_RULE, width, rates)
    while True:
        # halve the panels that hold the excess over the tolerance
        order = np.argsort(gap)[::-1]
        tail = np.cumsum(gap[order][::-1])[::-1]
        chosen = np.sort(order[(tail > tolerance) & (width[order] > _NARROWEST)])
        if chosen.size == 0 or left.size + chosen.size > _MOST_PANELS:
            break
        half, start = 0.5 * np.repeat(width[chosen], 2), np.repeat(left[chosen], 2)
        start[1::2] += half[1::2]
        wanted = start[:, None] + half[:, None] * PANEL_RULE.c
        if friction.associated:
            near = (rates.z[:, chosen] @ _TO_HALVES.T).reshape(3, start.size, -1)
        else:  # no mean of branches is near any of them
            nodes = left[:, None] + width[:, None] * PANEL_RULE.c
            before = np.maximum(np.searchsorted(nodes.ravel(), wanted) - 1, 0)
            near = rates.z.reshape(3, -1)[:, before]
        new = rates_at(body, friction, path, delta, wanted, near=near, **asked)
        # the whole panel, and its polynomials half way, against the two halves
        first, second = ([x[k::2] for x in increments(PANEL_RULE, half, new)] for k in (0, 1))
        second[1] = np.exp(1j * first[0]) * second[1]
        middle = increments(PANEL_RULE, width[chosen], rates.of(chosen), _TO_MIDDLE)
        whole = (part[chosen] for part in parts)
        at_end = [a + b - both for a, b, both in zip(first, second, whole, strict=True)]
        half_way = [a - both for a, both in zip(first, middle, strict=True)]
        rest = np.setdiff1d(np.arange(left.size), chosen)
        place = np.argsort(np.concatenate([left[rest], start]))
        left, width = (
            np.concatenate([old[rest], added])[place]
            for old, added in ((left, start), (width, half))
        )
        joined = zip(rates.of(rest), new, strict=True)
        rates = Rates(*(np.concatenate(pair, axis=-2) for pair in joined)).of(place)
        parts = increments(PANEL_RULE, width, rates)
        on_spin, on_move, *on_sums = _error_weights(parts, names, shares)
        change = sum(
            np.abs(move) * on_move
            + np.abs(spin) * on_spin
            + sum(np.abs(part) * share for share, part in zip(on_sums, sums, strict=True))
            for spin, move, *sums in (at_end, half_way)
        )
        gap = np.concatenate([gap[rest], np.repeat(0.5 * change, 2)])[place]
    return FineMotion(np.append(left, edges[-1]), rates, *_cumulative(parts), gap)


def _error_weights(
    parts: Increments,
    names: tuple[str, ...],
    shares: Callable[[Mapping[str, float]], Mapping[str, float]],
) -> list[float]:
    """Relative change of the objective per unit of rotation, displacement, work and quantities."""
    theta, path, totals = _cumulative(parts)
    period = dict(zip(names, totals[:, -1], strict=True))
    period |= {"distance": max(abs(path[-1]), 1e-300), "rotation": theta[-1]}
    period["work"] = max(period["work"], 1e-300)
    share = {name: abs(value) for name, value in shares(period).items()}
    reach = np.abs(path - path[-1]).max()
    on_spin = share["distance"] * reach + share["rotation"]
    return [on_spin, share["distance"], *(share.get(name, 0.0) for name in names)]


def _cumulative(parts: Increments) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Orientation, lab displacement, and work and quantities at the edges."""
    theta, *totals = (np.append(0.0, np.cumsum(part)) for part in (parts[0], *parts[2:]))
    moved = np.exp(1j * theta[:-1]) * parts[1]
    return theta, np.append(0.0, np.cumsum(moved)), np.stack(totals)
