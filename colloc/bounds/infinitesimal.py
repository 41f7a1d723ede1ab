"""Small gaits at a shape: a linear program over rate directions.

A closed path spends times w_i in rate directions r_i, ``sum w_i r_i = 0``, without rotation, ``sum
w_i omega_i = 0``; per unit of work ``sum w_i P_i = 1`` it moves ``sum w_i e.v_i`` along e, which is
of first order, as motions are not linear in the rates.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from colloc.bounds.coulomb_motion import CoulombMotion
from colloc.numerics.linear_program import linear_maximum


class SmallGait(NamedTuple):
    efficiency: float  # d/W as its size tends to zero
    heading: float  # direction of travel in the axes of the middle link [rad]
    rates: np.ndarray  # the directions used, (n_joint, m)
    weights: np.ndarray  # time spent in each, for unit work, (m,)

    def path(self, shape: np.ndarray, size: float, *, back: bool = False) -> np.ndarray:
        """Corners ``(n_joint, m)`` of the closed polygon about `shape` through the directions by
        angle."""
        order = np.argsort(np.arctan2(self.rates[-1], self.rates[0]))[:: -1 if back else 1]
        sides = (self.rates * self.weights)[:, order]
        corners = np.cumsum(sides, axis=1)
        corners = corners - corners.mean(axis=1, keepdims=True)
        return shape[:, None] + size * corners / np.linalg.norm(sides, axis=0).sum()


def gain_along(motion: CoulombMotion, heading: float) -> np.ndarray:
    return np.cos(heading) * motion.velocity[0] + np.sin(heading) * motion.velocity[1]


def best_mixture(motion: CoulombMotion, heading: float) -> tuple[float, np.ndarray, np.ndarray]:
    """Efficiency along `heading`, weights ``(m,)`` for unit work, and multipliers of closure,
    rotation and work."""
    closed = np.vstack([motion.rates, motion.spin, motion.power])
    right = np.zeros(len(closed))
    right[-1] = 1.0
    return linear_maximum(gain_along(motion, heading), closed, right)


def heading_of(motion: CoulombMotion, weights: np.ndarray) -> float:
    """Direction of travel of a mixture [rad]: it is worth more along that than along any other."""
    way = motion.velocity @ weights
    return float(np.arctan2(way[1], way[0]))
