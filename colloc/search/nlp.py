"""The one place that names IPOPT: solves a transcription's nonlinear program and measures what comes back."""

from __future__ import annotations

import time
from dataclasses import dataclass, replace
from typing import Generic, TypeVar

import casadi as ca
import numpy as np
from scipy import sparse

from colloc.collocation.program import Program
from colloc.collocation.reduced_program import CondensedProgram
from colloc.collocation.transcription import Transcription
from colloc.gaits.problem import CONDENSED
from colloc.numerics.blocks import Oracles, oracles
from colloc.numerics.multiplier_estimate import estimated_multipliers
from colloc.search.stop_request import StopRequest
from colloc.system.interruption import interruptible

IPOPT_OPTIONS: dict[str, object] = {
    "print_level": 0,
    "sb": "yes",
    "linear_solver": "mumps",
    "tol": 1e-9,
    "constr_viol_tol": 1e-9,
    "acceptable_iter": 0,
    "mu_strategy": "monotone",
    "mu_init": 1e-4,
    "bound_push": 1e-5,
    "bound_frac": 1e-5,
    "warm_start_init_point": "yes",
    "warm_start_bound_push": 1e-5,
    "warm_start_bound_frac": 1e-5,
    "warm_start_slack_bound_push": 1e-5,
    "warm_start_slack_bound_frac": 1e-5,
    "warm_start_mult_bound_push": 1e-5,
    "max_iter": 60,
}
CONDENSED_OPTIONS: dict[str, object] = {"alpha_red_factor": 0.2, "watchdog_shortened_iter_trigger": 3}
"""Every trial step costs a balance, and steps are cut at kinks: cut them faster, and soon try a full one (half the time of the
slowest starts at (1, 1, 3))."""
LIFTED_OPTIONS: dict[str, object] = {"theta_max_fact": 0.1, "max_iter": 300}
"""With lifted forces theta_max_fact decides: it keeps the iterates near the balance manifold, from which a step along
negative curvature would otherwise carry them away for good. The price is up to 120 short steps a level. The velocity map
needs no such leash and is slowed by it."""


@dataclass(frozen=True, eq=False)
class NlpResult:
    """A point IPOPT returned, with its multipliers and what we measured there ourselves.

    Attributes
    ----------
    x, lam_x : (n,)
    lam_g : (m,)
    objective : float
    kkt_error : float
        Largest component of the Lagrangian's gradient, unscaled.
    violation : float
        Largest violation of a constraint or bound.
    complementarity : float
        Largest product of a multiplier with its distance to the bound.
    status : str
        IPOPT's own word; not a verdict.
    iterations : int
    seconds : float
    evaluation_seconds : float
        The part spent evaluating functions and derivatives.
    excess : (m,)
        How far each constraint is violated.
    """

    x: np.ndarray
    lam_x: np.ndarray
    lam_g: np.ndarray
    objective: float
    kkt_error: float
    violation: float
    complementarity: float
    status: str
    iterations: int
    seconds: float
    evaluation_seconds: float
    excess: np.ndarray

    def accumulated(self, earlier: NlpResult) -> NlpResult:
        """This result with the effort of an earlier solve of the same level added."""
        return replace(
            self,
            iterations=self.iterations + earlier.iterations,
            seconds=self.seconds + earlier.seconds,
            evaluation_seconds=self.evaluation_seconds + earlier.evaluation_seconds,
        )

    @property
    def optimal(self) -> bool:
        """First-order conditions hold to 1e-6, by our own measure."""
        return max(self.kkt_error, self.violation, self.complementarity) < OPTIMAL_TOLERANCE


OPTIMAL_TOLERANCE = 1e-6
AnyProgram = TypeVar("AnyProgram", bound=Program)
_REGIONS, _ALIKE, _WIDEST = 20, 3, 1.0
"""Trust regions that may follow each other, and how many of them have the first one's radius. A gait that still moves then is
not near its optimum at all (paths of three joints, whose basins end between deltas, go 2 rad and more), so regions double,
up to the widest [rad]."""
_INSIDE = 0.999
"""A point nearer to the edge of its trust region than this is on it: the barrier keeps off an active bound by its tolerance
over the multiplier, which is small where efficiency is flat."""


