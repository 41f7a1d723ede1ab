"""Initial heading of a gait that does not state one."""

from __future__ import annotations

import numpy as np

from colloc.dynamics.control_problem import ControlProblem
from colloc.dynamics.kinds import kind_of_motion
from colloc.gaits.regime import LEVEL
from colloc.numerics.mesh import Mesh
from colloc.reduced.motion import ReducedMotion, Shapes

_TURNS = 0.25 * np.pi * np.array([0, 1, -1, 2, -2, 3, -3])
"""Turns [rad] tried where the body slides down."""


def with_heading(control: ControlProblem, mesh: Mesh, shapes: Shapes, v: np.ndarray) -> np.ndarray:
    """Parameters with the initial heading last: the one that travels as asked on the level, or the
    nearest at which the body does not slide down."""
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
