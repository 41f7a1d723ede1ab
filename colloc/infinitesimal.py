"""The best infinitesimal gait at a shape: a linear program over rate directions.

Dry friction lets a small closed path in shape space move the body in first order: motions are homogeneous of degree 1 in the
rates but not linear. A small gait spends times w_i in rate directions r_i, with ``sum w_i r_i = 0`` (the path closes) and
``sum w_i omega_i = 0`` (so does the rotation); per unit of work ``sum w_i P_i = 1`` it moves ``sum w_i e.v_i`` along e.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.optimize import linprog

from colloc.body import Chain
from colloc.coulomb_motion import Motion, balanced_motion, unit_directions
from colloc.errors import NotConvergedError
from colloc.friction import Friction


class SmallGait(NamedTuple):
    """The best small gait at a shape.

    efficiency: d/W as its size tends to zero. heading: direction of travel in the axes of the middle link [rad].
    rates ``(n_joint, m)``, weights ``(m,)``: the directions used, and the time spent in each, for unit work.
    """

    efficiency: float
    heading: float
    rates: np.ndarray
    weights: np.ndarray

    def path(self, shape: np.ndarray, size: float) -> np.ndarray:
        """Corners ``(n_joint, m)`` of the closed polygon about `shape` that runs through the directions by angle."""
        order = np.argsort(np.arctan2(self.rates[-1], self.rates[0]))
        sides = (self.rates * self.weights)[:, order]
        corners = np.cumsum(sides, axis=1)
        corners = corners - corners.mean(axis=1, keepdims=True)
        return shape[:, None] + size * corners / np.linalg.norm(sides, axis=0).sum()


_REFINEMENTS = 4


def _turned(angles: np.ndarray, rates: np.ndarray, turn: float) -> tuple[np.ndarray, np.ndarray]:
    """The shape, and directions of two joint rates on both sides of the given ones."""
    c, s = np.cos(turn), np.sin(turn)
    both = np.concatenate([np.array([[c, -s], [s, c]]) @ rates, np.array([[c, s], [-s, c]]) @ rates], axis=1)
    return np.repeat(angles[:, :1], both.shape[1], axis=1), both


def _best(motion: Motion, heading: float) -> tuple[float, np.ndarray]:
    along = np.cos(heading) * motion.velocity[0] + np.sin(heading) * motion.velocity[1]
    closed = np.vstack([motion.rates, motion.spin, motion.power])
    right = np.zeros(len(closed))
    right[-1] = 1.0
    program = linprog(-along, A_eq=closed, b_eq=right, bounds=(0, None), method="highs-ds")
    if program.status != 0:
        raise NotConvergedError(f"the linear program of the small gait failed: {program.message}")
    return -program.fun, program.x


def small_gait(body: Chain, friction: Friction, shape: np.ndarray, directions: int = 180, headings: int = 12) -> SmallGait:
    """Best infinitesimal gait at one shape ``(n_joint,)``, any order of the directions being equivalent at first order.

    `directions` are spread over all senses of the rates, `headings` over half a turn (a whole one where mu_b differs from
    mu_f); then both are refined about the best ones.
    """
    rates = unit_directions(body.n_joint, directions, half=False)
    angles = np.repeat(np.asarray(shape, dtype=float)[:, None], rates.shape[1], axis=1)
    motion = balanced_motion(body, friction, angles, rates)
    turn = np.pi if friction.reversible else 2 * np.pi
    tried = np.arange(headings) * turn / headings
    best = max(((*_best(motion, float(h)), float(h)) for h in tried), key=lambda item: item[0])
    for level in range(1, _REFINEMENTS + 1):
        if body.n_joint == 2:
            used = motion.rates[:, best[1] > 1e-9 * best[1].max()]
            motion = motion.joined(balanced_motion(body, friction, *_turned(angles, used, 2 * np.pi / directions / 2**level)))
        near = best[2] + np.array([-1.0, 0.0, 1.0]) * 0.5**level * turn / headings
        best = max(((*_best(motion, float(h)), float(h)) for h in near), key=lambda item: item[0])
    value, weights, heading = best
    used = weights > 1e-9 * weights.max()
    return SmallGait(float(value), heading, motion.rates[:, used], weights[used])
