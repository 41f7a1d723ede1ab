"""The value that the stages of a search hand on: a gait that is optimal in its class at one delta
on one mesh, or nearly; and the spaces in which such gaits are searched."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from colloc.dynamics.control_problem import control_problem
from colloc.gaits.gait_fields import AnyGait
from colloc.gaits.harmonic import Prescribed
from colloc.gaits.problem import Problem
from colloc.mechanics.contact import Pairs
from colloc.numerics.sqp import Stationarity, stationarity
from colloc.reduced.linear_space import LinearSpace
from colloc.reduced.program import ReducedProgram, SearchSpace
from colloc.results.answer import Step
from colloc.search.options import MEDIUM, TOLERANCES

STATIONARY, NOT_STATIONARY = "stationary", "not stationary"
SPACES = LinearSpace, SearchSpace


@dataclass(frozen=True, eq=False)
class Iterate:
    """A gait with its first-order conditions."""

    space: SearchSpace
    v: np.ndarray  # parameters in that space, (n,)
    delta: float  # in the units of the class of gaits
    objective: float  # what SQP minimises: minus the value, in units of the friction
    kkt_error: float
    violation: float
    complementarity: float
    kkt: float  # tolerance of the KKT error that was asked for
    hessian: np.ndarray | None = None  # quasi-Newton estimate for the Lagrangian, (n, n)
    on_kink: bool = False  # whether the conditions hold for gradients sampled around v, not at v
    message: str = ""  # what refinement could not reach
    history: tuple[Step, ...] = ()  # iterates that led here, this one last

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
        return self.space.control.unscale(-self.objective)

    @property
    def optimal(self) -> bool:
        stationary = max(self.kkt_error, self.complementarity) < self.kkt
        return stationary and self.violation < TOLERANCES.kkt

    @cached_property
    def strays(self) -> bool:
        """True if the body, where several velocities balance it, would not move as the search has
        it: that goes on at each instant from the last gait, a body from the instant before."""
        dynamics = self.space.control.dynamics
        if dynamics.law.associated or dynamics.states:
            return False
        in_time = ReducedProgram(self.space, self.delta).objective(self.v)
        return abs(in_time - self.objective) > TOLERANCES.replay_gap * abs(self.objective)

    def program(self) -> ReducedProgram:
        """Reduced program with its rows at the worst instants of this gait."""
        program = ReducedProgram(self.space, self.delta)
        program.place_rows(self.v)
        return program

    def after(self, history: tuple[Step, ...]) -> Iterate:
        return replace(self, history=(*history, self.step))


def evaluate_at(
    space: SearchSpace,
    v: np.ndarray,
    delta: float,
    kkt: float = MEDIUM,
    program: ReducedProgram | None = None,
    conditions: Stationarity | None = None,
    *,
    iterations: int = 0,
    seconds: float = 0.0,
    hessian: np.ndarray | None = None,
) -> Iterate:
    """Iterate at given parameters, with its program (rows placed) and conditions if known."""
    if program is None:
        program = ReducedProgram(space, delta)
        program.place_rows(v)
    now = conditions or stationarity(program, v)
    objective, period = program.objective(v), program.period(v)
    stationary = max(now.kkt_error, now.complementarity) < kkt
    numbers = program.value(objective), period["distance"], period["work"], now.kkt_error
    status = STATIONARY if stationary else NOT_STATIONARY
    step = Step(delta, space.mesh.n, *numbers, stationary, status, iterations, seconds)
    errors = now.kkt_error, now.violation, now.complementarity
    return Iterate(space, v, delta, objective, *errors, kkt, hessian, history=(step,))


def space_of(
    problem: Problem, edges: np.ndarray | None = None, scheme: str = "", far: Pairs = ()
) -> SearchSpace:
    """The class of a problem on a mesh, by default the first one, with pairs of links `far` kept
    from crossing; edges in the program's own time."""
    space: type = SearchSpace if isinstance(problem.gait, Prescribed) else LinearSpace
    return space(control_problem(problem), edges, scheme, far)


def space_near(
    problem: Problem,
    gait: AnyGait,
    edges: np.ndarray | None = None,
    scheme: str = "",
    far: Pairs = (),
) -> tuple[SearchSpace, np.ndarray]:
    """The space of `space_of`, on edges in phases of the gait, and the parameters of its member
    nearest to the gait."""
    edges = None if edges is None else problem.gait.times(gait, edges)
    space = space_of(problem, edges, scheme, far)
    return space, space.parameters(gait)
