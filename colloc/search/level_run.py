"""The levels of a continuation under way: one solve at a delta, from what the levels before have shown."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from colloc.collocation.program import GaitProgram
from colloc.collocation.warm_start import feasible_point
from colloc.gaits.gait_fields import AnyGait
from colloc.gaits.problem import CONDENSED, Problem
from colloc.mechanics.contact import Pairs
from colloc.results.level import Level
from colloc.search.closure import closed_parameters, opened_parameters
from colloc.search.far_contact import crossing_pairs, last_free
from colloc.search.nlp import NlpResult, Solver
from colloc.search.path_start import nearest_parameters, transcribed
from colloc.search.prediction import Track

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
NEXT_ITERATIONS = 15
"""Iterations a condensed level of a one-harmonic gait may take that starts from a converged one on the same mesh. 4 to 12
do near an optimum; one that needs more follows a kink of stick-slip in tiny steps: a smaller step in delta is cheaper.
Gaits of more parameters need more."""
_RETRIES = 2
"""A gait of many parameters that has not converged on a refined mesh after a few dozen iterations follows a kink in tiny
steps. Hundreds more rarely help; going on from its last gait, projected back onto the balance, within half the trust region,
does. So it does for paths right after pairs of links were found to cross, where the start is far from the optimum."""
_EXCHANGES = 4
_ADMISSIBLE = 1e-8
OTHER_MESH = 1.15
"""Factor in the number of intervals between a uniform mesh and another one."""
LOWER_START = 0.3
"""Factor between the deltas of first levels that are tried one after the other."""

Report = Callable[[Level], None]


class Run:
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
        self.new_mesh = self.patient = True
        self.reached: NlpResult | None = None
        if problem.gait.symmetry == "none" and not problem.has_path:
            self.parameters = closed_parameters(problem, self.parameters, problem.delta_start)

    @property
    def gait(self) -> AnyGait:
        return self.solver.transcription.member(self.parameters)

    def take_over(self, levels: Sequence[Level]) -> None:
        """Go on where an interrupted run stopped: all up to its last optimal level counts as done."""
        optimal = [k for k, level in enumerate(levels) if level.optimal]
        if not optimal:
            return
        self.levels = list(levels[: optimal[-1] + 1])
        last = self.levels[-1]
        problem = self.problem.with_(scheme=last.scheme or self.problem.scheme)
        self.solver = Solver(transcribed(problem, None, last.edges))
        self.parameters = last.x[self.solver.transcription.layout.parameters[:, 0]]
        self.multipliers, self.radius, self.first_delta = (last.lam_x, last.lam_g), self.next_radius, last.delta
        self.reached = _as_result(last)

    def attempt(self, delta: float, patient: bool = False) -> NlpResult:
        """Solve at delta from the last converged gait, `patient` without `NEXT_ITERATIONS`; take an optimal result over."""
        self.patient = patient or self.new_mesh or self.rich or self.problem.formulation != CONDENSED
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
                self.radius *= LOWER_START
            elif not self.track:
                self.parameters = opened_parameters(self.problem, self.parameters, delta)
        self._record(delta, result)
        if result.optimal:
            before, self.parameters = self.parameters, result.x[self.solver.transcription.layout.parameters[:, 0]]
            self.multipliers = (result.lam_x, result.lam_g)
            self.radius, self.new_mesh = self.next_radius, False
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
        iterations = NEXT_ITERATIONS if self.track and not self.patient else None
        result = self.solver.solve(x, delta, multipliers, radius, iterations)
        stuck = self.rich and bool(self.levels) and self.levels[-1].optimal and self.levels[-1].delta == delta
        stuck = stuck or (start is not None and self.problem.has_path)
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
        self.radius, self.new_mesh = radius, True
        self.track.remeshed()

    def other_mesh(self) -> None:
        """Go on with a uniform mesh of a few more intervals, whose kinks lie elsewhere."""
        edges = self.solver.transcription.mesh.edges
        self.remesh(np.linspace(0.0, edges[-1], 1 + round(OTHER_MESH * (edges.size - 1)) | 1))

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
