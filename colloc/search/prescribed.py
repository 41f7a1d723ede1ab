"""Gaits that are collocated as they are, by no optimiser: prescribed motions, and gaits that are
given."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from colloc.collocation.layout import distance_and_work, layout_of
from colloc.collocation.warm_start import balanced_variables
from colloc.gaits.control_problem import control_problem
from colloc.gaits.gait_fields import AnyGait
from colloc.gaits.harmonic import Fourier
from colloc.gaits.problem import Problem
from colloc.motion.kinds import kind_of_motion
from colloc.numerics.mesh import Mesh
from colloc.numerics.schemes import scheme
from colloc.reduced.motion import ReducedMotion
from colloc.results.answer import EVALUATED, PRESCRIBED, Answer
from colloc.search.certify import goes_nowhere
from colloc.search.refine import MESHES
from colloc.verification.refinement import planned_mesh


def prescribed_answer(problem: Problem) -> Answer:
    """What a prescribed motion achieves on a mesh that meets the problem's tolerance; its message
    says what is missing."""
    gait = problem.gait.member(np.empty(0), problem.body.n_joint)
    edges, kept = problem.gait.edges(problem.intervals), np.array(problem.gait.stages)
    return _on_a_fine_mesh(
        problem,
        gait,
        edges,
        kept,
        lambda mesh: as_it_is(problem, mesh, gait, np.empty(0), PRESCRIBED),
    )


def evaluated_answer(problem: Problem, gait: Fourier) -> Answer:
    """The same of a series whose class is that of the problem, all harmonics without symmetry; it
    starts at the phase that fixes the start of the class. Of a gait that goes nowhere, which no
    mesh would resolve, on a first mesh."""
    parameters = problem.gait.parameters(gait)
    member, edges = (
        problem.gait.member(parameters, gait.n_joint),
        np.linspace(0.0, 1.0, problem.intervals + 1),
    )

    def answer_on(mesh: Mesh) -> Answer:
        return as_it_is(problem, mesh, member, parameters, EVALUATED)

    first = answer_on(Mesh(scheme(problem.scheme), edges))
    if goes_nowhere(first):
        return replace(first, history=(first.step,))
    return _on_a_fine_mesh(problem, member, edges, np.empty(0), answer_on)


def _on_a_fine_mesh(
    problem: Problem,
    gait: AnyGait,
    edges: np.ndarray,
    kept: np.ndarray,
    answer_on: Callable[[Mesh], Answer],
) -> Answer:
    """The answer on a mesh that meets the problem's tolerance for a gait, and on which the phases
    `kept` are knots."""
    begin, mesh, message = time.perf_counter(), Mesh(scheme(problem.scheme), edges), ""
    for _ in range(MESHES if problem.mesh_tolerance > 0 else 0):
        plan = planned_mesh(
            control_problem(problem), mesh, gait, problem.delta, problem.mesh_tolerance, kept=kept
        )
        if plan is None:
            break
        mesh = Mesh(scheme(plan.scheme), plan.edges)
        message = "" if plan.reached else f"the mesh is accurate to {plan.estimate:.0e} only."
    answer = replace(answer_on(mesh), message=message)
    answer = replace(answer, seconds=time.perf_counter() - begin)
    return replace(answer, history=(answer.step,))


class _Given(NamedTuple):
    """A gait at the points of a mesh, whatever the parameters are."""

    gait: AnyGait
    mesh: Mesh

    def at(self, v: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        return *self.gait(self.mesh.times), np.ones(self.mesh.n_point)

    def pulled_back(self, v: np.ndarray, on_shape: np.ndarray, on_pace: np.ndarray) -> np.ndarray:
        raise NotImplementedError("nothing is sought")


def as_it_is(
    problem: Problem, mesh: Mesh, gait: AnyGait, parameters: np.ndarray, word: str
) -> Answer:
    """A gait with everything else following from its balance."""
    control = control_problem(problem)
    layout, aim = layout_of(control, mesh), control.aims.objective
    x = balanced_variables(control, layout, mesh, parameters, problem.delta, gait)
    distance, work = distance_and_work(control, layout, x)
    motion = ReducedMotion(
        kind_of_motion(control.dynamics), mesh, _Given(gait, mesh), aim.integrals
    )
    value = control.stated(float(aim(motion.values(parameters, problem.delta))))
    return Answer(
        problem,
        gait,
        problem.delta,
        edges=mesh.edges,
        scheme=mesh.scheme.name,
        x=x,
        lam_x=np.zeros_like(x),
        lam_g=np.empty(0),
        value=value,
        distance=distance,
        work=work,
        kkt_error=0.0,
        violation=0.0,
        complementarity=0.0,
        status=word,
        optimal=True,
        iterations=0,
        seconds=0.0,
        program=word,
    )
