"""The class of relaxed gaits: mixtures of a few directions, of given symmetry (`colloc.gaits.mixture`)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from colloc.gaits.harmonic import Harmonic
from colloc.gaits.symmetry import BILATERAL, BOTH, SYMMETRIES, fraction
from colloc.system.errors import ProblemError

_PIECES, _PARAMETERS = 240, 400
"""Pieces over a period, and at most so many parameters of the part that is solved: as many as a dense search can take."""


@dataclass(frozen=True)
class Relaxed:
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

    free = True
    unit_speed = True
    mixes = True
    delta_start = 0.01
    moves_knots = False
    of_arcs = False

    def __post_init__(self) -> None:
        if (
            isinstance(self.directions, bool)
            or not isinstance(self.directions, (int, np.integer))
            or not 1 <= self.directions <= 9
        ):
            raise ProblemError(f"gait.directions must be a whole number from 1 to 9, not {self.directions!r}.")
        if self.symmetry not in (*SYMMETRIES, BOTH):
            raise ProblemError(f"gait.symmetry must be one of {', '.join((*SYMMETRIES, BOTH))}, not {self.symmetry!r}.")

    @property
    def fraction(self) -> float:
        """The part of the period that has to be solved; symmetry gives the rest."""
        return fraction(self.symmetry)

    def intervals(self, n_joint: int) -> int:
        """Pieces of the part that is solved."""
        each = self.directions * (2 if n_joint == 2 else 1 + n_joint)
        return max(8, round(min(self.fraction * _PIECES, _PARAMETERS / each)))

    def describe(self) -> str:
        """The class in words, for reports."""
        return f"relaxed gaits that mix {self.directions} directions, symmetry {self.symmetry}"

    def fewest_intervals(self, per_interval: int) -> tuple[int, str]:
        """Pieces that a mesh needs at least, and for what."""
        return 4, "a path"

    def series(self, harmonics: int) -> Harmonic:
        """Fourier series in arc length that stand for the mean shapes of its gaits."""
        return Harmonic(harmonics, BILATERAL if self.symmetry == BOTH else self.symmetry)
