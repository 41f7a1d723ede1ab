"""IPOPT on a full program, and first-order conditions measured at what it returns."""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property

import casadi as ca
import numpy as np
from scipy import sparse

from colloc.numerics.multiplier_estimate import least_squares_multipliers
from colloc.numerics.repeated import as_sparse
from colloc.numerics.sqp import keep_last
from colloc.search.options import TOLERANCES
from colloc.system.interruption import interrupted, interruptible
from colloc.transcription.full_program import FullProgram

_PUSHED = ("bound_push", "bound_frac", "slack_bound_push", "slack_bound_frac", "mult_bound_push")
IPOPT_OPTIONS: dict[str, object] = {
    "print_level": 0,
    "sb": "yes",
    "linear_solver": "mumps",
    **dict.fromkeys(("tol", "constr_viol_tol"), 1e-9),
    "acceptable_iter": 0,
    "mu_strategy": "monotone",
    "mu_init": 1e-4,
    "warm_start_init_point": "yes",
    **dict.fromkeys([*_PUSHED[:2], *(f"warm_start_{name}" for name in _PUSHED)], 1e-5),
    "max_iter": 60,
}
LIFTED_OPTIONS: dict[str, object] = {
    "theta_max_fact": 0.1,
    "constr_viol_tol": 1e-11,
    "max_iter": 300,
}
"""theta_max_fact keeps the iterates near the balance manifold, from which a step along negative
curvature would carry them away for good, at up to 120 short steps a level; the velocity map needs
none. A violated row moves the balance of a point by up to 1 / delta as much, of which a certificate
allows 1e-6."""
CONFIRMING: dict[str, object] = {"mu_init": 1e-10, "max_iter": 30}
"""The barrier begins where it ends, as multipliers are known: one to four steps confirm most gaits,
and more than 30 lead away."""


@dataclass(frozen=True, eq=False)
class NlpResult:
    """A point that IPOPT returned, with multipliers and measured first-order conditions."""

    x: np.ndarray  # (n,)
    lam_x: np.ndarray  # (n,)
    lam_g: np.ndarray  # (m,)
    objective: float
    kkt_error: float
    """Largest component of the Lagrangian's gradient, unscaled."""
    violation: float
    complementarity: float
    status: str
    """IPOPT's word, no verdict."""
    iterations: int
    seconds: float
    evaluation_seconds: float
    """Seconds in functions and derivatives."""
    excess: np.ndarray
    """Violation of each constraint, ``(m,)``."""

    def accumulate(self, earlier: NlpResult) -> NlpResult:
        """This result with the iterations and seconds of an earlier solve added."""
        return replace(
            self,
            iterations=self.iterations + earlier.iterations,
            seconds=self.seconds + earlier.seconds,
            evaluation_seconds=self.evaluation_seconds + earlier.evaluation_seconds,
        )

    @property
    def optimal(self) -> bool:
        return max(self.kkt_error, self.violation, self.complementarity) < TOLERANCES.kkt


_REGIONS = 20
"""Successive trust regions at most: gaits of three joints go 2 rad and more."""
_INSIDE = 0.999
"""Part of the radius from which a point counts as on the edge: the barrier keeps off it."""


