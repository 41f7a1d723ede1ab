"""The mesh is refined until the collocated objective is as accurate as the problem asks for; a
smooth body's panels with it.

Every mesh is planned as a whole for the gait at hand (`colloc.verification.refinement`), and the
gait optimised on it, until it needs no other. On the way it need not be optimised to the last
digit: the next mesh moves it by more.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from colloc.gaits.gait import delta_per_period
from colloc.reduced.program import ReducedProgram, SearchSpace
from colloc.search.certify import NOWHERE
from colloc.search.converge import converged
from colloc.search.effort import FINE, ROUGH
from colloc.search.optimum import Optimum, replace_keeping_space
from colloc.search.run import this_run
from colloc.search.spaces import remeshed, space_of
from colloc.system.errors import NotConvergedError
from colloc.verification.refinement import AIM, MOST_POINTS, MeshPlan, planned_mesh

MESHES, _SAME_AIM = 8, 2
"""Meshes tried, and how many of them with the usual aim. Where kinks move to and fro with the mesh,
as many are planned for half of it, later ones for a quarter, and keep all their knots."""
_GROWTH = 4
"""A mesh has at most so many times the points of the last one, and a smooth body so many times its
panels: the gait will move, and what was planned is wasted."""
_MOST_PANELS, _LEFT = 128, 6
"""Panels of a smooth body at most; error that they may leave, over what the mesh may. Every
doubling was seen to leave a sixth or less, with a point at rest that moves over the panels."""


@dataclass(eq=False)
class _Meshes:
    """The meshes tried so far, and the phases that have to stay knots."""

    kept: np.ndarray
    count: int = 0

    def plan(self, optimum: Optimum) -> MeshPlan | None:
        """A mesh on which the gait is accurate enough; None if its own will do."""
        problem, gait, late = optimum.problem, optimum.gait, max(0, self.count - _SAME_AIM)
        control = optimum.space.control
        mesh = control.in_phases(optimum.space.mesh, gait)
        return planned_mesh(
            control,
            mesh,
            gait,
            delta_per_period(problem.gait, gait, optimum.delta),
            problem.mesh_tolerance,
            kept=self.kept,
            nested=self.count >= _SAME_AIM,
            aim=AIM * 0.5 ** min(late, _SAME_AIM),
            most_points=min(MOST_POINTS, _GROWTH * mesh.n_point),
        )


def refine(optimum: Optimum) -> Optimum:
    """The gait on a mesh that meets the problem's ``mesh_tolerance``.

    Parameters
    ----------
    optimum : Optimum
        At the final delta.

    Returns
    -------
    Optimum
        Optimised to the last digit. Its `lacks` says what is missing if no mesh was fine enough.
    """
    meshes = _Meshes(np.array(optimum.problem.gait.stages))
    if optimum.problem.regime.slides and optimum.objective > -NOWHERE:
        return optimum  # relative to nothing no mesh is fine enough
    while True:
        this_run().told("refine", meshes.count, MESHES, optimum)
        try:
            finer = _finer(optimum, meshes)
        except (
            NotConvergedError
        ) as error:  # the gait at hand is not lost for it: its certificate says what it is worth
            finer = replace_keeping_space(
                optimum, lacks=f"refinement ended, as on a finer mesh: {error}"
            )
        if finer is None or finer.lacks:
            return finer or optimum
        optimum = finer


def _finer(optimum: Optimum, meshes: _Meshes) -> Optimum | None:
    """The gait optimised on the next mesh, or on more panels; after the last with what it lacks.
    None if its own will do, or no other would."""
    if meshes.count and optimum.violation > ROUGH.kkt_error:
        return None  # its rows contradict each other, which no mesh mends
    refines = optimum.problem.mesh_tolerance > 0
    finer = on_more_panels(optimum) if refines else None
    plan = meshes.plan(optimum) if refines and finer is None else None
    if finer is None and plan is None and optimum.effort == FINE:
        return None
    if meshes.count == MESHES:
        lacks = f"refinement ended after {MESHES} meshes: the gait still moves with the mesh."
        return replace_keeping_space(optimum, lacks=lacks)
    space, v, effort = optimum.space, optimum.v, FINE
    if finer is not None:
        (space, v), effort = finer, ROUGH
    if plan is not None:
        meshes.count, meshes.kept = meshes.count + 1, np.concatenate([meshes.kept, plan.kept])
        space = remeshed(space, optimum.gait, plan.edges, plan.scheme)
        known = optimum.iterations == 0  # the search began at it, and no mesh will move it far
        effort = FINE if known or meshes.count > _SAME_AIM else ROUGH
        v = space.parameters(optimum.gait)
    curvature = optimum.curvature if optimum.v.size == v.size else None
    return converged(space, v, optimum.delta, effort, curvature).after(*optimum.history)


def on_more_panels(optimum: Optimum) -> tuple[SearchSpace, np.ndarray] | None:
    """The class with a smooth body on as many panels as the gait needs, and its parameters; None if
    its own will do.

    They do where half as many change the objective by no more than six times what the mesh may.
    """
    space, v, here, problem = optimum.space, optimum.v, optimum.objective, optimum.problem
    panels = problem.body.panels
    if panels == 0:
        return None

    def on(count: int) -> tuple[SearchSpace, np.ndarray, float]:
        body = problem.body.on_panels(count)
        space = space_of(problem.with_(body=body), None, *optimum.space.given)
        v = space.parameters(optimum.gait)
        return space, v, ReducedProgram(space, optimum.delta).objective(v)

    before, most = on(panels // 2)[2], min(_GROWTH * panels, _MOST_PANELS)
    while abs(here - before) > _LEFT * problem.mesh_tolerance * abs(here) and 2 * panels <= most:
        panels, before = 2 * panels, here
        space, v, here = on(panels)
    return None if space is optimum.space else (space, v)
