"""A gait as a solution of the full nonlinear program, by IPOPT.

The full program is solved on the final mesh, from the gait that the search found, with the
multipliers of the reduced program and, for the equations, those that come closest to stationarity.
Both have the same solutions, so a few steps confirm it. Where IPOPT strays from a gait at which the
first-order conditions hold, as at a kink, whose second derivatives mislead it, the gait is kept.
"""

from __future__ import annotations

import time
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import casadi as ca
import numpy as np
from scipy import sparse

from colloc.dynamics.collocated import whole_turns
from colloc.dynamics.control_problem import ControlProblem, control_problem
from colloc.gaits.gait import ANTIPODAL
from colloc.gaits.gait_fields import AnyGait
from colloc.gaits.problem import Problem
from colloc.mechanics.contact import far_pairs
from colloc.numerics.mesh import Mesh
from colloc.numerics.repeated import NumPyFunction, least_squares_multipliers
from colloc.numerics.sqp import stationarity
from colloc.reduced.program import ReducedProgram, SearchSpace
from colloc.reduced.second_order import curvature
from colloc.results.answer import NOT_MEASURED, PRESCRIBED, REDUCED, Answer, SecondOrder, Step
from colloc.search.checkpoint import active_run, checkpoint
from colloc.search.iterate import NOT_STATIONARY, STATIONARY, Iterate, space_near, space_of
from colloc.search.optimise import delta_levels, with_kink
from colloc.search.options import COARSE, MEDIUM, OPTIONS, TOLERANCES, max_rounds
from colloc.system.interruption import interruptible, is_interrupted
from colloc.transcription.full_program import ACTUATORS, AT_LEAST, FullProgram
from colloc.transcription.layout import balanced_variables, distance_and_work, layout_of
from colloc.verification.mesh_error import plan_mesh

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
# MUMPS analyses a matrix of one to four steps for as long as it takes to factorise them: minimum
# degree, with no matching of large entries to the diagonal, takes a fifth to two fifths less of a
# confirmation, with the same steps to the same optimum (3,000 to 28,000 variables)
_QUICK_ORDER = {"mumps_pivot_order": 0, "mumps_permuting_scaling": 0}

_STRAYS = (
    "several motions are balanced, and the search ended with one that does not follow from the "
    "instants before. Try another guess."
)


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
        names = (name.removeprefix("lam_") for name in ca.nlpsol_out())
        sizes = [self._nlp.expressions[name].numel() for name in names]
        stop = ca.Sparsity.dense(1), lambda *_: is_interrupted()
        self._stop = NumPyFunction("stop_request", sizes, stop)  # held here, as CasADi does not
        self._settings |= {**self._nlp.functions, "iteration_callback": self._stop}

    @cached_property
    def _solver(self) -> ca.Function:
        return ca.nlpsol("colloc", "ipopt", self._nlp.expressions, self._settings)

    def _values_and_slopes(
        self, x: np.ndarray, delta: float
    ) -> tuple[float, np.ndarray, np.ndarray, sparse.csc_matrix]:
        at = np.append(x, delta / self.program.delta_unit)
        (f, *_), g = np.split(self._nlp.values(at), [1])
        gradient, jacobian = self._nlp.slopes(at)
        return float(f), gradient, g, jacobian

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
        decisions, lower, upper = t.layout.decisions, t.lower.copy(), t.upper.copy()
        lower[decisions] = np.maximum(lower[decisions], x[decisions] - radius)
        upper[decisions] = np.minimum(upper[decisions], x[decisions] + radius)
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
        t = self.program
        _, gradient, _, slopes = self._values_and_slopes(x, delta)
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
        jacobian = self._values_and_slopes(x, delta)[3].tocsr()
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
        f, gradient, g, jacobian = self._values_and_slopes(x, delta)
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
    p = program.layout.decisions
    result = Solver(program, options).solve_within(x, delta, None, radius)
    for _ in range(20):
        # the barrier keeps off the edge of the region
        if not result.optimal or np.abs(result.x[p] - x[p]).max() < 0.999 * radius:
            return program, result
        program, x = program.moved_to(result.x)
        further = Solver(program, options).solve_within(x, delta, None, radius)
        result = further.accumulate(result)
    return program, replace(result, complementarity=np.inf, status="still moving")


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
        kind = "the limit of" if name in body.bounded_angles.names else "the"
        kind = "contact of" if name.startswith("links") else kind
        return f"{kind} {name}", float(mesh.edges[program.cells[name][index]])
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
            each = ((limit, most) for limit in limits.each for most in np.ravel(limit.most))
            limit, most = [*each][(worst - rows.start) % len(limits.names)]
            units = {"moment": " weight x body length", "power": " weight x body length per period"}
            failed = f"{what} is {most:g}{units.get(limit.function, '')}, and the gait needs "
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
        # the gradient is known to 1e-16/delta (docs/developers/error_control.md)
        if delta < 1e-9:
            advice = "ask for a delta of at least 1e-09, below which rounding hides the optimum"
    effort = f"not converged at delta = {delta:.1e} after {result.iterations} iterations"
    return f"{effort}: {failed} ({result.status}). Try to {advice}."


