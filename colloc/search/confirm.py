"""A gait as a solution of the full nonlinear program, confirmed by IPOPT.

The full program is solved on the final mesh, from the gait that the search found, with the
multipliers of the reduced program and, for the equations, those that come closest to stationarity.
Both have the same solutions, so a few steps confirm it. Where IPOPT strays from a gait at which the
first-order conditions hold, as at a kink, whose second derivatives mislead it, the gait is kept.
"""

from __future__ import annotations

import time
from dataclasses import replace

import numpy as np

from colloc.mechanics.contact import far_pairs
from colloc.numerics.sqp import Stationarity, stationarity
from colloc.reduced.program import ReducedProgram, SearchSpace
from colloc.reduced.second_order import curvature
from colloc.results.answer import NOT_MEASURED, PRESCRIBED, REDUCED, Answer, SecondOrder
from colloc.search.checkpoint import active_run, checkpointed
from colloc.search.converge import with_kink
from colloc.search.diagnosis import explanation
from colloc.search.ipopt import CONFIRMING, NlpResult, Solver
from colloc.search.iterate import NOT_STATIONARY, STATIONARY, Iterate
from colloc.search.options import COARSE, MEDIUM, OPTIONS, TOLERANCES, max_rounds
from colloc.search.spaces import with_far, with_whole_turns
from colloc.transcription.full_program import ACTUATORS, AT_LEAST, FullProgram, full_program
from colloc.transcription.layout import balanced_variables, distance_and_work, layout_of


def confirm(iterate: Iterate) -> Answer:
    """The gait as a point of the full program, with measured first- and second-order conditions;
    `message` says what holds where IPOPT does not confirm it."""
    if not iterate.problem.gait.free:
        answer = answer_of_iterate(iterate)
        return replace(answer, status=PRESCRIBED, program=PRESCRIBED, message=iterate.message)
    active_run().report("confirm", 0, 1, iterate)
    return _confirm(iterate)


@checkpointed
def _confirm(iterate: Iterate) -> Answer:
    begin, iterate = time.perf_counter(), with_kink(iterate)
    program, result, message = _solve_full(iterate)
    answer = answer_of(program, result, iterate.delta)
    # at the search's gait, which is on its active bounds; IPOPT's is a little inside
    second = second_order(iterate.space, iterate.v, iterate.delta, answer.value)
    answer = replace(
        answer,
        program=REDUCED if message else iterate.problem.formulation,
        seconds=time.perf_counter() - begin,
        message=" ".join(part for part in (message, iterate.message) if part),
        second_order=second,
    )
    return replace(answer, history=(*iterate.history, answer.step))


def _solve_full(iterate: Iterate) -> tuple[FullProgram, NlpResult, str]:
    """The full program, a point of it with its first-order conditions, and what holds there; ""
    if IPOPT ended there, within reach of the iterate."""
    space, delta, mesh = iterate.space, iterate.delta, iterate.space.mesh
    reduced, parameters = iterate.program(), space.full_parameters(iterate.v)
    program = full_program(space.control, parameters, mesh.edges, mesh.scheme.name, space.far)
    x = program.feasible(parameters, delta)
    program = with_whole_turns(program, x)
    if reduced.actuators is not None:
        program = program.with_bounds(ACTUATORS, *reduced.actuators.every_bound())
    solver = Solver(program, CONFIRMING)
    multipliers = _multipliers(reduced, stationarity(reduced, iterate.v), program)
    before = solver.measured(x, delta, *multipliers)
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
        return (
            program,
            here,
            f"The optimum is a kink of the objective: gradients on its sides cancel (to "
            f"{here.kkt_error:.1e}).",
        )
    last, result, ended = _solve_within(solver, reduced, x, before, delta)
    if not ended:
        return last, result, ""
    kind = iterate.problem.formulation
    if before.optimal:
        return (
            last,
            replace(before, status=STATIONARY),
            f"First-order conditions hold (KKT error {before.kkt_error:.1e} on the {kind} "
            f"program); {ended}.",
        )
    if iterate.optimal and feasible:
        # with friction as steep as 1 / delta, multipliers of the balance are known to fewer digits
        # than the conditions need
        where = f"KKT error {here.kkt_error:.1e}; {before.kkt_error:.1e} on the {kind} program"
        text = f"First-order conditions hold in the reduced space ({where}); {ended}."
        return last, here, text
    return last, failed, f"{explanation(last, failed, delta)} {ended}."


