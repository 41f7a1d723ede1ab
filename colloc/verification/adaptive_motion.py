"""A gait's motion by adaptive Gauss quadrature, at any phase, and the record of a period.

Panels are halved until both halves agree with them, so they shrink towards the kinks of stick and
slip. They know nothing of a collocation mesh: it is held against them.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, NamedTuple, TypeVar

import numpy as np

from colloc.gaits.objective import EFFICIENCY, Objective, Period, chord_per_way
from colloc.mechanics.bodies import Body
from colloc.mechanics.densities import Instants, Quantity
from colloc.mechanics.law import Law
from colloc.mechanics.solution_branches import on_one_branch
from colloc.numerics.schemes import Scheme, scheme
from colloc.system.errors import NotConvergedError

PANEL_RULE = scheme("gauss-5")
_TO_MIDDLE = PANEL_RULE.integrals(np.array([0.5]))[0]
_TO_HALVES = PANEL_RULE.lagrange(0.5 * np.concatenate([PANEL_RULE.c, 1.0 + PANEL_RULE.c]))
_NARROWEST = 1e-9
_MOST_PANELS = 20_000
_PIECES = 400, 200
"""Pieces of a path in which a quantity is summed up, and once more for the error."""
_TENTH = 0.1  # error of each run over that of the last
LEAST = 1e-12  # the smallest error that is tried

Path = Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]]
"""Joint angles and rates, each ``(n_joint, n_time)``, at phases ``(n_time,)``."""
Numbers = dict[str, float]
Ran = TypeVar("Ran")


class Rates(NamedTuple):
    z: np.ndarray  # tail velocity, (3, ...)
    centre: np.ndarray
    """Velocity of the centre of mass in the body frame (complex), turned back evenly by the
    turn."""
    densities: np.ndarray  # power and densities of k quantities, (1 + k, ...)

    def of(self, panels: np.ndarray) -> Rates:
        return Rates(*(each[..., panels, :] for each in self))


def rates_at(
    body: Body,
    friction: Law,
    path: Path,
    delta: float,
    t: np.ndarray,
    *,
    guess: np.ndarray | None = None,
    quantities: Sequence[Quantity] = (),
    turn: float = 0.0,
) -> Rates:
    """Velocities of a path at phases t, from tail velocities `guess` ``(3, ...)``; without them at
    ascending phases, on one branch in time where several motions are balanced."""
    angles, rates = path(t.ravel())
    at = body, friction, angles, rates, delta
    solved = body.solve(*at[1:], start=None if guess is None else guess.reshape(3, -1)).require()
    if guess is None and (start := on_one_branch(*at, solved.z)) is not solved.z:
        solved = body.solve(*at[1:], start=start).require()
    now = body.motion(*at[1:], solved)
    instants = Instants(*at, z=now.z, joint_map=getattr(path, "joint_map", None))
    densities = np.stack([now.power, *(quantity.at(instants)[0] for quantity in quantities)])
    rows = now.z, (now.centre[0] + 1j * now.centre[1]) * np.exp(-1j * turn * t.ravel()), densities
    return Rates(*(row.reshape(*row.shape[:-1], *t.shape) for row in rows))


def totals_along(
    quantity: Quantity, path: Path, left: np.ndarray, right: np.ndarray, pieces: int
) -> np.ndarray:
    """A quantity of shapes and rates alone over intervals, ``(n,)``, by Gauss quadrature."""
    h = (right - left) / pieces
    starts = left[:, None] + h[:, None] * np.arange(pieces)
    t = starts[:, :, None] + h[:, None, None] * PANEL_RULE.c
    shapes: Any = None, None, *getattr(path, "motor_gait", path)(t.ravel()), 0.0
    densities = np.asarray(quantity.at(Instants(*shapes)))[0].reshape(t.shape)
    return h * (densities @ PANEL_RULE.b).sum(axis=1)


def whole_totals(
    quantities: Iterable[Quantity], path: Path
) -> tuple[dict[str, float], dict[str, float]]:
    """Totals of quantities that need no forces, and their errors."""
    values, errors = {}, {}
    for each in [each for each in quantities if not each.needs_forces]:
        value, rougher = (
            float(totals_along(each, path, np.zeros(1), np.ones(1), pieces)[0])
            for pieces in _PIECES
        )
        values[each.name], errors[each.name] = value, abs(value - rougher)
    return values, errors


def increments(
    rule: Scheme, h: np.ndarray, rates: Rates, weights: np.ndarray | None = None
) -> tuple[np.ndarray, ...]:
    """Increments of intervals of length h ``(n,)`` from rates at the nodes of the rule ``(n, s)``;
    other weights are those of an integral over a part of the interval."""
    omega, b = rates.z[2], rule.b if weights is None else weights
    turn = np.exp(1j * h[:, None] * (omega @ rule.A.T))
    return h * (omega @ b), h * ((turn * rates.centre) @ b), *(h * (rates.densities @ b))


@dataclass(frozen=True, eq=False)
class FineMotion:
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
        k = np.clip(np.searchsorted(self.edges, t, side="right") - 1, 0, self.edges.size - 2)
        h = self.edges[k + 1] - self.edges[k]
        return k, (t - self.edges[k]) / h, h

    def velocity(self, t: np.ndarray) -> np.ndarray:
        """Tail velocities ``(3, ...)`` by the panels' polynomials."""
        k, fraction, _ = self._locate(t)
        weights = PANEL_RULE.lagrange(fraction.ravel()).reshape(*t.shape, -1)
        return np.einsum("...s,c...s->c...", weights, self.rates.z[:, k])

    @cached_property
    def _velocity_in_lab(self) -> np.ndarray:
        turned = np.diff(self.edges)[:, None] * (self.rates.z[2] @ PANEL_RULE.A.T)
        return np.exp(1j * (self.theta[:-1, None] + turned)) * self.rates.centre

    def at(self, t: np.ndarray) -> tuple[np.ndarray, ...]:
        """Orientation, displacement, work and quantities ``(n_time,)``."""
        k, fraction, h = self._locate(t)
        weights = PANEL_RULE.integrals(fraction) * h[:, None]
        return (
            self.theta[k] + (weights * self.rates.z[2, k]).sum(axis=1),
            self.path[k] + (weights * self._velocity_in_lab[k]).sum(axis=1),
            *(self.totals[:, k] + (weights * self.rates.densities[:, k]).sum(axis=2)),
        )