@checkpoint
def confirm(iterate: Iterate) -> Answer:
    """The gait as a point of the full program, with measured first- and second-order conditions;
    `message` says what holds where IPOPT does not confirm it."""
    if not iterate.problem.gait.free:
        answer = answer_of_iterate(iterate)
        return replace(answer, status=PRESCRIBED, program=PRESCRIBED, message=iterate.message)
    begin, iterate = time.perf_counter(), with_kink(iterate)
    program, result, message = _solve_full(iterate)
    answer = answer_of(program, result, iterate.delta)
    answer = replace(
        answer,
        program=REDUCED if message else iterate.problem.formulation,
        seconds=time.perf_counter() - begin,
        message=" ".join(part for part in (message, iterate.message) if part),
        # at the search's gait, which is on its active bounds; IPOPT's is a little inside
        second_order=second_order(iterate.space, iterate.v, iterate.delta, answer.value),
    )
    return replace(answer, history=(*iterate.history, answer.step))


def _solve_full(iterate: Iterate) -> tuple[FullProgram, NlpResult, str]:
    """The full program, a point of it with its first-order conditions, and what holds there; ""
    if IPOPT ended there, within reach of the iterate."""
    space, delta, mesh = iterate.space, iterate.delta, iterate.space.mesh
    reduced, parameters = iterate.program(), space.full_parameters(iterate.v)
    program = FullProgram(space.control, parameters, mesh.edges, mesh.scheme.name, space.far)
    x = program.feasible(parameters, delta)
    program = _with_whole_turns(program, x)
    if reduced.actuators is not None:
        bounds = (each.T.ravel() for each in (reduced.actuators.lower, reduced.actuators.upper))
        program = program.with_bounds(ACTUATORS, *bounds)
    # the barrier begins where it ends, as multipliers are known: one to four steps confirm most
    # gaits, and more than 30 lead away
    confirming: dict[str, object] = {"mu_init": 1e-10, "max_iter": 30, **_QUICK_ORDER}
    solver = Solver(program, confirming)
    before = solver.conditions_at(x, delta, *_multipliers(reduced, iterate.v, program))
    feasible = before.violation < TOLERANCES.violation
    # at the iterate, by the conditions of the reduced program
    here = replace(
        before,
        status=STATIONARY,
        kkt_error=iterate.kkt_error,
        complementarity=iterate.complementarity,
    )
    failure = replace(before, status=NOT_STATIONARY, iterations=iterate.step.iterations)
    if iterate.violation > OPTIONS.confirm_radius:  # no gait within reach is admissible
        return program, failure, explanation(program, failure, delta)
    if iterate.on_kink and feasible:
        kink = "The optimum is a kink of the objective: gradients on its sides cancel"
        return program, here, f"{kink} (to {here.kkt_error:.1e})."
    if iterate.strays and not before.optimal:
        # in 7 of 7 such ends of three random problems IPOPT did not confirm, for half of the time
        return program, failure, f"not converged at delta = {delta:.1e}: {_STRAYS}"
    result = solver.solve_within(
        x, delta, (before.lam_x, before.lam_g), radius := OPTIONS.confirm_radius
    )
    decisions = program.layout.decisions[space.indices]
    # beyond its checks by what SQP allows; at last, where the worst instant swings, by what a
    # certificate lets pass
    rounds = max_rounds(COARSE)
    for allowed in (*rounds * (TOLERANCES.violation,), TOLERANCES.kkt):
        if not result.optimal:
            break
        if reduced.place_rows(result.x[decisions]) <= allowed:
            return program, result, ""
        program, x = program.moved_to(result.x)
        again = Solver(program, confirming).solve_within(x, delta, None, radius)
        result = again.accumulate(result)
    ended = f"ended with {result.status} at a KKT error of {result.kkt_error:.1e}"
    if result.optimal:
        ended = f"moved the gait beyond its limits {rounds} times"
    ended, kind = f"IPOPT, begun there, {ended}", iterate.problem.formulation
    if before.optimal:
        where = f"KKT error {before.kkt_error:.1e} on the {kind} program"
        text = f"First-order conditions hold ({where}); {ended}."
        return program, replace(before, status=STATIONARY), text
    if iterate.optimal and feasible:
        # friction is as steep as 1 / delta: multipliers are known to fewer digits than needed
        where = f"KKT error {here.kkt_error:.1e}; {before.kkt_error:.1e} on the {kind} program"
        text = f"First-order conditions hold in the reduced space ({where}); {ended}."
        return program, here, text
    return program, failure, f"{explanation(program, failure, delta)} {ended}."


