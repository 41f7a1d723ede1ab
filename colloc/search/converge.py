"""A gait optimised at one delta on one mesh, in the reduced space, by quasi-Newton SQP: what every
stage of a search repeats.

The gait is optimised within a box round the last one, with the shape checks at their worst
instants; they are moved, and the gait optimised again, until checks, box and gait rest.

Links more than two apart are kept from crossing only where they turn out to cross. A chain of n
links has (n - 2)(n - 3)/2 such pairs and few of them ever come near each other. So a problem is
solved without them, the gait is checked against every pair, the pairs that cross are constrained
from then on, and the problem is solved again (a cutting-plane method).
"""

from __future__ import annotations

import time
from dataclasses import replace
from typing import NamedTuple, Protocol

import numpy as np

from colloc.gaits.control_problem import ControlProblem
from colloc.gaits.gait_fields import AnyGait
from colloc.mechanics.bodies import Pairs
from colloc.mechanics.contact import overlapping_pairs
from colloc.numerics.kinks import stationarity_around
from colloc.numerics.sqp import NonlinearProgram, Stationarity, minimised, stationarity
from colloc.reduced.program import ReducedProgram, SearchSpace
from colloc.results.answer import Step
from colloc.search.certify import EXACT, VIOLATION
from colloc.search.effort import ROUGH, Effort
from colloc.search.optimum import Optimum, replace_keeping_space
from colloc.search.run import this_run
from colloc.search.spaces import with_far
from colloc.system.errors import NotConvergedError

BOX = 1.0
"""How far a parameter may go in one round [rad]: as far as an optimum moves, not so far that a step
ends in another world. A gait that ends on the edge of its box goes on from there."""
STATIONARY, NOT_STATIONARY = "stationary", "not stationary"
_SLOW = 0.1
"""A round that changes the violation by less than this part of it, or ends nearer than this part of
its way to where the one before began, is the last: the rows contradict each other, or the gait goes
to and fro between two worst instants of a cell."""
_WIDEST = 1e-5
"""Radius [rad] of the ball in which gradients are sampled at a suspected kink, at most: where the
slopes are so small that the objective is missed by less than an equation may be violated. It is as
exact as a gait has to be elsewhere."""
PHASES = 1000
"""Phases of the solved part of the period at which all pairs of links are checked; the certificate
checks 20000 a period."""
_FRACTIONS = np.linspace(0.05, 0.95, 19)


class Placed(NonlinearProgram, Protocol):
    """A program whose rows depend on where the gait is worst."""

    @property
    def space(self) -> SearchSpace: ...

    def place_rows(self, v: np.ndarray) -> float:
        """Place them for v; how far it exceeds any bound there."""

    def follow_worst(self) -> None:
        """Until then, they move with the worst instants."""


class Rested(NamedTuple):
    """Where a program came to rest: parameters, objective, first-order conditions, counts, and what
    is known of curvature."""

    v: np.ndarray
    objective: float
    conditions: Stationarity
    iterations: int
    evaluations: int
    curvature: np.ndarray | None


def at_rest(
    program: Placed,
    v: np.ndarray,
    effort: Effort,
    curvature: np.ndarray | None = None,
) -> Rested:
    """Optimise from v ``(n,)`` until rows, box and gait rest, as exactly as an equation has to
    hold, or for as many rounds as the effort allows."""
    iterations = evaluations = 0
    program.place_rows(v)
    violation, ends = np.inf, [v]
    for _ in range(effort.rounds):
        before, worse = v, violation
        fresh = curvature is None
        if len(ends) > 1:
            # with the instants held, every round overshoots where they move far with the gait
            program.follow_worst()
        result = minimised(program, v, BOX, effort.accuracy, curvature=curvature)
        v, iterations, evaluations = (
            result.v,
            iterations + result.iterations,
            evaluations + result.evaluations,
        )
        admissible = program.place_rows(v) <= VIOLATION
        conditions = stationarity(program, v)
        stationary = conditions.kkt_error < effort.kkt_error
        # what was learned across kinks may end the search too early: then it begins anew
        curvature = result.curvature if stationary else None
        if (
            admissible
            and not result.on_edge
            and (stationary or (fresh and np.abs(v - before).max() < VIOLATION))
        ):
            break
        violation = conditions.violation
        if (
            violation > ROUGH.kkt_error
            and abs(violation - worse) < _SLOW * worse
            and not result.on_edge
        ):
            break  # the rows contradict each other near here
        ends.append(v)
        # the first round, with instants held, may have left an optimum that the second comes back
        # to
        if len(ends) > 3 and np.abs(v - ends[-3]).max() < _SLOW * np.abs(v - before).max():
            break  # between two worst instants of one cell, where only finer cells help
    return Rested(v, result.objective, conditions, iterations, evaluations, curvature)