class Solver:
    """A full program bound to IPOPT, for many deltas and starts."""

    def __init__(self, program: FullProgram, options: dict[str, object] | None = None) -> None:
        self.program, self._nlp = program, program.nlp
        lifted = LIFTED_OPTIONS if program.layout.friction.size else {}
        chosen = {**IPOPT_OPTIONS, **lifted, **(options or {})}
        settings: dict[str, object] = {f"ipopt.{k}": v for k, v in chosen.items()}
        settings |= dict.fromkeys(
            ("print_time", "calc_lam_p", "calc_lam_x", "calc_f", "calc_g"), False
        )
        settings |= {"error_on_fail": False, "no_nlp_grad": True, "record_time": True}
        # held here: CasADi does not keep it alive
        self._stop = StopRequest(self._nlp.expressions)
        self._settings = settings | {**self._nlp.functions, "iteration_callback": self._stop}
        self._values_and_slopes = keep_last(self._evaluate)

    @cached_property
    def _solver(self) -> ca.Function:
        return ca.nlpsol("colloc", "ipopt", self._nlp.expressions, self._settings)

    def solve_within(
        self,
        x: np.ndarray,
        delta: float,
        multipliers: tuple[np.ndarray, np.ndarray] | None,
        radius: float,
    ) -> NlpResult:
        """Maximise from x ``(n,)`` within a trust region of so many radians for each gait
        parameter, at delta per period; `multipliers` (lam_x, lam_g) are those closest to
        stationarity by default."""
        t = self.program
        own = t.layout.parameters[:, 0]
        lower, upper = t.lower.copy(), t.upper.copy()
        lower[own], upper[own] = (
            np.maximum(lower[own], x[own] - radius),
            np.minimum(upper[own], x[own] + radius),
        )
        limits = {"lbx": lower, "ubx": upper, "lbg": t.row_lower, "ubg": t.row_upper}
        lam_x, lam_g = multipliers or self._complete(
            x, delta, np.zeros_like(x), np.zeros_like(t.row_lower)
        )
        duals = {"lam_x0": lam_x, "lam_g0": lam_g}
        start = time.perf_counter()
        with interruptible():
            solution = self._solver(x0=x, p=delta / self.program.delta_unit, **limits, **duals)
        seconds = time.perf_counter() - start
        stats = self._solver.stats()
        x, lam_x, lam_g = (np.array(solution[k]).ravel() for k in ("x", "lam_x", "lam_g"))
        return self._result(x, lam_x, lam_g, delta, (lower, upper), stats, seconds)

    def _evaluate(self, at: np.ndarray) -> tuple[float, np.ndarray, np.ndarray, sparse.csr_matrix]:
        """Objective, gradient ``(n,)``, rows ``(m,)`` and Jacobian ``(m, n)`` at ``(x, delta)``."""
        x, delta = at[:-1], at[-1] / self.program.delta_unit
        f, gradient = self._nlp.functions["grad_f"](x, delta)
        g, jacobian = self._nlp.functions["jac_g"](x, delta)
        return float(f), gradient.full().ravel(), g.full().ravel(), as_sparse(jacobian)

    def measured(
        self, x: np.ndarray, delta: float, lam_x: np.ndarray, lam_g: np.ndarray
    ) -> NlpResult:
        """First-order conditions at x ``(n,)``, from multipliers of bounds and inequalities; those
        of the equations are the ones closest to stationarity."""
        multipliers = self._complete(x, delta, lam_x, lam_g)
        bounds = self.program.lower, self.program.upper
        nothing = {"return_status": "measured", "iter_count": 0}
        return self._result(x, *multipliers, delta, bounds, nothing, 0.0)

    def _complete(
        self, x: np.ndarray, delta: float, lam_x: np.ndarray, lam_g: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Multipliers of bounds and rows: those of the equations minimise the Lagrangian's
        gradient."""
        t = self.program
        free, equality = t.lower < t.upper, np.flatnonzero(t.row_lower == t.row_upper)
        _, gradient, _, jacobian = self._values_and_slopes(np.append(x, delta))
        lam_g = np.where(t.row_lower == t.row_upper, 0.0, lam_g)
        gradient = gradient + jacobian.T @ lam_g + lam_x
        lam_g[equality] = least_squares_multipliers(jacobian[equality][:, free], gradient[free])
        return lam_x, lam_g

    def equality_jacobian(
        self, x: np.ndarray, delta: float
    ) -> tuple[sparse.csr_matrix, np.ndarray]:
        """Jacobian of the equations in the free variables at x, and their row numbers."""
        t = self.program
        equality = np.flatnonzero(t.row_lower == t.row_upper)
        jacobian = self._values_and_slopes(np.append(x, delta))[3]
        return jacobian[equality][:, t.lower < t.upper], equality

    def _result(
        self,
        x: np.ndarray,
        lam_x: np.ndarray,
        lam_g: np.ndarray,
        delta: float,
        bounds: tuple[np.ndarray, np.ndarray],
        stats: dict,
        seconds: float,
    ) -> NlpResult:
        t = self.program
        lower, upper = bounds
        f, gradient, g, jacobian = self._values_and_slopes(np.append(x, delta))
        free = t.lower < t.upper
        stationarity = gradient + jacobian.T @ lam_g + lam_x
        outside = np.maximum(np.maximum(t.row_lower - g, g - t.row_upper), 0.0)
        bounds_outside = np.maximum(np.maximum(lower - x, x - upper), 0.0)
        products = [
            _complementarity(lam_x[free], x[free], lower[free], upper[free]),
            _complementarity(lam_g, g, t.row_lower, t.row_upper),
        ]
        evaluation = sum(v for k, v in stats.items() if k.startswith("t_wall_nlp_"))
        return NlpResult(
            x,
            lam_x,
            lam_g,
            f,
            float(np.abs(stationarity[free]).max()),
            float(max(outside.max(), bounds_outside.max())),
            max(products),
            stats["return_status"],
            int(stats["iter_count"]),
            seconds,
            float(evaluation),
            outside,
        )


def solve_in_regions(
    program: FullProgram,
    x: np.ndarray,
    delta: float,
    radius: float,
    options: dict[str, object] | None = None,
) -> tuple[FullProgram, NlpResult]:
    """Optimum of successive trust regions, each about the last one's end, with shape limits at the
    worst instants there; and the program of the last region."""
    result: NlpResult | None = None
    p = program.layout.parameters[:, 0]
    for _ in range(_REGIONS):
        last = Solver(program, options).solve_within(x, delta, None, radius)
        result = last if result is None else last.accumulate(result)
        if not result.optimal or np.abs(result.x[p] - x[p]).max() < _INSIDE * radius:
            return program, result
        program, x = program.moved_to(result.x)
    assert result is not None
    return program, replace(result, complementarity=np.inf, status="still moving")


def _complementarity(
    multiplier: np.ndarray, value: np.ndarray, lower: np.ndarray, upper: np.ndarray
) -> float:
    """Largest |multiplier| x distance to its bound, of inequalities; |multiplier| where that
    is infinite."""
    inequality = lower < upper
    distance = np.where(multiplier > 0, upper - value, value - lower)
    with np.errstate(invalid="ignore"):
        product = np.where(np.isinf(distance), np.abs(multiplier), np.abs(multiplier * distance))
    return float(product[inequality].max(initial=0.0))


class StopRequest(ca.Callback):
    """The ``iteration_callback`` of nlpsol: ends IPOPT once Ctrl-C came."""

    def __init__(self, nlp: Mapping[str, ca.MX]) -> None:
        ca.Callback.__init__(self)
        self._sparsity = {
            name: nlp[name.removeprefix("lam_")].sparsity() for name in ca.nlpsol_out()
        }
        self.construct("stop_request")

    def get_n_in(self) -> int:
        return ca.nlpsol_n_out()

    def get_name_in(self, index: int) -> str:
        return ca.nlpsol_out(index)

    def get_sparsity_in(self, index: int) -> ca.Sparsity:
        return self._sparsity[ca.nlpsol_out(index)]

    def eval(self, arguments: list[ca.DM]) -> list[int]:
        return [int(interrupted())]
