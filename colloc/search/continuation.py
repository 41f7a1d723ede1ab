"""Continuation in delta: from strongly regularised friction, which converges from poor guesses, to nearly dry friction.

Every level starts from the last converged gait, projected back onto the balance at the new delta by the fixed-point
solver, with the last multipliers. A level that fails is tried again closer to the one that converged. At the final delta
the mesh is refined where the gait needs it.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Sequence

import numpy as np

from colloc.collocation.program import GaitProgram
from colloc.collocation.warm_start import feasible_point
from colloc.gaits.problem import Problem
from colloc.results.level import Level
from colloc.results.solution import Solution
from colloc.search.diagnosis import explanation, redundant_equations
from colloc.search.friction_unit import in_friction_units, restated
from colloc.search.level_run import LOWER_START, REMESH_RADIUS, SMALLEST_RADIUS, TRIVIAL, Report, Run
from colloc.search.nlp import NlpResult, Solver
from colloc.search.path_start import transcribed
from colloc.verification.mesh_error import mesh_error
from colloc.verification.refinement import AIM, MOST_POINTS, MeshPlan, planned_mesh

_SMALLEST_STEP = 0.8
REFINE_DELTA = 1e-3
"""The mesh is refined on the way, at the first level below this delta, and checked again at the end. A refined mesh displaces
the optimum by more than the kinks at a small delta let pass: entered there, most solves on it fail."""
_FAILURES_PER_MESH, _MESHES = 2, 4
"""After so many failures in a row another uniform mesh is tried, up to so many meshes in all. Where a link changes its
direction of sliding at a node, mu_b and mu_f give the collocated efficiency a kink, and an optimum may sit right on it:
there first-order conditions never hold. Another mesh has its kinks elsewhere."""
_FIRST_DELTAS = 5
"""Where the first level fails, the next lower delta is tried, up to so many first levels in all."""
_FEASIBLE = 1e-6
"""A first level that fails with all equations satisfied to this has stalled on a kink; one that does not has lost its way."""
_REFINEMENTS, _SAME_AIM = 5, 2
"""Meshes tried, and how many of them with the usual aim. Where kinks move to and fro with the mesh, later ones are planned for
half, then a quarter of it."""
_BUILT_IN = ("body", "friction", "gait", "joint_limit", "smallest_shape_speed", "intervals", "scheme", "formulation")
_MOST_KEPT = 4
_kept = threading.local()


def continue_delta(
    problem: Problem,
    on_level: Report | None = None,
    solver: Solver[GaitProgram] | None = None,
    before: Sequence[Level] = (),
) -> Solution:
    """Solve a problem through falling delta, from ``delta_start`` to ``delta``, then refine its mesh.

    Parameters
    ----------
    problem : Problem
    on_level : callable, optional
        Called with each `Level` as it ends, also with failed ones.
    solver : Solver, optional
        Built for the same problem before, to save building it again.
    before : sequence of Level
        Levels of an interrupted run of the same problem; it goes on from the last optimal one.

    Returns
    -------
    Solution
        Without a certificate; the last level is one at ``problem.delta`` only if all went well.
    """
    begin = time.perf_counter()
    stated, (problem, unit) = problem, in_friction_units(problem)
    report = None if on_level is None else lambda level: on_level(restated(level, unit))
    run = Run(problem, solver or _kept_solver(problem), report)
    run.take_over([restated(level, 1.0 / unit) for level in before])
    first = feasible_point(run.solver.transcription, run.parameters, problem.delta_start)
    redundant = redundant_equations(run.solver, first, problem.delta_start)
    result, shortfall = _refine(run)
    levels = [restated(level, unit) for level in run.levels]
    solution = Solution(stated, levels, seconds=time.perf_counter() - begin, message=shortfall)
    if not result.optimal:
        delta = run.levels[-1].delta
        solution.message = explanation(run.solver.transcription, result, delta)
        if redundant:
            solution.message += (
                f" Before the first solve the equations were rank deficient, which no optimiser bears: {', '.join(redundant)}."
            )
    return solution


def _kept_solver(problem: Problem) -> Solver[GaitProgram]:
    """The solver of a problem's uniform mesh, built once a thread: guess and delta are no part of it, save for paths."""
    if problem.has_path:
        return Solver(transcribed(problem))
    key = tuple(getattr(problem, name) for name in _BUILT_IN)
    kept = _kept.__dict__.setdefault("solvers", {})
    if key not in kept:
        while len(kept) >= _MOST_KEPT:
            kept.pop(next(iter(kept)))
        kept[key] = Solver(transcribed(problem))
    return kept[key]


