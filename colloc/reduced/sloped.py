"""The members of a class of harmonics on a slope: a gait that does not say where it points is pointed somewhere."""

from __future__ import annotations

import numpy as np

from colloc.gaits.gait_fields import AnyGait
from colloc.motion.kinds import SlowOnLevel
from colloc.reduced.linear_space import LinearSpace
from colloc.reduced.motion import ReducedMotion


class SlopeSpace(LinearSpace):
    """Members of a class of harmonics on a slope; a gait that does not say where it points is pointed to where it would go,
    on the level, in the direction that counts."""

    def parameters(self, gait: AnyGait) -> np.ndarray:
        v = super().parameters(gait)
        if np.isnan(v[-1]):
            problem, v[-1] = self.problem, 0.0
            kind = SlowOnLevel(problem.body, problem.law, problem.gait.motion_symmetry)
            level = ReducedMotion(kind, self.mesh, self)
            v[-1] = (problem.towards or 0.0) - np.angle(level.at(v, problem.delta_start).pose.place[-1])
        return v

    laid = parameters