def _with_whole_turns(program: FullProgram, x: np.ndarray) -> FullProgram:
    if program.control.aims.closing != ANTIPODAL or "rotation" not in program.groups:
        return program
    theta = x[program.layout.theta[0]]
    turns = np.array([whole_turns(theta[0], theta[-1])])
    return program.with_bounds("rotation", turns, turns)


def _multipliers(
    reduced: ReducedProgram, v: np.ndarray, program: FullProgram
) -> tuple[np.ndarray, np.ndarray]:
    lam_x, lam_g = np.zeros(program.n), np.zeros(program.row_lower.size)
    conditions, space = stationarity(reduced, v), reduced.space
    n_least = len(space.control.aims.at_least)
    n_of_period = conditions.on_rows.size - reduced.constraints.lower.size
    on_period, on_shape = np.split(conditions.on_rows, [n_of_period])
    if reduced.actuators is not None:
        limited = reduced.actuators
        on_period, on_limits = np.split(on_period, [on_period.size - limited.placed.shape[1]])
        lam_g[program.groups[ACTUATORS]] = limited.multipliers(on_limits)
    if n_least:
        lam_g[program.groups[AT_LEAST]] = on_period[-n_least:]
    at = 0
    for name, cells in reduced.constraints.kinds.items():
        _, of_reduced, of_full = np.intersect1d(
            cells, program.cells.get(name, cells), assume_unique=True, return_indices=True
        )
        lam_g[program.groups[name].start + of_full] = on_shape[at + of_reduced]
        at += cells.size
    lam_x[program.layout.decisions[space.indices]] = conditions.on_bounds
    return lam_x, lam_g


def _answer(
    control: ControlProblem,
    mesh: Mesh,
    gait: AnyGait,
    x: np.ndarray,
    conditions: Iterate | NlpResult,
    effort: Step | NlpResult,
    **fields: Any,
) -> Answer:
    fields["distance"], fields["work"] = distance_and_work(control, layout_of(control, mesh), x)
    for name in ("kkt_error", "violation", "complementarity", "optimal"):
        fields[name] = getattr(conditions, name)
    for name in ("status", "iterations", "seconds"):
        fields[name] = getattr(effort, name)
    edges = control.in_phases(mesh, gait).edges
    return Answer(control.problem, gait, edges=edges, scheme=mesh.scheme.name, x=x, **fields)


