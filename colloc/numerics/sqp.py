"""Small dense nonlinear programs with bounds and rows: sequential quadratic programming, and
first-order conditions, also at kinks.

Second derivatives of a reduced gait program jump, so damped BFGS updates (Powell, 1978) build them
from gradients. SciPy's SLSQP takes 150 to 600 ms a step with 250 variables, where this takes 12.

At a kink some mean of the gradients around a point vanishes (docs/search.md; Goldstein, Math.
Program. 13, 1977; Burke, Lewis and Overton, SIAM J. Optim. 15, 2005). Where several kinks meet
samples miss sides, and steps down the mean that is nearest to 0 find them.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import NamedTuple, Protocol, TypeVar

import numpy as np

from colloc.numerics.conic import quadratic_step
from colloc.system.interruption import interruptible, is_interrupted

Value = TypeVar("Value")
_NOWHERE = 1e3  # objective where the balance cannot be solved: a line search steps back from it
_ACTIVE = 1e-6
"""Slack below which an inequality may carry a multiplier; their product is measured too."""
_EDGE = 1e-9
_FEASIBLE = 1e-10  # sum of the violations that no accuracy asks to be below
_MOST_TRIALS = 12  # points along a step
_DAMPING = 0.2  # least curvature along a step, as a share of the model's (Powell)
_LOWER = 0.1
"""A kink that bends down has the same gradients; there points are lower by more than this part of
what they would be higher by."""
_STEPS_DOWN = 4  # steps down the nearest mean, per variable, at most
_FEW = 8
"""Columns up to which `nonnegative` does without SciPy's optimize, which loads for a sixth of a
second."""


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
    kkt_error: float  # largest component of the Lagrangian's gradient
    violation: float  # largest, of a row or bound
    complementarity: float  # largest product of a multiplier and its slack
    on_rows: np.ndarray  # multipliers, positive at upper bounds
    on_bounds: np.ndarray


def _binding(
    slopes: np.ndarray, values: np.ndarray, lower: np.ndarray, upper: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Indices of rows and bounds, counted on, that may carry a multiplier at their upper and lower
    ends; and their gradients ``(n, n_binding)``, those at lower ends negated."""
    unit = np.vstack([slopes, np.eye(slopes.shape[1])])
    high, low = np.flatnonzero(values > upper - _ACTIVE), np.flatnonzero(values < lower + _ACTIVE)
    return high, low, np.concatenate([unit[high], -unit[low]]).T


def _rows_and_bounds(program: NonlinearProgram, v: np.ndarray) -> tuple[np.ndarray, ...]:
    return (
        np.concatenate([program.rows(v), v]),
        np.concatenate([program.row_lower, program.lower]),
        np.concatenate([program.row_upper, program.upper]),
    )


def stationarity(program: NonlinearProgram, v: np.ndarray) -> Stationarity:
    """First-order conditions at v, with the non-negative multipliers that minimise the Lagrangian's
    gradient."""
    if not v.size:
        return Stationarity(0.0, 0.0, 0.0, np.zeros(program.row_lower.size), np.empty(0))
    gradient, (values, lower, upper) = program.gradient(v), _rows_and_bounds(program, v)
    high, low, columns = _binding(program.row_slopes(v), values, lower, upper)
    multipliers, left = np.zeros(values.size), gradient
    if columns.size and np.isfinite(columns).all() and np.isfinite(gradient).all():
        on = nonnegative(columns, -gradient)
        np.add.at(multipliers, high, on[: high.size])
        np.add.at(multipliers, low, -on[high.size :])
        left = gradient + columns @ on
    slack = np.where(multipliers > 0, upper - values, values - lower)
    slack = np.where((lower < upper) & (multipliers != 0), slack, 0.0)
    outside = np.maximum(np.maximum(lower - values, values - upper), 0.0)
    on_rows, on_bounds = np.split(multipliers, [values.size - v.size])
    return Stationarity(
        float(np.abs(left).max()),
        float(outside.max()),
        float(np.abs(multipliers * slack).max()),
        on_rows,
        on_bounds,
    )


