"""Where a bound is sampled: a lattice of shapes and rate directions, refined where the bound is nearly attained."""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np

from colloc.body import Chain
from colloc.coulomb_motion import Motion, admissible, balanced_motion, fundamental, unit_directions
from colloc.friction import Friction

OVERLAP = 0.1
"""Samples reach this angle [rad] beyond shapes whose links touch, so that the edge of the admissible set is covered."""


@dataclass(frozen=True)
class Domain:
    """The gaits a bound speaks of.

    Parameters
    ----------
    body : Chain
    friction : Friction
    joint_limit : float
        Largest |joint angle| [rad].
    """

    body: Chain
    friction: Friction
    joint_limit: float

    def keeps(self, angles: np.ndarray, overlap: float = OVERLAP) -> np.ndarray:
        """Mask of shapes to sample: within the limits, links not crossing, one of each class of mirror images."""
        inside = (np.abs(angles) <= self.joint_limit + 1e-12).all(axis=0)
        return inside & admissible(self.body, angles, overlap) & fundamental(self.body, angles)

    def motion(self, angles: np.ndarray, rates: np.ndarray) -> Motion:
        """Balanced motions; with directed friction the end swap reverses time, so both senses of every rate are sampled."""
        return balanced_motion(self.body, self.friction, angles, rates)

    def lattice(self, shapes: int, directions: int, overlap: float = OVERLAP) -> Motion:
        """Motions on a lattice of `shapes` + 1 values of every joint angle and about `directions` rate directions."""
        axis = np.linspace(-self.joint_limit, self.joint_limit, shapes + 1)
        angles = np.stack([a.ravel() for a in np.meshgrid(*[axis] * self.body.n_joint, indexing="ij")])
        angles = angles[:, self.keeps(angles, overlap)]
        rates = unit_directions(self.body.n_joint, directions, self.friction.reversible)
        return self.motion(np.repeat(angles, rates.shape[1], axis=1), np.tile(rates, angles.shape[1]))

    def refined(self, motion: Motion, near: np.ndarray, spacing: float, turn: float) -> Motion:
        """New motions around the chosen ones: shapes shifted by 0 or +-spacing, directions turned by 0 or +-turn."""
        steps = np.array(list(itertools.product((-1.0, 0.0, 1.0), repeat=self.body.n_joint))).T
        angles, rates = motion.angles[:, near], motion.rates[:, near]
        shifted = (angles[:, :, None] + spacing * steps[:, None, :]).reshape(len(angles), -1)
        rates = np.repeat(rates, steps.shape[1], axis=1)
        turned = [rates]
        for i, j in itertools.combinations(range(len(rates)), 2):
            for sign in (-turn, turn):
                other = rates.copy()
                other[i] = np.cos(sign) * rates[i] - np.sin(sign) * rates[j]
                other[j] = np.sin(sign) * rates[i] + np.cos(sign) * rates[j]
                turned.append(other)
        rates = np.concatenate(turned, axis=1)
        angles = np.tile(shifted, len(turned))
        kept = self.keeps(angles)
        angles, rates = angles[:, kept], rates[:, kept]
        old = _keys(motion.angles, motion.rates, spacing, turn)
        new = _keys(angles, rates, spacing, turn)
        _, first = np.unique(np.concatenate([old, new]), axis=0, return_index=True)
        fresh = np.sort(first[first >= len(old)]) - len(old)
        return self.motion(angles[:, fresh], rates[:, fresh])


def _keys(angles: np.ndarray, rates: np.ndarray, spacing: float, turn: float) -> np.ndarray:
    """Integers that agree for samples at the same place of a lattice, ``(n, 2 n_joint)``."""
    return np.rint(np.concatenate([angles / (0.5 * spacing), rates / (0.5 * turn)])).astype(np.int64).T
