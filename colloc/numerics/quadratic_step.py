"""The step of sequential quadratic programming: a dense convex quadratic program, by DAQP through
CasADi.

    minimise  d.B d / 2 + g.d   with  low <= d <= high,  row_low <= R d <= row_high

DAQP is a dual active-set method (Arnstrom, Bemporad and Axehill, IEEE TAC 67, 2022); its steps are
exact to rounding.
"""

from __future__ import annotations

import threading
from functools import lru_cache
from typing import NamedTuple

import casadi as ca
import numpy as np

_TOLERANCE, _MET = 1e-10, 1e-7
"""What DAQP may leave of a limit, in units of its rows, and how much is taken for a failure."""
_UNMET = 1e3
"""Price of half the squared share of the violations that stays."""


class QuadraticStep(NamedTuple):
    """The step d ``(n,)``, multipliers of the rows, positive at upper limits, and the share of the
    violations it removes."""

    d: np.ndarray
    on_rows: np.ndarray
    share: float


def quadratic_step(
    b: np.ndarray,
    gradient: np.ndarray,
    slopes: np.ndarray,
    row_low: np.ndarray,
    row_high: np.ndarray,
    low: np.ndarray,
    high: np.ndarray,
) -> QuadraticStep | None:
    """The minimum of the quadratic model; where the rows contradict each other, their violations
    are removed in part.

    b ``(n, n)`` is positive definite, the slopes ``(m, n)`` are those of the rows. None if there is
    no step, or no finite model.
    """
    if not (np.isfinite(gradient).all() and np.isfinite(slopes).all() and np.isfinite(b).all()):
        return None
    rows = {"lba": row_low, "uba": row_high}
    found = _minimum(h=b, g=gradient, a=slopes, lbx=low, ubx=high, **rows)
    if found is not None:
        return QuadraticStep(*found, 1.0)
    short = np.where(row_low > 0, row_low, np.where(row_high < 0, row_high, 0.0))
    wide = np.zeros((gradient.size + 1, gradient.size + 1))
    wide[:-1, :-1], wide[-1, -1] = b, _UNMET
    relaxed = {
        "a": np.column_stack([slopes, short]),
        "lbx": np.append(low, 0.0),
        "ubx": np.append(high, 1.0),
    }
    found = _minimum(h=wide, g=np.append(gradient, 0.0), **relaxed, **rows)
    return None if found is None else QuadraticStep(found[0][:-1], found[1], 1.0 - found[0][-1])


def _minimum(**program: np.ndarray) -> tuple[np.ndarray, np.ndarray] | None:
    return _OWN.solver(*program["a"].shape).minimum(program)


class _Solver:
    """DAQP for m rows and n unknowns, in memory of its own: CasADi's arrays take five times as long
    as a small step."""

    def __init__(self, m: int, n: int) -> None:
        shapes = {"h": ca.Sparsity.dense(n, n), "a": ca.Sparsity.dense(m, n)}
        with _MAKING:
            function = ca.conic(
                "step", "daqp", shapes, {"error_on_fail": False, "daqp": {"primal_tol": _TOLERANCE}}
            )
        self._buffer, self._solve = function.buffer()
        self._room = {name: np.empty(function.sparsity_in(name).shape[::-1]) for name in _GIVEN}
        self._d, self._on_rows = np.empty(n), np.empty(m)
        for name, room in self._room.items():
            self._buffer.set_arg(function.index_in(name), room.reshape(-1).data)
        self._buffer.set_res(function.index_out("x"), self._d.data)
        self._buffer.set_res(function.index_out("lam_a"), self._on_rows.data)

    def minimum(self, program: dict[str, np.ndarray]) -> tuple[np.ndarray, np.ndarray] | None:
        """The step and the multipliers of the rows; None where there is no step."""
        for name, room in self._room.items():
            room[:] = program[name].T
        self._d.fill(np.nan)
        self._solve()
        # a dual method that fails ends outside of some limit
        d, rows = self._d.copy(), program["a"] @ self._d
        within = _within(d, program["lbx"], program["ubx"]) and _within(
            rows, program["lba"], program["uba"]
        )
        return (d, self._on_rows.copy()) if within else None


def _within(values: np.ndarray, low: np.ndarray, high: np.ndarray) -> bool:
    slack = _MET * np.maximum(1.0, np.abs(values))
    return bool(((values >= low - slack) & (values <= high + slack)).all())


class _OfThread(threading.local):
    """Solvers by size; one that two threads share would be torn by them."""

    def __init__(self) -> None:
        self.solver = lru_cache(maxsize=64)(_Solver)


_GIVEN = ("h", "g", "a", "lba", "uba", "lbx", "ubx")
_OWN, _MAKING = _OfThread(), threading.Lock()