def stationarity_around(
    program: NonlinearProgram,
    v: np.ndarray,
    at: Stationarity,
    radius: float,
    *,
    enough: float,
    points: int = 4,
) -> Stationarity:
    """Replace the KKT error at v by that of the best mean of the gradients within `radius`; `at`
    itself if none is closer to 0, or some point around is clearly lower. `points` are drawn per
    variable, until a mean is within `enough` of 0."""
    rows, slopes = program.rows(v), program.row_slopes(v)
    columns = _binding(slopes, *_rows_and_bounds(program, v))[2]
    rng = np.random.default_rng(0)

    def lagrangian(u):
        """Gradient and value ``(n + 1,)``; rows count by what is not linear in them."""
        bent = program.rows(u) - rows - slopes @ (u - v)
        gradient = program.gradient(u) + at.on_rows @ (program.row_slopes(u) - slopes)
        return np.append(gradient, program.objective(u) + at.on_rows @ bent)

    drawn = v + radius * rng.uniform(-1.0, 1.0, (points * v.size, v.size))
    places = [*np.clip(np.vstack([v, drawn]), program.lower, program.upper)]
    sampled = [lagrangian(u) for u in places]
    if not np.isfinite(sampled).all():
        return at
    gradients = np.array(sampled)[:, :-1]
    size = float(np.abs(gradients).max())
    weights, multipliers = _nearest_mean(gradients, columns, size)
    nearest = gradients.T @ weights + columns @ multipliers
    for step in rng.uniform(0.0, 1.0, _STEPS_DOWN * v.size) ** 2:
        if np.abs(nearest).max() < enough:
            break
        u = v - radius * step * nearest / np.abs(nearest).max()
        u = np.clip(u, program.lower, program.upper)
        below = lagrangian(u)
        if not np.isfinite(below).all():
            break
        places.append(u)
        sampled.append(below)
        # gradients without a weight in the nearest mean are not needed for a nearer one
        gradients = np.vstack([gradients[weights > 0], below[:-1]])
        weights, multipliers = _nearest_mean(gradients, columns, size)
        nearest = gradients.T @ weights + columns @ multipliers
    error, heights = float(np.abs(nearest).max()), np.array(sampled)[:, -1]
    higher = heights - heights[0] + (np.array(places) - v) @ columns @ multipliers
    bends_down = -higher.min() > _LOWER * higher.max()
    return at if bends_down or error >= at.kkt_error else replace(at, kkt_error=error)


def _nearest_mean(
    gradients: np.ndarray, columns: np.ndarray, size: float
) -> tuple[np.ndarray, np.ndarray]:
    """Weights of gradients ``(m, n)`` and multipliers of columns ``(n, k)`` with the sum nearest to
    0."""
    m, k = len(gradients), columns.shape[1]
    # the last row's size does not matter: all is divided by the sum of the weights
    matrix = np.vstack([np.hstack([gradients.T, columns]), np.repeat([size, 0.0], [m, k])])
    parts = nonnegative(matrix, np.append(np.zeros(len(matrix) - 1), size))
    return parts[:m] / parts[:m].sum(), parts[m:] / parts[:m].sum()


def nonnegative(matrix: np.ndarray, right: np.ndarray) -> np.ndarray:
    """The x >= 0 that minimises ``|matrix @ x - right|`` (Lawson and Hanson, 1974)."""
    n = matrix.shape[1]
    if n > _FEW:
        from scipy.optimize import nnls

        with suppress(RuntimeError):  # SciPy before 1.15 may go round in circles
            return nnls(matrix, right, maxiter=30 * n)[0]
    x, free = np.zeros(n), np.zeros(n, dtype=bool)
    size = np.abs(matrix).sum(axis=0).max(initial=0.0)
    tolerance = 10 * max(matrix.shape) * np.finfo(float).eps * size
    for _ in range(30 * n):
        falls = np.where(free, -np.inf, matrix.T @ (right - matrix @ x))
        if falls.max() <= tolerance:
            break
        free[np.argmax(falls)] = True
        while True:
            best = np.zeros(n)
            best[free] = np.linalg.lstsq(matrix[:, free], right, rcond=None)[0]
            negative = free & (best <= 0)
            if not negative.any():
                break
            # as far as the first that would turn negative, which stays 0
            way = np.full(n, np.inf)
            way[negative] = x[negative] / (x[negative] - best[negative])
            x = x + way.min() * (best - x)
            free &= way > way.min()
            x[~free] = 0.0
        x = best
    return x


class SqpResult(NamedTuple):
    v: np.ndarray  # (n,)
    objective: float
    iterations: int
    on_edge: bool  # v lies on the edge of the box around the start
    curvature: np.ndarray  # model of the Lagrangian's second derivatives, (n, n)


