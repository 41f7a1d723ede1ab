"""IPOPT on a full program, first-order conditions measured at what it returns, and why a solve
failed: which equation, which link, which time window, and what to try."""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property

import casadi as ca
import numpy as np
from scipy import sparse

from colloc.numerics.repeated import least_squares_multipliers
from colloc.numerics.sqp import keep_last
from colloc.search.options import TOLERANCES
from colloc.system.interruption import interruptible, is_interrupted
from colloc.transcription.full_program import ACTUATORS, FullProgram

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
# theta_max_fact keeps the iterates near the balance manifold, from which a step along negative
# curvature would carry them away for good, at up to 120 short steps a level; the velocity map needs
# none. A violated row moves the balance of a point by up to 1 / delta as much, of which a
# certificate allows 1e-6
LIFTED_OPTIONS = {"theta_max_fact": 0.1, "constr_viol_tol": 1e-11, "max_iter": 300}


@dataclass(frozen=True, eq=False)
class NlpResult:
    """A point that IPOPT returned, with multipliers and measured first-order conditions."""

    x: np.ndarray  # (n,)
    lam_x: np.ndarray  # (n,)
    lam_g: np.ndarray  # (m,)
    objective: float
    kkt_error: float  # largest component of the Lagrangian's gradient, unscaled
    violation: float
    complementarity: float
    status: str  # IPOPT's word, no verdict
    iterations: int
    seconds: float
    excess: np.ndarray  # violation of each constraint, (m,)

    def accumulate(self, earlier: NlpResult) -> NlpResult:
        iterations, seconds = self.iterations + earlier.iterations, self.seconds + earlier.seconds
        return replace(self, iterations=iterations, seconds=seconds)

    @property
    def optimal(self) -> bool:
        return max(self.kkt_error, self.violation, self.complementarity) < TOLERANCES.kkt


