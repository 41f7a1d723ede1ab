"""Where a gait points that does not say so, in a motion that depends on it."""

from __future__ import annotations

import numpy as np

from colloc.gaits.control_problem import ControlProblem
from colloc.gaits.regime import LEVEL
from colloc.motion.kinds import kind_of_motion
from colloc.numerics.mesh import Mesh
from colloc.reduced.motion import ReducedMotion, Shapes

_TURNS = 0.25 * np.pi * np.array([0, 1, -1, 2, -2, 3, -3])
"""By which a body is turned that slides down as it points."""


def pointed(control: ControlProblem, mesh: Mesh, shapes: Shapes, v: np.ndarray) -> np.ndarray:
    """Parameters whose last says where the body points: where it would go, on the level, in the
    direction that counts, or as little aside of it as it needs not to slide down. As they are if
    they say so."""
    if not np.isnan(v[-1:]).any():
        return v
    dynamics, delta, v = control.dynamics, control.delta_start, np.append(v[:-1], 0.0)
    level, here = (
        ReducedMotion(kind_of_motion(dynamics._replace(regime=regime)), mesh, shapes)
        for regime in (LEVEL, dynamics.regime)
    )
    v[-1] = dynamics.regime.ahead - np.angle(level.at(v, delta).pose.place[-1])
    beside = (np.append(v[:-1], v[-1] + turn) for turn in _TURNS)
    return next((each for each in beside if np.isfinite(here.values(each, delta)["work"])), v)