def fine_motion(
    body: Body,
    friction: Law,
    path: Path,
    delta: float,
    edges: np.ndarray,
    tolerance: float,
    objective: Objective | None = EFFICIENCY,
    *,
    quantities: Sequence[Quantity] = (),
    turn: float = 0.0,
    periods: float = 1.0,
) -> FineMotion:
    """Integrate a path, in panels that begin as those of `edges`, to a relative error of an
    objective of so many of it; without one to an absolute error of the way.

    The way is seen from axes that turn evenly, by `turn` a period. `NotConvergedError` without a
    balance.
    """
    names = "work", *(quantity.name for quantity in quantities)
    counts = dict.fromkeys(names, periods) | {"rotation": 1.0}
    counts["distance"] = periods * chord_per_way(turn)
    how: Any = {"quantities": quantities, "turn": turn}
    left, width = edges[:-1], np.diff(edges)
    nodes = left[:, None] + width[:, None] * PANEL_RULE.c
    rates, gap = rates_at(body, friction, path, delta, nodes, **how), np.full(left.size, np.inf)
    parts = increments(PANEL_RULE, width, rates)
    while True:
        # halve the panels that hold the excess over the tolerance
        order = np.argsort(gap)[::-1]
        tail = np.cumsum(gap[order][::-1])[::-1]
        halve = np.sort(order[(tail > tolerance) & (width[order] > _NARROWEST)])
        if halve.size == 0 or left.size + halve.size > _MOST_PANELS:
            break
        half, start = 0.5 * np.repeat(width[halve], 2), np.repeat(left[halve], 2)
        start[1::2] += half[1::2]
        phases = start[:, None] + half[:, None] * PANEL_RULE.c
        if friction.associated:
            guess = (rates.z[:, halve] @ _TO_HALVES.T).reshape(3, start.size, -1)
        else:  # no mean of branches is near any of them
            nodes = left[:, None] + width[:, None] * PANEL_RULE.c
            before = np.maximum(np.searchsorted(nodes.ravel(), phases) - 1, 0)
            guess = rates.z.reshape(3, -1)[:, before]
        new = rates_at(body, friction, path, delta, phases, guess=guess, **how)
        # the whole panel, and its polynomials half way, against the two halves
        first, second = ([x[k::2] for x in increments(PANEL_RULE, half, new)] for k in (0, 1))
        second[1] = np.exp(1j * first[0]) * second[1]
        middle = increments(PANEL_RULE, width[halve], rates.of(halve), _TO_MIDDLE)
        whole = (part[halve] for part in parts)
        at_end = [a + b - both for a, b, both in zip(first, second, whole, strict=True)]
        half_way = [a - both for a, both in zip(first, middle, strict=True)]
        rest = np.delete(np.arange(left.size), halve)
        place = np.argsort(np.concatenate([left[rest], start]))
        left, width = (
            np.concatenate([old[rest], added])[place]
            for old, added in ((left, start), (width, half))
        )
        joined = zip(rates.of(rest), new, strict=True)
        rates = Rates(*(np.concatenate(pair, axis=-2) for pair in joined)).of(place)
        parts = increments(PANEL_RULE, width, rates)
        theta, way, totals = _cumulative(parts)
        share = {"distance": 1.0}
        if objective is not None:
            values = dict(zip(names, totals[:, -1], strict=True))
            values |= {"distance": max(abs(way[-1]), 1e-300), "rotation": theta[-1] + turn}
            values["work"] = max(values["work"], 1e-300)
            share = objective.shares({x: counts[x] * value for x, value in values.items()})
            share = {x: abs(counts[x] * share[x]) for x in counts}
        on_spin = share["distance"] * np.abs(way - way[-1]).max() + share.get("rotation", 0.0)
        weights = [on_spin, share["distance"], *(share.get(name, 0.0) for name in names)]
        off = zip(weights, at_end, half_way, strict=True)
        change = sum(weight * (np.abs(a) + np.abs(b)) for weight, a, b in off)
        gap = np.concatenate([gap[rest], np.repeat(0.5 * change, 2)])[place]
    return FineMotion(np.append(left, edges[-1]), rates, *_cumulative(parts), gap)


