"""The multipliers of the bound's program: the best motion that it knows of, as a measure on shapes,
headings and directions.

The program that bounds the efficiency is the dual of a linear one: of all ways to share out work
among motions (shape, heading of the middle link, direction of the joint rates) so that they close
in the mean, find the one that travels farthest. Its multipliers are that mixture. They say where a
gait should look for its shapes.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from colloc.bounds.coulomb_motion import CoulombMotion
from colloc.gaits.polygon import Corners
from colloc.gaits.symmetry import BILATERAL
from colloc.system.errors import ProblemError

_SECTORS = 24
"""Of the quarter of the plane of two joint angles, in which a measure is averaged to a path."""
_LIGHT = 2e-3


@dataclass(frozen=True, eq=False)
class Measure:
    """A mixture of motions, one of each class of images in the symmetries of body and friction.

    Attributes
    ----------
    motion : CoulombMotion
        Shapes and unit directions.
    heading : (n,)
        Of the middle link [rad]; the body travels along 0.
    weight : (n,)
        Share of the work, of sum 1.
    """

    motion: CoulombMotion
    heading: np.ndarray
    weight: np.ndarray

    @property
    def time(self) -> np.ndarray:
        """Time at unit shape speed that goes with the work, ``(n,)``."""
        return self.weight / self.motion.power

    def efficiency(self) -> float:
        """Distance over work; up to smoothing and tolerances the value of the program."""
        u, v = self.motion.velocity
        return float(self.time @ (np.cos(self.heading) * u - np.sin(self.heading) * v))

    def path(self) -> Corners:
        """A closed path of two joint angles through the mean shapes of the measure, symmetric both
        ways: a start for a search.

        The images of the measure fill four sectors about the straight body; in one of them shapes
        are averaged by their angle about it, from the antidiagonal, where the body is its own image
        backwards, to the diagonal.

        Raises
        ------
        ProblemError
            If there are not two joints, or the measure lies in too few sectors to be a path.
        """
        if len(self.motion.angles) != 2:
            raise ProblemError("a measure shows a path for bodies of two joints only.")
        a, b = self.motion.angles
        across, along = 0.5 * np.abs(a - b), 0.5 * np.abs(a + b)
        turn = np.arctan2(along, across)
        sector = np.minimum((turn * (_SECTORS / (0.5 * np.pi))).astype(int), _SECTORS - 1)
        shapes = []
        for k in range(_SECTORS):
            inside = sector == k
            if self.weight[inside].sum() > _LIGHT:
                share = self.weight[inside] / self.weight[inside].sum()
                shapes.append((share @ across[inside], share @ along[inside]))
        if len(shapes) < 4:
            raise ProblemError(
                "the measure is no path: it lies at a few shapes, which loops about one of them "
                "would use."
            )
        quarter = np.array([(shapes[0][0], 0.0), *shapes, (0.0, shapes[-1][1])]).T
        half = np.stack([quarter[1] + quarter[0], quarter[1] - quarter[0]])
        return Corners(np.concatenate([half, half[::-1, -2::-1]], axis=1), BILATERAL)
