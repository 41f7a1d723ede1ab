"""The class of gaits with nothing free: a body whose motion is prescribed runs through its phases.

The shape coordinates of such a body are a point on a circle, ``(cos 2 pi t, sin 2 pi t)``: closed,
and the same for all.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from colloc.gaits.gait import ClassOfGaits, GaitFunction
from colloc.gaits.harmonic import Harmonic
from colloc.gaits.symmetry import ANTIPODAL, NONE, both_halves
from colloc.system.errors import ProblemError

_INTERVALS_A_STAGE = 4


@dataclass(frozen=True, eq=False, repr=False)
class Phases(GaitFunction):
    """A body's run through its phases: the only gait of its class.

    Parameters
    ----------
    schedule : (n + 1,)
        Phases from 0 to the part of the period that is solved, between which the motion is smooth
        in time.
    symmetry : {"none", "antipodal"}
    """

    schedule: tuple[float, ...] = (0.0, 1.0)
    symmetry: str = NONE

    shape_speed = 1.0

    def __post_init__(self) -> None:
        object.__setattr__(self, "schedule", tuple(float(t) for t in self.schedule))

    @property
    def n_joint(self) -> int:
        return 2

    @property
    def corner_phases(self) -> np.ndarray:
        """Phases in (0, 1) at which the motion may start to move otherwise."""
        return both_halves(self.symmetry, np.array(self.schedule))

    def lines(self) -> list[str]:
        """The gait in words: its class says all."""
        return []

    def angles(self, t: np.ndarray) -> np.ndarray:
        """Points on the circle ``(2, n_time)`` at phases t."""
        phase = 2 * np.pi * np.asarray(t, dtype=float)
        return np.stack([np.cos(phase), np.sin(phase)])

    def rates(self, t: np.ndarray) -> np.ndarray:
        """Their rates per period."""
        phase = 2 * np.pi * np.asarray(t, dtype=float)
        return 2 * np.pi * np.stack([-np.sin(phase), np.cos(phase)])


@dataclass(frozen=True)
class Prescribed(ClassOfGaits):
    """Nothing is free: a problem of this class asks what a given motion achieves.

    Parameters
    ----------
    stages : tuple of float
        Phases from 0 to the part of the period that is solved, between which the motion is smooth
        in time.
    symmetry : {"none", "antipodal"}
        Antipodal: the second half period is the mirror image of the first.
    """

    stages: tuple[float, ...] = (0.0, 1.0)
    symmetry: str = NONE

    symmetries = (NONE, ANTIPODAL)
    free = False

    def __post_init__(self) -> None:
        stages = tuple(float(t) for t in self.stages)
        object.__setattr__(self, "stages", stages)
        self._check_symmetry()
        if (
            len(stages) < 2
            or stages[0] != 0.0
            or stages[-1] != self.fraction
            or min(np.diff(stages)) <= 0
        ):
            raise ProblemError(
                f"gait.stages must ascend from 0 to {self.fraction:g}, not {stages}."
            )

    def trajectory(self, parameters: np.ndarray, n_joint: int) -> Phases:
        """The same in the time of a program."""
        return self.member(parameters, n_joint)

    def intervals(self, n_joint: int) -> int:
        """Intervals of a first mesh: some in every stage."""
        return _INTERVALS_A_STAGE * (len(self.stages) - 1)

    def fewest_intervals(self, per_interval: int) -> tuple[int, str]:
        """Intervals that a mesh needs at least, and for what."""
        return len(self.stages) - 1, "the stages"

    def edges(self, n: int) -> np.ndarray:
        """A mesh of about n intervals on which every stage ends at a knot."""
        each = max(1, round(n / (len(self.stages) - 1)))
        parts = [
            np.linspace(a, b, each + 1)[:-1]
            for a, b in zip(self.stages, self.stages[1:], strict=False)
        ]
        return np.concatenate([*parts, self.stages[-1:]])

    def describe(self) -> str:
        return f"a prescribed motion, symmetry {self.symmetry}"

    def size(self, n_joint: int) -> int:
        return 0

    def member(self, parameters: np.ndarray, n_joint: int) -> Phases:
        """The only one."""
        return Phases(self.stages, self.symmetry)

    def series(self, harmonics: int) -> Harmonic:
        """Fourier series that stand for its gaits: the circle is one."""
        return Harmonic(1, self.symmetry)