def _descend(run: Run, delta: float, target: float) -> NlpResult:
    """Levels from delta down to the target, with smaller steps after a failure; the last result."""
    factor, reached, failures, meshes = run.factor, None, 0, 1
    while True:
        result = run.attempt(delta, patient=failures > 0)
        if result.optimal:
            reached = delta
            if delta <= target:
                return result
            factor, failures = max(run.factor, factor**2), 0
        elif reached is None:
            failures += 1
            if failures == _FIRST_DELTAS:
                return result
            if result.status == TRIVIAL and not run.problem.has_path:
                continue
            if result.violation < _FEASIBLE and meshes < _MESHES and not run.problem.has_path:
                run.leave_kink(result)
                meshes += 1
            elif delta > target:
                delta = max(LOWER_START * delta, target)
            else:
                return result
            continue
        else:
            failures += 1
            if failures >= _FAILURES_PER_MESH and meshes < _MESHES and not run.problem.has_path:
                run.other_mesh()
                failures, meshes = 0, meshes + 1
            elif factor > _SMALLEST_STEP:
                return result
            else:
                factor = factor**0.5
        delta = _next_delta(reached, factor, target)


def _next_delta(reached: float, factor: float, target: float) -> float:
    return reached * factor if reached * factor > 1.2 * target else target


def _refine(run: Run) -> tuple[NlpResult, str]:
    """Levels down to the problem's delta, on planned meshes until the gait needs no other; the last result, what it lacks."""
    problem, kept = run.problem, np.empty(0)
    first = run.first_delta
    target = max(problem.delta, min(REFINE_DELTA, first))
    if run.reached is None:
        result = _descend(run, first, target)
    else:
        result = run.reached if first <= target else _descend(run, _next_delta(first, run.factor, target), target)
    for count in range(_REFINEMENTS):
        at = run.levels[-1].delta
        aim = AIM * 0.5 ** max(0, count - _SAME_AIM)
        plan = _plan(run, kept, aim) if result.optimal and problem.mesh_tolerance > 0 else None
        if plan is not None:
            kept = np.concatenate([kept, plan.kept])
            again = problem.has_path and at <= problem.delta
            run.remesh(plan.edges, SMALLEST_RADIUS if again else REMESH_RADIUS, plan.scheme)
            # a mesh refined at the end is entered where its kinks are mild
            begin = at if run.rich else min(max(at, REFINE_DELTA), first)
        elif not result.optimal or at <= problem.delta:
            return result, ""
        else:
            begin = run.factor * at
        result = _descend(run, max(begin, problem.delta), problem.delta)
        if plan is not None and not plan.reached:
            break
    if not result.optimal or problem.mesh_tolerance == 0:
        return result, ""
    gait = run.gait
    mesh = run.solver.transcription.phase_mesh(gait)
    error = mesh_error(problem, mesh, gait, problem.delta * gait.delta_unit, problem.mesh_tolerance)
    if error.estimate <= problem.mesh_tolerance:
        return result, ""
    return result, (
        f"refinement ended after {_REFINEMENTS} meshes or {MOST_POINTS} points at an estimated efficiency error of "
        f"{error.estimate:.1e}, above mesh_tolerance {problem.mesh_tolerance:.0e}."
    )


def _plan(run: Run, kept: np.ndarray, aim: float) -> MeshPlan | None:
    """A mesh on which the gait found is accurate at the problem's delta; None if the present one will do."""
    problem, gait = run.problem, run.gait
    mesh = run.solver.transcription.phase_mesh(gait)
    return planned_mesh(problem, mesh, gait, problem.delta * gait.delta_unit, problem.mesh_tolerance, kept=kept, aim=aim)
