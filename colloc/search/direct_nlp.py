"""IPOPT on the full program at every level of delta, from the guess and the balance solver alone:
what a reader of the equations would try first, and what the reduced search is measured against."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from colloc.dynamics.control_problem import control_problem
from colloc.gaits.gait import delta_per_period
from colloc.gaits.problem import Problem
from colloc.results.answer import Answer, Step
from colloc.search.checkpoint import active_run, checkpointed
from colloc.search.confirm import answer_of, second_order
from colloc.search.descend import delta_levels
from colloc.search.diagnosis import explanation, redundant_equations
from colloc.search.ipopt import Solver, solve_in_regions
from colloc.search.options import OPTIONS
from colloc.search.spaces import space_near, with_whole_turns
from colloc.transcription.full_program import full_program
from colloc.verification.refinement import plan_mesh

_ITERATIONS = 1500  # on each mesh, at most: from a guess IPOPT may need five hundred


def solve_directly(problem: Problem) -> Answer:
    """A local optimum by IPOPT alone; it ends at the first level or mesh that fails, and its
    message says what did."""
    history, run = tuple[Step, ...](), active_run()
    space, v = space_near(problem, problem.guess)
    parameters, mesh = space.full_parameters(v), space.mesh
    levels = delta_levels(problem, problem.delta_start)
    for done, delta in enumerate(levels):
        run.report("descend", done, len(levels))
        answer = _solve_full(problem, parameters, delta, mesh.edges, mesh.scheme.name)
        history = (*history, answer.step)
        if not answer.optimal:
            return replace(answer, history=history)
        parameters = answer.x[answer.layout.parameters[:, 0]]
    knots = np.empty(0)
    for done in range(OPTIONS.meshes if problem.mesh_tolerance > 0 else 0):
        run.report("refine", done, OPTIONS.meshes)
        gait, control = answer.gait, space.control
        plan = plan_mesh(
            control,
            control.in_phases(space.mesh, gait),
            gait,
            delta_per_period(problem.gait, gait, delta),
            problem.mesh_tolerance,
            kept=knots,
        )
        if plan is None:
            break
        knots = np.concatenate([knots, plan.kept])
        space, v = space_near(problem, gait, plan.edges, plan.scheme)
        parameters = space.full_parameters(v)
        answer = _solve_full(problem, parameters, delta, space.mesh.edges, plan.scheme)
        history = (*history, answer.step)
        if not answer.optimal:
            return replace(answer, history=history)
    space, v = space_near(problem, answer.gait, answer.edges, answer.scheme)
    curved = second_order(space, v, answer.delta, answer.value)
    return replace(answer, second_order=curved, history=history)


@checkpointed
def _solve_full(
    problem: Problem, parameters: np.ndarray, delta: float, edges: np.ndarray, scheme: str
) -> Answer:
    control = control_problem(problem)
    program = full_program(control, parameters, edges, scheme)
    x = program.feasible(parameters, delta)
    program = with_whole_turns(program, x)
    last, result = solve_in_regions(program, x, delta, OPTIONS.radius, {"max_iter": _ITERATIONS})
    answer = answer_of(last, result, delta)
    if result.optimal:
        return answer
    text = explanation(last, result, delta)
    if redundant := redundant_equations(Solver(program), x, delta):
        text += (
            f" Before the first solve the equations were rank deficient, which no optimiser "
            f"bears: {', '.join(redundant)}."
        )
    return replace(answer, message=text)
