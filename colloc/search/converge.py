"""The search for an optimum in the reduced space: delta falls, checks move, the mesh is refined, by quasi-Newton SQP.

At every delta the gait is optimised within a box round the last one, with the shape checks at their worst instants; they are
moved, and the gait optimised again, until it rests. At the final delta a smooth body gets as many panels as the gait needs, and
a mesh is planned for it (`colloc.verification.refinement`); the gait is optimised on those, until it needs no other.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import NamedTuple, Protocol

import numpy as np

from colloc.gaits.gait_fields import AnyGait
from colloc.gaits.problem import Problem
from colloc.numerics.kinks import stationarity_around
from colloc.numerics.sqp import NonlinearProgram, Stationarity, minimised, stationarity
from colloc.reduced.closure import closed_gait
from colloc.reduced.program import ReducedProgram, SearchSpace
from colloc.reduced.spaces import space_near
from colloc.search.far_contact import crossing_pairs, last_free
from colloc.system.errors import NotConvergedError
from colloc.verification.refinement import AIM, MOST_POINTS, MeshPlan, planned_mesh

FACTOR = 0.2
FIRST_RADIUS, NEXT_RADIUS, REMESH_RADIUS = 1.0, 0.5, 0.3
"""Boxes round the last gait [rad], at the first level, later ones, and on a refined mesh: far enough for an optimum to move,
not so far that a step ends in another world. A gait that ends on the edge of its box goes on from there."""
VERY_ROUGH, ROUGH, FINE = 1e-5, 1e-8, 1e-14
"""Accuracy of the objective at which SQP stops: to tell gaits apart, on the way, and at the final delta."""
STATIONARY = {VERY_ROUGH: 1e-1, ROUGH: 1e-3, FINE: 1e-6}
"""What the first-order conditions have to keep to then; the objective is off by the square of that."""
KINK_RADIUS, _WIDEST, _MISSED = 1e-6, 1e-5, 1e-8
"""Of the points whose gradients are taken together [rad]: as far as an optimum without a kink may be missed by; more where the
slopes at a kink are so small that the objective is not missed by more than the last."""
_AROUND = (2, 16)
"""How many those are per parameter; the second where several kinks meet."""
_GROWTH, _FEW_POINTS = 3, 300
"""A mesh has at most so many times the points of the last one, and some: the gait will move, and what was planned is wasted."""
_DRIER, _LOST = 0.1, 0.5
_ROUNDS, _AT_REST = {VERY_ROUGH: 2, ROUGH: 12, FINE: 12}, 1e-8
_ITERATIONS = {VERY_ROUGH: 60, ROUGH: 150, FINE: 150}
"""Of SQP, each time checks are moved. A start that needs more to be told apart is told apart as it is."""
_ADMISSIBLE, _ALIKE = 1e-8, 1e-3
NOWHERE = 1e-4
"""Value of the objective on a slope up to which a gait goes nowhere."""
_SWINGS = 0.1
"""Part of the way of a round that the gait does not come back in the next, where it only goes to and fro."""
_MOST_PANELS, _PANELS_GROW, _LEFT = 128, 4, 6
_MESHES, _SAME_AIM, _HALVINGS = 8, 2, 2
"""Meshes tried, and how many of them with the usual aim. Where kinks move to and fro with the mesh, later ones are planned for
half, then a quarter of it."""


@dataclass(frozen=True, eq=False)
class Found:
    """A gait that SQP came to rest at.

    Attributes
    ----------
    space : SearchSpace
        Its class on a mesh, with the checks placed.
    v : (n,)
    delta : float
    objective : float
        Minus the value of the problem's objective.
    conditions : Stationarity
        Of the reduced program.
    accuracy : float
        Of it that was asked for.
    program : ReducedProgram, optional
        Whose conditions these are; by default the program of that space at that delta.
    on_kink : bool
        Whether the conditions hold on the sides of a kink, not at v itself.
    iterations, evaluations : int
    seconds : float
    curvature : (n, n), optional
        What SQP knows of the Lagrangian's second derivatives.
    """

    space: SearchSpace
    v: np.ndarray
    delta: float
    objective: float
    conditions: Stationarity
    accuracy: float
    iterations: int
    evaluations: int
    seconds: float
    curvature: np.ndarray | None = None
    program: ReducedProgram | None = None
    on_kink: bool = False

    @classmethod
    def at(cls, space: SearchSpace, v: np.ndarray, delta: float) -> Found:
        """A gait as it is, to go on from."""
        program = ReducedProgram(space, delta)
        program.place_rows(v)
        return cls(space, v, delta, program.objective(v), stationarity(program, v), ROUGH, 0, 0, 0.0, program=program)

    @property
    def optimal(self) -> bool:
        """First-order conditions hold in the reduced space, as far as the accuracy asked for needs."""
        c = self.conditions
        return max(c.kkt_error, c.complementarity) < STATIONARY[self.accuracy] and c.violation < STATIONARY[FINE]

    @property
    def gait(self) -> AnyGait:
        return self.space.member(self.v)


Report = Callable[[Found], None]


def kink_or_not(found: Found) -> Found:
    """The gait as it is; where the conditions do not hold at it but around it, it rests on a kink, and they are those."""
    if found.optimal:
        return found
    program = found.program or ReducedProgram(found.space, found.delta)
    radius = min(max(KINK_RADIUS, _MISSED / found.conditions.kkt_error), _WIDEST)
    for points in _AROUND:
        conditions = stationarity_around(program, found.v, found.conditions, radius, points)
        around = replace(found, conditions=conditions, on_kink=True)
        if around.optimal:
            return around
    return found


class Placed(NonlinearProgram, Protocol):
    """A program whose rows depend on where the gait is worst."""

    @property
    def space(self) -> SearchSpace: ...

    def place_rows(self, v: np.ndarray) -> float:
        """Place them for v; how far it exceeds any bound there."""


class Rested(NamedTuple):
    """Where a program came to rest: parameters, objective, first-order conditions, counts, and what is known of curvature."""

    v: np.ndarray
    objective: float
    conditions: Stationarity
    iterations: int
    evaluations: int
    curvature: np.ndarray | None


def at_rest(
    program: Placed,
    v: np.ndarray,
    radius: float,
    accuracy: float,
    curvature: np.ndarray | None = None,
    rounds: int | None = None,
) -> Rested:
    """Optimise from v until rows, box and gait rest, or for so many rounds."""
    iterations = evaluations = 0
    program.place_rows(v)
    violation, ends = np.inf, [v]
    for _ in range(rounds or _ROUNDS[accuracy]):
        before, worse = v, violation
        fresh = curvature is None
        if len(ends) > 1:
            # with the instants held, every round overshoots where they move far with the gait
            program.space.follow_worst()
        if fresh and accuracy < VERY_ROUGH:
            curvature = program.space.metric(v)
        result = minimised(program, v, radius, accuracy, _ITERATIONS[accuracy], curvature)
        v, iterations, evaluations = result.v, iterations + result.iterations, evaluations + result.evaluations
        admissible = program.place_rows(v) <= _ADMISSIBLE
        conditions = stationarity(program, v)
        stationary = conditions.kkt_error < STATIONARY[accuracy]
        # what was learned across kinks may end the search too early: then it begins anew
        curvature = result.curvature if stationary else None
        if admissible and not result.on_edge and (stationary or (fresh and np.abs(v - before).max() < _AT_REST)):
            break
        violation = conditions.violation
        if violation > STATIONARY[ROUGH] and abs(violation - worse) < _ALIKE * worse and not result.on_edge:
            break  # the rows contradict each other near here
        ends.append(v)
        if len(ends) > 2 and np.abs(v - ends[-3]).max() < _SWINGS * np.abs(v - before).max():
            break  # between two worst instants of one cell, where only finer cells help
    return Rested(v, result.objective, conditions, iterations, evaluations, curvature)


def settled(
    space: SearchSpace,
    v: np.ndarray,
    delta: float,
    radius: float,
    accuracy: float,
    curvature: np.ndarray | None = None,
    rounds: int | None = None,
) -> Found:
    """Optimise from v at one delta on one mesh until checks, box and gait rest, or for so many rounds."""
    begin, program = time.perf_counter(), ReducedProgram(space, delta)
    if space.problem.slope is not None and np.isnan(program.objective(v)):
        raise NotConvergedError(
            "friction does not hold the body on the slope all the way, or its joints brake: take a gentler one."
        )
    rested = at_rest(program, v, radius, accuracy, curvature, rounds)
    v, objective, conditions, iterations, evaluations, curvature = rested
    counts = iterations, evaluations, time.perf_counter() - begin
    return Found(space, v, delta, objective, conditions, accuracy, *counts, curvature, program)


def settled_apart(
    space: SearchSpace,
    v: np.ndarray,
    delta: float,
    radius: float,
    accuracy: float,
    curvature: np.ndarray | None = None,
    rounds: int | None = None,
) -> Found:
    """The same, keeping pairs of links more than two apart from crossing as they turn out to cross."""
    found = settled(space, v, delta, radius, accuracy, curvature, rounds)
    while new := tuple(p for p in crossing_pairs(found.space, found.v) if p not in found.space.far):
        begin = last_free(found.space, v, found.v)
        space = found.space.with_far(found.space.far + new)
        found = settled(space, begin, delta, radius, accuracy, rounds=rounds)
    return found


def deltas(problem: Problem, first: float) -> list[float]:
    """Levels from a first delta down to the problem's."""
    levels = [first]
    while levels[-1] > problem.delta:
        below = FACTOR * levels[-1]
        levels.append(below if below > 1.2 * problem.delta else problem.delta)
    return levels


