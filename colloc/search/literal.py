"""The literal route: IPOPT on the full program at every level of delta, from the guess and the
balance solver alone.

Nothing is eliminated and no second derivative is spared. It is what a reader of the equations would
try first, and what the search in the reduced space is measured against.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from colloc.collocation.program import GaitProgram
from colloc.collocation.warm_start import feasible_point
from colloc.gaits.gait import delta_per_period
from colloc.gaits.problem import Problem
from colloc.results.answer import Answer, Step
from colloc.search.confirm import answer_of, second_order
from colloc.search.converge import BOX
from colloc.search.descend import levels
from colloc.search.diagnosis import explanation, redundant_equations
from colloc.search.ipopt import NlpResult, Solver
from colloc.search.refine import MESHES
from colloc.search.run import this_run
from colloc.search.spaces import heading, nearest_parameters, transcribed
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
    program = transcribed(problem)
    parameters, history = nearest_parameters(program, problem.guess), tuple[Step, ...]()
    below = levels(problem, problem.delta_start)
    for done, delta in enumerate(below):
        this_run().told("descend", done, len(below))
        answer = _solved(program, parameters, delta)
        history = (*history, answer.step)
        if not answer.optimal:
            return replace(answer, history=history)
        parameters = answer.x[program.layout.parameters[:, 0]]
    kept = np.empty(0)
    for done in range(MESHES if problem.mesh_tolerance > 0 else 0):
        this_run().told("refine", done, MESHES)
        gait = program.member(parameters)
        mesh = program.control.in_phases(program.mesh, gait)
        plan = planned_mesh(
            program.control,
            mesh,
            gait,
            delta_per_period(problem.gait, gait, delta),
            problem.mesh_tolerance,
            kept=kept,
        )
        if plan is None:
            break
        kept = np.concatenate([kept, plan.kept])
        program = transcribed(problem, gait, plan.edges, plan.scheme)
        answer = _solved(program, nearest_parameters(program, gait), delta)
        history = (*history, answer.step)
        if not answer.optimal:
            return replace(answer, history=history)
        parameters = answer.x[program.layout.parameters[:, 0]]
    return replace(answer, second_order=second_order(answer), history=history)


def _solved(program: GaitProgram, parameters: np.ndarray, delta: float) -> Answer:
    """The full program solved from the gait of some parameters."""

    def compute() -> Answer:
        x = feasible_point(program, parameters, delta)
        solver = Solver(heading(program, x), {"max_iter": _ITERATIONS})
        result = solver.solve(x, delta, None, BOX)
        answer = answer_of(program, result, delta)
        return answer if result.optimal else replace(answer, message=_why(solver, x, result, delta))

    given = (
        program.control.problem,
        parameters,
        delta,
        program.mesh.edges,
        program.mesh.scheme.name,
    )
    return this_run().kept("literal", given, compute)


def _why(solver: Solver, x: np.ndarray, result: NlpResult, delta: float) -> str:
    """What failed, and whether the equations were to blame from the start."""
    redundant, text = (
        redundant_equations(solver, x, delta),
        explanation(solver.transcription, result, delta),
    )
    if redundant:
        text += (
            f" Before the first solve the equations were rank deficient, which no optimiser "
            f"bears: {', '.join(redundant)}."
        )
    return text
