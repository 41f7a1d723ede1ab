"""Projection of a gait to one of its class that does not turn the body.

Where reversed rates reverse the motion, net rotation and displacement are odd under reversal of the
gait. So every retraced gait closes its rotation, goes nowhere and, surrounded by gaits that do not
close, is a critical point of the efficiency. Searches that start far from closure fall into them:
of 75 starts at (1, 1, 1), (3, 1, 1) and (10, 1, 1), 19. So the rotation is closed first, at
constant enclosed area, which a retraced gait lacks: none.
"""

from __future__ import annotations

import numpy as np

from colloc.gaits.gait import delta_per_period
from colloc.gaits.gait_fields import AnyGait
from colloc.gaits.linear import enclosed_area
from colloc.gaits.objective import EFFICIENCY
from colloc.gaits.problem import Problem
from colloc.gaits.symmetry import NONE
from colloc.numerics.sqp import minimize
from colloc.reduced.program import ReducedProgram
from colloc.search.checkpoint import checkpointed
from colloc.search.spaces import space_near

_ACCURACY, _STEPS, _INTERVALS = 1e-8, 30, 30
_FREE_OTHERWISE = {
    "at_least": (),
    "torque_limit": None,
    "power_limit": None,
    "grade": 0.0,
    "towards": None,
}


class _Projection:
    """Minimise |v - target|^2 / 2 subject to the rows of a program and v' A v = target' A
    target."""

    def __init__(self, program: ReducedProgram, target: np.ndarray, area: np.ndarray) -> None:
        self._program, self._target, self._area = program, target, area
        self.lower, self.upper = program.lower, program.upper
        enclosed = target @ area @ target
        self.row_lower = np.append(program.row_lower, enclosed)
        self.row_upper = np.append(program.row_upper, enclosed)

    def objective(self, v: np.ndarray) -> float:
        return 0.5 * float(np.sum((v - self._target) ** 2))

    def gradient(self, v: np.ndarray) -> np.ndarray:
        return v - self._target

    def rows(self, v: np.ndarray) -> np.ndarray:
        return np.append(self._program.rows(v), v @ self._area @ v)

    def row_slopes(self, v: np.ndarray) -> np.ndarray:
        return np.vstack([self._program.row_slopes(v), 2 * self._area @ v])


@checkpointed
def project_to_zero_rotation(
    problem: Problem, gait: AnyGait, delta: float | None = None
) -> AnyGait:
    """A gait near a given one that turns the body as prescribed and encloses the same area.

    The gait itself where a symmetry closes the rotation, nothing prescribes it, or the gait is no
    Fourier series. Delta is in the units of the class, by default the problem's. SQP makes few
    steps: a start need not be perfect.
    """
    seeds = problem.gait.start_class
    if (
        problem.gait.symmetry != NONE
        or problem.rotation is None
        or not gait.is_series
        or not seeds.linear
    ):
        return gait
    delta = delta_per_period(problem.gait, gait, problem.delta if delta is None else delta)
    level = {"gait": seeds, "guess": gait, "intervals": _INTERVALS + 4 * seeds.harmonics}
    level |= _FREE_OTHERWISE
    if problem.regime.free:
        level |= {"objective": EFFICIENCY, "froude": problem.regime.froude}
    space, v = space_near(problem.with_(**level), gait)
    program = ReducedProgram(space, delta)
    # limits of the angles are kept by the search that begins here
    program.place_rows(np.zeros_like(v))
    projection = _Projection(program, v, enclosed_area(seeds, problem.body.n_joint))
    return space.member(minimize(projection, v, np.inf, _ACCURACY, _STEPS).v)
