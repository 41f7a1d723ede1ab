"""The members of a class of harmonics on a slope: a gait that does not say where it points is pointed somewhere."""

from __future__ import annotations

import numpy as np

from colloc.gaits.gait_fields import AnyGait
from colloc.gaits.regime import LEVEL
from colloc.motion.kinds import kind_of_motion
from colloc.reduced.linear_space import LinearSpace
from colloc.reduced.motion import ReducedMotion

_TURNS = 0.25 * np.pi * np.array([0, 1, -1, 2, -2, 3, -3])
"""By which a body is turned that slides down as it points."""


class SlopeSpace(LinearSpace):
    """Members of a class of harmonics on a slope; a gait that does not say where it points is pointed to where it would go,
    on the level, in the direction that counts, or as little aside of it as it needs not to slide down."""

    def parameters(self, gait: AnyGait) -> np.ndarray:
        v = super().parameters(gait)
        if np.isnan(v[-1]):
            dynamics, delta, v[-1] = self.control.dynamics, self.control.delta_start, 0.0
            level, here = (
                ReducedMotion(kind_of_motion(dynamics._replace(regime=regime)), self.mesh, self)
                for regime in (LEVEL, dynamics.regime)
            )
            v[-1] = dynamics.regime.ahead - np.angle(level.at(v, delta).pose.place[-1])
            beside = (np.append(v[:-1], v[-1] + turn) for turn in _TURNS)
            v = next((each for each in beside if np.isfinite(here.values(each, delta)["work"])), v)
        return v

    laid = parameters
