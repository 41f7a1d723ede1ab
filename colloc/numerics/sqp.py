"""Small programs with bounds and rows by sequential quadratic programming with dense quasi-Newton
updates.

The second derivatives of a reduced gait program jump where narrow bands of stick cross a mesh
point, so they are not asked for: damped BFGS updates (Powell, 1978) build them from gradients, and
do not mind. What comes back is measured here. SciPy's SLSQP takes the same steps (150 to 600 ms
each with 250 parameters, where this takes 12), but begins anew at every call.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol, TypeVar

import numpy as np

from colloc.numerics.nonnegative import nonnegative
from colloc.numerics.quadratic_step import quadratic_step
from colloc.system.interruption import interrupted, interruptible

Value = TypeVar("Value")
_NOWHERE = 1e3
"""Objective where the balance cannot be solved: a line search steps back from it."""
_ACTIVE = 1e-6
"""Slack below which an inequality may carry a multiplier; its product with the slack is measured
too."""
_EDGE = 1e-9
_FEASIBLE = 1e-10
"""Sum of the violations that no accuracy asks to be below."""
_TRIED, _DAMPED = 12, 0.2
"""Points along a step; the least curvature along it, as a share of what was known (Powell)."""


class NonlinearProgram(Protocol):
    """Minimise ``objective(v)`` with v within ``lower, upper`` and ``rows(v)`` within ``row_lower,
    row_upper``; where those are equal, rows are equations."""

    @property
    def lower(self) -> np.ndarray: ...

    @property
    def upper(self) -> np.ndarray: ...

    @property
    def row_lower(self) -> np.ndarray: ...

    @property
    def row_upper(self) -> np.ndarray: ...

    def objective(self, v: np.ndarray) -> float: ...

    def gradient(self, v: np.ndarray) -> np.ndarray: ...

    def rows(self, v: np.ndarray) -> np.ndarray: ...

    def row_slopes(self, v: np.ndarray) -> np.ndarray: ...


@dataclass(frozen=True, eq=False)
class Stationarity:
    """First-order conditions at a point, by the multipliers that come closest to them."""

    kkt_error: float
    """Largest component of the Lagrangian's gradient."""
    violation: float
    """Largest violation of a row or bound."""
    complementarity: float
    """Largest product of a multiplier and its slack."""
    on_rows: np.ndarray
    on_bounds: np.ndarray
    """Multipliers of rows and bounds, positive at upper ones."""


