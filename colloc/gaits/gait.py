"""Gaits: functions of the phase in [0, 1]."""

from __future__ import annotations

import copy
from typing import Any

import numpy as np

from colloc.mechanics.densities import JointMap
from colloc.mechanics.inertia import GRAVITY
from colloc.system.arguments import shown
from colloc.system.errors import ProblemError

_DENSE = np.linspace(0.0, 1.0, 2001)
DELTA_START = 0.01
"""First delta of a search, relative to the shape speed [body lengths per radian of path]."""


class GaitFunction:
    """Base of gaits: ``gait(t)`` is joint angles and rates per period ``(n_joint, n_time)`` at
    phases t. One defines that call, or `angles` and `rates`."""

    n_joint: Any
    is_series = False  # a sum of functions of the phase
    theta: float | None = None  # orientation of the tail link at phase 0, on a slope [rad]
    log_period: float | None = None  # logarithm of the period [sqrt(length / gravity)]
    coordinate = "joint"  # name of a shape coordinate
    joint_map: JointMap | None = None
    rest: np.ndarray | float = 0.0  # part of the angles that scaling leaves as it is

    def __call__(self, t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return self.angles(t), self.rates(t)

    def angles(self, t: np.ndarray) -> np.ndarray:
        return self(t)[0]

    def rates(self, t: np.ndarray) -> np.ndarray:
        return self(t)[1]

    def transform(self, matrix: np.ndarray) -> Any:
        """The gait with shapes multiplied by a matrix ``(m, n_joint)``."""
        raise NotImplementedError

    def lines(self) -> list[str]:
        """The gait as a formula or in words, a line each."""
        return []

    @property
    def length(self) -> float:
        """Length of the closed path [rad]."""
        return float(np.linalg.norm(np.diff(self.angles(_DENSE)), axis=0).sum())

    @property
    def motor_gait(self) -> Any:
        return self

    def scaled(self, factor: float) -> Any:
        """The gait with all angles but those at rest multiplied by a factor."""
        return self.transform(factor * np.eye(self.n_joint))

    @property
    def mirrored(self) -> Any:
        return self.scaled(-1.0)

    def grown(self, factor: float) -> Any:
        """The gait with shapes multiplied by a factor about their mean, if it can grow."""
        return self

    @property
    def corner_phases(self) -> np.ndarray:
        """Phases in (0, 1) where the rates jump."""
        return np.empty(0)

    @property
    def pointing(self) -> list[str]:
        """Lines on the period and the initial orientation, if the gait has them."""
        lines = []
        if self.log_period is not None:
            period = np.exp(self.log_period)
            lines.append(
                f"a cycle takes {period:.5g} sqrt(L/g), {period / np.sqrt(GRAVITY):.3g} s for "
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

    def __str__(self) -> str:
        return "\n".join(self.lines())

    def __repr__(self) -> str:
        plural = "s" * (self.n_joint > 1)
        return f"<{type(self).__name__} of {self.n_joint} {self.coordinate}{plural}>"


def delta_per_period(gait_class: Any, gait: GaitFunction, delta: float) -> float:
    """Convert delta in the units of a class to body lengths per period of a gait."""
    return delta * gait.length if gait_class.relative_delta else delta


def finite_array(name: str, value: object, ndim: int) -> np.ndarray:
    """Convert to an array of so many dimensions. `ProblemError` unless all squares are finite."""
    try:
        array = np.array(value, dtype=float)
    except (TypeError, ValueError, OverflowError):
        raise ProblemError(f"{name} must be numbers, not {shown(value)}.") from None
    largest = np.sqrt(np.finfo(float).max) / (array.size + 1)
    if array.ndim != ndim or not (np.abs(array) < largest).all():
        raise ProblemError(f"{name} must be a finite {ndim}-D array.")
    return array
