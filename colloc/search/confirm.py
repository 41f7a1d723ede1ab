"""A gait as a solution of its problem's full nonlinear program, confirmed by IPOPT.

The full program has joint angles, rates, tail velocities and link forces as variables and the
balance of forces as constraints. It is solved on the final mesh, from the gait that the search
found, with the multipliers of the reduced program and, for the equations, those that come closest
to stationarity. Both have the same solutions, so a few steps confirm it.

Where IPOPT strays from a gait at which the first-order conditions hold, the gait is kept: at a kink
of the collocated objective its second derivatives mislead. What holds then, and where, is the
answer's verdict.
"""

from __future__ import annotations

import time
from dataclasses import dataclass, replace
from enum import Enum

import numpy as np

from colloc.numerics.sqp import Stationarity, stationarity
from colloc.reduced.program import ReducedProgram, SearchSpace
from colloc.reduced.second_order import curvature
from colloc.results.answer import NOT_MEASURED, PRESCRIBED, REDUCED, Answer, SecondOrder
from colloc.search.certify import EXACT, VIOLATION
from colloc.search.converge import NOT_STATIONARY, STATIONARY, with_kink
from colloc.search.diagnosis import explanation
from colloc.search.effort import ROUGH, SKETCH
from colloc.search.ipopt import CONFIRMING, NlpResult, Solver
from colloc.search.optimum import Optimum
from colloc.search.run import this_run
from colloc.search.spaces import heading, with_far
from colloc.transcription.full_program import ACTUATORS, AT_LEAST, FullProgram, full_program
from colloc.transcription.layout import distance_and_work, layout_of
from colloc.transcription.warm_start import balanced_variables

RADIUS = 0.01
"""How far the gait may move [rad]: a solution farther away would be another gait."""
_MOST_PARAMETERS = 150
"""Curvature is measured for so many parameters at most: it takes two gradients for each."""


class Verdict(Enum):
    """What holds at an answer."""

    CONFIRMED = "confirmed"
    """IPOPT ended there, within reach of the gait found."""
    STATIONARY_ON_FULL = "first-order conditions hold on the full program"
    STATIONARY_ON_REDUCED = "first-order conditions hold in the reduced space"
    ON_KINK = "first-order conditions hold on the sides of a kink"
    FAILED = "not stationary"


@dataclass(frozen=True, eq=False)
class _Outcome:
    """What became of a gait on the full program."""

    verdict: Verdict
    program: FullProgram
    result: NlpResult
    ended: str = ""
    """How IPOPT ended, where that is not the answer."""
    on_full: float = np.nan
    """KKT error of the full program."""


def confirm(optimum: Optimum) -> Answer:
    """The gait as a point of the full program, with measured first- and second-order conditions.

    Parameters
    ----------
    optimum : Optimum
        On its final mesh.

    Returns
    -------
    Answer
        Optimal if any of the first four verdicts holds; `message` says which, unless IPOPT confirms
        it.
    """
    begin = time.perf_counter()
    if not optimum.problem.gait.free:
        answer = unconfirmed(optimum)
        return replace(answer, status=PRESCRIBED, program=PRESCRIBED, message=optimum.lacks)

    def compute() -> Answer:
        found = with_kink(optimum)
        reduced = found.program()
        outcome = _outcome(found, reduced, stationarity(reduced, found.v))
        program, result, confirmed = (
            outcome.program,
            outcome.result,
            outcome.verdict is Verdict.CONFIRMED,
        )
        answer = answer_of(program, result, optimum.delta)
        answer = replace(
            answer,
            program=optimum.problem.formulation if confirmed else REDUCED,
            seconds=time.perf_counter() - begin,
            message=" ".join(part for part in (_sentence(found, outcome), found.lacks) if part),
        )
        # at the search's gait, which is on the bounds that hold it; IPOPT's is a little inside
        curved = second_order(found.space, found.v, optimum.delta, answer.value)
        answer = replace(answer, second_order=curved)
        return replace(answer, history=(*found.history, answer.step))

    this_run().told("confirm", 0, 1, optimum)
    return this_run().kept("confirm", (optimum,), compute)


def _outcome(optimum: Optimum, reduced: ReducedProgram, conditions: Stationarity) -> _Outcome:
    space, delta = optimum.space, optimum.delta
    mesh = space.mesh
    parameters = space.full_parameters(optimum.v)
    program = full_program(space.control, parameters, mesh.edges, mesh.scheme.name, space.given.far)
    x = program.feasible(parameters, delta)
    program = heading(program, x)
    if reduced.actuators is not None:
        program = program.with_bounds(ACTUATORS, *reduced.actuators.every_bound())
    solver = Solver(program, CONFIRMING)
    before = solver.measured(x, delta, *_multipliers(reduced, conditions, program))
    here = replace(
        before,
        status=STATIONARY,
        kkt_error=optimum.kkt_error,
        complementarity=optimum.complementarity,
    )
    failed = replace(before, status=NOT_STATIONARY, iterations=optimum.iterations)
    if optimum.violation > RADIUS:  # no gait within reach is admissible
        return _Outcome(Verdict.FAILED, program, failed)
    if optimum.on_kink and before.violation < VIOLATION:
        return _Outcome(Verdict.ON_KINK, program, here)
    result = solver.solve_within(x, delta, (before.lam_x, before.lam_g), RADIUS)
    own = program.layout.parameters[space.own, 0]
    # beyond its checks it may be by what SQP allows; at last, where the worst instant swings, by
    # what a certificate lets pass
    for allowed in (*SKETCH.rounds * (VIOLATION,), EXACT):
        if not result.optimal:
            break
        if reduced.place_rows(result.x[own]) <= allowed:
            return _Outcome(Verdict.CONFIRMED, program, result)
        # the gait has moved so far that other instants are the worst
        program, x = program.moved_to(result.x)
        result = (
            Solver(program, CONFIRMING).solve_within(x, delta, None, RADIUS).accumulated(result)
        )
    ended = (
        f"IPOPT, begun there, ended with {result.status} at a KKT error of {result.kkt_error:.1e}"
    )
    if result.optimal:
        ended = f"IPOPT, begun there, moved the gait beyond its limits {SKETCH.rounds} times"
    if before.optimal:
        return _Outcome(
            Verdict.STATIONARY_ON_FULL, program, replace(before, status=STATIONARY), ended
        )
    if optimum.optimal and before.violation < VIOLATION:
        # with friction as steep as 1 / delta, multipliers of the balance are known to fewer digits
        # than the conditions need
        return _Outcome(Verdict.STATIONARY_ON_REDUCED, program, here, ended, before.kkt_error)
    return _Outcome(Verdict.FAILED, program, failed, ended)