class Solver:
    """A full program bound to IPOPT, for many deltas and starts."""

    def __init__(self, program: FullProgram, options: dict[str, object] | None = None) -> None:
        self.program, self._nlp = program, program.nlp
        lifted = LIFTED_OPTIONS if program.layout.friction.size else {}
        chosen = {**IPOPT_OPTIONS, **lifted, **(options or {})}
        self._settings: dict[str, object] = {f"ipopt.{k}": v for k, v in chosen.items()}
        off = ("print_time", "calc_lam_p", "calc_lam_x", "calc_f", "calc_g", "error_on_fail")
        self._settings |= dict.fromkeys(off, False) | {"no_nlp_grad": True}
        # held here: CasADi does not keep it alive
        self._stop = StopRequest(self._nlp.expressions)
        self._settings |= {**self._nlp.functions, "iteration_callback": self._stop}
        self._values_and_slopes = keep_last(self._evaluate)

    @cached_property
    def _solver(self) -> ca.Function:
        return ca.nlpsol("colloc", "ipopt", self._nlp.expressions, self._settings)

    def _evaluate(self, at: np.ndarray) -> tuple[float, np.ndarray, np.ndarray, sparse.csr_matrix]:
        """Objective, gradient ``(n,)``, rows ``(m,)`` and Jacobian ``(m, n)`` at ``(x, delta)``."""
        x, delta = at[:-1], at[-1] / self.program.delta_unit
        f, gradient = self._nlp.functions["grad_f"](x, delta)
        g, jacobian = self._nlp.functions["jac_g"](x, delta)
        parts = jacobian.nonzeros(), jacobian.row(), jacobian.colind()
        slopes = sparse.csc_matrix(parts, shape=jacobian.shape).tocsr()
        return float(f), gradient.full().ravel(), g.full().ravel(), slopes

    def solve_within(
        self,
        x: np.ndarray,
        delta: float,
        multipliers: tuple[np.ndarray, np.ndarray] | None,
        radius: float,
    ) -> NlpResult:
        """Maximise from x ``(n,)`` at delta per period, the gait's parameters, heading and log
        period within a trust region of such a radius; `multipliers` (lam_x, lam_g) are those
        closest to stationarity by default."""
        t = self.program
        own, lower, upper = t.layout.decisions, t.lower.copy(), t.upper.copy()
        lower[own] = np.maximum(lower[own], x[own] - radius)
        upper[own] = np.minimum(upper[own], x[own] + radius)
        lam_x, lam_g = multipliers or self._complete(
            x, delta, np.zeros_like(x), np.zeros_like(t.row_lower)
        )
        start = time.perf_counter()
        with interruptible():
            solution = self._solver(
                x0=x,
                p=delta / t.delta_unit,
                lbx=lower,
                ubx=upper,
                lbg=t.row_lower,
                ubg=t.row_upper,
                lam_x0=lam_x,
                lam_g0=lam_g,
            )
        seconds, stats = time.perf_counter() - start, self._solver.stats()
        x, lam_x, lam_g = (np.array(solution[k]).ravel() for k in ("x", "lam_x", "lam_g"))
        ended = stats["return_status"], int(stats["iter_count"]), seconds
        return self._result(x, lam_x, lam_g, delta, lower, upper, ended)

    def conditions_at(
        self, x: np.ndarray, delta: float, lam_x: np.ndarray, lam_g: np.ndarray
    ) -> NlpResult:
        """First-order conditions at x ``(n,)``, from multipliers of bounds and inequalities; those
        of the equations are the ones closest to stationarity."""
        multipliers, t = self._complete(x, delta, lam_x, lam_g), self.program
        return self._result(x, *multipliers, delta, t.lower, t.upper, ("measured", 0, 0.0))

    def _complete(
        self, x: np.ndarray, delta: float, lam_x: np.ndarray, lam_g: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Multipliers of bounds and rows: those of the equations minimise the Lagrangian's
        gradient."""
        t = self.program
        _, gradient, _, slopes = self._values_and_slopes(np.append(x, delta))
        lam_g = np.where(t.row_lower == t.row_upper, 0.0, lam_g)
        gradient = gradient + slopes.T @ lam_g + lam_x
        jacobian, equality = self.equality_jacobian(x, delta)
        lam_g[equality] = least_squares_multipliers(jacobian, gradient[t.lower < t.upper])
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
        lower: np.ndarray,
        upper: np.ndarray,
        ended: tuple[str, int, float],
    ) -> NlpResult:
        t, free = self.program, self.program.lower < self.program.upper
        f, gradient, g, jacobian = self._values_and_slopes(np.append(x, delta))
        stationarity = gradient + jacobian.T @ lam_g + lam_x
        outside = np.maximum(np.maximum(t.row_lower - g, g - t.row_upper), 0.0)
        bounds_outside = np.maximum(np.maximum(lower - x, x - upper), 0.0)
        products = []
        for multiplier, value, low, high in (
            (lam_x[free], x[free], lower[free], upper[free]),
            (lam_g, g, t.row_lower, t.row_upper),
        ):
            # of inequalities; the multiplier alone where the bound is infinite
            distance = np.where(multiplier > 0, high - value, value - low)
            distance = np.where(np.isinf(distance), 1.0, np.abs(distance))
            products.append((np.abs(multiplier) * distance)[low < high].max(initial=0.0))
        kkt_error = float(np.abs(stationarity[free]).max())
        errors = kkt_error, float(max(outside.max(), bounds_outside.max())), float(max(products))
        return NlpResult(x, lam_x, lam_g, f, *errors, *ended, outside)


def solve_in_regions(
    program: FullProgram,
    x: np.ndarray,
    delta: float,
    radius: float,
    options: dict[str, object] | None = None,
) -> tuple[FullProgram, NlpResult]:
    """Optimum of successive trust regions, each about the last one's end, with shape limits at the
    worst instants there; and the program of the last region. There are at most twenty: gaits of
    three joints go 2 rad and more."""
    result, p = (
        Solver(program, options).solve_within(x, delta, None, radius),
        program.layout.decisions,
    )
    for _ in range(20):
        # the barrier keeps off the edge of the region
        if not result.optimal or np.abs(result.x[p] - x[p]).max() < 0.999 * radius:
            return program, result
        program, x = program.moved_to(result.x)
        further = Solver(program, options).solve_within(x, delta, None, radius)
        result = further.accumulate(result)
    return program, replace(result, complementarity=np.inf, status="still moving")


class StopRequest(ca.Callback):
    """Ends IPOPT once Ctrl-C came."""

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
        return [int(is_interrupted())]


_MEANING = {
    "tail": "the direction of the tail",
    **dict.fromkeys(("velocity x", "velocity y"), "the joining of links"),
    **dict.fromkeys(("force x", "force y"), "the balance of forces"),
    "torque": "the balance of torques",
    "balance": "the balance of the body",
    "force law": "the law of friction",
    "orientation": "the rotation between nodes",
    "distance": "the distance gained over an interval",
    "work": "the work gained over an interval",
    "at least": "a value that has to be reached",
    "shape speed": "the lower bound on the shape speed",
    "heading": "where the body points at the start",
    "across": "the way across the direction that was asked for",
}
_BALANCE = ("tail", "velocity", "force", "torque", "balance")
_ADVICE = {
    _BALANCE: "start the continuation at a larger delta_start, use more intervals, or another "
    "formulation",
    (ACTUATORS,): "relax the limits, use other links, or start from another guess",
    ("at least",): "ask for less, or start from a guess that reaches it",
    ("rotation",): "start from a guess with less net rotation, or impose a symmetry that closes it",
    ("joint", "links", "tangent"): "start from a guess of smaller amplitude",
    ("",): "use more intervals or another guess",
}


def row_meaning(program: FullProgram, row: int) -> tuple[str, float]:
    name = _group(program, row)
    rows, mesh = program.groups[name], program.mesh
    index, count = row - rows.start, rows.stop - rows.start
    body, aims = program.control.dynamics.body, program.control.aims
    if name == ACTUATORS:
        point, which = divmod(index, len(program.control.actuators.names))
        limit = program.control.actuators.names[which]
        return f"the limit on the {limit}", float(mesh.times[point])
    if name == "rotation":
        return "closure of the net rotation", float(mesh.edges[-1])
    if name in program.cells:
        what = "contact of" if name.startswith("links") else "the limit of"
        what = what if name.startswith("links") or name in body.bounded_angles.names else "the"
        return f"{what} {name}", float(mesh.edges[program.cells[name][index]])
    integrals = {each.name: f"the {each.meaning or each.name}" for each in aims.integrals}
    what = integrals.get(name) or _MEANING.get(name.rstrip(" 0123456789"), f"the {name}")
    if name in ("angles", "rates"):
        joint = f"{body.defaults.coordinate} {index // mesh.n_point + 1}"
        what = f"the {name[:-1]} of {joint} against its gait"
    elif name in integrals or name in ("at least", "shape speed", "heading", "across"):
        return what, 0.0
    if count % mesh.n_point == 0:  # rows of points, part by part
        return what, float(mesh.times[index % mesh.n_point])
    return what, float(mesh.edges[index * mesh.n // count])


def _group(program: FullProgram, row: int) -> str:
    return next(name for name, s in program.groups.items() if s.start <= row < s.stop)


def explanation(program: FullProgram, result: NlpResult, delta: float) -> str:
    """Sentences on the worst violated row, and what to try next."""
    worst = int(np.argmax(result.excess))
    excess = result.excess[worst]
    if excess > TOLERANCES.violation:
        (what, when), group = row_meaning(program, worst), _group(program, worst)
        rows = program.groups[group]
        bad = rows.start + np.flatnonzero(result.excess[rows] >= 0.1 * excess)
        phases = [row_meaning(program, int(row))[1] for row in bad]
        window = f"at phase {when:.3f}"
        if min(phases) < max(phases):
            window = f"between phases {min(phases):.3f} and {max(phases):.3f}, worst at {when:.3f}"
        failed = f"{what} is off by {excess:.1e} {window}"
        if group == ACTUATORS:
            limits = program.control.problem.path_limits
            each = [
                (limit.function, most) for limit in limits.each for most in np.ravel(limit.most)
            ]
            function, most = each[(worst - rows.start) % len(limits.names)]
            units = {"moment": " weight x body length", "power": " weight x body length per period"}
            failed = f"{what} is {most:g}{units.get(function, '')}, and the gait needs "
            failed += f"{1 + excess:.4g} times as much {window}"
        advice = next(text for names, text in _ADVICE.items() if group.startswith(names))
    elif result.status == "still moving":
        failed = "the optimiser did not settle, from one trust region to the next"
        advice = "start from a better guess"
    else:
        what = program.control.aims.objective.name
        failed = (
            f"every equation holds, but the {what} is not stationary (KKT error "
            f"{result.kkt_error:.1e})"
        )
        advice = (
            "use more intervals, since kinks at stick may be under-resolved, or start from "
            "another guess"
        )
        # links at stick move at the order of delta, tail velocities resolve 1e-16, so the gradient
        # is known to 1e-16/delta: KKT errors of 1.8e-8 at 1e-8, 1.3e-7 at 1e-9, 2e-6 at 1e-10 were
        # measured on one harmonic of three links
        if delta < 1e-9:
            advice = "ask for a delta of at least 1e-09, below which rounding hides the optimum"
    effort = f"not converged at delta = {delta:.1e} after {result.iterations} iterations"
    return f"{effort}: {failed} ({result.status}). Try to {advice}."
