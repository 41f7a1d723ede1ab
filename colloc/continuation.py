"""Continuation in delta: from strongly regularised friction, which converges from poor guesses, to nearly dry friction.

Every level starts from the last converged gait, projected back onto the balance at the new delta by the fixed-point
solver, with the last multipliers. A level that fails is tried again closer to the one that converged. At the final delta
the mesh is refined where the gait needs it.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from colloc.closure import closed_parameters
from colloc.diagnosis import explanation, redundant_equations
from colloc.gait import Fourier
from colloc.nlp import NlpResult, Solver
from colloc.problem import Problem
from colloc.refinement import refined_edges
from colloc.solution import Level, Solution
from colloc.transcription import transcribe
from colloc.warm_start import feasible_point

FIRST_FACTOR = 0.1
FIRST_RADIUS, NEXT_RADIUS, REMESH_RADIUS = 1.0, 0.5, 0.1
"""Trust region of the gait parameters [rad] at the first level, at later ones, and on a refined mesh: how far an optimum is
expected to move. A region that turns out too small is moved, so it costs steps, not optima."""
TRIVIAL, TRIVIAL_EFFICIENCY = "trivial gait", 1e-4
"""Status of a level whose gait goes nowhere: efficiency times the smallest friction coefficient (at most 1) below this."""
_SMALLEST_STEP = 0.8
_RETRIES = 2
"""A solve that has not converged after a few dozen iterations follows a kink of stick-slip in tiny steps. Hundreds more
rarely help; going on from its last gait, projected back onto the balance, within half the trust region, does. Between two
levels a smaller step in delta is better still, so only solves on refined meshes are retried."""
_FAILURES_PER_MESH, _MESHES, _OTHER_MESH = 2, 4, 1.15
"""After so many failures in a row a uniform mesh with this many times the intervals is tried. Where a link changes its
direction of sliding at a node, mu_b and mu_f give the collocated efficiency a kink, and an optimum may sit right on it:
there first-order conditions never hold. Another mesh has its kinks elsewhere."""
_FIRST_DELTAS = 4
_LOWER_START = 0.3
"""Where the first level fails, the next lower delta is tried, this factor below, up to so many first levels in all."""
_EXCHANGES = 4
_REFINEMENTS = 4
_ADMISSIBLE = 1e-8

Report = Callable[[Level], None]


class _Run:
    """A continuation under way: the solver of the current mesh, the last converged result, and all levels so far."""

    def __init__(self, problem: Problem, solver: Solver, on_level: Report | None) -> None:
        self.problem, self.solver, self.on_level = problem, solver, on_level
        self.levels: list[Level] = []
        self.parameters = problem.gait.parameters(problem.guess)
        self.multipliers: tuple[np.ndarray, np.ndarray] | None = None
        self.radius = FIRST_RADIUS
        self.reached: NlpResult | None = None
        if problem.gait.symmetry == "none":
            self.parameters = closed_parameters(problem, self.parameters, problem.delta_start)

    @property
    def gait(self) -> Fourier:
        return self.problem.gait.fourier(self.parameters, self.problem.body.n_joint)

    def take_over(self, levels: Sequence[Level]) -> None:
        """Go on where an interrupted run stopped: all up to its last optimal level counts as done."""
        optimal = [k for k, level in enumerate(levels) if level.optimal]
        if not optimal:
            return
        self.levels = list(levels[: optimal[-1] + 1])
        last = self.levels[-1]
        self.solver = Solver(transcribe(self.problem, last.edges))
        self.parameters = last.x[self.solver.transcription.layout.parameters[:, 0]]
        self.multipliers, self.radius = (last.lam_x, last.lam_g), NEXT_RADIUS
        self.reached = _as_result(last)

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
            # a critical point, but no optimum: step out less far the next time
            result = replace(result, complementarity=np.inf, status=TRIVIAL)
            self.radius *= _LOWER_START
        self._record(delta, result)
        if result.optimal:
            self.parameters = result.x[self.solver.transcription.layout.parameters[:, 0]]
            self.multipliers = (result.lam_x, result.lam_g)
            self.radius = NEXT_RADIUS
        return result

    def _solve(self, delta: float) -> NlpResult:
        """One solve; where no smaller step in delta can follow, repeated from where it stopped if it fails."""
        transcription, multipliers, radius = self.solver.transcription, self.multipliers, self.radius
        x = feasible_point(transcription, self.parameters, delta)
        result = self.solver.solve(x, delta, multipliers, radius)
        stuck = bool(self.levels) and self.levels[-1].optimal and self.levels[-1].delta == delta
        for _ in range(_RETRIES if stuck else 0):
            if result.optimal or not np.isfinite(result.x).all():
                break
            radius *= 0.5
            own = transcription.layout.parameters[:, 0]
            x = feasible_point(transcription, result.x[own], delta)
            result = self.solver.solve(x, delta, None, radius).accumulated(result)
        return result

    def remesh(self, edges: np.ndarray) -> None:
        """Go on with another mesh; multipliers do not carry over."""
        self.solver = Solver(transcribe(self.problem, edges))
        self.multipliers = None
        self.radius = REMESH_RADIUS

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


def continue_delta(
    problem: Problem, on_level: Report | None = None, solver: Solver | None = None, before: Sequence[Level] = ()
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
    run = _Run(problem, solver or Solver(transcribe(problem)), on_level)
    run.take_over(before)
    result = _descend(run)
    if result.optimal and problem.mesh_tolerance > 0:
        result = _refine(run, result)
    solution = Solution(problem, run.levels, seconds=time.perf_counter() - begin)
    if not result.optimal:
        delta = run.levels[-1].delta
        solution.message = explanation(run.solver.transcription, result, delta)
        redundant = redundant_equations(run.solver, feasible_point(run.solver.transcription, run.parameters, delta), delta)
        if redundant:
            solution.message += f" Redundant equations, which no optimiser bears: {', '.join(redundant)}."
    return solution


def _descend(run: _Run) -> NlpResult:
    """Levels down to the problem's delta, with smaller steps after a failure; the last result."""
    target = run.problem.delta
    delta, factor, reached, failures, meshes = run.problem.delta_start, FIRST_FACTOR, None, 0, 1
    if run.reached is not None:
        reached = run.levels[-1].delta
        if reached <= target:
            return run.reached
        delta = _next_delta(reached, factor, target)
    while True:
        result = run.attempt(delta)
        if result.optimal:
            reached = delta
            if delta <= target:
                return result
            factor, failures = max(FIRST_FACTOR, factor**2), 0
        elif reached is None:
            failures += 1
            if failures == _FIRST_DELTAS or delta <= target:
                return result
            delta = max(_LOWER_START * delta, target)
            continue
        else:
            failures += 1
            if failures >= _FAILURES_PER_MESH and meshes < _MESHES:
                edges = run.solver.transcription.mesh.edges
                run.remesh(np.linspace(0.0, edges[-1], 1 + round(_OTHER_MESH * (edges.size - 1)) | 1))
                failures, meshes = 0, meshes + 1
            elif factor > _SMALLEST_STEP:
                return result
            else:
                factor = factor**0.5
        delta = _next_delta(reached, factor, target)


def _next_delta(reached: float, factor: float, target: float) -> float:
    return reached * factor if reached * factor > 1.2 * target else target


def _as_result(level: Level) -> NlpResult:
    """What the optimiser returned for an optimal level that was kept."""
    return NlpResult(
        level.x,
        level.lam_x,
        level.lam_g,
        -level.efficiency,
        level.kkt_error,
        level.violation,
        level.complementarity,
        level.status,
        level.iterations,
        level.seconds,
        level.evaluation_seconds,
        np.zeros_like(level.lam_g),
    )


def _refine(run: _Run, result: NlpResult) -> NlpResult:
    """Solve again on refined meshes until the gait found needs no further refinement."""
    problem = run.problem
    for _ in range(_REFINEMENTS):
        mesh = run.solver.transcription.mesh
        edges = refined_edges(problem, mesh, run.gait, problem.delta, problem.mesh_tolerance)
        if edges is None:
            break
        run.remesh(edges)
        result = run.attempt(problem.delta)
        if not result.optimal:
            break
    return result
