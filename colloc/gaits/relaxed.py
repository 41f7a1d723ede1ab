"""The class of relaxed gaits: mixtures of a few directions, of given symmetry (`colloc.gaits.mixture`)."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from colloc.gaits.gait import ClassOfGaits
from colloc.gaits.harmonic import Harmonic
from colloc.gaits.paths import Corners
from colloc.gaits.symmetry import BILATERAL, BOTH, NONE, SYMMETRIES
from colloc.system.errors import ProblemError

_PIECES, _PARAMETERS = 240, 400
"""Pieces over a period, and at most so many parameters of the part that is solved: as many as a dense search can take."""


@dataclass(frozen=True)
class Relaxed(ClassOfGaits):
    """Relaxed gaits: at each instant a mixture of a few directions of joint rates, constant on every piece of the period.

    Parameters
    ----------
    directions : int
        At most so many are mixed; ``n_joint + 2`` suffice for any mixture (Caratheodory). One makes a polygon.
    symmetry : {"none", "bilateral", "antipodal", "both"}
        "both" is bilateral and antipodal: q(-t) = S q(t) and q(t + 1/2) = -q(t), with a quarter of the period to solve.

    Examples
    --------
    >>> Relaxed(directions=3, symmetry="both").fraction
    0.25
    """

    directions: int = 3
    symmetry: str = BOTH

    symmetries = (*SYMMETRIES, BOTH)
    unit_speed = True
    mixes = True
    delta_start = 0.01

    def __post_init__(self) -> None:
        if (
            isinstance(self.directions, bool)
            or not isinstance(self.directions, (int, np.integer))
            or not 1 <= self.directions <= 9
        ):
            raise ProblemError(f"gait.directions must be a whole number from 1 to 9, not {self.directions!r}.")
        self._check_symmetry()

    def intervals(self, n_joint: int) -> int:
        """Pieces of the part that is solved."""
        each = self.directions * (2 if n_joint == 2 else 1 + n_joint)
        return max(8, round(min(self.fraction * _PIECES, _PARAMETERS / each)))

    def describe(self) -> str:
        """The class in words, for reports."""
        return f"relaxed gaits that mix {self.directions} directions, symmetry {self.symmetry}"

    def series(self, harmonics: int) -> Harmonic:
        """Fourier series in arc length that stand for the mean shapes of its gaits."""
        return Harmonic(harmonics, self.finite.symmetry)

    # finite gaits that come near: polygons
    @property
    def finite(self) -> Relaxed:
        """The class in the symmetry of its finite gaits: one that has both is kept as a bilateral half."""
        return replace(self, symmetry=BILATERAL) if self.symmetry == BOTH else self

    def size(self, n_joint: int, n_interval: int) -> int:
        """Number of parameters of a polygon of so many straight pieces: its vertices."""
        return n_joint * (n_interval + 1)

    def member(self, parameters: np.ndarray, n_joint: int, edges: np.ndarray) -> Corners:
        """The polygon of a parameter vector; its phases follow from its sides."""
        vertices = parameters.reshape(-1, n_joint).T
        symmetry = self.finite.symmetry
        return Corners(vertices[:, :-1] if symmetry == NONE else vertices, symmetry)