class _Point(NamedTuple):
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


def minimize(
    program: NonlinearProgram,
    v: np.ndarray,
    radius: float,
    accuracy: float,
    iterations: int = 150,
    curvature: np.ndarray | None = None,
) -> SqpResult:
    """Minimise from v within a box of the given radius, to an accuracy of the objective.

    Steps minimise a quadratic model within the box and the linear models of the rows, and are
    shortened until the objective and the violations, each at its price, fall together (Han, 1977;
    Powell, 1978).
    """
    if not v.size:
        return SqpResult(v, program.objective(v), 0, False, np.empty((0, 0)))
    start, (v, lower, upper) = v, _box(program, v, radius)
    here, fresh = _Point.at(program, v), curvature is None
    b = np.eye(v.size) if curvature is None else curvature
    price, feasible = np.zeros(here.rows.size), max(accuracy, _FEASIBLE)
    gradient, slopes = program.gradient(here.v), program.row_slopes(here.v)
    count = 0
    with interruptible():
        while count < iterations and not is_interrupted():
            count += 1
            limits = program.row_lower - here.rows, program.row_upper - here.rows
            step = quadratic_step(b, gradient, slopes, *limits, lower - here.v, upper - here.v)
            there = None
            if step is not None:
                price = np.maximum(np.abs(step.on_rows), 0.5 * (price + np.abs(step.on_rows)))
                change, violations = gradient @ step.d, price @ here.outside
                if abs(change) + violations < accuracy and here.outside.sum() < feasible:
                    break
                model = change - step.share * price @ here.outside
                there = _line_search(program, here, step.d, price, model)
            if step is None or there is None:
                if fresh:
                    break
                b, fresh = np.eye(v.size), True
                continue
            before, here, fresh = here, there, False
            new_gradient, new_slopes = program.gradient(here.v), program.row_slopes(here.v)
            turn = new_gradient - gradient + step.on_rows @ (new_slopes - slopes)
            gradient, slopes, b = new_gradient, new_slopes, _bfgs(b, here.v - before.v, turn)
            if abs(here.objective - before.objective) < accuracy and here.outside.sum() < feasible:
                break
    on_edge = is_on_edge(program, start, radius, here.v)
    return SqpResult(here.v, here.objective, count, on_edge, b)


def _box(
    program: NonlinearProgram, v: np.ndarray, radius: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    v = np.clip(v, program.lower, program.upper)
    return v, np.maximum(program.lower, v - radius), np.minimum(program.upper, v + radius)


def is_on_edge(program: NonlinearProgram, start: np.ndarray, radius: float, v: np.ndarray) -> bool:
    """True if v lies on the edge of the box around a start, and not on the program's."""
    _, lower, upper = _box(program, start, radius)
    at_low = (program.lower < lower - _EDGE) & (v < lower + _EDGE)
    at_high = (program.upper > upper + _EDGE) & (v > upper - _EDGE)
    return bool((at_low | at_high).any())


def _line_search(
    program: NonlinearProgram, here: _Point, d: np.ndarray, price: np.ndarray, model: float
) -> _Point | None:
    merit, size = here.objective + price @ here.outside, 1.0
    for _ in range(_MOST_TRIALS):
        there = _Point.at(program, here.v + size * d)
        change = there.objective + price @ there.outside - merit
        if change <= 0.1 * size * model:
            return there
        size *= min(max(0.5 * size * model / (size * model - change), 0.1), 0.5)
    return None


def _bfgs(b: np.ndarray, s: np.ndarray, y: np.ndarray) -> np.ndarray:
    bs = b @ s
    sbs, sy = s @ bs, s @ y
    if not np.isfinite(sy) or sbs <= 0:
        return b
    if sy < _DAMPING * sbs:
        share = (1 - _DAMPING) * sbs / (sbs - sy)
        y = share * y + (1 - share) * bs
        sy = s @ y
    return b - np.outer(bs, bs) / sbs + np.outer(y, y) / sy


def keep_last(function: Callable[[np.ndarray], Value]) -> Callable[[np.ndarray], Value]:
    """Keep the last value of a function for calls at the same point."""
    last: dict[bytes, Value] = {}

    def call(at):
        key = at.tobytes()
        if key not in last:
            last.clear()
            last[key] = function(at)
        return last[key]

    return call