def answer_of(program: FullProgram, result: NlpResult, delta: float) -> Answer:
    control, n, gait = program.control, program.layout.n, program.member(result.x)
    answer = _answer(
        *(control, program.mesh, gait, result.x[:n], result, result),
        delta=delta,
        lam_x=result.lam_x[:n],
        lam_g=result.lam_g,
        value=control.unscale(-result.objective),
        program=control.formulation,
    )
    return replace(answer, history=(answer.step,))


def answer_of_iterate(iterate: Iterate) -> Answer:
    """The gait as the search found it, every other variable from its balance."""
    space, control, mesh = iterate.space, iterate.space.control, iterate.space.mesh
    parameters, layout = space.full_parameters(iterate.v), layout_of(control, mesh)
    x = balanced_variables(control, layout, mesh, parameters, iterate.delta)
    return _answer(
        *(control, mesh, iterate.gait, x, iterate, iterate.step),
        delta=iterate.delta,
        lam_x=np.zeros_like(x),
        lam_g=np.empty(0),
        value=iterate.value,
        history=iterate.history,
    )


def second_order(space: SearchSpace, v: np.ndarray, delta: float, value: float) -> SecondOrder:
    """Curvature of the Lagrangian at v over a value of the objective, with all pairs of links kept
    apart."""
    if v.size > OPTIONS.max_curvature_parameters:
        return replace(NOT_MEASURED, why_not=f"not measured, for {v.size} parameters")
    far, problem = far_pairs(space.control.dynamics.body), space.control.problem
    program = ReducedProgram(space_of(problem, space.edges, space.scheme, far), delta)
    program.place_rows(v)
    here, size = curvature(program, v), abs(value / program.value(-1.0))
    if not here.kkt_error < MEDIUM * size:  # elsewhere a curvature means nothing
        text = "not measured, where the gradient of the reduced program does not vanish"
        return replace(NOT_MEASURED, why_not=text)
    return SecondOrder(here.smallest / size, here.error / size, here.n_free)


def solve_directly(problem: Problem) -> Answer:
    """A local optimum by IPOPT alone, at every level of delta, from the guess and the balance
    solver: what a reader of the equations would try first, and what the reduced search is measured
    against. It ends at the first level or mesh that fails, and its message says what did."""
    history, run, knots = tuple[Step, ...](), active_run(), np.empty(0)
    space, v = space_near(problem, problem.guess)
    parameters, levels = space.full_parameters(v), delta_levels(problem, problem.delta_start)

    def answer_at(delta):
        nonlocal history
        mesh = space.mesh
        answer = _solve_from(problem, parameters, delta, mesh.edges, mesh.scheme.name)
        history = (*history, answer.step)
        return replace(answer, history=history)

    for done, delta in enumerate(levels):
        run.report("descend", done, len(levels))
        answer = answer_at(delta)
        if not answer.optimal:
            return answer
        parameters = answer.x[answer.layout.decisions]
    for done in range(OPTIONS.meshes if problem.mesh_tolerance > 0 else 0):
        run.report("refine", done, OPTIONS.meshes)
        gait, control = answer.gait, space.control
        mesh, speed = control.in_phases(space.mesh, gait), answer.delta_per_period
        plan = plan_mesh(control, mesh, gait, speed, problem.mesh_tolerance, knots=knots)
        if plan is None:
            break
        knots = np.concatenate([knots, plan.knots])
        space, v = space_near(problem, gait, plan.edges, plan.scheme)
        parameters = space.full_parameters(v)
        answer = answer_at(delta)
        if not answer.optimal:
            return answer
    space, v = space_near(problem, answer.gait, answer.edges, answer.scheme)
    return replace(answer, second_order=second_order(space, v, answer.delta, answer.value))


@checkpoint
def _solve_from(
    problem: Problem, parameters: np.ndarray, delta: float, edges: np.ndarray, scheme: str
) -> Answer:
    program = FullProgram(control_problem(problem), parameters, edges, scheme)
    x = program.feasible(parameters, delta)
    program = _with_whole_turns(program, x)
    # from a guess IPOPT may need five hundred iterations
    last, result = solve_in_regions(program, x, delta, OPTIONS.radius, {"max_iter": 1500})
    answer = answer_of(last, result, delta)
    return answer if result.optimal else replace(answer, message=explanation(last, result, delta))