def _cumulative(parts: tuple[np.ndarray, ...]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    totals = [np.append(0.0, np.cumsum(part)) for part in parts[2:]]
    return *poses(*parts[:2]), np.stack(totals)


def poses(turn: np.ndarray, move: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Heading and place (complex) before every panel and after the last ``(n + 1,)``."""
    heading = np.append(0.0, np.cumsum(turn))
    return heading, np.append(0.0, np.cumsum(np.exp(1j * heading[:-1]) * move))


@dataclass(frozen=True)
class Replay(Period):
    """A simulated period of a gait, and how far its quantities can be trusted."""

    lever: float  # largest distance of a point of the body from its centre of mass [body lengths]
    actuator_work: float  # of the joints, by their moments; equals `work` in balance
    residual: float
    """Largest force or torque left over, in units of the largest friction coefficient; with inertia
    the change of the momenta in a period."""
    error: float  # relative, of the objective
    several: float  # part of the period at which several motions are balanced
    instants: int
    tail: tuple[np.ndarray, np.ndarray] = field(compare=False)
    """Phases ``(n,)`` and tail velocities there ``(3, n)``."""
    shares: np.ndarray = field(default_factory=lambda: np.empty(0), compare=False)
    """Largest shares of the actuators' limits."""
    objective: Objective = EFFICIENCY
    across: float = 0.0  # on a slope the way across the direction that counts
    multipliers: tuple[complex, ...] = ()
    """By what small changes of the momenta are multiplied in a period with inertia."""
    states: np.ndarray = field(default_factory=lambda: np.empty((7, 0)), compare=False)
    """With inertia: Vx, Vy, H (`colloc.mechanics.inertia`), the tail link's orientation, the place
    of the centre of mass, and the work up to there, at the phases of `tail` ``(7, n)``; seen from
    axes that turn evenly."""

    def __repr__(self) -> str:
        value = f"{self.objective.short} = {self.value:.6g} +- {self.error * abs(self.value):.0e}"
        return (
            f"<Replay at {self.instants} instants: {value}, d = {self.distance:.6g}, W = "
            f"{self.work:.6g}>"
        )

    def tail_velocity(self, t: np.ndarray) -> np.ndarray:
        """Tail velocities ``(3, n_time)`` interpolated at phases t."""
        phases, z = self.tail
        return np.stack([np.interp(t, phases, row, period=1.0) for row in z])

    @property
    def value(self) -> float:
        return self.objective(self.values)

    @property
    def stable(self) -> bool:
        """True if motions beside this one come closer to it, period by period."""
        return max(map(abs, self.multipliers), default=0.0) < 1.0

    @property
    def ambiguity(self) -> float:
        """Largest relative change of the objective by other balanced motions."""
        return self.ambiguity_of(self.objective)


def to_tolerance(
    run: Callable[[float], tuple[Ran, Numbers]],
    first: float,
    objective: Objective,
    tolerance: float,
    others: tuple[Numbers, Numbers],
    errors_of: Callable[[Ran, Ran], Numbers] | None = None,
) -> tuple[Ran, Numbers, Numbers]:
    """Solve a differential equation with ever smaller errors a step until these change an objective
    by less than a relative error: the last run, its numbers and their errors.

    `run` takes an error, `first` to begin with; `others` are other numbers and their errors;
    `errors_of` compares a run with one of ten times the error: by default their difference, but
    half of the error at least, as differences vanish now and then. `NotConvergedError` if rounding
    hides the accuracy.
    """
    aim, before = max(first, LEAST / _TENTH), None
    while aim > 0.5 * LEAST:
        motion, now = run(aim)
        if before is not None:
            if errors_of is None:
                errors = {x: max(abs(now[x] - before[1][x]), 0.5 * aim) for x in now}
            else:
                errors = dict.fromkeys(now, 0.0) | errors_of(motion, before[0])
            values, errors = now | others[0], errors | others[1]
            if not objective.relative_error(values, errors) > tolerance:
                return motion, values, errors
        aim, before = _TENTH * aim, (motion, now)
    raise NotConvergedError(
        f"the motion cannot be replayed to a relative error of {tolerance:.0e}."
    )


def lever(body: Body, angles: np.ndarray) -> float:
    """Largest distance of a point of the body from its centre of mass."""
    (x, y), (gx, gy) = body.outline(angles), body.centre(angles)
    return float(np.hypot(x - gx, y - gy).max())
