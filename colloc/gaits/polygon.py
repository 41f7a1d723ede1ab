"""Gaits along polygons at constant shape speed: members of `colloc.gaits.bspline.Polygon`."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from colloc.gaits.gait import GaitFunction, finite_array
from colloc.gaits.symmetry import NONE, SYMMETRIES, both_halves, fraction, reduced, take_images
from colloc.system.arguments import STATED_IF_SET, named_arguments
from colloc.system.errors import ProblemError

_EVENLY = np.linspace(0.0, 1.0, 1001)[:-1]
_MOST_LISTED = 64  # vertices


@named_arguments
@dataclass(frozen=True, eq=False, repr=False)
class Corners(GaitFunction):
    """A closed polygon, run through at constant shape speed: the phase is the arc length from the
    start over that of the whole path.

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
        if self.symmetry not in SYMMETRIES:
            raise ProblemError(
                f"the symmetry of a path must be one of {', '.join(SYMMETRIES)}, not "
                f"{self.symmetry!r}."
            )
        object.__setattr__(self, "corners", finite_array("polygon.corners", self.corners, 2))
        if self.corners.shape[0] < 1 or self.corners.shape[1] < 2:
            raise ProblemError("polygon.corners needs a row per joint and at least two columns.")
        with np.errstate(invalid="ignore"):
            apart = np.diff(self.phases) > 0  # as far as rounding shows
        if not apart.all():
            raise ProblemError("polygon.corners has two equal neighbours.")

    @property
    def vertices(self) -> np.ndarray:
        """Ends of the sides of the solved part, ``(n_joint, n_side + 1)``."""
        if self.symmetry != NONE:
            return self.corners
        return np.concatenate([self.corners, self.corners[:, :1]], axis=1)

    def _side_lengths(self) -> np.ndarray:
        return np.linalg.norm(np.diff(self.vertices), axis=0)

    @property
    def n_joint(self) -> int:
        return self.corners.shape[0]

    @property
    def length(self) -> float:
        """Length of the whole closed path [rad]."""
        return float(self._side_lengths().sum()) / fraction(self.symmetry)

    @property
    def shape_speed(self) -> float:
        """Shape speed [rad per radian of phase]."""
        return self.length / (2 * np.pi)

    @property
    def corner_phases(self) -> np.ndarray:
        return both_halves(self.symmetry, self.phases)

    @property
    def phases(self) -> np.ndarray:
        """Phases of `vertices`, from 0 to the solved part of the period."""
        along = np.concatenate([[0.0], np.cumsum(self._side_lengths())])
        return fraction(self.symmetry) * along / along[-1]

    def mapped(self, matrix: np.ndarray) -> Corners:
        """The polygon with corners multiplied by a matrix ``(m, n_joint)``."""
        return Corners(matrix @ self.corners, self.symmetry)

    def angles(self, t: np.ndarray) -> np.ndarray:
        phase, image = reduced(self.symmetry, t)
        start, rates, since = self._side(phase)
        return take_images(self.symmetry, start + rates * since, image)

    def rates(self, t: np.ndarray) -> np.ndarray:
        """Joint rates ``(n_joint, n_time)`` per period; at a corner those of the side ahead."""
        phase, image = reduced(self.symmetry, t)
        return take_images(self.symmetry, self._side(phase)[1], image, derivative=1)

    def _side(self, phase: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """First vertex of the side at each phase, rates on it, and phase since that vertex."""
        phases, vertices = self.phases, self.vertices
        k = np.clip(np.searchsorted(phases, phase, side="right") - 1, 0, phases.size - 2)
        rates = (vertices[:, k + 1] - vertices[:, k]) / (phases[k + 1] - phases[k])
        return vertices[:, k], rates, phase - phases[k]

    def grown(self, factor: float) -> Corners:
        """The polygon with shapes multiplied by a factor about their mean over the path."""
        mean = self.angles(_EVENLY).mean(axis=1, keepdims=True)
        return Corners(mean + factor * (self.corners - mean), self.symmetry)

    def lines(self) -> list[str]:
        first, n = f"path of length {self.length:.4f} rad", self.corners.shape[1]
        if n > _MOST_LISTED:
            return [f"{first}, {n} vertices", *self.pointing]
        vertices = (", ".join(f"{a:+.4f}" for a in corner) for corner in self.corners.T)
        return [first, *(f"vertex ({each})" for each in vertices), *self.pointing]
