"""Gaits that are collocated as they are, by no optimiser: prescribed motions, and finite gaits that stand for relaxed ones."""

from __future__ import annotations

import time
from dataclasses import replace

import numpy as np

from colloc.collocation.layout import problem_layout
from colloc.collocation.warm_start import balanced_variables
from colloc.gaits.gait_fields import AnyGait
from colloc.gaits.polygon import Corners
from colloc.gaits.problem import Problem
from colloc.numerics.mesh import Mesh
from colloc.numerics.schemes import scheme
from colloc.results.answer import PRESCRIBED, REALISED, Level
from colloc.verification.refinement import planned_mesh

_MESHES = 4


def measured(problem: Problem) -> tuple[Level, str]:
    """What a prescribed motion achieves on a mesh that meets the problem's tolerance, and what is missing, or ""."""
    begin, gait = time.perf_counter(), problem.gait.member(np.empty(0), problem.body.n_joint)
    mesh, message = Mesh(scheme(problem.scheme), problem.gait.edges(problem.intervals)), ""
    kept = np.array(problem.gait.stages)
    for _ in range(_MESHES if problem.mesh_tolerance > 0 else 0):
        plan = planned_mesh(problem, mesh, gait, problem.delta, problem.mesh_tolerance, kept=kept)
        if plan is None:
            break
        mesh = Mesh(scheme(plan.scheme), plan.edges)
        message = "" if plan.reached else f"the mesh is accurate to {plan.estimate:.0e} only."
    return replace(_level(problem, mesh, gait, np.empty(0), PRESCRIBED), seconds=time.perf_counter() - begin), message


def realised(problem: Problem, gait: Corners) -> Level:
    """What a polygon achieves with an interval for every side; the problem's class is that of finite gaits."""
    level = _level(problem, Mesh(scheme(problem.scheme), gait.phases), gait, gait.vertices.ravel(order="F"), REALISED)
    return replace(level, knots=gait.phases)


def _level(problem: Problem, mesh: Mesh, gait: AnyGait, parameters: np.ndarray, word: str) -> Level:
    """The gait with everything else following from its balance."""
    begin, layout = time.perf_counter(), problem_layout(problem, mesh)
    x = balanced_variables(problem, layout, mesh, gait, parameters, problem.delta)
    periods, seconds = 1.0 / problem.gait.fraction, time.perf_counter() - begin
    distance, work = (periods * float(x[row[0, -1]]) for row in (layout.distance, layout.work))
    return Level(
        problem.delta, mesh.edges, x, np.zeros_like(x), np.empty(0), distance / work, distance, work,
        0.0, 0.0, 0.0, word, True, 0, seconds, seconds, mesh.scheme.name, word,
    )  # fmt: skip