def _sentence(optimum: Optimum, outcome: _Outcome) -> str:
    """What holds, where it is not all that should."""
    kind, kkt_error = optimum.problem.formulation, outcome.result.kkt_error
    if outcome.verdict is Verdict.CONFIRMED:
        return ""
    if outcome.verdict is Verdict.ON_KINK:
        return (
            f"The optimum is a kink of the objective: gradients on its sides cancel (to "
            f"{kkt_error:.1e})."
        )
    if outcome.verdict is Verdict.STATIONARY_ON_FULL:
        return (
            f"First-order conditions hold (KKT error {kkt_error:.1e} on the {kind} program); "
            f"{outcome.ended}."
        )
    if outcome.verdict is Verdict.STATIONARY_ON_REDUCED:
        where = f"KKT error {kkt_error:.1e}; {outcome.on_full:.1e} on the {kind} program"
        return f"First-order conditions hold in the reduced space ({where}); {outcome.ended}."
    text = explanation(outcome.program, outcome.result, optimum.delta)
    return f"{text} {outcome.ended}." if outcome.ended else text


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


def unconfirmed(optimum: Optimum) -> Answer:
    """The gait as the search found it, every other variable following from its balance: where there
    is no time for more."""
    space, control = optimum.space, optimum.space.control
    mesh, layout = space.mesh, layout_of(control, space.mesh)
    parameters = space.full_parameters(optimum.v)
    x = balanced_variables(control, layout, mesh, parameters, optimum.delta)
    distance, work = distance_and_work(control, layout, x)
    return Answer(
        optimum.problem,
        optimum.gait,
        optimum.delta,
        edges=control.in_phases(mesh, optimum.gait).edges,
        scheme=mesh.scheme.name,
        x=x,
        lam_x=np.zeros_like(x),
        lam_g=np.empty(0),
        value=optimum.value,
        distance=distance,
        work=work,
        kkt_error=optimum.kkt_error,
        violation=optimum.violation,
        complementarity=optimum.complementarity,
        status=optimum.step.status,
        optimal=optimum.optimal,
        iterations=optimum.iterations,
        seconds=optimum.seconds,
        history=optimum.history,
    )


def second_order(space: SearchSpace, v: np.ndarray, delta: float, value: float) -> SecondOrder:
    """The curvature of the Lagrangian at parameters v over a value of the objective, with all pairs
    of links kept apart."""
    body = space.control.dynamics.body
    if v.size > _MOST_PARAMETERS:
        return replace(NOT_MEASURED, why_not=f"not measured, for {v.size} parameters")
    program = ReducedProgram(with_far(space, body.far_pairs), delta)
    program.place_rows(v)
    found, size = curvature(program, v), abs(value / program.stated(-1.0))
    if not found.kkt_error < ROUGH.kkt_error * size:  # elsewhere a curvature means nothing
        return replace(
            NOT_MEASURED,
            why_not="not measured, where the gradient of the reduced program does not vanish",
        )
    return SecondOrder(found.smallest / size, found.error / size, found.n_free)


def _multipliers(
    reduced: ReducedProgram, conditions: Stationarity, program: FullProgram
) -> tuple[np.ndarray, np.ndarray]:
    """Multipliers of the full program's bounds and inequalities, from those of the reduced one."""
    lam_x, lam_g = np.zeros(program.n), np.zeros(program.row_lower.size)
    space, reached = reduced.space, len(reduced.space.control.aims.at_least)
    of_period, on_rows = np.split(
        conditions.on_rows, [conditions.on_rows.size - reduced.constraints.lower.size]
    )
    if reduced.actuators is not None:
        limited = reduced.actuators
        of_period, on_actuators = np.split(of_period, [of_period.size - limited.placed.shape[1]])
        lam_g[program.groups[ACTUATORS]] = limited.multipliers(on_actuators)
    if reached:
        lam_g[program.groups[AT_LEAST]] = of_period[-reached:]
    at = 0
    for name, cells in reduced.constraints.kinds.items():
        _, of_reduced, of_full = np.intersect1d(
            cells, program.cells.get(name, cells), assume_unique=True, return_indices=True
        )
        lam_g[program.groups[name].start + of_full] = on_rows[at + of_reduced]
        at += cells.size
    lam_x[program.layout.parameters[space.own, 0]] = conditions.on_bounds
    return lam_x, lam_g
