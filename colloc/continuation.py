"""Continuation in delta: from strongly regularised friction, which converges from poor guesses, to nearly dry friction.

Every level starts from the last converged gait, projected back onto the balance at the new delta by the fixed-point
solver, with the last multipliers. A level that fails is tried again closer to the one that converged. At the final delta
the mesh is refined where the gait needs it.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from colloc.closure import closed_parameters, opened_parameters
from colloc.contact import Pairs
from colloc.diagnosis import explanation, redundant_equations
from colloc.far_contact import crossing_pairs, last_free
from colloc.gait_fields import AnyGait
from colloc.mesh_error import mesh_error
from colloc.nlp import NlpResult, Solver
from colloc.path_start import nearest_parameters, transcribed
from colloc.prediction import Track
from colloc.problem import CONDENSED, Problem
from colloc.program import GaitProgram
from colloc.refinement import MOST_POINTS, MeshPlan, planned_mesh
from colloc.solution import Level, Solution
from colloc.warm_start import feasible_point

FIRST_FACTOR = 0.2
FIRST_RADIUS, NEXT_RADIUS, REMESH_RADIUS = 1.0, 0.5, 0.1
"""Trust region of the gait parameters [rad] at the first level, at later ones, and on a refined mesh: how far an optimum is
expected to move. A region that turns out too small is moved, so it costs steps, not optima."""
PATH_FACTOR, PATH_RADIUS, SMALLEST_RADIUS = 0.3, 0.1, 0.003
"""The same for free paths and polygons, whose many parameters can follow the kinks of stick-slip from point to point: levels
closer together and short steps. Optima move about as much as delta does, so the region of a level is half of what the last
one moved, from 0.1 down to 0.003 rad. Measured at curvature 8 on 60 intervals, delta from 0.01 to 1e-5: 104 iterations; with
steps of up to 0.1 rad the level at 3e-4 fails."""
TRIVIAL, TRIVIAL_EFFICIENCY = "trivial gait", 1e-4
"""Status of a level whose gait goes nowhere: efficiency times the smallest friction coefficient (at most 1) below this."""
_SMALLEST_STEP = 0.8
NEXT_ITERATIONS = 15
"""Iterations a condensed level of a one-harmonic gait may take that starts from a converged one. Near the optimum 4 to 12
do; a solve that needs more follows a kink of stick-slip in tiny steps, and a smaller step in delta is cheaper than its end.
Gaits of more parameters need more."""
REFINE_DELTA = 1e-3
"""The mesh is refined on the way, at the first level below this delta, and checked again at the end. A refined mesh displaces
the optimum by more than the kinks at a small delta let pass: entered there, most solves on it fail."""
_RETRIES = 2
"""A gait of many parameters that has not converged on a refined mesh after a few dozen iterations follows a kink in tiny
steps. Hundreds more rarely help; going on from its last gait, projected back onto the balance, within half the trust region,
does."""
_FAILURES_PER_MESH, _MESHES, _OTHER_MESH = 2, 4, 1.15
"""After so many failures in a row a uniform mesh with this many times the intervals is tried. Where a link changes its
direction of sliding at a node, mu_b and mu_f give the collocated efficiency a kink, and an optimum may sit right on it:
there first-order conditions never hold. Another mesh has its kinks elsewhere."""
_FIRST_DELTAS = 5
_LOWER_START = 0.3
"""Where the first level fails, the next lower delta is tried, this factor below, up to so many first levels in all."""
_FEASIBLE = 1e-6
"""A first level that fails with all equations satisfied to this has stalled on a kink; one that does not has lost its way."""
_EXCHANGES = 4
_REFINEMENTS = 5
_ADMISSIBLE = 1e-8

_BUILT_IN = ("body", "friction", "gait", "joint_limit", "smallest_shape_speed", "intervals", "scheme", "formulation")
_MOST_KEPT = 4
_kept = threading.local()

Report = Callable[[Level], None]


class _Run:
    """A continuation under way: the solver of the current mesh, the last converged result, and all levels so far."""

    def __init__(self, problem: Problem, solver: Solver[GaitProgram], on_level: Report | None) -> None:
        self.problem, self.solver, self.on_level = problem, solver, on_level
        self.levels: list[Level] = []
        self.track = Track()
        self.parameters = nearest_parameters(solver.transcription, problem.guess)
        self.multipliers: tuple[np.ndarray, np.ndarray] | None = None
        self.velocities: np.ndarray | None = None
        self.radius = FIRST_RADIUS
        self.factor, self.next_radius = (PATH_FACTOR, PATH_RADIUS) if problem.has_path else (FIRST_FACTOR, NEXT_RADIUS)
        self.rich = problem.has_path or problem.gait.harmonics > 1
        self.first_delta = problem.delta_start
        self.far: Pairs = ()
        if problem.gait.symmetry == "none" and not problem.has_path:
            self.parameters = closed_parameters(problem, self.parameters, problem.delta_start)

    @property
    def gait(self) -> AnyGait:
        return self.solver.transcription.member(self.parameters)

    def take_over(self, levels: Sequence[Level]) -> None:
        """Go on where an interrupted run stopped: its last optimal level is solved again, from its own result."""
        optimal = [k for k, level in enumerate(levels) if level.optimal]
        if not optimal:
            return
        last = levels[optimal[-1]]
        if not np.array_equal(last.edges, self.solver.transcription.mesh.edges):
            self.remesh(last.edges)
        self.levels = list(levels[: optimal[-1]])
        self.parameters = last.x[self.solver.transcription.layout.parameters[:, 0]]
        self.multipliers, self.radius, self.first_delta = (last.lam_x, last.lam_g), self.next_radius, last.delta

    def attempt(self, delta: float) -> NlpResult:
        """Solve at delta from the last converged gait; take the result over if it is optimal."""
        result = self._solve_apart(delta)
        if delta == self.problem.delta:
            # move the checks between nodes to the new gait's worst instants until none is exceeded
            for _ in range(_EXCHANGES):
                if not result.optimal or self.solver.transcription.check_excess(result.x) <= _ADMISSIBLE:
                    break
                again = self.solver.solve(result.x, delta, (result.lam_x, result.lam_g), self.radius)
                result = again.accumulated(result)
        if result.optimal and abs(result.objective) * self.problem.friction.smallest < TRIVIAL_EFFICIENCY:
            # a critical point, but no optimum: begin further away from it, or step out less far, the next time
            result = replace(result, complementarity=np.inf, status=TRIVIAL)
            if self.problem.has_path:
                self.radius *= _LOWER_START
            elif not self.track:
                self.parameters = opened_parameters(self.problem, self.parameters, delta)
        self._record(delta, result)
        if result.optimal:
            before, self.parameters = self.parameters, result.x[self.solver.transcription.layout.parameters[:, 0]]
            self.multipliers = (result.lam_x, result.lam_g)
            self.radius = self.next_radius
            if not self.problem.has_path:
                self.velocities = result.x[self.solver.transcription.layout.z]
                self.track.record(delta, self.parameters)
            else:
                moved = float(np.abs(self.parameters - before).max())
                self.radius = min(max(0.5 * moved, SMALLEST_RADIUS), self.next_radius)
        return result

    def _solve_apart(self, delta: float) -> NlpResult:
        """Solve, constraining pairs of links more than two apart as they turn out to cross each other."""
        result = self._solve(delta)
        while np.isfinite(result.x).all():
            found = result.x[self.solver.transcription.layout.parameters[:, 0]]
            new = tuple(p for p in crossing_pairs(self.solver.transcription, found) if p not in self.far)
            if not new:
                break
            self.far += new
            self.remesh(self.solver.transcription.mesh.edges, self.radius)
            again = self._solve(delta, last_free(self.solver.transcription, self.parameters, found))
            result = again.accumulated(result)
        return result

    def _solve(self, delta: float, start: np.ndarray | None = None) -> NlpResult:
        """One solve, by default from where the optimum is expected."""
        transcription, multipliers, radius = self.solver.transcription, self.multipliers, self.radius
        own = self.parameters + self.track.move(delta) if start is None else start
        x = feasible_point(transcription, own, delta, self.velocities)
        hurried = self.track and self.problem.formulation == CONDENSED and not self.rich
        iterations = NEXT_ITERATIONS if hurried else None
        result = self.solver.solve(x, delta, multipliers, radius, iterations)
        stuck = self.rich and bool(self.levels) and self.levels[-1].optimal and self.levels[-1].delta == delta
        for _ in range(_RETRIES if stuck else 0):
            if result.optimal or not np.isfinite(result.x).all():
                break
            radius *= 0.5
            own = transcription.layout.parameters[:, 0]
            x = feasible_point(transcription, result.x[own], delta)
            result = self.solver.solve(x, delta, None, radius).accumulated(result)
        return result

    def remesh(self, edges: np.ndarray, radius: float = REMESH_RADIUS, scheme: str | None = None) -> None:
        """Go on with another mesh or scheme, or more pairs of links kept apart; multipliers do not carry over."""
        scheme, gait = scheme or self.solver.transcription.mesh.scheme.name, self.gait
        self.solver = Solver(transcribed(self.problem.with_(scheme=scheme), gait, edges, self.far))
        self.parameters = nearest_parameters(self.solver.transcription, gait)
        self.multipliers = self.velocities = None
        self.radius = radius
        self.track.remeshed()

    def other_mesh(self) -> None:
        """Go on with a uniform mesh of a few more intervals, whose kinks lie elsewhere."""
        edges = self.solver.transcription.mesh.edges
        self.remesh(np.linspace(0.0, edges[-1], 1 + round(_OTHER_MESH * (edges.size - 1)) | 1))

    def leave_kink(self, result: NlpResult) -> None:
        """Go on from where a feasible solve stalled, with another mesh."""
        self.parameters = result.x[self.solver.transcription.layout.parameters[:, 0]]
        self.other_mesh()
        self.radius = self.next_radius

    def _record(self, delta: float, result: NlpResult) -> None:
        transcription = self.solver.transcription
        layout, periods = transcription.layout, 1.0 / self.problem.gait.fraction
        level = Level(
            delta,
            transcription.phase_mesh(transcription.member(result.x[layout.parameters[:, 0]])).edges,
            result.x,
            result.lam_x,
            result.lam_g,
            -result.objective,
            periods * float(result.x[layout.distance[0, -1]]),
            periods * float(result.x[layout.work[0, -1]]),
            result.kkt_error,
            result.violation,
            result.complementarity,
            result.status,
            result.optimal,
            result.iterations,
            result.seconds,
            result.evaluation_seconds,
            transcription.mesh.scheme.name,
        )
        self.levels.append(level)
        if self.on_level is not None:
            self.on_level(level)


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
    run = _Run(problem, solver or _kept_solver(problem), on_level)
    run.take_over(before)
    result, shortfall = _refine(run)
    solution = Solution(problem, run.levels, seconds=time.perf_counter() - begin, message=shortfall)
    if not result.optimal:
        delta = run.levels[-1].delta
        solution.message = explanation(run.solver.transcription, result, delta)
        redundant = redundant_equations(run.solver, feasible_point(run.solver.transcription, run.parameters, delta), delta)
        if redundant:
            solution.message += f" Redundant equations, which no optimiser bears: {', '.join(redundant)}."
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


def _descend(run: _Run, delta: float, target: float) -> NlpResult:
    """Levels from delta down to the target, with smaller steps after a failure; the last result."""
    factor, reached, failures, meshes = run.factor, None, 0, 1
    while True:
        result = run.attempt(delta)
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
                delta = max(_LOWER_START * delta, target)
            else:
                return result
            continue
        else:
            failures += 1
            if failures >= _FAILURES_PER_MESH and meshes < _MESHES:
                run.other_mesh()
                failures, meshes = 0, meshes + 1
            elif factor > _SMALLEST_STEP:
                return result
            else:
                factor = factor**0.5
        delta = reached * factor if reached * factor > 1.2 * target else target


def _refine(run: _Run) -> tuple[NlpResult, str]:
    """Levels down to the problem's delta, on planned meshes until the gait needs no other; the last result, what it lacks."""
    problem, kept = run.problem, np.empty(0)
    first = run.first_delta
    result = _descend(run, first, max(problem.delta, min(REFINE_DELTA, first)))
    for _ in range(_REFINEMENTS):
        at = run.levels[-1].delta
        plan = _plan(run, kept) if result.optimal and problem.mesh_tolerance > 0 else None
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


def _plan(run: _Run, kept: np.ndarray) -> MeshPlan | None:
    """A mesh on which the gait found is accurate at the problem's delta; None if the present one will do."""
    problem, gait = run.problem, run.gait
    mesh = run.solver.transcription.phase_mesh(gait)
    return planned_mesh(problem, mesh, gait, problem.delta * gait.delta_unit, problem.mesh_tolerance, kept=kept)
