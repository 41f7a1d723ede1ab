"""Polygons, run through at constant shape speed, and the class of them with a given number of
corners.

The parameters of a member are the joint angles at the ends of all straight pieces of the part of
the period that is solved.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from colloc.gaits.gait import DELTA_START, ClassOfGaits, UnitSpeedGait, finite_array
from colloc.gaits.harmonic import series_of
from colloc.gaits.symmetry import ANTIPODAL, BILATERAL, NONE, both_halves, fraction
from colloc.system.arguments import STATED_IF_SET, is_number, is_whole, named_arguments
from colloc.system.errors import ProblemError

_EVENLY = np.linspace(0.0, 1.0, 1001)[:-1]
_MOST_TOLD = 64
"""Vertices of a polygon that are told one by one."""


@named_arguments
@dataclass(frozen=True, eq=False, repr=False)
class Corners(UnitSpeedGait):
    """A closed polygon.

    Parameters
    ----------
    corners : (n_joint, n)
        Joint angles [rad] at the corners, in order. Without a symmetry the last is joined to the
        first. With one these are the vertices of half the path, ends included; an end that lies
        within an edge is no corner of the polygon.
    symmetry : {"none", "bilateral", "antipodal"}
    theta : float, optional
        On a slope: angle of the tail link at phase 0 from straight uphill, positive to the left
        [rad].

    Examples
    --------
    >>> from colloc import Corners
    >>> triangle = Corners([[2.0, 2.9, 2.0], [-2.0, -2.0, -2.9]])
    >>> round(triangle.length, 3)
    3.073
    """

    corners: np.ndarray
    symmetry: str = "none"
    theta: float | None = field(default=None, metadata=STATED_IF_SET, kw_only=True)

    @classmethod
    def through(cls, vertices: np.ndarray, symmetry: str) -> Corners:
        """The polygon with these `vertices`, of which without a symmetry the last is the first."""
        return cls(vertices[:, :-1] if symmetry == NONE else vertices, symmetry)

    def __post_init__(self) -> None:
        self._check_symmetry()
        object.__setattr__(self, "corners", finite_array("polygon.corners", self.corners, 2))
        if self.corners.shape[0] < 1 or self.corners.shape[1] < 2:
            raise ProblemError("polygon.corners needs a row per joint and at least two columns.")
        with np.errstate(invalid="ignore"):
            apart = np.diff(self.phases) > 0  # as far as rounding shows
        if not apart.all():
            raise ProblemError("polygon.corners has two equal neighbours.")

    @property
    def vertices(self) -> np.ndarray:
        """Ends of the straight pieces of the stored part, ``(n_joint, n_piece + 1)``."""
        closed = self.symmetry == "none"
        return (
            np.concatenate([self.corners, self.corners[:, :1]], axis=1) if closed else self.corners
        )

    def _lengths(self) -> np.ndarray:
        return np.linalg.norm(np.diff(self.vertices), axis=0)

    @property
    def n_joint(self) -> int:
        return self.corners.shape[0]

    @property
    def n_corner(self) -> int:
        """Corners over the whole period."""
        n = self.corners.shape[1]
        return n if self.symmetry == NONE else round((n - 1) / fraction(self.symmetry))

    @property
    def length(self) -> float:  # type: ignore[override]
        """Of the whole closed path [rad]."""
        return float(self._lengths().sum()) / fraction(self.symmetry)

    @property
    def corner_phases(self) -> np.ndarray:
        """Phases in (0, 1) where the rates jump."""
        return both_halves(self.symmetry, self.phases)

    @property
    def phases(self) -> np.ndarray:
        """Phases of `vertices`, from 0 to the part of the period that symmetry leaves."""
        along = np.concatenate([[0.0], np.cumsum(self._lengths())])
        return fraction(self.symmetry) * along / along[-1]

    def mapped(self, matrix: np.ndarray) -> Corners:
        """The polygon with corners multiplied by a matrix ``(m, n_joint)``."""
        return Corners(matrix @ self.corners, self.symmetry)

    def _angles(self, phase: np.ndarray) -> np.ndarray:
        start, rates, since = self._side(phase)
        return start + rates * since

    def _rates(self, phase: np.ndarray) -> np.ndarray:
        return self._side(phase)[1]

    def _side(self, phase: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Where the side that each phase lies on begins, the rates on it, and how long ago it
        began."""
        phases, vertices = self.phases, self.vertices
        k = np.clip(np.searchsorted(phases, phase, side="right") - 1, 0, phases.size - 2)
        # a side of no length is never chosen
        return (
            vertices[:, k],
            (vertices[:, k + 1] - vertices[:, k]) / (phases[k + 1] - phases[k]),
            phase - phases[k],
        )

    def grown(self, factor: float) -> Corners:
        """The polygon with shapes multiplied by a factor about their mean over the path."""
        mean = self.angles(_EVENLY).mean(axis=1, keepdims=True)
        return Corners(mean + factor * (self.corners - mean), self.symmetry)

    def lines(self) -> list[str]:
        """Length and, if they are few, corners."""
        n = self.corners.shape[1]
        if n > _MOST_TOLD:
            return [f"path of length {self.length:.4f} rad, {n} vertices", *self.pointing]
        corners = [
            f"vertex ({', '.join(f'{a:+.4f}' for a in corner)})" for corner in self.corners.T
        ]
        return [f"path of length {self.length:.4f} rad", *corners, *self.pointing]


