"""The members of a class of harmonics on a slope: a gait that does not say where it points is pointed somewhere."""

from __future__ import annotations

import numpy as np

from colloc.gaits.gait_fields import AnyGait
from colloc.motion.kinds import kind_of_motion
from colloc.reduced.linear_space import LinearSpace
from colloc.reduced.motion import ReducedMotion


class SlopeSpace(LinearSpace):
    """Members of a class of harmonics on a slope; a gait that does not say where it points is pointed to where it would go,
    on the level, in the direction that counts."""

    def parameters(self, gait: AnyGait) -> np.ndarray:
        v = super().parameters(gait)
        if np.isnan(v[-1]):
            dynamics, v[-1] = self.control.dynamics, 0.0
            assert dynamics.slope is not None
            level = ReducedMotion(kind_of_motion(dynamics._replace(slope=None)), self.mesh, self)
            v[-1] = dynamics.slope.ahead - np.angle(level.at(v, self.control.delta_start).pose.place[-1])
        return v

    laid = parameters
