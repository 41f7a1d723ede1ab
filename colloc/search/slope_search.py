"""The gait of a problem's class that climbs a slope at the least work: the same search, with a slope in the problem."""

from __future__ import annotations

from colloc.gaits.problem import Problem
from colloc.results.solution import Solution
from colloc.search.solve import best_gait


def climbing_gait(problem: Problem, grade: float, *, towards: float | None = None, starts: int | None = None) -> Solution:
    """`best_gait` of a problem with a slope put under it, on the mesh and from the delta that are usual there.

    Parameters
    ----------
    problem : Problem
    grade, towards : float
        As of a `Problem`.
    starts : int, optional

    Examples
    --------
    >>> import colloc
    >>> problem = colloc.Problem("steep", gait=colloc.Harmonic(1, "bilateral"), delta=1e-2)
    >>> found = colloc.climbing_gait(problem, grade=0.1, starts=2)
    >>> found.status, round(found.certificate.value, 2)
    ('solved', 0.09)
    """
    return best_gait(problem.with_(grade=grade, towards=towards, intervals=None, delta_start=None), starts)