class Solver(Generic[AnyProgram]):
    """A transcription bound to IPOPT; built once, solved for many deltas and starts."""

    def __init__(self, transcription: AnyProgram, options: dict[str, object] | None = None) -> None:
        self.transcription = transcription
        self.oracles: Oracles = oracles(transcription.assembly)
        self._reduced: CondensedProgram | None = None
        if isinstance(transcription, Transcription) and transcription.problem.formulation == CONDENSED:
            self._reduced = CondensedProgram(transcription)
        own = CONDENSED_OPTIONS if self._reduced else LIFTED_OPTIONS if transcription.lifted else {}
        chosen = {**IPOPT_OPTIONS, **own, **(options or {})}
        settings: dict[str, object] = {f"ipopt.{k}": v for k, v in chosen.items()}
        settings |= {"print_time": False, "calc_lam_p": False, "calc_lam_x": False, "calc_f": False, "calc_g": False}
        settings |= {"error_on_fail": False, "no_nlp_grad": True, "record_time": True}
        program = self._reduced or self.oracles
        self._nlp = program.nlp
        self._stop = StopRequest(self._nlp)  # held here: CasADi does not keep it alive
        self._settings = {**settings, **program.options, "iteration_callback": self._stop}
        self._solvers: dict[int | None, ca.Function] = {}

    def _solver(self, iterations: int | None) -> ca.Function:
        if iterations not in self._solvers:
            limit = {} if iterations is None else {"ipopt.max_iter": iterations}
            self._solvers[iterations] = ca.nlpsol("colloc", "ipopt", self._nlp, {**self._settings, **limit})
        return self._solvers[iterations]

    def solve(
        self,
        x: np.ndarray,
        delta: float,
        multipliers: tuple[np.ndarray, np.ndarray] | None = None,
        radius: float = np.inf,
        iterations: int | None = None,
    ) -> NlpResult:
        """Maximise efficiency from x.

        Parameters
        ----------
        x : (n,)
        delta : float
            Regularisation speed, per period.
        multipliers : (lam_x, lam_g), optional
            By default those of the equations that come closest to stationarity at x.
        radius : float
            Trust region: how far each gait parameter may move [rad]. A result on its edge is solved again from there.
        iterations : int, optional
            Give up after so many in each region; by default after the number in the options.
        """
        result = self._solve_within(x, delta, multipliers, radius, iterations)
        own = self.transcription.layout.parameters[:, 0]
        here, widest = radius, _WIDEST
        for count in range(_REGIONS):
            if not result.optimal or np.abs(result.x[own] - x[own]).max() < _INSIDE * here:
                return result
            x = result.x
            if count >= _ALIKE:
                here = max(radius, min(2 * here, widest))
            result = self._solve_within(x, delta, None, here, iterations).accumulated(result)
            if not result.optimal and here > radius:
                here = widest = radius  # kinks are too many further out
                result = self._solve_within(x, delta, None, here, iterations).accumulated(result)
        return replace(result, complementarity=np.inf, status="still moving")

    def _solve_within(
        self,
        x: np.ndarray,
        delta: float,
        multipliers: tuple[np.ndarray, np.ndarray] | None,
        radius: float,
        iterations: int | None,
    ) -> NlpResult:
        t = self.transcription
        own = t.layout.parameters[:, 0]
        worst = t.block_parameters(x[own])
        parameters = self.oracles.parameter_vector(delta / t.speed_unit, worst)
        lower, upper = t.lower.copy(), t.upper.copy()
        lower[own], upper[own] = np.maximum(lower[own], x[own] - radius), np.minimum(upper[own], x[own] + radius)
        solver = self._solver(iterations)
        if self._reduced is not None:
            return self._solve_condensed(solver, x, delta / t.speed_unit, multipliers, parameters, worst, (lower, upper))
        limits = {"lbx": lower, "ubx": upper, "lbg": t.constraint_lower, "ubg": t.constraint_upper}
        lam_x, lam_g = multipliers or (np.zeros_like(x), self._estimated_multipliers(x, parameters))
        duals = {"lam_x0": lam_x, "lam_g0": lam_g}
        start = time.perf_counter()
        with interruptible():
            solution = solver(x0=x, p=parameters, **limits, **duals)
        seconds = time.perf_counter() - start
        stats = solver.stats()
        x, lam_x, lam_g = (np.array(solution[k]).ravel() for k in ("x", "lam_x", "lam_g"))
        return self._measured(x, lam_x, lam_g, parameters, (lower, upper), stats, seconds)

    def _solve_condensed(
        self,
        solver: ca.Function,
        x: np.ndarray,
        delta: float,
        multipliers: tuple[np.ndarray, np.ndarray] | None,
        parameters: np.ndarray,
        worst: list[np.ndarray],
        bounds: tuple[np.ndarray, np.ndarray],
    ) -> NlpResult:
        """Solve with all equations eliminated; what comes back is measured as a point of the full program."""
        reduced, own = self._reduced, self.transcription.layout.parameters[:, 0]
        assert reduced is not None
        at = reduced.condensed
        free = np.full(at.n - own.size, np.inf)
        limits = {"lbx": np.append(bounds[0][own], -free), "ubx": np.append(bounds[1][own], free)}
        limits |= {"lbg": reduced.lower, "ubg": reduced.upper}
        v = at.variables(x)
        lam_x, lam_g = np.zeros(v.size), reduced.estimated_multipliers(v, delta)
        if multipliers is not None:
            lam_x[: own.size], lam_g = multipliers[0][own], multipliers[1][reduced.kept]
        duals = {"lam_x0": lam_x, "lam_g0": lam_g}
        start = time.perf_counter()
        with interruptible():
            solution = solver(x0=v, p=reduced.parameter_vector(delta, worst), **limits, **duals)
        seconds = time.perf_counter() - start
        stats = solver.stats()
        v = np.array(solution["x"]).ravel()
        x = at.lifted(v, delta)
        lam_x = np.zeros(x.size)
        lam_x[own] = np.array(solution["lam_x"]).ravel()[: own.size]
        gradient = np.array(self.oracles.options["grad_f"](x, parameters)[1]).ravel()
        jacobian = _scipy(self.oracles.options["jac_g"](x, parameters)[1])
        lam_g = reduced.multipliers(np.array(solution["lam_g"]).ravel(), gradient, jacobian)
        return self._measured(x, lam_x, lam_g, parameters, bounds, stats, seconds)

    def _estimated_multipliers(self, x: np.ndarray, parameters: np.ndarray) -> np.ndarray:
        """Multipliers of the equality rows that minimise the Lagrangian's gradient at x; zero for inequalities."""
        t = self.transcription
        jacobian, equality = self._equality_jacobian(x, parameters)
        gradient = np.array(self.oracles.options["grad_f"](x, parameters)[1]).ravel()[t.lower < t.upper]
        multipliers = np.zeros(t.assembly.m)
        multipliers[equality] = estimated_multipliers(jacobian, gradient)
        return multipliers

    def _equality_jacobian(self, x: np.ndarray, parameters: np.ndarray) -> tuple[sparse.csr_matrix, np.ndarray]:
        t = self.transcription
        equality = np.flatnonzero(t.constraint_lower == t.constraint_upper)
        return _scipy(self.oracles.options["jac_g"](x, parameters)[1])[equality][:, t.lower < t.upper], equality

    def equality_jacobian(self, x: np.ndarray, delta: float) -> tuple[sparse.csr_matrix, np.ndarray]:
        """Jacobian of the equations in the free variables at x, and their row numbers among all constraints."""
        t = self.transcription
        parameters = self.oracles.parameter_vector(delta / t.speed_unit, t.block_parameters(x[t.layout.parameters[:, 0]]))
        return self._equality_jacobian(x, parameters)

    def _measured(
        self,
        x: np.ndarray,
        lam_x: np.ndarray,
        lam_g: np.ndarray,
        parameters: np.ndarray,
        bounds: tuple[np.ndarray, np.ndarray],
        stats: dict,
        seconds: float,
    ) -> NlpResult:
        t = self.transcription
        lower, upper = bounds
        f, gradient = self.oracles.options["grad_f"](x, parameters)
        g, jacobian = self.oracles.options["jac_g"](x, parameters)
        g = np.array(g).ravel()
        free = t.lower < t.upper
        stationarity = np.array(gradient).ravel() + np.array(jacobian.T @ lam_g).ravel() + lam_x
        outside = np.maximum(np.maximum(t.constraint_lower - g, g - t.constraint_upper), 0.0)
        bounds_outside = np.maximum(np.maximum(lower - x, x - upper), 0.0)
        products = [
            _complementarity(lam_x[free], x[free], lower[free], upper[free]),
            _complementarity(lam_g, g, t.constraint_lower, t.constraint_upper),
        ]
        evaluation = sum(v for k, v in stats.items() if k.startswith("t_wall_nlp_"))
        return NlpResult(
            x,
            lam_x,
            lam_g,
            float(f),
            float(np.abs(stationarity[free]).max()),
            float(max(outside.max(), bounds_outside.max())),
            max(products),
            stats["return_status"],
            int(stats["iter_count"]),
            seconds,
            float(evaluation),
            outside,
        )


def _scipy(matrix: ca.DM) -> sparse.csr_matrix:
    return sparse.csc_matrix((matrix.nonzeros(), matrix.row(), matrix.colind()), shape=matrix.shape).tocsr()


def _complementarity(multiplier: np.ndarray, value: np.ndarray, lower: np.ndarray, upper: np.ndarray) -> float:
    """Largest |multiplier| x distance to the bound it belongs to; equality rows do not count.

    Where that bound is infinite the multiplier itself ought to vanish and counts as it is.
    """
    inequality = lower < upper
    distance = np.where(multiplier > 0, upper - value, value - lower)
    with np.errstate(invalid="ignore"):
        product = np.where(np.isinf(distance), np.abs(multiplier), np.abs(multiplier * distance))
    return float(product[inequality].max(initial=0.0))
