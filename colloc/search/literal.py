"""The literal route: IPOPT on the full program at every level of delta, from the guess and the balance solver alone.

Nothing is eliminated and no second derivative is spared. It is what a reader of the equations would try first, and what the
search in the reduced space is measured against.
"""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np

from colloc.collocation.warm_start import feasible_point
from colloc.gaits.friction_unit import in_friction_units, restated
from colloc.gaits.problem import Problem
from colloc.reduced.spaces import heading, nearest_parameters, transcribed
from colloc.results.answer import Level
from colloc.results.solution import Solution
from colloc.search.confirm import level_of
from colloc.search.converge import FIRST_RADIUS, NEXT_RADIUS, REMESH_RADIUS, deltas
from colloc.search.diagnosis import explanation, redundant_equations
from colloc.search.ipopt import NlpResult, Solver
from colloc.verification.refinement import planned_mesh

_MESHES, _ITERATIONS = 8, 1500
"""Meshes at the final delta, and iterations of IPOPT on each, at most: from a guess it may need five hundred."""


def literal_optimum(problem: Problem, on_level: Callable[[Level], None] | None = None) -> Solution:
    """A local optimum by IPOPT alone, not certified yet; it ends at the first level that fails. `on_level` is called with every
    `Level` as it ends."""
    begin, stated, (problem, unit) = time.perf_counter(), problem, in_friction_units(problem)
    levels: list[Level] = []
    program = transcribed(problem)
    parameters, radius, message = nearest_parameters(program, problem.guess), FIRST_RADIUS, ""

    def solved(delta: float) -> NlpResult:
        nonlocal message
        x = feasible_point(program, parameters, delta)
        solver = Solver(heading(program, x), {"max_iter": _ITERATIONS})
        result = solver.solve(x, delta, None, radius)
        levels.append(restated(level_of(program, result, delta, problem.formulation), unit, problem.objective))
        if on_level is not None:
            on_level(levels[-1])
        message = "" if result.optimal else _why(solver, x, result, delta)
        return result

    for delta in deltas(problem, problem.delta_start):
        result = solved(delta)
        if not result.optimal:
            break
        parameters, radius = result.x[program.layout.parameters[:, 0]], NEXT_RADIUS
    kept = np.empty(0)
    for _ in range(_MESHES if result.optimal and problem.mesh_tolerance > 0 else 0):
        gait = program.member(parameters)
        mesh = program.phase_mesh(gait)
        plan = planned_mesh(problem, mesh, gait, delta * gait.delta_unit, problem.mesh_tolerance, kept=kept)
        if plan is None:
            break
        kept = np.concatenate([kept, plan.kept])
        program = transcribed(problem.with_(scheme=plan.scheme), gait, plan.edges)
        parameters, radius = nearest_parameters(program, gait), REMESH_RADIUS
        result = solved(delta)
        if not result.optimal:
            break
        parameters = result.x[program.layout.parameters[:, 0]]
    return Solution(stated, levels, seconds=time.perf_counter() - begin, message=message)


def _why(solver: Solver, x: np.ndarray, result: NlpResult, delta: float) -> str:
    """What failed, and whether the equations were to blame from the start."""
    redundant, text = redundant_equations(solver, x, delta), explanation(solver.transcription, result, delta)
    if redundant:
        text += f" Before the first solve the equations were rank deficient, which no optimiser bears: {', '.join(redundant)}."
    return text
