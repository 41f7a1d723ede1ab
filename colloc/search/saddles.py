"""Off a saddle: a gait that satisfies the first-order conditions only because its symmetry keeps the search from falling.

A start with more symmetry than its class never leaves it: the gradient has it too. Such a gait may be the best of the symmetric
ones and still no optimum. The curvature (`colloc.reduced.second_order`) shows the way down. Where rows bind they bend away from
that straight line, so it is the Lagrangian that has to fall along it; what counts is where the search then ends.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from colloc.reduced.program import ReducedProgram
from colloc.reduced.second_order import Lagrangian, curvature
from colloc.search.converge import NEXT_RADIUS, ROUGH, Found, settled_apart

STEPS = (0.1, 0.03, 0.01)
"""Along the direction of smallest curvature, over the length of the parameters' vector: the first that leads down."""
_FALLS = 1e-3
"""A curvature below minus this part of the objective [1/rad^2] is one to follow."""
_GAIN = 1e-7
"""The part of the objective that leaving a saddle has to gain."""


def below_saddle(found: Found) -> Found | None:
    """A better gait that the search comes to from beside a gait of negative curvature; None if there is none."""
    return next(_better(found), None)


def _better(found: Found) -> Iterator[Found]:
    program = ReducedProgram(found.space, found.delta)
    program.place_rows(found.v)
    here = curvature(program, found.v)
    if here.smallest + here.error < -_FALLS * abs(found.objective):
        lagrangian, length = Lagrangian(program, found.v), np.linalg.norm(found.v)
        value = lagrangian.value(found.v)
        ways = [side * step * length * here.direction for step in STEPS for side in (1.0, -1.0)]
        for beside in [found.v + way for way in ways if lagrangian.value(found.v + way) < value]:
            other = settled_apart(found.space, beside, found.delta, NEXT_RADIUS, ROUGH)
            if other.objective < found.objective - _GAIN * abs(found.objective):
                yield other