def descended(found: Found, problem: Problem, report: Report, rounds: int | None = None) -> Found:
    """From a gait at some delta down to the problem's, on the same mesh; `rounds` as in `settled`."""
    for delta in deltas(problem, found.delta)[1:]:
        found = settled_apart(found.space, found.v, delta, NEXT_RADIUS, ROUGH, found.curvature, rounds)
        report(found)
    return found


def finer_body(found: Found) -> tuple[SearchSpace, np.ndarray] | None:
    """The class with the body on as many panels as the gait needs, and its parameters; None if its own will do.

    They do where half as many change the efficiency by no more than six times what the mesh may: every doubling was seen to
    leave a sixth or less, with a point at rest that moves over the panels. The gait will still move, so panels grow slowly.
    """
    space, v, here, problem = found.space, found.v, found.objective, found.space.problem
    panels, mesh = problem.body.panels, space.phase_mesh(found.gait)
    if panels == 0:
        return None

    def on(count: int) -> tuple[SearchSpace, np.ndarray, float]:
        body = problem.body.on_panels(count)
        space, v = space_near(problem.with_(body=body), found.gait, mesh.edges, mesh.scheme.name)
        return space.with_far(found.space.far), v, ReducedProgram(space, found.delta).objective(v)

    before, most = on(panels // 2)[2], min(_PANELS_GROW * panels, _MOST_PANELS)
    while abs(here - before) > _LEFT * problem.mesh_tolerance * abs(here) and 2 * panels <= most:
        panels, before = 2 * panels, here
        space, v, here = on(panels)
    return None if space is found.space else (space, v)


def refined(found: Found, report: Report) -> tuple[Found, str]:
    """The gait on planned meshes until it needs no other, and what is missing if that does not happen.

    On the way it need not be optimised to the last digit: the next mesh moves it by more.
    """
    refines, kept = found.space.problem.mesh_tolerance > 0, np.empty(0)
    count = 0
    if found.space.problem.slope is not None and found.objective > -NOWHERE:
        return found, ""  # relative to nothing, no mesh is fine enough
    while True:
        finer = finer_body(found) if refines else None
        plan = _plan(found, kept, count) if refines and finer is None else None
        if finer is None and plan is None and found.accuracy == FINE:
            return found, ""
        if count == _MESHES:
            return found, f"refinement ended after {_MESHES} meshes: the gait still moves with the mesh."
        space, v, radius, accuracy = found.space, found.v, NEXT_RADIUS, FINE
        if finer is not None:
            (space, v), radius, accuracy = finer, REMESH_RADIUS, ROUGH
        if plan is not None:
            count, kept, radius = count + 1, np.concatenate([kept, plan.kept]), REMESH_RADIUS
            space = space.remeshed(found.gait, plan.edges, plan.scheme)
            accuracy = FINE if count > _SAME_AIM else ROUGH
            try:
                v = space.parameters(found.gait)
            except NotConvergedError:
                v = space.laid(found.gait)  # breaks a row a little, as its own mesh lets it
        known = found.curvature if found.v.size == v.size else None
        found = settled_apart(space, v, found.delta, radius, accuracy, known)
        report(found)


def _plan(found: Found, kept: np.ndarray, count: int) -> MeshPlan | None:
    """A mesh on which the gait is accurate enough; None if its own will do."""
    problem, gait, aim = found.space.problem, found.gait, AIM * 0.5 ** min(max(0, count - _SAME_AIM), _HALVINGS)
    mesh, delta = found.space.phase_mesh(gait), found.delta * gait.delta_unit
    points = min(MOST_POINTS, _GROWTH * mesh.n_point + _FEW_POINTS)
    nested, tolerance = count >= _SAME_AIM, problem.mesh_tolerance
    return planned_mesh(problem, mesh, gait, delta, tolerance, kept=kept, nested=nested, aim=aim, most_points=points)


def is_viscous(found: Found) -> bool:
    """Whether the gait owes its value to delta: at a tenth of it half is lost. Slow parts of a retraced gait do that."""
    dry = ReducedProgram(found.space, _DRIER * found.delta).objective(found.v)
    return not dry <= found.objective + (1 - _LOST) * abs(found.objective)


def begun(space: SearchSpace, v: np.ndarray, levels: list[float], accuracy: float) -> Found:
    """The gait of the first level; where that is a viscous one, the start is tried at the next delta."""
    for delta in levels:
        found = settled_apart(space, v, delta, FIRST_RADIUS, accuracy)
        if not is_viscous(found):
            break
    return found


def searched(problem: Problem, start: AnyGait, report: Report) -> tuple[Found, str]:
    """An optimum of a problem from a start, on a mesh that meets its tolerance; the second is what is missing, or ""."""
    space, v = space_near(problem, closed_gait(problem, start, problem.delta_start))
    found = begun(space, v, deltas(problem, problem.delta_start), ROUGH)
    report(found)
    return refined(descended(found, problem, report), report)