@named_arguments
@dataclass(frozen=True)
class Polygon(ClassOfGaits):
    """Closed polygons with a given number of corners, which are free.

    Parameters
    ----------
    corners : int
        At least 2 (a retraced segment), over the whole period. Even if antipodal.
    symmetry : {"none", "bilateral", "antipodal"}
    axis : {"corner", "side"}
        Of a bilateral polygon: whether its axis (angle 1 = -angle 2 for two joints) first meets a
        corner or the middle of a side. With an odd number of corners it meets one of each, and this
        does not matter.
    shortest_side : float
        Lower bound on the length of a side [rad].

    Examples
    --------
    >>> from colloc import Polygon
    >>> Polygon(corners=3).describe()
    'polygons of 3 corners, symmetry none'
    """

    corners: int = 3
    symmetry: str = NONE
    axis: str = "corner"
    shortest_side: float = 0.02

    unit_speed = may_tell = True
    series = series_of
    delta_start = DELTA_START

    def __post_init__(self) -> None:
        if not is_whole(self.corners, 2, 64):
            raise ProblemError(
                f"gait.corners must be a whole number from 2 to 64, not {self.corners!r}."
            )
        self._check_symmetry()
        if self.axis not in ("corner", "side"):
            raise ProblemError(f"gait.axis must be 'corner' or 'side', not {self.axis!r}.")
        if self.symmetry == ANTIPODAL and self.corners % 2:
            raise ProblemError(
                f"an antipodal polygon has an even number of corners, not {self.corners}."
            )
        if not (is_number(self.shortest_side) and 0 < self.shortest_side < np.pi):
            raise ProblemError(
                f"gait.shortest_side must lie in (0, pi), not {self.shortest_side!r}."
            )

    def intervals(self, n_joint: int) -> int:
        """Intervals that a first mesh wants: some on every side."""
        return max(24, 4 * self.pieces)

    def describe(self) -> str:
        """The class in words, for reports."""
        axis = (
            f" through a {self.axis}"
            if self.symmetry == BILATERAL and self.corners % 2 == 0
            else ""
        )
        return f"polygons of {self.corners} corners, symmetry {self.symmetry}{axis}"

    def retraces(self, n_joint: int) -> bool:
        return self.corners == 2 or super().retraces(n_joint)

    @property
    def half_ends(self) -> tuple[bool, bool]:
        """Whether the solved part starts, and ends, in the middle of a side."""
        if self.symmetry != BILATERAL:
            return False, False
        if self.corners % 2:
            return False, True
        return self.axis == "side", self.axis == "side"

    @property
    def pieces(self) -> int:
        """Straight pieces of the solved part, halves of sides included."""
        if self.symmetry == NONE:
            return self.corners
        return (self.corners + sum(self.half_ends)) // 2

    def fewest_intervals(self, per_interval: int) -> tuple[int, str]:
        """Intervals that a mesh needs at least, and for what."""
        return 2 * self.pieces, "the sides"

    def size(self, n_joint: int, n_interval: int | None = None) -> int:
        return n_joint * (self.pieces + 1)

    def split(self, parameters: np.ndarray, n_joint: int) -> np.ndarray:
        """Angles at the ends of the pieces, ``(n_joint, n_piece + 1)``; works on the parameters'
        index array as well."""
        return parameters.reshape(-1, n_joint).T

    def member(
        self, parameters: np.ndarray, n_joint: int, edges: np.ndarray | None = None
    ) -> Corners:
        return Corners.through(self.split(parameters, n_joint), self.symmetry)

    def parameters(self, gait: Corners) -> np.ndarray:
        return gait.vertices.ravel(order="F")
