"""Gaits, functions of the phase in [0, 1], and classes of gaits, known by vectors of parameters."""

from __future__ import annotations

import copy
import dataclasses
from typing import Any

import numpy as np

from colloc.gaits.symmetry import SYMMETRIES, fraction
from colloc.mechanics.densities import JointMap
from colloc.mechanics.inertia import GRAVITY
from colloc.system.arguments import shown
from colloc.system.errors import ProblemError

_DENSE = 2000
_SEED_HARMONICS = 2
DELTA_START = 0.01
"""First delta of a search, relative to the shape speed [body lengths per radian of path]."""


class GaitFunction:
    """Base of gaits: ``gait(t)`` is joint angles and rates ``(n_joint, n_time)`` at phases t."""

    is_series = False  # a sum of functions of the phase
    theta: float | None = None  # orientation of the tail link at phase 0, on a slope [rad]
    log_period: float | None = None  # logarithm of the period [sqrt(length / gravity)]
    coordinate = "joint"  # name of a shape coordinate
    joint_map: JointMap | None = None
    rest: np.ndarray | float = 0.0  # part of the angles that scaling leaves as it is

    @property
    def n_joint(self) -> int:
        raise NotImplementedError

    def angles(self, t: np.ndarray) -> np.ndarray:
        """Joint angles ``(n_joint, n_time)`` at phases t ``(n_time,)``."""
        raise NotImplementedError

    def rates(self, t: np.ndarray) -> np.ndarray:
        """Joint rates ``(n_joint, n_time)`` per period at phases t."""
        raise NotImplementedError

    @property
    def length(self) -> float:
        """Length of the closed path [rad], the mean shape speed per period."""
        points = self.angles(np.linspace(0.0, 1.0, _DENSE + 1))
        return float(np.linalg.norm(np.diff(points), axis=0).sum())

    def mapped(self, matrix: np.ndarray) -> Any:
        """The gait with shapes multiplied by a matrix ``(m, n_joint)``."""
        raise NotImplementedError

    @property
    def motor_gait(self) -> Any:
        """The gait of the motors."""
        return self

    def scaled(self, factor: float) -> Any:
        """The gait with all angles but those at rest multiplied by a factor."""
        return self.mapped(factor * np.eye(self.n_joint))

    @property
    def mirrored(self) -> Any:
        """The mirror image: all angles negated."""
        return self.scaled(-1.0)

    def grown(self, factor: float) -> Any:
        """The gait with shapes multiplied by a factor about their mean, if it can grow."""
        return self

    @property
    def corner_phases(self) -> np.ndarray:
        """Phases in (0, 1) where the rates jump."""
        return np.empty(0)

    def lines(self) -> list[str]:
        """The gait as a formula or in words, a line each."""
        raise NotImplementedError

    @property
    def pointing(self) -> list[str]:
        """Lines on the period and the initial orientation, if the gait has them."""
        lines = []
        if self.log_period is not None:
            period = np.exp(self.log_period)
            lines.append(
                f"a period takes {period:.5g} sqrt(L/g), {period / np.sqrt(GRAVITY):.3g} s for "
                f"a body of 1 m: Froude number {period**-2:.4g}"
            )
        if self.theta is not None:
            turned = np.degrees(np.angle(np.exp(1j * self.theta)))
            lines.append(
                f"at t = 0 the tail link points {turned:+.2f}° off straight uphill (+: to the left)"
            )
        return lines

    def with_coordinate(self, coordinate: str) -> Any:
        """The gait with another name for its shape coordinates."""
        gait = copy.copy(self)
        object.__setattr__(gait, "coordinate", coordinate)
        return gait

    def __call__(self, t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return self.angles(t), self.rates(t)

    def __str__(self) -> str:
        return "\n".join(self.lines())

    def __repr__(self) -> str:
        plural = "s" * (self.n_joint > 1)
        return f"<{type(self).__name__} of {self.n_joint} {self.coordinate}{plural}>"


class ClassOfGaits:
    """Base of classes of gaits."""

    symmetry: str
    free = True  # has parameters
    stages: tuple[float, ...] = ()  # phases that every mesh has as edges
    relative_delta = False  # delta is relative to the shape speed, as the pace does not matter
    delta_start: float | None = None  # first delta of a search; None: the body's default
    linear = True  # angles are linear in the parameters of the search

    def _check_symmetry(self) -> None:
        if self.symmetry not in SYMMETRIES:
            raise ProblemError(
                f"gait.symmetry must be one of {', '.join(SYMMETRIES)}, not {self.symmetry!r}."
            )

    def with_symmetry(self, symmetry: str) -> Any:
        return dataclasses.replace(self, symmetry=symmetry)  # type: ignore[type-var]

    def check_joints(self, n_joint: int) -> None:
        """Raise a `ProblemError` if bodies with so many shape coordinates have no such gaits."""
        if self.relative_delta and n_joint < 2:
            raise ProblemError(
                f"the class {type(self).__name__} needs a body of at least three links, or two "
                f"modes."
            )

    def joint_map(self, n_joint: int) -> JointMap | None:
        """The map from motors to joints, if several joints hang on one or some are stuck."""
        return None

    @property
    def fraction(self) -> float:
        """Part of the period that is solved; symmetry gives the rest."""
        return fraction(self.symmetry)

    def describe(self) -> str:
        """The class in words, for reports."""
        raise NotImplementedError

    def intervals(self, n_joint: int) -> int:
        """Intervals of a first mesh."""
        raise NotImplementedError

    def fewest_intervals(self, per_interval: int) -> tuple[int, str]:
        """Least intervals of a mesh with so many points on each, and the reason."""
        return 4, "a gait"

    def edges(self, n: int) -> np.ndarray:
        """Edges of a mesh of about n intervals on the solved part of the period."""
        return np.linspace(0.0, self.fraction, n + 1)

    def series(self, harmonics: int) -> Any:
        """The class of Fourier series with about so many harmonics that stand for the gaits."""
        raise NotImplementedError

    @property
    def start_class(self) -> Any:
        """The class that starts of a search are drawn from."""
        return self.series(_SEED_HARMONICS)

    def size(self, n_joint: int) -> int:
        """Number of parameters."""
        raise NotImplementedError

    def member(self, parameters: np.ndarray, n_joint: int) -> Any:
        """The gait of a parameter vector."""
        raise NotImplementedError

    def parameters(self, gait: Any) -> np.ndarray:
        """Parameters of the member nearest to a gait."""
        raise NotImplementedError

    def in_phase(self, gait: Any) -> bool:
        """True if a gait starts in the phase in which members do."""
        return True

    def through(self, gait: Any) -> Any:
        """The gait that a search in the class begins with, for any gait."""
        return gait

    def phases(self, gait: Any, times: np.ndarray) -> np.ndarray:
        """Phases of a member at times of its program."""
        return times

    def times(self, gait: Any, phases: np.ndarray) -> np.ndarray:
        """Edges of a program's mesh, from phases of a member."""
        return phases


def delta_per_period(gait_class: ClassOfGaits, gait: GaitFunction, delta: float) -> float:
    """Convert delta in the units of a class to body lengths per period of a gait."""
    return delta * gait.length if gait_class.relative_delta else delta


def finite_array(name: str, value: object, ndim: int) -> np.ndarray:
    """Convert to an array of so many dimensions. `ProblemError` unless all squares are finite."""
    try:
        array = np.array(value, dtype=float)
    except (TypeError, ValueError, OverflowError):
        raise ProblemError(f"{name} must be numbers, not {shown(value)}.") from None
    if (
        array.ndim != ndim
        or not (np.abs(array) < np.sqrt(np.finfo(float).max) / (array.size + 1)).all()
    ):
        raise ProblemError(f"{name} must be a finite {ndim}-D array.")
    return array
