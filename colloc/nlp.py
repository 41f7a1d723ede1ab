"""The one place that names IPOPT: solves a transcription's nonlinear program and measures what comes back."""

from __future__ import annotations

import time
from dataclasses import dataclass, field, replace

import casadi as ca
import numpy as np

from colloc.blocks import Oracles, oracles
from colloc.layout import RADIANS
from colloc.transcription import Transcription, worst_instants

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
    "theta_max_fact": 0.1,
    "warm_start_init_point": "yes",
    "warm_start_bound_push": 1e-5,
    "warm_start_bound_frac": 1e-5,
    "warm_start_slack_bound_push": 1e-5,
    "warm_start_slack_bound_frac": 1e-5,
    "warm_start_mult_bound_push": 1e-5,
    "max_iter": 300,
}
"""theta_max_fact decides: it keeps the iterates near the balance manifold, from which a step along negative curvature
would otherwise carry them away for good."""


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
    group_violation: dict[str, float] = field(default_factory=dict)

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


class Solver:
    """A transcription bound to IPOPT; built once, solved for many deltas and starts."""

    def __init__(self, transcription: Transcription, options: dict[str, object] | None = None) -> None:
        self.transcription = transcription
        self.oracles: Oracles = oracles(transcription.assembly)
        settings: dict[str, object] = {f"ipopt.{k}": v for k, v in {**IPOPT_OPTIONS, **(options or {})}.items()}
        settings |= {"print_time": False, "calc_lam_p": False, "calc_lam_x": False, "calc_f": False, "calc_g": False}
        settings |= {"error_on_fail": False, "no_nlp_grad": True, "record_time": True, **self.oracles.options}
        self._solver = ca.nlpsol("colloc", "ipopt", self.oracles.nlp, settings)

    def solve(
        self,
        x: np.ndarray,
        delta: float,
        multipliers: tuple[np.ndarray, np.ndarray] | None = None,
    ) -> NlpResult:
        """Maximise efficiency from x at regularisation `delta` (per period); multipliers are (lam_x, lam_g)."""
        t = self.transcription
        parameters = self.oracles.parameter_vector(delta / RADIANS, t.block_parameters(x[t.layout.parameters[:, 0]]))
        bounds = {"lbx": t.lower, "ubx": t.upper, "lbg": t.constraint_lower, "ubg": t.constraint_upper}
        duals = {} if multipliers is None else {"lam_x0": multipliers[0], "lam_g0": multipliers[1]}
        start = time.perf_counter()
        solution = self._solver(x0=x, p=parameters, **bounds, **duals)
        seconds = time.perf_counter() - start
        stats = self._solver.stats()
        x, lam_x, lam_g = (np.array(solution[k]).ravel() for k in ("x", "lam_x", "lam_g"))
        return self._measured(x, lam_x, lam_g, parameters, stats, seconds)

    def check_excess(self, x: np.ndarray) -> float:
        """How far the shape checks are exceeded at the worst instants of the gait in x [rad]."""
        t = self.transcription
        parameters = x[t.layout.parameters[:, 0]]
        worst = worst_instants(t.problem, t.mesh, t.checks, parameters)
        gait = t.gait(x)
        excess = 0.0
        for (name, check), times in zip(t.checks, worst, strict=True):
            rows = t.groups[name]
            values = np.array(check.map(times.size)(gait.angles(times))).ravel()
            excess = max(excess, float(np.max(values - t.constraint_upper[rows])))
            excess = max(excess, float(np.max(t.constraint_lower[rows] - values)))
        return excess

    def _measured(self, x, lam_x, lam_g, parameters, stats, seconds) -> NlpResult:
        t = self.transcription
        f, gradient = self.oracles.options["grad_f"](x, parameters)
        g, jacobian = self.oracles.options["jac_g"](x, parameters)
        g = np.array(g).ravel()
        free = t.lower < t.upper
        stationarity = np.array(gradient).ravel() + np.array(jacobian.T @ lam_g).ravel() + lam_x
        outside = np.maximum(np.maximum(t.constraint_lower - g, g - t.constraint_upper), 0.0)
        bounds_outside = np.maximum(np.maximum(t.lower - x, x - t.upper), 0.0)
        products = [
            _complementarity(lam_x[free], x[free], t.lower[free], t.upper[free]),
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
            {name: float(outside[rows].max()) for name, rows in t.groups.items() if rows.stop > rows.start},
        )


def _complementarity(multiplier: np.ndarray, value: np.ndarray, lower: np.ndarray, upper: np.ndarray) -> float:
    """Largest |multiplier| x distance to the bound it belongs to; equality rows do not count."""
    inequality = lower < upper
    distance = np.where(multiplier > 0, upper - value, value - lower)
    with np.errstate(invalid="ignore"):
        product = np.where(multiplier == 0, 0.0, np.abs(multiplier * distance))
    return float(product[inequality].max(initial=0.0))
