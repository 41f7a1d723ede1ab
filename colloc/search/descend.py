"""Continuation in delta, from the one at which a gait was found down to the problem's, and descent
from saddles.

A start with more symmetry than its class never leaves it, as the gradient has that symmetry too: it
may satisfy the first-order conditions and be a saddle. The direction of negative curvature leads
away. Where rows bind they bend away from that line, so it is the Lagrangian that has to fall.
"""

from __future__ import annotations

import numpy as np

from colloc.gaits.problem import Problem
from colloc.reduced.program import ReducedProgram
from colloc.reduced.second_order import curvature
from colloc.search.checkpoint import active_run
from colloc.search.converge import optimise
from colloc.search.iterate import Iterate
from colloc.search.options import MEDIUM, OPTIONS, objective_accuracy


def delta_levels(problem: Problem, first: float) -> list[float]:
    """Deltas from a first one down to the problem's."""
    levels = [first]
    while levels[-1] > problem.delta:
        levels.append(max(OPTIONS.delta_ratio * levels[-1], problem.delta))
    return levels


def descend(iterate: Iterate) -> Iterate:
    """The gait at the problem's delta, on the same mesh; `NotConvergedError` if there is no
    periodic motion on the way.

    Examples
    --------
    >>> import colloc
    >>> from colloc.search.descend import descend
    >>> from colloc.search.explore import first_optimum
    >>> problem = colloc.Problem("quick", gait=colloc.Harmonic(1, "bilateral"), delta=1e-2)
    >>> descend(first_optimum(problem, problem.guess)).delta
    0.01
    """
    levels = delta_levels(iterate.problem, iterate.delta)[1:]
    for done, delta in enumerate(levels):
        active_run().report("descend", done, len(levels), iterate)
        lower = optimise(iterate.space, iterate.v, delta, MEDIUM, iterate.hessian)
        iterate = lower.after(iterate.history)
    return iterate


def leave_saddle(iterate: Iterate) -> Iterate | None:
    """A better gait reached along the direction of negative curvature; None if there is none."""
    program = iterate.program()
    here = curvature(program, iterate.v)
    if here.smallest + here.error >= 0:
        return None
    size, value = np.linalg.norm(iterate.v), here.lagrangian(iterate.v)
    for step in (OPTIONS.saddle_step, OPTIONS.saddle_step**2):
        for side in (1.0, -1.0):
            start = iterate.v + side * step * size * here.direction
            if here.lagrangian(start) >= value:
                continue
            other = optimise(iterate.space, start, iterate.delta, MEDIUM)
            gain = objective_accuracy(MEDIUM) * abs(iterate.objective)
            if other.objective < iterate.objective - gain:
                return other.after(iterate.history)
    return None


def regularisation_dominated(iterate: Iterate) -> bool:
    """True if the gait loses half of its value at the next delta, as slow parts of a retraced gait
    do."""
    drier = ReducedProgram(iterate.space, OPTIONS.delta_ratio * iterate.delta)
    kept = (1 - OPTIONS.lost) * abs(iterate.objective)
    return not drier.objective(iterate.v) <= iterate.objective + kept