def optimum_at(
    program: ReducedProgram,
    v: np.ndarray,
    effort: Effort,
    conditions: Stationarity,
    *,
    iterations: int = 0,
    seconds: float = 0.0,
    curvature: np.ndarray | None = None,
) -> Optimum:
    """The value of a gait with given first-order conditions, whose rows are placed."""
    space, gait, objective = program.space, program.space.member(v), program.objective(v)
    kept = max(conditions.kkt_error, conditions.complementarity) < effort.kkt_error
    period = program.period(v)
    step = Step(
        program.delta,
        space.mesh.n,
        *(program.stated(objective), period["distance"], period["work"], conditions.kkt_error),
        optimal=kept,
        status=STATIONARY if kept else NOT_STATIONARY,
        iterations=iterations,
        seconds=seconds,
    )
    found = Optimum(
        space.control.problem,
        space.given,
        v,
        gait,
        *(
            program.delta,
            objective,
            conditions.kkt_error,
            conditions.violation,
            conditions.complementarity,
        ),
        effort=effort,
        iterations=iterations,
        seconds=seconds,
        step=step,
        curvature=curvature,
        history=(step,),
    )
    found.__dict__["space"] = space
    return found


def as_it_is(space: SearchSpace, v: np.ndarray, delta: float) -> Optimum:
    """A gait that nothing was optimised at, to go on from."""
    program = ReducedProgram(space, delta)
    program.place_rows(v)
    return optimum_at(program, v, ROUGH, stationarity(program, v))


def converged(
    space: SearchSpace,
    v: np.ndarray,
    delta: float,
    effort: Effort,
    curvature: np.ndarray | None = None,
) -> Optimum:
    """The gait where SQP comes to rest at one delta on one mesh.

    Parameters
    ----------
    space : SearchSpace
        A class of gaits on a mesh.
    v : (n,)
        Where it begins; need not be a member of the class.
    delta : float
        In the units of the class.
    effort : Effort
    curvature : (n, n), optional
        What is known of the Lagrangian's second derivatives.

    Raises
    ------
    NotConvergedError
        If friction does not hold the body on its slope all the way.
    """
    given = (space.control.problem, space.given, v, delta, effort, curvature)

    def compute() -> Optimum:
        begin, here = time.perf_counter(), space
        rested, program = _rested(here, v, delta, effort, curvature)
        while new := tuple(p for p in crossing_pairs(here, rested.v) if p not in here.given.far):
            free = last_free(here, v, rested.v)
            here = with_far(here, here.given.far + new)
            rested, program = _rested(here, free, delta, effort, None)
        return optimum_at(
            program,
            rested.v,
            effort,
            rested.conditions,
            iterations=rested.iterations,
            seconds=time.perf_counter() - begin,
            curvature=rested.curvature,
        )

    return this_run().kept("converged", given, compute)


def _rested(
    space: SearchSpace, v: np.ndarray, delta: float, effort: Effort, curvature: np.ndarray | None
) -> tuple[Rested, ReducedProgram]:
    program = ReducedProgram(space, delta)
    if np.isnan(program.objective(v)):
        raise NotConvergedError(f"there is no motion to begin with: {program.motion.kind.lack}.")
    return at_rest(program, v, effort, curvature), program


def conditions_on_kink(
    program: NonlinearProgram, v: np.ndarray, effort: Effort
) -> Stationarity | None:
    """First-order conditions that hold by the gradients around v, where they do not hold by that at
    v: it lies on a kink."""
    conditions = stationarity(program, v)
    radius = min(max(EXACT, VIOLATION / conditions.kkt_error), _WIDEST)
    around = stationarity_around(program, v, conditions, radius, enough=effort.kkt_error)
    holds = (
        max(around.kkt_error, around.complementarity) < effort.kkt_error
        and around.violation < EXACT
    )
    return around if holds else None


def with_kink(optimum: Optimum) -> Optimum:
    """The same; where the conditions do not hold at the gait but around it, it rests on a kink, and
    they are those."""
    around = (
        None
        if optimum.optimal
        else conditions_on_kink(optimum.program(), optimum.v, optimum.effort)
    )
    if around is None:
        return optimum
    step = replace(optimum.step, kkt_error=around.kkt_error, optimal=True, status=STATIONARY)
    return replace_keeping_space(
        optimum,
        kkt_error=around.kkt_error,
        violation=around.violation,
        complementarity=around.complementarity,
        on_kink=True,
        step=step,
        history=(*optimum.history[:-1], step),
    )


class Members(Protocol):
    """A class of gaits by parameters."""

    @property
    def control(self) -> ControlProblem: ...

    def member(self, parameters: np.ndarray) -> AnyGait:
        """The gait of a parameter vector."""


def crossing_pairs(space: Members, v: np.ndarray) -> Pairs:
    """Pairs of links more than two apart that cross, or pass through each other, in a gait.

    Judged by plain intersection: the smooth `mechanics.contact.clearance` keeps a small distance,
    and constraining pairs that only touch makes problems harder for nothing (a folded chain of
    equal links has such contacts).
    """
    admissible = space.control.admissible
    body, t = admissible.body, np.linspace(0.0, admissible.gait.fraction, PHASES)
    ends = np.stack(body.outline(space.member(v).angles(t)))
    return overlapping_pairs(ends, body.far_pairs, body.drawn_width, VIOLATION)


def last_free(space: Members, free: np.ndarray, crossing: np.ndarray) -> np.ndarray:
    """Gait parameters on the way from those of a free gait to those of one with crossing links, as
    far as links stay apart."""
    last = free
    for fraction in _FRACTIONS:
        between = free + fraction * (crossing - free)
        if crossing_pairs(space, between):
            break
        last = between
    return last