def binding(program: NonlinearProgram, v: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Which rows and bounds, counted on, may carry a multiplier at their upper and at their lower
    ends; and their slopes, ``(n, n_binding)``, those at lower ends reversed."""
    values, unit = (
        np.concatenate([program.rows(v), v]),
        np.vstack([program.row_slopes(v), np.eye(v.size)]),
    )
    lower, upper = (
        np.concatenate([program.row_lower, program.lower]),
        np.concatenate([program.row_upper, program.upper]),
    )
    high, low = np.flatnonzero(values > upper - _ACTIVE), np.flatnonzero(values < lower + _ACTIVE)
    return high, low, np.concatenate([unit[high], -unit[low]]).T


def stationarity(program: NonlinearProgram, v: np.ndarray) -> Stationarity:
    """Measure the first-order conditions at v, with the non-negative multipliers that minimise the
    Lagrangian's gradient; where there are no variables they hold."""
    if not v.size:
        return Stationarity(0.0, 0.0, 0.0, np.zeros(program.row_lower.size), np.empty(0))
    gradient, values = program.gradient(v), np.concatenate([program.rows(v), v])
    lower, upper = (
        np.concatenate([program.row_lower, program.lower]),
        np.concatenate([program.row_upper, program.upper]),
    )
    high, low, columns = binding(program, v)
    multipliers, on = np.zeros(values.size), np.zeros(0)
    if columns.size and np.isfinite(columns).all() and np.isfinite(gradient).all():
        on = nonnegative(columns, -gradient)
        np.add.at(multipliers, high, on[: high.size])
        np.add.at(multipliers, low, -on[high.size :])
    slack = np.where(multipliers > 0, upper - values, values - lower)
    slack = np.where((lower < upper) & (multipliers != 0), slack, 0.0)
    outside = np.maximum(np.maximum(lower - values, values - upper), 0.0)
    left = gradient + (columns @ on if on.size else 0.0)
    on_rows, on_bounds = np.split(multipliers, [values.size - v.size])
    return Stationarity(
        float(np.abs(left).max()),
        float(outside.max()),
        float(np.abs(multipliers * slack).max()),
        on_rows,
        on_bounds,
    )


@dataclass(frozen=True, eq=False)
class SqpResult:
    """Where SQP ended."""

    v: np.ndarray  # (n,)
    objective: float
    iterations: int
    evaluations: int
    on_edge: bool
    """Whether v lies on the edge of the box round the start."""
    curvature: np.ndarray
    """What is known of the Lagrangian's second derivatives, ``(n, n)``."""


@dataclass(frozen=True, eq=False)
class _Point:
    """A point and what holds there; an objective or row that cannot be evaluated is far too
    large."""

    v: np.ndarray
    objective: float
    rows: np.ndarray
    outside: np.ndarray

    @classmethod
    def at(cls, program: NonlinearProgram, v: np.ndarray) -> _Point:
        value, rows = program.objective(v), program.rows(v)
        rows = np.where(np.isfinite(rows), rows, _NOWHERE)
        outside = np.maximum(np.maximum(program.row_lower - rows, rows - program.row_upper), 0.0)
        return cls(v, value if np.isfinite(value) else _NOWHERE, rows, outside)


def minimised(
    program: NonlinearProgram,
    v: np.ndarray,
    radius: float,
    accuracy: float,
    iterations: int = 150,
    curvature: np.ndarray | None = None,
) -> SqpResult:
    """Minimise from v within a box of the given radius round it.

    Every step is the minimum of a quadratic model, within the box and the rows' linear models. It
    is shortened until the objective and the violations, each at its price, fall together (Han,
    1977; Powell, 1978).

    Parameters
    ----------
    program : NonlinearProgram
    v : (n,)
    radius : float
    accuracy : float
        Of the objective, at which to stop.
    iterations : int
    curvature : (n, n), optional
        Of the first model; by default 1. Where a model leads nowhere, it begins anew with that.
    """
    if not v.size:
        return SqpResult(v, program.objective(v), 0, 1, False, np.empty((0, 0)))
    v = np.clip(v, program.lower, program.upper)
    lower, upper = np.maximum(program.lower, v - radius), np.minimum(program.upper, v + radius)
    here, fresh = _Point.at(program, v), curvature is None
    b, price, feasible = (
        np.eye(v.size) if curvature is None else curvature,
        np.zeros(here.rows.size),
        max(accuracy, _FEASIBLE),
    )
    gradient, slopes, count, evaluations = (
        program.gradient(here.v),
        program.row_slopes(here.v),
        0,
        1,
    )
    with interruptible():
        while count < iterations and not interrupted():
            count += 1
            limits = program.row_lower - here.rows, program.row_upper - here.rows
            step = quadratic_step(b, gradient, slopes, *limits, lower - here.v, upper - here.v)
            there = None
            if step is not None:
                price = np.maximum(np.abs(step.on_rows), 0.5 * (price + np.abs(step.on_rows)))
                promised = gradient @ step.d - step.share * price @ here.outside
                if (
                    abs(gradient @ step.d) + price @ here.outside < accuracy
                    and here.outside.sum() < feasible
                ):
                    break
                there, tried = _improved(program, here, step.d, price, promised)
                evaluations += tried
            if step is None or there is None:
                if fresh:
                    break
                b, fresh = np.eye(v.size), True
                continue
            before, here = here, there
            new_gradient, new_slopes = program.gradient(here.v), program.row_slopes(here.v)
            change = new_gradient - gradient + step.on_rows @ (new_slopes - slopes)
            gradient, slopes, b, fresh = (
                new_gradient,
                new_slopes,
                _updated(b, here.v - before.v, change),
                False,
            )
            if abs(here.objective - before.objective) < accuracy and here.outside.sum() < feasible:
                break
    at = here.v
    inner = (program.lower < lower - _EDGE) & (at < lower + _EDGE) | (
        program.upper > upper + _EDGE
    ) & (at > upper - _EDGE)
    return SqpResult(at, here.objective, count, evaluations, bool(inner.any()), b)


def _improved(
    program: NonlinearProgram, here: _Point, d: np.ndarray, price: np.ndarray, promised: float
) -> tuple[_Point | None, int]:
    """The first point along a step that keeps a tenth of what the model promises, if there is one;
    points tried."""
    merit, size = here.objective + price @ here.outside, 1.0
    for tried in range(1, _TRIED + 1):
        there = _Point.at(program, here.v + size * d)
        change = there.objective + price @ there.outside - merit
        if change <= 0.1 * size * promised:
            return there, tried
        size *= min(max(0.5 * size * promised / (size * promised - change), 0.1), 0.5)
    return None, _TRIED


def _updated(b: np.ndarray, s: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Curvature after a step s that changed the Lagrangian's gradient by y: BFGS, damped so that it
    stays positive."""
    bs = b @ s
    sbs, sy = s @ bs, s @ y
    if not np.isfinite(sy) or sbs <= 0:
        return b
    if sy < _DAMPED * sbs:
        share = (1 - _DAMPED) * sbs / (sbs - sy)
        y = share * y + (1 - share) * bs
        sy = s @ y
    return b - np.outer(bs, bs) / sbs + np.outer(y, y) / sy


def remembered(function: Callable[[np.ndarray], Value]) -> Callable[[np.ndarray], Value]:
    """The function, evaluated once where it is asked for the same point again and again."""
    known: dict[bytes, Value] = {}

    def remembering(at: np.ndarray) -> Value:
        key = at.tobytes()
        if key not in known:
            known.clear()
            known[key] = function(at)
        return known[key]

    return remembering
