"""Friction gets drier: a gait is followed from the delta at which it was found down to the
problem's, and off any saddle.

A gait may satisfy the first-order conditions only because its symmetry keeps the search from
falling: a start with more symmetry than its class never leaves it, as the gradient has it too. Such
a gait may be the best of the symmetric ones and still no optimum. The curvature
(`colloc.reduced.second_order`) shows the way down. Where rows bind they bend away from that
straight line, so it is the Lagrangian that has to fall along it; what counts is where the search
then ends.
"""

from __future__ import annotations

import numpy as np

from colloc.gaits.problem import Problem
from colloc.reduced.program import ReducedProgram
from colloc.reduced.second_order import Lagrangian, curvature
from colloc.search.converge import converged
from colloc.search.effort import ROUGH, Effort
from colloc.search.optimum import Optimum
from colloc.search.run import this_run

FACTOR = 0.2
"""Of one delta to the one before."""
_STEP = 0.1
"""Along the direction of smallest curvature, over the length of the parameters' vector; its square
where that leads up."""
_LOST = 0.5
"""A gait that loses this part of its value at the next delta owes it to delta."""


def levels(problem: Problem, first: float) -> list[float]:
    """The deltas from a first one down to the problem's."""
    found = [first]
    while found[-1] > problem.delta:
        found.append(max(FACTOR * found[-1], problem.delta))
    return found


def descend(optimum: Optimum, effort: Effort = ROUGH) -> Optimum:
    """The gait at the problem's delta, on the same mesh.

    Parameters
    ----------
    optimum : Optimum
        At a larger delta, or at that one: then it is returned as it is.
    effort : Effort

    Returns
    -------
    Optimum

    Raises
    ------
    NotConvergedError
        If friction does not hold the body on its slope all the way.

    Examples
    --------
    >>> import colloc
    >>> from colloc.search.descend import descend
    >>> from colloc.search.explore import begin_at
    >>> problem = colloc.Problem("quick", gait=colloc.Harmonic(1, "bilateral"), delta=1e-2)
    >>> descend(begin_at(problem, problem.guess)).delta
    0.01
    """
    run, below = this_run(), levels(optimum.problem, optimum.delta)[1:]
    for done, delta in enumerate(below):
        run.told("descend", done, len(below), optimum)
        history = optimum.history
        optimum = converged(optimum.space, optimum.v, delta, effort, optimum.curvature).after(
            *history
        )
    return optimum


def below_saddle(optimum: Optimum) -> Optimum | None:
    """A better gait that the search comes to from beside a gait of negative curvature; None if
    there is none."""
    program = optimum.program()
    here = curvature(program, optimum.v)
    if here.smallest + here.error >= 0:
        return None
    lagrangian, length = Lagrangian(program, optimum.v), np.linalg.norm(optimum.v)
    value = lagrangian.value(optimum.v)
    for step in (_STEP, _STEP**2):
        for side in (1.0, -1.0):
            beside = optimum.v + side * step * length * here.direction
            if lagrangian.value(beside) >= value:
                continue
            other = converged(optimum.space, beside, optimum.delta, ROUGH)
            if other.objective < optimum.objective - ROUGH.accuracy * abs(optimum.objective):
                return other.after(*optimum.history)
    return None


def is_viscous(optimum: Optimum) -> bool:
    """Whether the gait owes its value to delta: at the next one half is lost. Slow parts of a
    retraced gait do that."""
    dry = ReducedProgram(optimum.space, FACTOR * optimum.delta).objective(optimum.v)
    return not dry <= optimum.objective + (1 - _LOST) * abs(optimum.objective)
