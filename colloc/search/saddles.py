"""Off a saddle: a gait that satisfies the first-order conditions only because its symmetry keeps the search from falling.

A start with more symmetry than its class never leaves it: the gradient has it too. Such a gait may be the best of the symmetric
ones and still no optimum. The curvature (`colloc.reduced.second_order`) shows the way down.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from colloc.reduced.program import ReducedProgram
from colloc.reduced.second_order import curvature
from colloc.search.reduced_search import NEXT_RADIUS, ROUGH, Found, Report, refined, settled_apart

STEPS = (0.1, 0.03, 0.01)
"""Along the direction of smallest curvature, over the length of the parameters' vector: the first that leads down."""
_FALLS = 1e-3
"""A curvature below minus this part of the objective [1/rad^2] is one to follow."""
_TRIES = 3


def off_saddles(found: Found, lacks: str, report: Report) -> tuple[Found, str]:
    """The gait itself if its curvature is not negative, else the optimum below; and what is missing there, or ""."""
    for _ in range(_TRIES):
        below = next(_below(found), None)
        if not found.optimal or below is None:
            break
        found = settled_apart(found.space, below, found.delta, NEXT_RADIUS, ROUGH)
        report(found)
        found, lacks = refined(found, report)
    return found, lacks


def _below(found: Found) -> Iterator[np.ndarray]:
    """Gaits beside a saddle that are better."""
    program = ReducedProgram(found.space, found.delta)
    program.move_checks(found.v)
    here = curvature(program, found.v)
    if here.smallest + here.error < -_FALLS * abs(found.objective):
        for step in STEPS:
            for side in (1.0, -1.0):
                beside = found.v + side * step * np.linalg.norm(found.v) * here.direction
                if program.objective(beside) < found.objective:
                    yield beside
