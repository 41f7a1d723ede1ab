"""The value that the stages of a search hand on: a gait that is optimal in its class at one delta
on one mesh, or nearly."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from colloc.gaits.gait_fields import AnyGait
from colloc.gaits.problem import Problem
from colloc.numerics.sqp import Stationarity, stationarity
from colloc.reduced.program import ReducedProgram, SearchSpace
from colloc.results.answer import Step
from colloc.search.options import MEDIUM, TOLERANCES

STATIONARY, NOT_STATIONARY = "stationary", "not stationary"


@dataclass(frozen=True, eq=False)
class Iterate:
    """A gait with its first-order conditions.

    Attributes
    ----------
    space : SearchSpace
        The class of gaits on a mesh; its problem has the body's panels of this iterate.
    v : (n,)
        Parameters in that space.
    delta : float
        In the units of the class of gaits.
    objective : float
        What SQP minimises: minus the value, in units of the friction.
    kkt_error, violation, complementarity : float
    kkt : float
        Tolerance of the KKT error that was asked for.
    hessian : (n, n), optional
        Quasi-Newton estimate of the Lagrangian's second derivatives.
    on_kink : bool
        Whether the conditions hold for gradients sampled around v, not at v.
    message : str
        What refinement could not reach.
    history : tuple of Step
        Iterates that led here, this one last.
    """

    space: SearchSpace
    v: np.ndarray
    delta: float
    objective: float
    kkt_error: float
    violation: float
    complementarity: float
    kkt: float
    hessian: np.ndarray | None = None
    on_kink: bool = False
    message: str = ""
    history: tuple[Step, ...] = ()

    def __repr__(self) -> str:
        verdict = "" if self.optimal else ", not stationary"
        return (
            f"<Iterate {self.value:.6g} at delta = {self.delta:.1e}, {self.step.intervals} "
            f"intervals{verdict}>"
        )

    @property
    def problem(self) -> Problem:
        return self.space.control.problem

    @cached_property
    def gait(self) -> AnyGait:
        return self.space.member(self.v)

    @property
    def step(self) -> Step:
        return self.history[-1]

    @property
    def value(self) -> float:
        """Value of the problem's objective."""
        return self.space.control.stated(-self.objective)

    @property
    def optimal(self) -> bool:
        stationary = max(self.kkt_error, self.complementarity) < self.kkt
        return stationary and self.violation < TOLERANCES.kkt

    def program(self) -> ReducedProgram:
        """Reduced program with its rows at the worst instants of this gait."""
        program = ReducedProgram(self.space, self.delta)
        program.place_rows(self.v)
        return program

    def after(self, history: tuple[Step, ...]) -> Iterate:
        return replace(self, history=(*history, self.step))


def iterate_at(
    program: ReducedProgram,
    v: np.ndarray,
    kkt: float,
    conditions: Stationarity,
    *,
    iterations: int = 0,
    seconds: float = 0.0,
    hessian: np.ndarray | None = None,
) -> Iterate:
    """Iterate of a program whose rows are placed, with known first-order conditions."""
    objective, period = program.objective(v), program.period(v)
    stationary = max(conditions.kkt_error, conditions.complementarity) < kkt
    step = Step(
        program.delta,
        program.space.mesh.n,
        *(program.stated(objective), period["distance"], period["work"], conditions.kkt_error),
        optimal=stationary,
        status=STATIONARY if stationary else NOT_STATIONARY,
        iterations=iterations,
        seconds=seconds,
    )
    return Iterate(
        program.space,
        v,
        program.delta,
        objective,
        *(conditions.kkt_error, conditions.violation, conditions.complementarity),
        kkt=kkt,
        hessian=hessian,
        history=(step,),
    )


def evaluate_at(space: SearchSpace, v: np.ndarray, delta: float) -> Iterate:
    """Iterate at given parameters, without optimising them."""
    program = ReducedProgram(space, delta)
    program.place_rows(v)
    return iterate_at(program, v, MEDIUM, stationarity(program, v))
