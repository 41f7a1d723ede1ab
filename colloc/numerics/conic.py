"""Small dense linear and quadratic programs, by HiGHS and DAQP through CasADi: SciPy's optimize
takes as long to load as 200 linear ones.

DAQP is a dual active-set method (Arnstrom, Bemporad and Axehill, IEEE TAC 67, 2022).
"""

import threading
from functools import lru_cache
from typing import NamedTuple

import casadi as ca
import numpy as np

from colloc.system.errors import NotConvergedError

_TOLERANCE = 1e-10  # DAQP may leave of a limit, in units of its rows
_MET = 1e-7  # what it leaves counts as failure above this
_UNMET = 1e3  # price of half the squared share of the violations that stays
_INPUTS = ("h", "g", "a", "lba", "uba", "lbx", "ubx")
_ONE_AT_A_TIME = threading.Lock()
"""CasADi lets other threads run while it makes a solver, or HiGHS solves, and a second one in the
same solver ends the process."""


def linear_maximum(
    gain: np.ndarray, equations: np.ndarray, right: np.ndarray
) -> tuple[float, np.ndarray, np.ndarray]:
    """The largest ``gain @ x`` with ``equations @ x == right`` and x >= 0; x at a corner ``(n,)``;
    multipliers ``(m,)``, what a unit of each right side adds. `NotConvergedError` if there is
    none."""
    with _ONE_AT_A_TIME:
        solver = _highs(*equations.shape)
        answer = solver(g=-gain, a=equations, lba=right, uba=right, lbx=0.0, ubx=np.inf)
        stats = solver.stats()
    if not stats["success"]:
        raise NotConvergedError(f"a linear program failed: {stats['return_status']}")
    return -float(answer["cost"]), *(answer[key].toarray()[:, 0] for key in ("x", "lam_a"))


@lru_cache(maxsize=16)
def _highs(m: int, n: int) -> ca.Function:
    silent = {"error_on_fail": False, "highs": {"output_flag": False}}
    return ca.conic("program", "highs", {"a": ca.Sparsity.dense(m, n)}, silent)


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
    """Minimise ``d.B d / 2 + gradient.d`` with ``low <= d <= high``, ``row_low <= slopes d <=
    row_high`` and B positive definite; where rows contradict each other, their violations are
    removed in part. None if there is no step."""
    if not (np.isfinite(gradient).all() and np.isfinite(slopes).all() and np.isfinite(b).all()):
        return None
    rows = {"lba": row_low, "uba": row_high}
    solver = _LOCAL.daqp(*slopes.shape)
    exact = solver.minimum({"h": b, "g": gradient, "a": slopes, "lbx": low, "ubx": high, **rows})
    if exact is not None:
        return QuadraticStep(*exact, 1.0)
    short = np.where(row_low > 0, row_low, np.where(row_high < 0, row_high, 0.0))
    wide = np.zeros((gradient.size + 1, gradient.size + 1))
    wide[:-1, :-1], wide[-1, -1] = b, _UNMET
    relaxed = {
        "h": wide,
        "g": np.append(gradient, 0.0),
        "a": np.column_stack([slopes, short]),
        "lbx": np.append(low, 0.0),
        "ubx": np.append(high, 1.0),
    }
    partial = _LOCAL.daqp(*relaxed["a"].shape).minimum(relaxed | rows)
    if partial is None:
        return None
    return QuadraticStep(partial[0][:-1], partial[1], 1.0 - partial[0][-1])


class _Daqp:
    """DAQP in memory of its own: CasADi's arrays take five times as long as a small step."""

    def __init__(self, m: int, n: int) -> None:
        shapes = {"h": ca.Sparsity.dense(n, n), "a": ca.Sparsity.dense(m, n)}
        options = {"error_on_fail": False, "daqp": {"primal_tol": _TOLERANCE}}
        with _ONE_AT_A_TIME:
            function = ca.conic("step", "daqp", shapes, options)
        self._buffer, self._solve = function.buffer()
        self._inputs = {name: np.empty(function.sparsity_in(name).shape[::-1]) for name in _INPUTS}
        self._d, self._on_rows = np.empty(n), np.empty(m)
        for name, memory in self._inputs.items():
            self._buffer.set_arg(function.index_in(name), memory.reshape(-1).data)
        self._buffer.set_res(function.index_out("x"), self._d.data)
        self._buffer.set_res(function.index_out("lam_a"), self._on_rows.data)

    def minimum(self, program: dict[str, np.ndarray]) -> tuple[np.ndarray, np.ndarray] | None:
        for name, memory in self._inputs.items():
            memory[:] = program[name].T
        self._d.fill(np.nan)
        self._solve()
        # a dual method that fails ends outside of some limit
        d, rows = self._d.copy(), program["a"] @ self._d
        for values, limits in ((d, ("lbx", "ubx")), (rows, ("lba", "uba"))):
            (low, high), slack = (program[name] for name in limits), _MET * np.abs(values)
            slack = np.maximum(slack, _MET)
            if not ((values >= low - slack) & (values <= high + slack)).all():
                return None
        return d, self._on_rows.copy()


class _PerThread(threading.local):
    """Solvers by size; one that two threads share would be torn by them."""

    def __init__(self) -> None:
        self.daqp = lru_cache(maxsize=64)(_Daqp)


_LOCAL = _PerThread()
