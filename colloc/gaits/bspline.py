"""Gaits whose joint angles are periodic B-splines of the phase, on evenly spaced knots.

Function i is the cardinal B-spline of the degree, centred at phase i / knots (C. de Boor, A
Practical Guide to Splines, 2001). It differs from 0 on degree + 1 intervals between knots, so one
coefficient changes a part of the period alone, which no harmonic does.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from colloc.gaits.harmonic import Harmonic, series_of
from colloc.gaits.linear import LinearClass
from colloc.gaits.symmetry import ANTIPODAL
from colloc.system.arguments import is_whole, named_arguments
from colloc.system.errors import ProblemError

_DRAWN = 3
"""Harmonics, at most, through which starts are drawn: coefficients by chance would make rough
gaits."""


@named_arguments
@dataclass(frozen=True)
class BSpline(LinearClass):
    """The class of gaits whose joint angles are periodic B-splines in time.

    A joint has as many coefficients as the spline has knots.

    Parameters
    ----------
    knots : int
        In a period, evenly spaced; more than the degree, 64 at most, and an even number for
        antipodal gaits.
    degree : int
        Of the polynomials between knots, 3 to 5; its derivatives below the degree are continuous.
    symmetry : {"none", "bilateral", "antipodal"}

    Raises
    ------
    ProblemError
        If there are no such splines.

    Examples
    --------
    >>> from colloc import BSpline
    >>> BSpline(knots=12, symmetry="bilateral").describe()
    'periodic B-splines of degree 4, 12 knots, symmetry bilateral'
    >>> BSpline(knots=8, symmetry="bilateral").size(n_joint=2)
    8
    """

    knots: int = 8
    degree: int = 4
    symmetry: str = "none"

    series = series_of

    def __post_init__(self) -> None:
        if not is_whole(self.degree, 3, 5):
            raise ProblemError(f"gait.degree must be 3, 4 or 5, not {self.degree!r}.")
        if not is_whole(self.knots, self.degree + 1, 64):
            raise ProblemError(
                f"gait.knots must be an integer from degree + 1 = {self.degree + 1} to 64, not "
                f"{self.knots!r}."
            )
        self._check_symmetry()
        if self.symmetry == ANTIPODAL and self.knots % 2:
            raise ProblemError(
                f"antipodal splines repeat after half a period: give them an even number of knots, "
                f"not {self.knots}."
            )

    @property
    def harmonics(self) -> int:  # type: ignore[override]
        """As many waves as so many knots resolve."""
        return self.knots // 2

    def functions(self, t: np.ndarray, derivative: int = 0) -> np.ndarray:
        """``(knots, n_time)``: the B-splines at phases t, or their derivatives per period."""
        from scipy.interpolate import BSpline as Piecewise

        one = Piecewise.basis_element(np.arange(self.degree + 2), extrapolate=False)
        since = (
            self.knots * t - np.arange(self.knots)[:, None] + 0.5 * (self.degree + 1)
        ) % self.knots
        return self.knots**derivative * np.nan_to_num(one(since, nu=derivative), nan=0.0)

    def describe(self) -> str:
        return (
            f"periodic B-splines of degree {self.degree}, {self.knots} knots, symmetry "
            f"{self.symmetry}"
        )

    @property
    def _smooth(self) -> Harmonic:
        """What starts are drawn through."""
        return self.series(min(self.harmonics, _DRAWN))

    def dimension(self, n_joint: int) -> int:
        return self._smooth.dimension(n_joint)

    def drawn(self, unit: np.ndarray, n_joint: int) -> Any:
        return self._smooth.drawn(unit, n_joint)

    def moved(self, gait: Any, step: float, fall: int, rng: np.random.Generator) -> Any:
        """The member nearest to a gait, moved by smooth waves by chance: all finer features
        stay."""
        rest = self._smooth.fourier(np.zeros(self._smooth.size(gait.n_joint)), gait.n_joint)
        by = self.parameters(self._smooth.moved(rest, step, fall, rng))
        return self.member(self.parameters(self.through(gait)) + by, gait.n_joint)
