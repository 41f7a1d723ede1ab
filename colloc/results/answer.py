"""The answer of a search: a gait as a point of its full program, with its history."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from colloc.dynamics.control_problem import control_problem
from colloc.gaits.gait import delta_per_period
from colloc.gaits.gait_fields import AnyGait
from colloc.gaits.problem import Problem
from colloc.numerics.mesh import Mesh
from colloc.numerics.schemes import scheme
from colloc.results.collocated_motion import CollocatedMotion
from colloc.transcription.layout import Layout, layout_of

REDUCED, PRESCRIBED, EVALUATED = "reduced", "prescribed", "evaluated"


@dataclass(frozen=True)
class Step:
    """An iterate of a search, as a line of a table.

    Attributes
    ----------
    delta : float
        In the units of the class of gaits.
    intervals : int
    value, distance, work : float
        Objective, distance and work of a period, as collocated.
    kkt_error : float
    optimal : bool
        Whether the first-order conditions hold to the tolerance of the step.
    status : str
    iterations : int
    seconds : float
    program : str
        "reduced", or the problem's formulation as solved by IPOPT.
    """

    delta: float
    intervals: int
    value: float
    distance: float
    work: float
    kkt_error: float
    optimal: bool
    status: str
    iterations: int
    seconds: float
    program: str = REDUCED


@dataclass(frozen=True)
class SecondOrder:
    """Smallest curvature of the Lagrangian over the value of the objective [1/rad^2], and its
    error; infinite if no direction is free, NaN (`why_not`) if it was not measured."""

    smallest: float
    error: float
    n_free: int
    why_not: str = ""


NOT_MEASURED = SecondOrder(np.nan, np.nan, 0, "nothing is free in a prescribed motion")


@dataclass(frozen=True, eq=False)
class Answer:
    """A gait as a point of the full direct-collocation program of its problem.

    Attributes
    ----------
    problem : Problem
        As it was solved: the body on its panels, at the final delta.
    gait : AnyGait
    delta : float
        In the units of the problem's class of gaits.
    edges : (n_interval + 1,)
        The mesh, in phases of the gait.
    scheme : str
    x, lam_x : (n,)
        Variables of the motion (`colloc.transcription.layout`) and multipliers of their bounds;
        work and forces are in units of `colloc.dynamics.control_problem`.
    lam_g : (m,)
        Multipliers of the constraints.
    value, distance, work : float
        Of the problem's objective, and over one whole period, as collocation sees them.
    kkt_error, violation, complementarity : float
        Measured first-order conditions, in units of the friction, otherwise unscaled.
    status : str
        In words.
    optimal : bool
        Whether the first-order conditions hold.
    iterations : int
    seconds : float
    program : str
        Where the conditions were measured: "reduced", or the problem's formulation as IPOPT
        confirms it; "prescribed" where nothing is free.
    second_order : SecondOrder
    message : str
        What does not hold, or holds in a way that should be told; empty otherwise.
    history : tuple of Step
        How the search came here; the last step is the answer itself.
    """

    problem: Problem
    gait: AnyGait
    delta: float
    edges: np.ndarray
    scheme: str
    x: np.ndarray
    lam_x: np.ndarray
    lam_g: np.ndarray
    value: float
    distance: float
    work: float
    kkt_error: float
    violation: float
    complementarity: float
    status: str
    optimal: bool
    iterations: int
    seconds: float
    program: str = REDUCED
    second_order: SecondOrder = NOT_MEASURED
    message: str = ""
    history: tuple[Step, ...] = ()

    def __repr__(self) -> str:
        verdict = "" if self.optimal else f", {self.status}"
        size = f"{self.x.size} variables"
        return (
            f"<Answer at delta = {self.delta:.1e}: {self.value:.6g}, {self.program}, "
            f"{size}{verdict}>"
        )

    @property
    def efficiency(self) -> float:
        """Distance over work, as collocation sees them."""
        return self.distance / self.work

    @property
    def step(self) -> Step:
        return Step(
            self.delta,
            self.edges.size - 1,
            *(self.value, self.distance, self.work, self.kkt_error),
            **{
                name: getattr(self, name)
                for name in ("optimal", "status", "iterations", "seconds", "program")
            },
        )

    @property
    def mesh(self) -> Mesh:
        return Mesh(scheme(self.scheme), self.edges)

    @property
    def layout(self) -> Layout:
        return layout_of(control_problem(self.problem), self.mesh)

    @property
    def delta_per_period(self) -> float:
        """Regularisation speed [body lengths per period]."""
        return delta_per_period(self.problem.gait, self.gait, self.delta)

    @cached_property
    def motion(self) -> CollocatedMotion:
        return CollocatedMotion(
            self.problem, self.mesh, self.layout, self.x, self.gait, self.delta_per_period
        )


@dataclass(frozen=True, eq=False)
class Alternative:
    """A distinct gait that starts met; its value is that on a coarse mesh."""

    value: float
    delta: float
    starts: int
    on_speed_floor: bool
    gait: AnyGait

    def __str__(self) -> str:
        size = ", as small as its bound allows" if self.on_speed_floor else ""
        return (
            f"{self.value:.4f} at delta {self.delta:.0e} ({self.starts} "
            f"start{'s' * (self.starts > 1)}{size})"
        )
