"""Optimisation of a gait at one delta on one mesh, in the reduced space, by quasi-Newton SQP.

Subproblems are solved within a trust region, with the shape constraints at the worst instants of
the last gait, until constraints, trust region and gait settle. Pairs of links more than two apart
are constrained only once they cross (a cutting-plane method): a chain of n links has (n - 2)(n -
3)/2 such pairs, and few of them ever come near each other.
"""

from __future__ import annotations

import time
from dataclasses import replace
from typing import NamedTuple, Protocol

import numpy as np

from colloc.dynamics.control_problem import ControlProblem
from colloc.gaits.gait_fields import AnyGait
from colloc.mechanics.contact import Pairs, far_pairs, link_width, overlapping_pairs
from colloc.numerics.kinks import stationarity_around
from colloc.numerics.sqp import NonlinearProgram, Stationarity, minimize, stationarity
from colloc.reduced.program import ReducedProgram, SearchSpace
from colloc.search.checkpoint import checkpointed
from colloc.search.iterate import STATIONARY, Iterate, iterate_at
from colloc.search.options import (
    MEDIUM,
    OPTIONS,
    TOLERANCES,
    max_rounds,
    objective_accuracy,
)
from colloc.search.spaces import with_far
from colloc.system.errors import NotConvergedError

PHASES = 1000
"""Phases of the solved part of the period at which all pairs of links are checked."""
_FRACTIONS = np.linspace(0.05, 0.95, 19)


class ActiveSetProgram(NonlinearProgram, Protocol):
    """A program whose rows stand at the worst instants of a gait."""

    def place_rows(self, v: np.ndarray) -> float:
        """Move the rows to the worst instants of v; return how far it exceeds any bound there."""

    def follow_worst(self) -> None:
        """Until they are placed again, let rows follow the worst instants of any gait."""


class Subproblem(NamedTuple):
    v: np.ndarray
    objective: float
    conditions: Stationarity
    iterations: int
    hessian: np.ndarray | None


def solve_subproblems(
    program: ActiveSetProgram, v: np.ndarray, kkt: float, hessian: np.ndarray | None = None
) -> Subproblem:
    """Minimise from v ``(n,)``, updating the active instants, until nothing changes."""
    iterations, violation, ends = 0, np.inf, [v]
    program.place_rows(v)
    for _ in range(max_rounds(kkt)):
        before, violation_before, is_fresh = v, violation, hessian is None
        if len(ends) > 1:
            # with the instants fixed, rounds overshoot where they move far with the gait
            program.follow_worst()
        result = minimize(program, v, OPTIONS.radius, objective_accuracy(kkt), curvature=hessian)
        v, iterations = result.v, iterations + result.iterations
        admissible = program.place_rows(v) <= TOLERANCES.violation
        conditions = stationarity(program, v)
        stationary = conditions.kkt_error < kkt
        # an estimate from across kinks may end the search too early
        hessian = result.curvature if stationary else None
        step = np.abs(v - before).max(initial=0.0)
        unchanged = is_fresh and step < TOLERANCES.violation
        if admissible and not result.on_edge and (stationary or unchanged):
            break
        violation = conditions.violation
        change = abs(violation - violation_before)
        if (
            violation > MEDIUM
            and change < OPTIONS.stalled * violation_before
            and not result.on_edge
        ):
            break  # the constraints are infeasible near here
        ends.append(v)
        # the first round, with instants fixed, may leave an optimum that the second comes back to
        if len(ends) > 3 and np.abs(v - ends[-3]).max() < OPTIONS.stalled * step:
            break  # between two worst instants of one cell, where only a finer mesh helps
    return Subproblem(v, result.objective, conditions, iterations, hessian)


@checkpointed
def optimise(
    space: SearchSpace,
    v: np.ndarray,
    delta: float,
    kkt: float,
    hessian: np.ndarray | None = None,
) -> Iterate:
    """Optimum that SQP reaches from parameters v ``(n,)``, not necessarily admissible, at delta (in
    the units of the class); `NotConvergedError` if there is no periodic motion at v."""
    begin = time.perf_counter()
    result, program = _optimise_on(space, v, delta, kkt, hessian)
    while crossing := tuple(p for p in crossing_pairs(space, result.v) if p not in space.far):
        start = last_free(space, v, result.v)
        space = with_far(space, space.far + crossing)
        result, program = _optimise_on(space, start, delta, kkt, None)
    return iterate_at(
        program,
        result.v,
        kkt,
        result.conditions,
        iterations=result.iterations,
        seconds=time.perf_counter() - begin,
        hessian=result.hessian,
    )


def _optimise_on(
    space: SearchSpace, v: np.ndarray, delta: float, kkt: float, hessian: np.ndarray | None
) -> tuple[Subproblem, ReducedProgram]:
    program = ReducedProgram(space, delta)
    if np.isnan(program.objective(v)):
        raise NotConvergedError(f"there is no motion to begin with: {program.motion.kind.lack}.")
    return solve_subproblems(program, v, kkt, hessian), program


def conditions_on_kink(program: NonlinearProgram, v: np.ndarray, kkt: float) -> Stationarity | None:
    """First-order conditions by gradients sampled around v, if they hold there and v lies on a
    kink."""
    conditions = stationarity(program, v)
    # where slopes are small the radius misses the objective by less than an equation may be
    # violated
    radius = max(TOLERANCES.kkt, TOLERANCES.violation / conditions.kkt_error)
    around = stationarity_around(program, v, conditions, min(radius, TOLERANCES.kink), enough=kkt)
    stationary = max(around.kkt_error, around.complementarity) < kkt
    return around if stationary and around.violation < TOLERANCES.kkt else None


def with_kink(iterate: Iterate) -> Iterate:
    """The iterate with its KKT residual replaced by that of sampled gradients if it lies on a
    kink."""
    if iterate.optimal:
        return iterate
    around = conditions_on_kink(iterate.program(), iterate.v, iterate.kkt)
    if around is None:
        return iterate
    step = replace(iterate.step, kkt_error=around.kkt_error, optimal=True, status=STATIONARY)
    return replace(
        iterate,
        kkt_error=around.kkt_error,
        violation=around.violation,
        complementarity=around.complementarity,
        on_kink=True,
        history=(*iterate.history[:-1], step),
    )


class Members(Protocol):
    """Gaits by parameters."""

    @property
    def control(self) -> ControlProblem: ...

    def member(self, parameters: np.ndarray) -> AnyGait: ...


def crossing_pairs(space: Members, v: np.ndarray) -> Pairs:
    """Pairs of links more than two apart that cross in a gait, by plain intersection: the smooth
    clearance keeps a distance that links which only touch do not need."""
    admissible = space.control.admissible
    body, t = admissible.body, np.linspace(0.0, admissible.fraction, PHASES)
    ends = np.stack(body.outline(space.member(v).angles(t)))
    return overlapping_pairs(ends, far_pairs(body), link_width(body), TOLERANCES.violation)


def last_free(space: Members, free: np.ndarray, crossing: np.ndarray) -> np.ndarray:
    """Parameters on the line from a free gait to a crossing one, as far as links stay apart."""
    last = free
    for fraction in _FRACTIONS:
        between = free + fraction * (crossing - free)
        if crossing_pairs(space, between):
            break
        last = between
    return last
