"""The literal route: IPOPT on the full program at every level of delta, from the guess and the
balance solver alone.

Nothing is eliminated and no second derivative is spared. It is what a reader of the equations would
try first, and what the search in the reduced space is measured against.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from colloc.gaits.gait import delta_per_period
from colloc.gaits.problem import Problem
from colloc.results.answer import Answer, Step
from colloc.search.confirm import answer_of, second_order
from colloc.search.converge import BOX
from colloc.search.descend import levels
from colloc.search.diagnosis import explanation, redundant_equations
from colloc.search.ipopt import NlpResult, Solver, solve_in_regions
from colloc.search.refine import MESHES
from colloc.search.run import this_run
from colloc.search.spaces import heading, program_of, space_near
from colloc.transcription.full_program import FullProgram, full_program
from colloc.verification.refinement import planned_mesh

_ITERATIONS = 1500
"""Of IPOPT on each mesh, at most: from a guess it may need five hundred."""


def literal_answer(problem: Problem) -> Answer:
    """A local optimum by IPOPT alone; it ends at the first level that fails.

    Parameters
    ----------
    problem : Problem

    Returns
    -------
    Answer
        Its message says what failed.
    """
    program, history = program_of(problem), tuple[Step, ...]()
    space, v = space_near(problem, problem.guess)
    parameters = space.full_parameters(v)
    below = levels(problem, problem.delta_start)
    for done, delta in enumerate(below):
        this_run().told("descend", done, len(below))
        answer = _solved(program, parameters, delta)
        history = (*history, answer.step)
        if not answer.optimal:
            return replace(answer, history=history)
        parameters = answer.x[program.layout.parameters[:, 0]]
        program = full_program(program.control, parameters)
    kept = np.empty(0)
    for done in range(MESHES if problem.mesh_tolerance > 0 else 0):
        this_run().told("refine", done, MESHES)
        gait = answer.gait
        plan = planned_mesh(
            program.control,
            program.control.in_phases(program.mesh, gait),
            gait,
            delta_per_period(problem.gait, gait, delta),
            problem.mesh_tolerance,
            kept=kept,
        )
        if plan is None:
            break
        kept = np.concatenate([kept, plan.kept])
        space, v = space_near(problem, gait, plan.edges, plan.scheme)
        parameters = space.full_parameters(v)
        program = full_program(program.control, parameters, space.mesh.edges, plan.scheme)
        answer = _solved(program, parameters, delta)
        history = (*history, answer.step)
        if not answer.optimal:
            return replace(answer, history=history)
    space, v = space_near(problem, answer.gait, answer.edges, answer.scheme)
    curved = second_order(space, v, answer.delta, answer.value)
    return replace(answer, second_order=curved, history=history)


def _solved(program: FullProgram, parameters: np.ndarray, delta: float) -> Answer:
    """The full program solved from the gait of some parameters."""

    def compute() -> Answer:
        x = program.feasible(parameters, delta)
        stated = heading(program, x)
        last, result = solve_in_regions(stated, x, delta, BOX, {"max_iter": _ITERATIONS})
        answer = answer_of(last, result, delta)
        if result.optimal:
            return answer
        return replace(answer, message=_why(Solver(stated), x, last, result, delta))

    given = (
        program.control.problem,
        parameters,
        delta,
        program.mesh.edges,
        program.mesh.scheme.name,
    )
    return this_run().kept("literal", given, compute)


def _why(solver: Solver, x: np.ndarray, last: FullProgram, result: NlpResult, delta: float) -> str:
    """What failed, and whether the equations were to blame from the start."""
    redundant, text = (
        redundant_equations(solver, x, delta),
        explanation(last, result, delta),
    )
    if redundant:
        text += (
            f" Before the first solve the equations were rank deficient, which no optimiser "
            f"bears: {', '.join(redundant)}."
        )
    return text
