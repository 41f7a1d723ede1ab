"""Small smooth programs with bounds and rows by sequential quadratic programming with dense quasi-Newton updates.

The second derivatives of a reduced gait program jump where narrow bands of stick cross a mesh point, so they are not asked
for: SciPy's SLSQP (Kraft, 1988) builds its own from gradients, and does not mind. What comes back is measured here.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol, TypeVar

import numpy as np
from scipy.optimize import minimize, nnls

from colloc.system.interruption import interruptible

Value = TypeVar("Value")
_NOWHERE = 1e3
"""Objective where the balance cannot be solved: a line search steps back from it."""
_ACTIVE = 1e-6
"""Slack below which an inequality may carry a multiplier; its product with the slack is measured too."""
_EDGE = 1e-9


class ReducedProgram(Protocol):
    """Minimise ``objective(v)`` with v within ``lower, upper`` and ``rows(v)`` within ``row_lower, row_upper``; where those are
    equal, rows are equations."""

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
    """First-order conditions at a point, by the multipliers that come closest to them.

    Attributes
    ----------
    kkt_error : float
        Largest component of the Lagrangian's gradient.
    violation : float
        Largest violation of a row or bound.
    complementarity : float
        Largest product of a multiplier and its slack.
    on_rows, on_bounds : array
        Multipliers, positive at upper bounds.
    """

    kkt_error: float
    violation: float
    complementarity: float
    on_rows: np.ndarray
    on_bounds: np.ndarray


def stationarity(program: ReducedProgram, v: np.ndarray) -> Stationarity:
    """Measure the first-order conditions at v, with the non-negative multipliers that minimise the Lagrangian's gradient."""
    gradient, rows, slopes = program.gradient(v), program.rows(v), program.row_slopes(v)
    values, unit = np.concatenate([rows, v]), np.vstack([slopes, np.eye(v.size)])
    lower, upper = np.concatenate([program.row_lower, program.lower]), np.concatenate([program.row_upper, program.upper])
    high, low = np.flatnonzero(values > upper - _ACTIVE), np.flatnonzero(values < lower + _ACTIVE)
    columns = np.concatenate([unit[high], -unit[low]]).T
    multipliers, on = np.zeros(values.size), np.zeros(0)
    if columns.size and np.isfinite(columns).all() and np.isfinite(gradient).all():
        on, _ = nnls(columns, -gradient, maxiter=30 * columns.shape[1])
        np.add.at(multipliers, high, on[: high.size])
        np.add.at(multipliers, low, -on[high.size :])
    slack = np.where(multipliers > 0, upper - values, values - lower)
    slack = np.where((lower < upper) & (multipliers != 0), slack, 0.0)
    outside = np.maximum(np.maximum(lower - values, values - upper), 0.0)
    left = gradient + unit.T @ multipliers
    return Stationarity(
        float(np.abs(left).max()),
        float(outside.max()),
        float(np.abs(multipliers * slack).max()),
        multipliers[: rows.size],
        multipliers[rows.size :],
    )


@dataclass(frozen=True, eq=False)
class SqpResult:
    """Where SLSQP ended.

    Attributes
    ----------
    v : (n,)
    objective : float
    iterations, evaluations : int
    on_edge : bool
        Whether v lies on the edge of the box round the start.
    """

    v: np.ndarray
    objective: float
    iterations: int
    evaluations: int
    on_edge: bool


def minimised(program: ReducedProgram, v: np.ndarray, radius: float, accuracy: float, iterations: int = 150) -> SqpResult:
    """Minimise from v within a box of the given radius round it.

    Parameters
    ----------
    program : ReducedProgram
    v : (n,)
    radius : float
    accuracy : float
        Of the objective, at which to stop.
    iterations : int
    """
    lower, upper = np.maximum(program.lower, v - radius), np.minimum(program.upper, v + radius)
    start = np.clip(v, lower, upper)
    equal = program.row_lower == program.row_upper
    high, low = np.isfinite(program.row_upper) & ~equal, np.isfinite(program.row_lower) & ~equal

    def objective(at: np.ndarray) -> float:
        value = program.objective(at)
        return value if np.isfinite(value) else _NOWHERE

    values, slopes = remembered(program.rows), remembered(program.row_slopes)
    rows = [
        {
            "type": "ineq",
            "fun": lambda at: np.concatenate([(program.row_upper - values(at))[high], (values(at) - program.row_lower)[low]]),
            "jac": lambda at: np.vstack([-slopes(at)[high], slopes(at)[low]]),
        }
    ]
    if equal.any():
        rows.append(
            {
                "type": "eq",
                "fun": lambda at: np.nan_to_num((values(at) - program.row_lower)[equal], nan=_NOWHERE),
                "jac": lambda at: slopes(at)[equal],
            }
        )
    with interruptible():
        found = minimize(
            objective, start, jac=program.gradient, method="SLSQP", bounds=np.stack([lower, upper], axis=1), constraints=rows,
            options={"ftol": accuracy, "maxiter": iterations},
        )  # fmt: skip
    at = np.clip(found.x, lower, upper)
    at = at if np.isfinite(at).all() else start
    inner = (program.lower < lower - _EDGE) & (at < lower + _EDGE) | (program.upper > upper + _EDGE) & (at > upper - _EDGE)
    return SqpResult(at, objective(at), int(found.nit), int(found.nfev), bool(inner.any()))


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
