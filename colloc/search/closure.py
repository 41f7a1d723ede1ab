"""Gaits that do not turn the body: the one of a class nearest to a given gait that closes its
rotation.

Where reversing the rates reverses the motion, net rotation and displacement are both odd under
reversal of the gait. So every retraced gait closes its rotation, goes nowhere, and, being
surrounded by gaits that do not close, is a critical point of the efficiency. A search that starts
far from closure falls into them: of 75 starts at (1, 1, 1), (3, 1, 1) and (10, 1, 1), 19. So the
rotation is closed first, at constant area enclosed in the planes of the joints, which is what a
retraced gait lacks: none.
"""

from __future__ import annotations

import numpy as np

from colloc.gaits.gait import delta_per_period
from colloc.gaits.gait_fields import AnyGait
from colloc.gaits.linear import enclosed_area
from colloc.gaits.objective import EFFICIENCY
from colloc.gaits.problem import Problem
from colloc.gaits.symmetry import NONE
from colloc.numerics.sqp import minimised
from colloc.reduced.program import ReducedProgram
from colloc.search.spaces import space_near

_ACCURACY, _STEPS, _INTERVALS = 1e-8, 30, 30
_ELSE_FREE = {
    "at_least": (),
    "torque_limit": None,
    "power_limit": None,
    "grade": 0.0,
    "towards": None,
}


class _Nearest:
    """The rows of a reduced program and the enclosed area; the objective is the squared distance
    from given parameters."""

    def __init__(self, program: ReducedProgram, target: np.ndarray, area: np.ndarray) -> None:
        self._program, self._target, self._area = program, target, area
        self.lower, self.upper = program.lower, program.upper
        enclosed = target @ area @ target
        self.row_lower, self.row_upper = (
            np.append(rows, enclosed) for rows in (program.row_lower, program.row_upper)
        )

    def objective(self, v: np.ndarray) -> float:
        """Half the squared distance."""
        return 0.5 * float(np.sum((v - self._target) ** 2))

    def gradient(self, v: np.ndarray) -> np.ndarray:
        """Of the objective."""
        return v - self._target

    def rows(self, v: np.ndarray) -> np.ndarray:
        """Those of the program, then the area."""
        return np.append(self._program.rows(v), v @ self._area @ v)

    def row_slopes(self, v: np.ndarray) -> np.ndarray:
        """Derivatives of the rows."""
        return np.vstack([self._program.row_slopes(v), 2 * self._area @ v])


def closed_gait(problem: Problem, gait: AnyGait, delta: float | None = None) -> AnyGait:
    """A gait near a given one whose net rotation is as prescribed and that encloses the same area.

    Where a symmetry closes the rotation or nothing prescribes it, and for gaits that are no Fourier
    series or not linear in their parameters, it is the gait itself; those are closed among the
    harmonics of the problem's class, or those its starts are drawn from, at delta in the units of
    the class, by default the problem's. A start need not be perfect: where SQP does not come to
    rest in a few steps, what it has found is returned.
    """
    if (
        problem.gait.symmetry != NONE
        or problem.rotation is None
        or not gait.is_series
        or not problem.gait.seeds.linear
    ):
        return gait
    delta = problem.delta if delta is None else delta
    delta = delta_per_period(problem.gait, gait, delta)
    own = problem.gait.seeds
    paced = (
        {"objective": EFFICIENCY, "froude": problem.regime.froude}
        if problem.regime.free_pace
        else {}
    )
    settings = (
        {"gait": own, "guess": gait, "intervals": _INTERVALS + 4 * own.harmonics}
        | _ELSE_FREE
        | paced
    )
    space, v = space_near(problem.with_(**settings), gait)
    program, area = ReducedProgram(space, delta), enclosed_area(own, problem.body.n_joint)
    # near no limit of the angles: those are kept by the search that begins here
    program.place_rows(np.zeros_like(v))
    return space.member(minimised(_Nearest(program, v, area), v, np.inf, _ACCURACY, _STEPS).v)
