"""Continuation in delta: from strongly regularised friction, which converges from poor guesses, to nearly dry friction.

Every level starts from the last converged gait, projected back onto the balance at the new delta by the fixed-point
solver, with the last multipliers. A level that fails is tried again closer to the one that converged. At the final delta
the mesh is refined where the gait needs it.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from colloc.closure import closed_parameters, opened_parameters
from colloc.diagnosis import explanation, redundant_equations
from colloc.gait import Fourier
from colloc.nlp import NlpResult, Solver
from colloc.prediction import Track
from colloc.problem import CONDENSED, Problem
from colloc.refinement import refined_edges
from colloc.solution import Level, Solution
from colloc.transcription import transcribe
from colloc.warm_start import feasible_point

FIRST_FACTOR = 0.2
FIRST_RADIUS, NEXT_RADIUS, REMESH_RADIUS = 1.0, 0.5, 0.1
"""Trust region of the gait parameters [rad] at the first level, at later ones, and on a refined mesh: how far an optimum is
expected to move. A region that turns out too small is moved, so it costs steps, not optima."""
TRIVIAL, TRIVIAL_EFFICIENCY = "trivial gait", 1e-4
"""Status of a level whose gait goes nowhere: efficiency times the smallest friction coefficient (at most 1) below this."""
_SMALLEST_STEP = 0.8
NEXT_ITERATIONS = 15
"""Iterations a condensed level may take that starts from a converged one. Near the optimum 4 to 12 do; a solve that needs
more follows a kink of stick-slip in tiny steps, and a smaller step in delta is cheaper than its end."""
REFINE_DELTA = 1e-3
"""The mesh is refined on the way, at the first level below this delta, and checked again at the end. A refined mesh displaces
the kinks that small deltas sharpen: entered at a smaller delta, most solves on it fail."""
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
_REFINEMENTS = 4
_ADMISSIBLE = 1e-8

_BUILT_IN = ("body", "friction", "gait", "joint_limit", "smallest_shape_speed", "intervals", "scheme", "formulation")
_MOST_KEPT = 4
_kept = threading.local()

Report = Callable[[Level], None]


class _Run:
    """A continuation under way: the solver of the current mesh, the last converged result, and all levels so far."""

    def __init__(self, problem: Problem, solver: Solver, on_level: Report | None) -> None:
        self.problem, self.solver, self.on_level = problem, solver, on_level
        self.levels: list[Level] = []
        self.track = Track()
        self.parameters = problem.gait.parameters(problem.guess)
        self.multipliers: tuple[np.ndarray, np.ndarray] | None = None
        self.velocities: np.ndarray | None = None
        self.radius = FIRST_RADIUS
        if problem.gait.symmetry == "none":
            self.parameters = closed_parameters(problem, self.parameters, problem.delta_start)

    @property
    def gait(self) -> Fourier:
        return self.problem.gait.fourier(self.parameters, self.problem.body.n_joint)

    def attempt(self, delta: float) -> NlpResult:
        """Solve at delta from the last converged gait; take the result over if it is optimal."""
        result = self._solve(delta)
        if delta == self.problem.delta:
            # move the checks between nodes to the new gait's worst instants until none is exceeded
            for _ in range(_EXCHANGES):
                if not result.optimal or self.solver.check_excess(result.x) <= _ADMISSIBLE:
                    break
                again = self.solver.solve(result.x, delta, (result.lam_x, result.lam_g), self.radius)
                result = again.accumulated(result)
        if result.optimal and abs(result.objective) * self.problem.friction.smallest < TRIVIAL_EFFICIENCY:
            # a critical point, but no optimum: begin further away from it the next time
            result = replace(result, complementarity=np.inf, status=TRIVIAL)
            if not self.track:
                self.parameters = opened_parameters(self.problem, self.parameters, delta)
        self._record(delta, result)
        if result.optimal:
            self.parameters = result.x[self.solver.transcription.layout.parameters[:, 0]]
            self.multipliers = (result.lam_x, result.lam_g)
            self.velocities = result.x[self.solver.transcription.layout.z]
            self.track.record(delta, self.parameters)
            self.radius = NEXT_RADIUS
        return result

    def _solve(self, delta: float) -> NlpResult:
        x = feasible_point(self.solver.transcription, self.parameters + self.track.move(delta), delta, self.velocities)
        iterations = NEXT_ITERATIONS if self.track and self.problem.formulation == CONDENSED else None
        return self.solver.solve(x, delta, self.multipliers, self.radius, iterations)

    def remesh(self, edges: np.ndarray) -> None:
        """Go on with another mesh; multipliers do not carry over."""
        self.solver = Solver(transcribe(self.problem, edges))
        self.multipliers = self.velocities = None
        self.radius = REMESH_RADIUS
        self.track.remeshed()

    def other_mesh(self) -> None:
        """Go on with a uniform mesh of a few more intervals, whose kinks lie elsewhere."""
        edges = self.solver.transcription.mesh.edges
        self.remesh(np.linspace(0.0, edges[-1], 1 + round(_OTHER_MESH * (edges.size - 1)) | 1))

    def leave_kink(self, result: NlpResult) -> None:
        """Go on from where a feasible solve stalled, with another mesh."""
        self.parameters = result.x[self.solver.transcription.layout.parameters[:, 0]]
        self.other_mesh()
        self.radius = NEXT_RADIUS

    def _record(self, delta: float, result: NlpResult) -> None:
        transcription = self.solver.transcription
        layout, periods = transcription.layout, 1.0 / self.problem.gait.fraction
        level = Level(
            delta,
            transcription.mesh.edges,
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
        )
        self.levels.append(level)
        if self.on_level is not None:
            self.on_level(level)


def continue_delta(problem: Problem, on_level: Report | None = None, solver: Solver | None = None) -> Solution:
    """Solve a problem through falling delta, from ``delta_start`` to ``delta``, then refine its mesh.

    Parameters
    ----------
    problem : Problem
    on_level : callable, optional
        Called with each `Level` as it ends, also with failed ones.
    solver : Solver, optional
        Built for the same problem before, to save building it again.

    Returns
    -------
    Solution
        Without a certificate; the last level is one at ``problem.delta`` only if all went well.
    """
    begin = time.perf_counter()
    run = _Run(problem, solver or _kept_solver(problem), on_level)
    first = feasible_point(run.solver.transcription, run.parameters, problem.delta_start)
    redundant = redundant_equations(run.solver, first, problem.delta_start)
    result = _descend(run, problem.delta_start, max(problem.delta, min(REFINE_DELTA, problem.delta_start)))
    for _ in range(_REFINEMENTS):
        at = run.levels[-1].delta
        edges = _refined(run) if result.optimal and problem.mesh_tolerance > 0 else None
        if edges is not None:
            run.remesh(edges)
        elif not result.optimal or at <= problem.delta:
            break
        # a mesh refined at the end is entered where its kinks are mild
        begin = min(max(at, REFINE_DELTA), problem.delta_start) if edges is not None else FIRST_FACTOR * at
        result = _descend(run, max(begin, problem.delta), problem.delta)
    solution = Solution(problem, run.levels, seconds=time.perf_counter() - begin)
    if not result.optimal:
        delta = run.levels[-1].delta
        solution.message = explanation(run.solver.transcription, result, delta)
        if redundant:
            solution.message += (
                f" Before the first solve the equations were rank deficient, which no optimiser bears: {', '.join(redundant)}."
            )
    return solution


def _kept_solver(problem: Problem) -> Solver:
    """The solver of a problem's uniform mesh, built once a thread: guess and delta are no part of it."""
    key = tuple(getattr(problem, name) for name in _BUILT_IN)
    kept = _kept.__dict__.setdefault("solvers", {})
    if key not in kept:
        while len(kept) >= _MOST_KEPT:
            kept.pop(next(iter(kept)))
        kept[key] = Solver(transcribe(problem))
    return kept[key]


def _descend(run: _Run, delta: float, target: float) -> NlpResult:
    """Levels from delta down to the target, with smaller steps after a failure; the last result."""
    factor, reached, failures, meshes = FIRST_FACTOR, None, 0, 1
    while True:
        result = run.attempt(delta)
        if result.optimal:
            reached = delta
            if delta <= target:
                return result
            factor, failures = max(FIRST_FACTOR, factor**2), 0
        elif reached is None:
            failures += 1
            if failures == _FIRST_DELTAS:
                return result
            if result.status == TRIVIAL:
                continue
            if result.violation < _FEASIBLE and meshes < _MESHES:
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


def _refined(run: _Run) -> np.ndarray | None:
    """Edges of a mesh on which the gait found is accurate; None if the present one will do."""
    mesh = run.solver.transcription.mesh
    return refined_edges(run.problem, mesh, run.gait, run.problem.delta, run.problem.mesh_tolerance)
