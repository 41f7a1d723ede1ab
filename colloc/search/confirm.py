"""The answer of a search: its gait as a solution of the problem's full nonlinear program, by IPOPT.

The full program has joint angles, rates, tail velocities and link forces as variables and the balance of forces as
constraints. It is solved on the final mesh, from the gait that the search found, with the multipliers of the reduced program
and, for the equations, those that come closest to stationarity. Both have the same solutions, so a few steps confirm it.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from colloc.collocation.layout import Layout, problem_layout
from colloc.collocation.point_equations import ACTUATORS
from colloc.collocation.program import GaitProgram
from colloc.collocation.warm_start import balanced_variables, feasible_point
from colloc.gaits.objective import EFFICIENCY
from colloc.gaits.problem import Problem
from colloc.reduced.program import ReducedProgram
from colloc.reduced.spaces import heading, transcribed
from colloc.results.answer import REDUCED, Level
from colloc.search.converge import Found
from colloc.search.diagnosis import explanation
from colloc.search.ipopt import NlpResult, Solver

STATIONARY, NOT_STATIONARY = "stationary", "not stationary"
RADIUS = 0.01
"""How far the gait may move [rad]: a solution farther away would be another gait."""
_OPTIONS: dict[str, object] = {"mu_init": 1e-8, "max_iter": 60, "max_cpu_time": 20.0}
STATIONARY_ROWS = 1e-8
"""Violation of the full program up to which its equations hold at the gait of a search."""
_ROUNDS, _ADMISSIBLE, _LET_PASS = 4, 1e-8, 1e-6
"""Times that the shape checks are moved after the answer, what may be beyond them [rad], and what a certificate lets pass where
the worst instant swings between two."""


def level_found(found: Found) -> Level:
    """What is kept of a level of the search: its gait with every other variable in balance."""
    space, problem = found.space, found.space.problem
    mesh, layout = space.phase_mesh(found.gait), problem_layout(problem, space.mesh, space.knots)
    x = balanced_variables(problem, layout, mesh, found.gait, space.full_parameters(found.v), found.delta)
    conditions = found.conditions
    return Level(
        found.delta,
        mesh.edges,
        x,
        np.zeros_like(x),
        conditions.on_rows,
        *_of_period(problem, layout, x),
        conditions.kkt_error,
        conditions.violation,
        conditions.complementarity,
        STATIONARY if found.optimal else NOT_STATIONARY,
        found.optimal,
        found.iterations,
        found.seconds,
        found.seconds,
        space.mesh.scheme.name,
        knots=space.knots,
        objective=_stated(problem, -found.objective),
        panels=problem.body.panels,
    )


def _of_period(problem: Problem, layout: Layout, x: np.ndarray) -> tuple[float, float, float]:
    """Efficiency, distance and work of a whole period."""
    distance, work = (float(x[row[0, -1]]) / problem.gait.fraction for row in (layout.distance, layout.work))
    return distance / work, distance, work


def _stated(problem: Problem, value: float) -> float:
    """`Level.objective` of a value that was found."""
    return np.nan if problem.objective == EFFICIENCY else value


def level_of(program: GaitProgram, result: NlpResult, delta: float, name: str) -> Level:
    """What is kept of a solved program."""
    gait = program.member(result.x[program.layout.parameters[:, 0]])
    return Level(
        delta,
        program.phase_mesh(gait).edges,
        result.x,
        result.lam_x,
        result.lam_g,
        *_of_period(program.problem, program.layout, result.x),
        result.kkt_error,
        result.violation,
        result.complementarity,
        result.status,
        result.optimal,
        result.iterations,
        result.seconds,
        result.evaluation_seconds,
        program.mesh.scheme.name,
        name,
        program.knots,
        _stated(program.problem, -result.objective),
        program.problem.body.panels,
    )


def answer(found: Found) -> tuple[Level, str]:
    """The gait of a search as a solution of the full program, and what does not hold, or "".

    Where IPOPT strays from a gait at which the first-order conditions of the full program hold, the gait is kept: at a kink of
    the collocated objective its second derivatives mislead. So it is where those of the reduced program hold alone. A gait that
    rests on a kink is not given to IPOPT.
    """
    space, delta = found.space, found.delta
    problem = space.problem.with_(scheme=space.mesh.scheme.name)
    program = transcribed(problem, found.gait, space.phase_mesh(found.gait).edges, space.far)
    x = feasible_point(program, space.full_parameters(found.v), delta)
    reduced = found.program or ReducedProgram(space, delta)
    program = _limited(reduced, heading(program, x))
    solver = Solver(program, _OPTIONS)
    before = solver.measured(x, delta, *_multipliers(found, program))
    if found.conditions.violation > RADIUS:  # no gait within reach is admissible
        kept = replace(before, status=NOT_STATIONARY, iterations=found.iterations)
        return level_of(program, kept, delta, REDUCED), explanation(program, kept, delta)
    here = found.conditions
    in_reduced_space = replace(before, status=STATIONARY, kkt_error=here.kkt_error, complementarity=here.complementarity)
    if found.on_kink and before.violation < STATIONARY_ROWS:
        text = f"The optimum is a kink of the objective: gradients on its sides cancel (to {here.kkt_error:.1e})."
        return level_of(program, in_reduced_space, delta, REDUCED), text
    result = solver.solve_within(x, delta, (before.lam_x, before.lam_g), RADIUS)
    own = program.layout.parameters[space.own, 0]
    for allowed in (*_ROUNDS * (_ADMISSIBLE,), _LET_PASS):
        if not result.optimal:
            break
        if reduced.place_rows(result.x[own]) <= allowed:
            return level_of(program, result, delta, problem.formulation), ""
        # the gait has moved so far that other instants are the worst
        solver.transcription = program = _limited(reduced, program)
        result = solver.solve_within(result.x, delta, (result.lam_x, result.lam_g), RADIUS).accumulated(result)
    ended = f"IPOPT, begun there, ended with {result.status} at a KKT error of {result.kkt_error:.1e}"
    if result.optimal:
        ended = f"IPOPT, begun there, moved the gait beyond its limits {_ROUNDS} times"
    if before.optimal:
        kept = replace(before, status=STATIONARY)
        text = f"First-order conditions hold (KKT error {before.kkt_error:.1e} on the {problem.formulation} program); {ended}."
        return level_of(program, kept, delta, REDUCED), text
    if found.optimal and before.violation < STATIONARY_ROWS:
        # with friction as steep as 1 / delta, multipliers of the balance are known to fewer digits than the conditions need
        text = (
            f"First-order conditions hold in the reduced space (KKT error {here.kkt_error:.1e}; {before.kkt_error:.1e} on the "
            f"{problem.formulation} program); {ended}."
        )
        return level_of(program, in_reduced_space, delta, REDUCED), text
    kept = replace(before, status=NOT_STATIONARY, iterations=found.iterations)
    return level_of(program, kept, delta, REDUCED), f"{explanation(program, kept, delta)} {ended}."


def _limited(reduced: ReducedProgram, program: GaitProgram) -> GaitProgram:
    """The full program with the bounds on actuators where the reduced one has them."""
    return program if reduced.actuators is None else reduced.actuators.laid_on(program)


def _multipliers(found: Found, program: GaitProgram) -> tuple[np.ndarray, np.ndarray]:
    """Multipliers of the full program's bounds and inequalities, from those of the reduced one."""
    lam_x, lam_g = np.zeros(program.layout.n), np.zeros(program.constraint_lower.size)
    conditions, space, reached = found.conditions, found.space, len(found.space.problem.at_least)
    of_period, on_rows = np.split(conditions.on_rows, [conditions.on_rows.size - space.row_lower.size])
    if found.program is not None and found.program.actuators is not None:
        limited = found.program.actuators
        of_period, on_actuators = np.split(of_period, [of_period.size - limited.placed.shape[1]])
        lam_g[program.groups[ACTUATORS]] = limited.multipliers(on_actuators)
    if reached:
        lam_g[program.groups["at least"]] = of_period[-reached:]
    at = 0
    for name, rows in space.watched.items():
        lam_g[program.groups[name].start + rows] = on_rows[at : at + rows.size]
        at += rows.size
    lam_x[program.layout.parameters[space.own, 0]] = conditions.on_bounds
    return lam_x, lam_g
