"""Refinement of the mesh until the collocated objective is as accurate as the problem asks for; of
a smooth body's panels with it.

Every mesh is planned as a whole for the gait at hand (`colloc.verification.refinement`), and the
gait optimised on it, until it needs no other.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from colloc.gaits.gait import delta_per_period
from colloc.reduced.program import ReducedProgram, SearchSpace
from colloc.search.checkpoint import active_run
from colloc.search.converge import optimise
from colloc.search.iterate import Iterate
from colloc.search.options import FINE, MEDIUM, OPTIONS, TOLERANCES
from colloc.search.spaces import on_mesh_of, space_of
from colloc.smooth.smooth_body import on_panels, panels_of
from colloc.system.errors import NotConvergedError
from colloc.verification.refinement import AIM, MOST_POINTS, MeshPlan, plan_mesh


@dataclass(eq=False)
class _Meshes:
    """Count of the meshes so far, and the phases that stay knots.

    Where kinks move to and fro with the mesh, later meshes aim at a half and a quarter of the
    error and keep all knots.
    """

    knots: np.ndarray
    count: int = 0

    def plan(self, iterate: Iterate) -> MeshPlan | None:
        """A mesh on which the gait is accurate enough; None if its own will do."""
        problem, gait = iterate.problem, iterate.gait
        late = max(0, self.count - OPTIONS.meshes_of_first_aim)
        control = iterate.space.control
        mesh = control.in_phases(iterate.space.mesh, gait)
        return plan_mesh(
            control,
            mesh,
            gait,
            delta_per_period(problem.gait, gait, iterate.delta),
            problem.mesh_tolerance,
            kept=self.knots,
            nested=self.count >= OPTIONS.meshes_of_first_aim,
            aim=AIM * 0.5 ** min(late, OPTIONS.meshes_of_first_aim),
            # the gait will move, and a finer plan be wasted
            most_points=min(MOST_POINTS, OPTIONS.growth * mesh.n_point),
        )


def refine(iterate: Iterate) -> Iterate:
    """The gait optimised to the last digit on a mesh that meets the problem's ``mesh_tolerance``;
    its `message` says what is missing if no mesh was fine enough."""
    meshes = _Meshes(np.array(iterate.problem.gait.stages))
    if iterate.problem.regime.slides and iterate.objective > -TOLERANCES.zero_value:
        return iterate  # the relative error is undefined for a zero objective
    while True:
        active_run().report("refine", meshes.count, OPTIONS.meshes, iterate)
        try:
            finer = _refine_once(iterate, meshes)
        except NotConvergedError as error:
            # keep the unrefined gait; its certificate records the mesh error
            finer = replace(iterate, message=f"refinement ended, as on a finer mesh: {error}")
        if finer is None or finer.message:
            return finer or iterate
        iterate = finer


def _refine_once(iterate: Iterate, meshes: _Meshes) -> Iterate | None:
    """The gait on the next mesh, or on more panels; None if its own will do, or no other would."""
    if meshes.count and iterate.violation > MEDIUM:
        return None  # the constraints are infeasible; refining cannot help
    refines = iterate.problem.mesh_tolerance > 0
    more_panels = on_more_panels(iterate) if refines else None
    plan = meshes.plan(iterate) if refines and more_panels is None else None
    if more_panels is None and plan is None and iterate.kkt == FINE:
        return None
    if meshes.count == OPTIONS.meshes:
        return replace(
            iterate,
            message=f"refinement ended after {OPTIONS.meshes} meshes: the gait still moves with "
            f"the mesh.",
        )
    space, v, kkt = iterate.space, iterate.v, FINE
    if more_panels is not None:
        (space, v), kkt = more_panels, MEDIUM
    if plan is not None:
        meshes.count, meshes.knots = meshes.count + 1, np.concatenate([meshes.knots, plan.kept])
        space = on_mesh_of(space, iterate.gait, plan.edges, plan.scheme)
        # where the search began at the optimum, no mesh moves the gait far
        at_optimum = iterate.step.iterations == 0
        late = meshes.count > OPTIONS.meshes_of_first_aim
        kkt = FINE if at_optimum or late else MEDIUM
        v = space.parameters(iterate.gait)
    hessian = iterate.hessian if iterate.v.size == v.size else None
    return optimise(space, v, iterate.delta, kkt, hessian).after(iterate.history)


def on_more_panels(iterate: Iterate) -> tuple[SearchSpace, np.ndarray] | None:
    """The space with a smooth body on as many panels as the gait needs, and its parameters; None if
    half as many panels change the objective by less than six times the mesh tolerance."""
    space, v, here, problem = iterate.space, iterate.v, iterate.objective, iterate.problem
    panels = panels_of(problem.body)
    if panels == 0:
        return None

    def on(count: int) -> tuple[SearchSpace, np.ndarray, float]:
        body = on_panels(problem.body, count)
        old = iterate.space
        space = space_of(problem.with_(body=body), None, old.edges, old.scheme, old.far)
        v = space.parameters(iterate.gait)
        return space, v, ReducedProgram(space, iterate.delta).objective(v)

    before, most = on(panels // 2)[2], min(OPTIONS.growth * panels, OPTIONS.max_panels)
    allowed = OPTIONS.panel_error * problem.mesh_tolerance
    while abs(here - before) > allowed * abs(here) and 2 * panels <= most:
        panels, before = 2 * panels, here
        space, v, here = on(panels)
    return None if space is iterate.space else (space, v)
