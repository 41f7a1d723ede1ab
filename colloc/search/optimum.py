"""The value that the stages of a search hand on: a gait that is optimal in its class at one delta
on one mesh, or nearly."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from colloc.gaits.control_problem import control_problem
from colloc.gaits.gait_fields import AnyGait
from colloc.gaits.problem import Problem
from colloc.reduced.given import Given
from colloc.reduced.program import ReducedProgram, SearchSpace
from colloc.results.answer import Step
from colloc.search.certify import EXACT
from colloc.search.effort import Effort
from colloc.search.spaces import space_of


@dataclass(frozen=True, eq=False)
class Optimum:
    """Where SQP came to rest: plain data, from which its space and program can be made again.

    Attributes
    ----------
    problem : Problem
        With the body on the panels, and the mesh and scheme, on which this was found.
    given : Given
        What the space of gaits was made of besides.
    v : (n,)
        Parameters of the gait in that space.
    gait : AnyGait
    delta : float
        In the units of the class of gaits.
    objective : float
        What SQP minimises: minus the value, in units of the friction.
    kkt_error, violation, complementarity : float
        Of the first-order conditions.
    effort : Effort
        What was asked for.
    iterations : int
    seconds : float
    step : Step
        The same as a line of a table.
    curvature : (n, n), optional
        What SQP knows of the Lagrangian's second derivatives.
    on_kink : bool
        Whether the conditions hold on the sides of a kink, not at v itself.
    lacks : str
        What refinement could not reach; empty if nothing.
    history : tuple of Step
        How the search came here, this step included.
    """

    problem: Problem
    given: Given
    v: np.ndarray
    gait: AnyGait
    delta: float
    objective: float
    kkt_error: float
    violation: float
    complementarity: float
    effort: Effort
    iterations: int
    seconds: float
    step: Step
    curvature: np.ndarray | None = None
    on_kink: bool = False
    lacks: str = ""
    history: tuple[Step, ...] = ()

    def __repr__(self) -> str:
        verdict = "" if self.optimal else ", not stationary"
        return (
            f"<Optimum {self.value:.6g} at delta = {self.delta:.1e}, {self.step.intervals} "
            f"intervals{verdict}>"
        )

    @cached_property
    def space(self) -> SearchSpace:
        """The class of gaits on its mesh. Its rows are placed by whoever asks for them
        (`ReducedProgram.place_rows`)."""
        return space_of(self.problem, None, *self.given)

    def program(self) -> ReducedProgram:
        """The program that this is an optimum of, with its rows placed."""
        program = ReducedProgram(self.space, self.delta)
        program.place_rows(self.v)
        return program

    @property
    def value(self) -> float:
        """Of the problem's objective."""
        return control_problem(self.problem).stated(-self.objective)

    @property
    def optimal(self) -> bool:
        """Whether the first-order conditions hold, as far as the effort asks for."""
        return (
            max(self.kkt_error, self.complementarity) < self.effort.kkt_error
            and self.violation < EXACT
        )

    def after(self, *before: Step) -> Optimum:
        """The same with steps that led to it."""
        return replace_keeping_space(self, history=(*before, self.step))


def replace_keeping_space(optimum: Optimum, **changes: object) -> Optimum:
    """A copy with some fields changed, none of which decides its space."""
    changed = replace(optimum, **changes)  # type: ignore[arg-type]
    if "space" in optimum.__dict__:
        changed.__dict__["space"] = optimum.__dict__["space"]
    return changed
