"""What a gait is, and a class of gaits: the bases of all kinds.

A gait is a function of the phase, with words for its reader. A class says which gaits are allowed.
Its members are known by a vector of parameters.
"""

from __future__ import annotations

import copy
import dataclasses
from typing import Any

import numpy as np

from colloc.gaits.symmetry import SYMMETRIES, fraction, symmetric_samples
from colloc.mechanics.inertia import GRAVITY
from colloc.mechanics.joint_map import JointMap
from colloc.system.arguments import shown
from colloc.system.errors import ProblemError

_DENSE = 2000
_SEED_HARMONICS = 2
DELTA_START = 0.01
"""Where searches begin in delta relative to the shape speed [body lengths per radian of path]."""


class GaitFunction:
    """Base of the kinds of gaits: ``gait(t)`` gives joint angles and rates, so a gait can stand
    where a path is asked for.

    Examples
    --------
    >>> from colloc import ellipse
    >>> gait = ellipse(A0=0, A1=2, B1=1)
    >>> angles, rates = gait([0, 0.25])
    >>> angles
    array([[ 2.,  1.],
           [-2.,  1.]])
    >>> print(gait)
    joint 1: +0.0000 +2.0000 cos 2πt +1.0000 sin 2πt
    joint 2: +0.0000 -2.0000 cos 2πt +1.0000 sin 2πt
    """

    is_series = False
    """Whether it is a sum of functions of the phase with coefficients, a Fourier series for one."""
    theta: float | None = None
    """Where the tail link points at phase 0, of a gait for a slope (`colloc.gaits.sloped`)."""
    log_period: float | None = None
    """Logarithm of the period [sqrt(length / gravity)], of a gait that says its pace
    (`colloc.gaits.inertia`)."""
    coordinate = "joint"
    """What the gait's body calls a shape coordinate."""
    joint_map: JointMap | None = None
    """Of joints that hang on fewer motors."""
    rest: np.ndarray | float = 0.0
    """What of the angles stays where the gait is scaled."""

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
        """Of the closed path [rad], which is the mean shape speed per period."""
        points = self.angles(np.linspace(0.0, 1.0, _DENSE + 1))
        return float(np.linalg.norm(np.diff(points), axis=0).sum())

    def mapped(self, matrix: np.ndarray) -> Any:
        """The gait, or a polygon near it, with shapes multiplied by a matrix ``(m, n_joint)``."""
        raise NotImplementedError

    @property
    def driven(self) -> Any:
        """The gait of what has motors: the gait itself, unless several joints share one."""
        return self

    @property
    def mirrored(self) -> Any:
        """Its mirror image: all angles are negative."""
        return self.mapped(-np.eye(self.n_joint))

    def grown(self, factor: float) -> Any:
        """The gait with shapes multiplied by a factor about their mean, where it can grow; else as
        it is."""
        return self

    @property
    def corner_phases(self) -> np.ndarray:
        """Phases in (0, 1) where the rates jump: by default none."""
        return np.empty(0)

    def lines(self) -> list[str]:
        """The gait in words or as a formula."""
        raise NotImplementedError

    @property
    def pointing(self) -> list[str]:
        """Lines that say how fast it is played and where it points, if it does."""
        found = []
        if self.log_period is not None:
            period = np.exp(self.log_period)
            said = (
                f"a period takes {period:.5g} sqrt(L/g), {period / np.sqrt(GRAVITY):.3g} s for "
                f"a body of 1 m"
            )
            found.append(f"{said}: Froude number {period**-2:.4g}")
        if self.theta is not None:
            turned = np.degrees(np.angle(np.exp(1j * self.theta)))
            found.append(
                f"at t = 0 the tail link points {turned:+.2f}° off straight uphill (+: to the left)"
            )
        return found

    def named(self, coordinate: str) -> Any:
        """The gait of a body that calls its shape coordinates so."""
        found = copy.copy(self)
        object.__setattr__(found, "coordinate", coordinate)
        return found

    def __call__(self, t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return self.angles(t), self.rates(t)

    def __str__(self) -> str:
        return "\n".join(self.lines())

    def __repr__(self) -> str:
        return (
            f"<{type(self).__name__} of {self.n_joint} "
            f"{self.coordinate}{'s' if self.n_joint > 1 else ''}>"
        )


class ClassOfGaits:
    """Base of the classes of gaits; besides what stands here a class has ``symmetry``."""

    symmetry: str
    symmetries: tuple[str, ...] = SYMMETRIES
    """Those that it may have."""
    free = True
    """Whether it has more than one member."""
    stages: tuple[float, ...] = ()
    """Phases that every mesh has to have as knots."""
    relative_delta = False
    """Whether delta is relative to the shape speed, in body lengths per radian of path, as
    where members are given by their path and the pace does not matter."""
    delta_start: float | None = None
    """Where a search begins in delta; None: where the body's usual one does."""
    has_fixed_edges = True
    """Whether edges of its meshes are where the rates jump, so that a planned mesh keeps them."""
    linear = True
    """Whether angles of a class of series are linear in the parameters by which its members are
    searched."""
    may_tell = False
    """Whether members can say where they point (`colloc.gaits.told`)."""

    def _check_symmetry(self) -> None:
        if self.symmetry not in self.symmetries:
            raise ProblemError(
                f"gait.symmetry must be one of {', '.join(self.symmetries)}, not {self.symmetry!r}."
            )

    def with_symmetry(self, symmetry: str) -> Any:
        """The same class with another symmetry."""
        return dataclasses.replace(self, symmetry=symmetry)  # type: ignore[type-var]

    def check_joints(self, n_joint: int) -> None:
        """A `ProblemError` if bodies with so many shape coordinates have no gaits of the class."""
        if self.relative_delta and n_joint < 2:
            raise ProblemError(
                f"the class {type(self).__name__} needs a body of at least three links, or two "
                f"modes."
            )

    def joint_map(self, n_joint: int) -> JointMap | None:
        """The map from motors to so many joints, where several hang on one or some are stuck."""
        return None

    def retraces(self, n_joint: int) -> bool:
        """Whether every member goes back the way it came, in as many shape coordinates."""
        return n_joint == 1

    @property
    def fraction(self) -> float:
        """The part of the period that has to be solved; symmetry gives the rest."""
        return fraction(self.symmetry)

    @property
    def motion_symmetry(self) -> str:
        """That of the motion, which gives the rest of it."""
        return self.symmetry

    @property
    def closing_symmetry(self) -> str:
        """What is known of the net rotation of all members: that of gaits with this symmetry."""
        return self.symmetry

    def series(self, harmonics: int) -> Any:
        """The class of Fourier series with about so many harmonics that stand for its gaits."""
        raise NotImplementedError

    def first_guess(self, gait: Any) -> Any:
        """What a search begins with where no guess is given but a wave: by default that."""
        return gait

    def through(self, gait: Any) -> Any:
        """The gait that stands for any gait where a search in the class begins: by default
        itself."""
        return gait

    def guessed(self, gait: Any) -> tuple[Any, float]:
        """What is checked of a guess, and its shape speed in rad per radian of phase: by default
        those of its path."""
        points = symmetric_samples(gait, self.symmetry)
        return gait, float(
            np.linalg.norm(np.diff(points), axis=0).sum() / (2 * np.pi * self.fraction)
        )

    @property
    def level(self) -> Any:
        """The class on the level."""
        return self

    def describe(self) -> str:
        """The class in words, for reports."""
        raise NotImplementedError

    def intervals(self, n_joint: int) -> int:
        """Intervals that a first mesh wants."""
        raise NotImplementedError

    def fewest_intervals(self, per_interval: int) -> tuple[int, str]:
        """Intervals that a mesh with so many points on each needs at least, and for what."""
        return 4, "a gait"

    def edges(self, n: int) -> np.ndarray:
        """A mesh of about n intervals on the part of the period that is solved."""
        return np.linspace(0.0, self.fraction, n + 1)

    @property
    def seeds(self) -> Any:
        """The class that starts are drawn from: a few harmonics where the class is one of paths."""
        return self.series(_SEED_HARMONICS)

    def size(self, n_joint: int) -> int:
        """Number of parameters."""
        raise NotImplementedError

    def member(self, parameters: np.ndarray, n_joint: int) -> Any:
        """The gait of a parameter vector."""
        raise NotImplementedError

    def phases(self, gait: Any, times: np.ndarray) -> np.ndarray:
        """Phases of a member at times of its program: by default the same."""
        return times

    def times(self, gait: Any, phases: np.ndarray) -> np.ndarray:
        """Edges of a program's mesh, from phases of a member."""
        return phases

    def parameters(self, gait: Any) -> np.ndarray:
        """The parameter vector of a member."""
        raise NotImplementedError

    def nearest(self, gait: Any) -> np.ndarray:
        """That of the member nearest to a gait, in its phase."""
        return self.parameters(gait)

    def in_phase(self, gait: Any) -> bool:
        """Whether a gait starts where members do."""
        return True


def delta_per_period(gait_class: ClassOfGaits, gait: GaitFunction, delta: float) -> float:
    """Delta of a class, in body lengths per period of a gait."""
    return delta * gait.length if gait_class.relative_delta else delta


def finite_array(name: str, value: object, ndim: int) -> np.ndarray:
    """Numbers of a gait as an array of so many dimensions. `ProblemError` if they, or their
    squares, are none or not finite."""
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
