"""Optimised low-mode gaits of smooth bodies: continuation in delta, refinement of panels and mesh, independent replay."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from colloc.collocation.modal_transcription import transcribe_modal
from colloc.gaits.harmonic import Fourier
from colloc.results.checks import Check
from colloc.search.nlp import OPTIMAL_TOLERANCE, NlpResult, Solver
from colloc.smooth.modal_problem import ModalProblem
from colloc.smooth.period import Period, measured_period
from colloc.system.errors import NotConvergedError

FIRST_RADIUS, NEXT_RADIUS = 0.5, 0.2
"""Trust region of the amplitudes [rad], at the first level and later ones."""
GAP, ROTATION, ANGLE, DELTA = 1e-4, 1e-3, 1e-3, 2e-2
"""Largest values that pass. ROTATION as for chains. DELTA: a smooth body has a point at rest at nearly every instant, so the
influence of delta is first order and larger than for links."""
_FACTOR, _SMALLEST_FACTOR = 0.3, 0.8
_REFINEMENTS = 2
_REPLAY_INTERVALS = 16


@dataclass(frozen=True, eq=False)
class ModalOptimum:
    """An optimised low-mode gait.

    Attributes
    ----------
    problem : ModalProblem
        With the panels and intervals that were needed.
    gait : Fourier
        Amplitudes of the modes.
    levels : list of (float, NlpResult)
        Every delta that was tried, and what IPOPT returned.
    period : Period
        The gait replayed by the general smooth-body solver, on panels that adapt.
    checks : tuple of Check
    """

    problem: ModalProblem
    gait: Fourier
    levels: list[tuple[float, NlpResult]]
    period: Period
    checks: tuple[Check, ...]

    @property
    def efficiency(self) -> float:
        """Of the replay."""
        return self.period.efficiency

    @property
    def certified(self) -> bool:
        return all(check.passed for check in self.checks)

    @property
    def iterations(self) -> int:
        return sum(result.iterations for _, result in self.levels)


class _Run:
    """A continuation under way: the gait reached so far and every level tried."""

    def __init__(self, problem: ModalProblem, iterations: int) -> None:
        self.iterations = iterations
        self.problem, self.parameters = problem, problem.gait.parameters(problem.guess)
        self.levels: list[tuple[float, NlpResult]] = []
        self.radius = FIRST_RADIUS
        self._build(problem)

    def _build(self, problem: ModalProblem) -> None:
        self.problem, self.transcription = problem, transcribe_modal(problem)
        self.solver = Solver(self.transcription, {"max_iter": self.iterations})

    def attempt(self, delta: float) -> bool:
        x = self.transcription.feasible_point(self.parameters, delta)
        result = self.solver.solve(x, delta, None, self.radius)
        self.levels.append((delta, result))
        if result.optimal:
            self.parameters, self.radius = result.x[self.transcription.layout.parameters[:, 0]], NEXT_RADIUS
        return result.optimal

    def descend(self) -> None:
        """Follow delta down, in smaller steps where a level fails.

        Raises
        ------
        NotConvergedError
            If the steps become too small.
        """
        problem, reached, factor = self.problem, np.inf, _FACTOR
        delta = problem.delta_start
        while True:
            if self.attempt(delta):
                if delta <= problem.delta:
                    return
                reached, factor = delta, max(_FACTOR, factor**2)
                delta = max(problem.delta, factor * reached)
            else:
                factor = np.sqrt(factor)
                if factor > _SMALLEST_FACTOR:
                    kkt = self.levels[-1][1].kkt_error
                    raise NotConvergedError(
                        f"{problem.name}: no optimum at delta = {delta:.2g} (KKT error {kkt:.1e}) even from "
                        f"{'the guess' if np.isinf(reached) else f'that at {reached:.2g}'}; start from another guess, raise "
                        "delta, or give the body more panels."
                    )
                # a first level that fails may be too viscous: friction then rewards other gaits
                delta = delta * factor if np.isinf(reached) else max(problem.delta, factor * reached)

    def refined(self) -> None:
        """Twice the panels and intervals, solved again at the final delta from the gait reached."""
        body = replace(self.problem.body, panels=2 * self.problem.body.panels)
        self._build(self.problem.with_(body=body, intervals=2 * self.problem.intervals))
        self.attempt(self.problem.delta)


def optimise_modal(problem: ModalProblem, iterations: int = 60) -> ModalOptimum:
    """Maximise the efficiency of a smooth body from the problem's guess.

    Panels and mesh are doubled until the replay confirms the collocated efficiency to a relative 1e-4, at most twice;
    `checks` says whether it does.

    Parameters
    ----------
    problem : ModalProblem
    iterations : int
        IPOPT's iterations within a trust region.

    Raises
    ------
    NotConvergedError
        If a level of the continuation fails however small the step.
    """
    run = _Run(problem, iterations)
    run.descend()
    for refinement in range(_REFINEMENTS + 1):
        gait = run.problem.member(run.parameters)
        period = _replay(run.problem, gait, problem.delta)
        checks = _checks(run, gait, period)
        if abs(checks[2].value) <= GAP or refinement == _REFINEMENTS:
            break
        run.refined()
    return ModalOptimum(run.problem, gait, run.levels, period, checks)


def _replay(problem: ModalProblem, gait: Fourier, delta: float) -> Period:
    motion = problem.body.motion(gait, problem.gait.symmetry == "antipodal")
    return measured_period(motion, problem.friction, delta, intervals=_REPLAY_INTERVALS)


def _checks(run: _Run, gait: Fourier, period: Period) -> tuple[Check, ...]:
    result, problem = run.levels[-1][1], run.problem
    softer = _replay(problem, gait, 0.25 * problem.delta).efficiency
    beyond = max(problem.steepest(gait) - problem.largest_angle, 0.0)
    kkt = max(result.kkt_error, result.complementarity)
    return (
        Check("KKT error", kkt, OPTIMAL_TOLERANCE, "gradient of the Lagrangian, complementarity"),
        Check("constraint violation", result.violation, OPTIMAL_TOLERANCE, "largest violated equation or bound"),
        Check("replay gap", -result.objective / period.efficiency - 1, GAP, "collocated over replayed efficiency, less 1"),
        Check("replay error", period.errors["efficiency"] / period.efficiency, GAP, "relative, from a coarser replay"),
        Check("net rotation", period.rotation, ROTATION, "of the replayed body over one period [rad]"),
        Check("tangent angle", beyond, ANGLE, "excess between the places where it is bounded [rad]"),
        Check("delta influence", softer / period.efficiency - 1, DELTA, "same gait at a quarter of delta, relative change"),
    )
