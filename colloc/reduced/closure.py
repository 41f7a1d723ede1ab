"""The gait of a class nearest to a given one that does not turn the body, whatever the law of friction."""

from __future__ import annotations

import numpy as np

from colloc.gaits.gait_fields import AnyGait
from colloc.gaits.problem import Problem
from colloc.gaits.symmetry import NONE
from colloc.numerics.sqp import minimised
from colloc.reduced.program import ReducedProgram
from colloc.reduced.spaces import space_near

_ACCURACY, _STEPS = 1e-10, 30


class _Nearest:
    """The rows of a reduced program, with the squared distance from given parameters as its objective."""

    def __init__(self, program: ReducedProgram, target: np.ndarray) -> None:
        self._target = target
        self.lower, self.upper, self.row_lower, self.row_upper = (
            program.lower, program.upper, program.row_lower, program.row_upper,
        )  # fmt: skip
        self.rows, self.row_slopes = program.rows, program.row_slopes

    def objective(self, v: np.ndarray) -> float:
        """Half the squared distance."""
        return 0.5 * float(np.sum((v - self._target) ** 2))

    def gradient(self, v: np.ndarray) -> np.ndarray:
        """Of the objective."""
        return v - self._target


def closed_gait(problem: Problem, gait: AnyGait) -> AnyGait:
    """The member of a problem's class near a gait whose net rotation vanishes, at the problem's delta.

    Where a symmetry closes the rotation it is the nearest member. A start need not be perfect: where SQP does not come to rest
    in a few steps, what it has found is returned.

    Raises
    ------
    NotConvergedError
        If no path of the class is found near the gait.
    """
    space, v = space_near(problem, gait)
    if problem.gait.symmetry == NONE:
        v = minimised(_Nearest(ReducedProgram(space, problem.delta), v), v, np.inf, _ACCURACY, _STEPS).v
    return space.member(v)