def _solve_within(
    solver: Solver, reduced: ReducedProgram, x: np.ndarray, before: NlpResult, delta: float
) -> tuple[FullProgram, NlpResult, str]:
    """The program as last stated, where IPOPT ended, and how, if that is no admissible optimum
    within reach."""
    program, radius = solver.program, OPTIONS.confirm_radius
    result = solver.solve_within(x, delta, (before.lam_x, before.lam_g), radius)
    own = program.layout.decisions[reduced.space.own]
    # beyond its checks by what SQP allows; at last, where the worst instant swings, by what a
    # certificate lets pass
    rounds = max_rounds(COARSE)
    for allowed in (*rounds * (TOLERANCES.violation,), TOLERANCES.kkt):
        if not result.optimal:
            break
        if reduced.place_rows(result.x[own]) <= allowed:
            return program, result, ""
        program, x = program.moved_to(result.x)
        again = Solver(program, CONFIRMING).solve_within(x, delta, None, radius)
        result = again.accumulate(result)
    if result.optimal:
        ended = f"IPOPT, begun there, moved the gait beyond its limits {rounds} times"
        return program, result, ended
    error = f"at a KKT error of {result.kkt_error:.1e}"
    return program, result, f"IPOPT, begun there, ended with {result.status} {error}"


def answer_of(program: FullProgram, result: NlpResult, delta: float) -> Answer:
    """A point of a full program, as an answer to the stated problem."""
    gait, n = program.member(result.x), program.layout.n
    distance, work = distance_and_work(program.control, program.layout, result.x)
    answer = Answer(
        program.control.problem,
        gait,
        delta,
        edges=program.control.in_phases(program.mesh, gait).edges,
        scheme=program.mesh.scheme.name,
        x=result.x[:n],
        lam_x=result.lam_x[:n],
        lam_g=result.lam_g,
        value=program.control.stated(-result.objective),
        distance=distance,
        work=work,
        kkt_error=result.kkt_error,
        violation=result.violation,
        complementarity=result.complementarity,
        status=result.status,
        optimal=result.optimal,
        iterations=result.iterations,
        seconds=result.seconds,
        program=program.control.formulation,
    )
    return replace(answer, history=(answer.step,))


def answer_of_iterate(iterate: Iterate) -> Answer:
    """The gait as the search found it, every other variable from its balance."""
    space, control = iterate.space, iterate.space.control
    mesh, layout = space.mesh, layout_of(control, space.mesh)
    x = balanced_variables(control, layout, mesh, space.full_parameters(iterate.v), iterate.delta)
    distance, work = distance_and_work(control, layout, x)
    return Answer(
        iterate.problem,
        iterate.gait,
        iterate.delta,
        edges=control.in_phases(mesh, iterate.gait).edges,
        scheme=mesh.scheme.name,
        x=x,
        lam_x=np.zeros_like(x),
        lam_g=np.empty(0),
        value=iterate.value,
        distance=distance,
        work=work,
        kkt_error=iterate.kkt_error,
        violation=iterate.violation,
        complementarity=iterate.complementarity,
        status=iterate.step.status,
        optimal=iterate.optimal,
        iterations=iterate.step.iterations,
        seconds=iterate.step.seconds,
        history=iterate.history,
    )


def second_order(space: SearchSpace, v: np.ndarray, delta: float, value: float) -> SecondOrder:
    """Curvature of the Lagrangian at v over a value of the objective, with all pairs of links kept
    apart."""
    if v.size > OPTIONS.max_curvature_parameters:
        return replace(NOT_MEASURED, why_not=f"not measured, for {v.size} parameters")
    program = ReducedProgram(with_far(space, far_pairs(space.control.dynamics.body)), delta)
    program.place_rows(v)
    here, size = curvature(program, v), abs(value / program.stated(-1.0))
    if not here.kkt_error < MEDIUM * size:  # elsewhere a curvature means nothing
        return replace(
            NOT_MEASURED,
            why_not="not measured, where the gradient of the reduced program does not vanish",
        )
    return SecondOrder(here.smallest / size, here.error / size, here.n_free)


def _multipliers(
    reduced: ReducedProgram, conditions: Stationarity, program: FullProgram
) -> tuple[np.ndarray, np.ndarray]:
    """Multipliers of the full program's bounds and inequalities, from those of the reduced one."""
    lam_x, lam_g = np.zeros(program.n), np.zeros(program.row_lower.size)
    space, n_least = reduced.space, len(reduced.space.control.aims.at_least)
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
