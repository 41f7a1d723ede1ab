"""A gait as a solution of the full nonlinear program, by IPOPT.

The full program is solved on the final mesh, from the gait that the search found, with the
multipliers of the reduced program and, for the equations, those that come closest to stationarity.
Both have the same solutions, so a few steps confirm it. Where IPOPT strays from a gait at which the
first-order conditions hold, as at a kink, whose second derivatives mislead it, the gait is kept.
"""

from __future__ import annotations

import time
from dataclasses import replace
from typing import Any

import numpy as np

from colloc.dynamics.collocated import whole_turns
from colloc.dynamics.control_problem import ControlProblem, control_problem
from colloc.gaits.gait import ANTIPODAL
from colloc.gaits.gait_fields import AnyGait
from colloc.gaits.problem import Problem
from colloc.mechanics.contact import far_pairs
from colloc.numerics.mesh import Mesh
from colloc.numerics.sqp import stationarity
from colloc.reduced.program import ReducedProgram, SearchSpace
from colloc.reduced.second_order import curvature
from colloc.results.answer import NOT_MEASURED, PRESCRIBED, REDUCED, Answer, SecondOrder, Step
from colloc.search.checkpoint import active_run, checkpoint
from colloc.search.ipopt import NlpResult, Solver, explanation, solve_in_regions
from colloc.search.iterate import NOT_STATIONARY, STATIONARY, Iterate, space_near, space_of
from colloc.search.optimise import delta_levels, with_kink
from colloc.search.options import COARSE, MEDIUM, OPTIONS, TOLERANCES, max_rounds
from colloc.transcription.full_program import ACTUATORS, AT_LEAST, FullProgram
from colloc.transcription.layout import balanced_variables, distance_and_work, layout_of
from colloc.verification.mesh_error import plan_mesh


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
    confirming: dict[str, object] = {"mu_init": 1e-10, "max_iter": 30}
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
    failed = replace(before, status=NOT_STATIONARY, iterations=iterate.step.iterations)
    if iterate.violation > OPTIONS.confirm_radius:  # no gait within reach is admissible
        return program, failed, explanation(program, failed, delta)
    if iterate.on_kink and feasible:
        kink = "The optimum is a kink of the objective: gradients on its sides cancel"
        return program, here, f"{kink} (to {here.kkt_error:.1e})."
    result = solver.solve_within(
        x, delta, (before.lam_x, before.lam_g), radius := OPTIONS.confirm_radius
    )
    own = program.layout.decisions[space.own]
    # beyond its checks by what SQP allows; at last, where the worst instant swings, by what a
    # certificate lets pass
    rounds = max_rounds(COARSE)
    for allowed in (*rounds * (TOLERANCES.violation,), TOLERANCES.kkt):
        if not result.optimal:
            break
        if reduced.place_rows(result.x[own]) <= allowed:
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
        # with friction as steep as 1 / delta, multipliers of the balance are known to fewer digits
        # than the conditions need
        where = f"KKT error {here.kkt_error:.1e}; {before.kkt_error:.1e} on the {kind} program"
        return (
            program,
            here,
            f"First-order conditions hold in the reduced space ({where}); {ended}.",
        )
    return program, failed, f"{explanation(program, failed, delta)} {ended}."


def _with_whole_turns(program: FullProgram, x: np.ndarray) -> FullProgram:
    """The program with the net rotation of an antipodal gait closed as variables x close it."""
    if program.control.aims.closing != ANTIPODAL or "rotation" not in program.groups:
        return program
    theta = x[program.layout.theta[0]]
    turns = np.array([whole_turns(theta[0], theta[-1])])
    return program.with_bounds("rotation", turns, turns)


def _multipliers(
    reduced: ReducedProgram, v: np.ndarray, program: FullProgram
) -> tuple[np.ndarray, np.ndarray]:
    """Multipliers of the full program's bounds and inequalities, from those of the reduced one."""
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
    lam_x[program.layout.decisions[space.own]] = conditions.on_bounds
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
    multipliers: Any = {"lam_x": result.lam_x[:n], "lam_g": result.lam_g}
    answer = _answer(
        *(control, program.mesh, gait, result.x[:n], result, result),
        delta=delta,
        value=control.unscale(-result.objective),
        program=control.formulation,
        **multipliers,
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
    history, run = tuple[Step, ...](), active_run()
    space, v = space_near(problem, problem.guess)
    parameters, mesh = space.full_parameters(v), space.mesh
    levels = delta_levels(problem, problem.delta_start)
    for done, delta in enumerate(levels):
        run.report("descend", done, len(levels))
        answer = _solve_from(problem, parameters, delta, mesh.edges, mesh.scheme.name)
        history = (*history, answer.step)
        if not answer.optimal:
            return replace(answer, history=history)
        parameters = answer.x[answer.layout.decisions]
    knots = np.empty(0)
    for done in range(OPTIONS.meshes if problem.mesh_tolerance > 0 else 0):
        run.report("refine", done, OPTIONS.meshes)
        gait, control = answer.gait, space.control
        mesh, speed = control.in_phases(space.mesh, gait), answer.delta_per_period
        plan = plan_mesh(control, mesh, gait, speed, problem.mesh_tolerance, kept=knots)
        if plan is None:
            break
        knots = np.concatenate([knots, plan.kept])
        space, v = space_near(problem, gait, plan.edges, plan.scheme)
        parameters = space.full_parameters(v)
        answer = _solve_from(problem, parameters, delta, space.mesh.edges, plan.scheme)
        history = (*history, answer.step)
        if not answer.optimal:
            return replace(answer, history=history)
    space, v = space_near(problem, answer.gait, answer.edges, answer.scheme)
    curved = second_order(space, v, answer.delta, answer.value)
    return replace(answer, second_order=curved, history=history)


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
