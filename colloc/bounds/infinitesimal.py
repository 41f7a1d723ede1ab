"""Small gaits at a shape: a linear program over rate directions.

Motions under dry friction are homogeneous of degree 1 in the rates but not linear, so a small
closed path moves the body in first order. It spends times w_i in rate directions r_i, with ``sum
w_i r_i = 0`` (the path closes) and ``sum w_i omega_i = 0`` (so does the rotation); per unit of work
``sum w_i P_i = 1`` it moves ``sum w_i e.v_i`` along e.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from colloc.bounds.coulomb_motion import CoulombMotion
from colloc.numerics.linear_program import linear_maximum


class SmallGait(NamedTuple):
    """The best small gait at a shape."""

    efficiency: float  # d/W as its size tends to zero
    heading: float  # direction of travel in the axes of the middle link [rad]
    rates: np.ndarray  # the directions used, (n_joint, m)
    weights: np.ndarray  # time spent in each, for unit work, (m,)

    def path(self, shape: np.ndarray, size: float, *, back: bool = False) -> np.ndarray:
        """Corners ``(n_joint, m)`` of the closed polygon about `shape` that runs through the
        directions by angle, or `back`."""
        order = np.argsort(np.arctan2(self.rates[-1], self.rates[0]))[:: -1 if back else 1]
        sides = (self.rates * self.weights)[:, order]
        corners = np.cumsum(sides, axis=1)
        corners = corners - corners.mean(axis=1, keepdims=True)
        return shape[:, None] + size * corners / np.linalg.norm(sides, axis=0).sum()


def gain_along(motion: CoulombMotion, heading: float) -> np.ndarray:
    """Velocities along a heading, ``(n,)``."""
    return np.cos(heading) * motion.velocity[0] + np.sin(heading) * motion.velocity[1]


def best_mixture(motion: CoulombMotion, heading: float) -> tuple[float, np.ndarray, np.ndarray]:
    """The linear program over motions at one shape: efficiency along `heading`, weights ``(m,)``
    for unit work, and multipliers of closure, rotation and work."""
    closed = np.vstack([motion.rates, motion.spin, motion.power])
    right = np.zeros(len(closed))
    right[-1] = 1.0
    return linear_maximum(gain_along(motion, heading), closed, right)


def heading_of(motion: CoulombMotion, weights: np.ndarray) -> float:
    """Direction of travel of a mixture, in the axes of its velocities [rad]: it is worth more along
    that than along any other."""
    way = motion.velocity @ weights
    return float(np.arctan2(way[1], way[0]))
