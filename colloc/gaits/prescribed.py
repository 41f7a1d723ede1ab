"""The class without parameters, of a body whose motion is prescribed: its shape coordinates are the
phase as a point on a circle, ``(cos 2 pi t, sin 2 pi t)``."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from colloc.gaits.gait import ANTIPODAL, NONE, GaitFunction, both_halves
from colloc.gaits.harmonic import Fourier, series_of
from colloc.gaits.linear import LinearClass
from colloc.system.errors import ProblemError

_INTERVALS_A_STAGE = 4
_CIRCLE = Fourier(np.zeros(2), np.array([[1.0], [0.0]]), np.array([[0.0], [1.0]]))


@dataclass(frozen=True, eq=False, repr=False)
class Phases(GaitFunction):
    """A body's run through its phases; `schedule` as `Prescribed.stages`."""

    schedule: tuple[float, ...] = (0.0, 1.0)
    symmetry: str = NONE

    shape_speed = 1.0
    n_joint = 2

    def __post_init__(self) -> None:
        object.__setattr__(self, "schedule", tuple(float(t) for t in self.schedule))

    @property
    def corner_phases(self) -> np.ndarray:
        return both_halves(self.symmetry, np.array(self.schedule))

    def __call__(self, t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return _CIRCLE(t)


@dataclass(frozen=True)
class Prescribed(LinearClass):
    """The class of a prescribed motion.

    Parameters
    ----------
    stages : tuple of float
        Phases from 0 to the solved part of the period, between which the motion is smooth.
    symmetry : {"none", "antipodal"}
        Antipodal: the second half period is the mirror image of the first.
    """

    stages: tuple[float, ...] = (0.0, 1.0)
    symmetry: str = NONE

    free, harmonics = False, 1
    series = series_of

    def __post_init__(self) -> None:
        stages = tuple(float(t) for t in self.stages)
        object.__setattr__(self, "stages", stages)
        if self.symmetry not in (NONE, ANTIPODAL):
            raise ProblemError(
                f"gait.symmetry must be one of none, antipodal, not {self.symmetry!r}."
            )
        ends = (stages[0], stages[-1]) if len(stages) > 1 else ()
        if ends != (0.0, self.fraction) or min(np.diff(stages)) <= 0:
            raise ProblemError(
                f"gait.stages must ascend from 0 to {self.fraction:g}, not {stages}."
            )

    @property
    def pieces(self) -> np.ndarray:
        return np.array(self.stages)

    def intervals(self, n_joint: int) -> int:
        return _INTERVALS_A_STAGE * (len(self.stages) - 1)

    def fewest_intervals(self, per_interval: int) -> tuple[int, str]:
        return len(self.stages) - 1, "the stages"

    def describe(self) -> str:
        return f"a prescribed motion, symmetry {self.symmetry}"

    def _basis(self, n_joint: int) -> np.ndarray:
        return np.empty((0, 0))

    def member(self, parameters: np.ndarray, n_joint: int) -> Phases:
        return Phases(self.stages, self.symmetry)

    def through(self, gait: Any) -> Any:
        return gait
