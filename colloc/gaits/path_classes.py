"""Classes of gaits that bound the path itself: paths of bounded curvature, and polygons. (`gaits.harmonic` holds harmonics.)

Without a bound on curvature, corners or bandwidth the efficiency has no maximum among nice paths: it keeps growing as
paths get finer (docs/gait_classes.md). So the class is part of the problem. Members are vectors of parameters on a mesh:

- `FreePath`: the mean shape speed, that is the length of the whole path over 2 pi (so that it moves about as far as the
  angles do), then the tangents at all edges, then the joint angles there;
- `Polygon`: the joint angles at the ends of all straight pieces of the solved part.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from colloc.gaits.gait import ClassOfGaits
from colloc.gaits.harmonic import Harmonic
from colloc.gaits.paths import ArcPath, Corners
from colloc.gaits.symmetry import ANTIPODAL, BILATERAL, NONE
from colloc.system.argument_names import named_arguments
from colloc.system.errors import ProblemError

_ARCS, _COARSE_ARCS, _PARAMETERS = 120, 24, 250
"""Arcs of a free path over a period, and at most so many parameters in them all."""

_DELTA_START = 0.01
"""Where searches begin in delta at unit shape speed [body lengths per radian of path]."""
JOINS, CURVATURE = 1e-8, 1e-6
"""Largest jump [rad] and relative excess of the curvature that a certificate allows."""


@named_arguments
@dataclass(frozen=True)
class FreePath(ClassOfGaits):
    """Closed paths of bounded curvature at unit shape speed: |q''| <= curvature in arc length.

    Parameters
    ----------
    curvature : float
        Largest curvature [1/rad]; for three and more joints the largest acceleration at unit shape speed, the same thing.
    symmetry : {"none", "bilateral", "antipodal"}
    winding : int, optional
        How often the tangent turns over a period, counter-clockwise in the plane of (joint 1, joint 2): 1 or -1 for simple
        loops, 0 for an eight; odd if antipodal. Two joints only. By default that of the guess.

    Examples
    --------
    >>> from colloc import FreePath
    >>> FreePath(curvature=8, symmetry="bilateral").describe()
    'paths of curvature <= 8 per rad, symmetry bilateral'
    """

    curvature: float = 8.0
    symmetry: str = NONE
    winding: int | None = None

    unit_speed = True
    delta_start = _DELTA_START
    of_arcs = True

    def __post_init__(self) -> None:
        value = self.curvature
        if isinstance(value, bool) or not isinstance(value, (int, float, np.number)) or not 0 < value < np.inf:
            raise ProblemError(f"gait.curvature must be a positive finite number, not {value!r}.")
        self._check_symmetry()
        if self.winding is not None:
            if isinstance(self.winding, bool) or not isinstance(self.winding, (int, np.integer)):
                raise ProblemError(f"gait.winding must be a whole number, not {self.winding!r}.")
            if self.symmetry == ANTIPODAL and self.winding % 2 == 0:
                raise ProblemError(f"gait.winding must be odd for an antipodal path, not {self.winding}.")

    def intervals(self, n_joint: int) -> int:
        """Intervals that a first mesh wants, each of which is an arc."""
        return round(self.fraction * min(_ARCS, self.most_arcs(n_joint)))

    def coarse_intervals(self, n_joint: int) -> int:
        """Intervals on which starts are told apart: arcs are parameters, and these show which way a path goes round."""
        return round(self.fraction * _COARSE_ARCS)

    def most_arcs(self, n_joint: int) -> int:
        """Arcs of the solved part that a dense search can take: finer meshes have several intervals an arc."""
        return round(_PARAMETERS / (1 if n_joint == 2 else n_joint))

    def describe(self) -> str:
        """The class in words, for reports."""
        turns = "" if self.winding is None else f", winding {self.winding}"
        return f"paths of curvature <= {self.curvature:g} per rad, symmetry {self.symmetry}{turns}"

    def laid_on(self, path: ArcPath, edges: np.ndarray) -> ArcPath:
        """A member with every interval of a mesh an arc, or as it is if those are too many."""
        return path.resampled(edges) if edges.size - 1 <= self.most_arcs(path.n_joint) else path

    def series(self, harmonics: int) -> Harmonic:
        """Fourier series in arc length that stand for its gaits."""
        return Harmonic(harmonics, self.symmetry)

    def own_checks(self, gait: ArcPath) -> list[tuple[str, float, float, str]]:
        """What a certificate checks of a member beyond what all gaits have to keep: name, value, allowed, meaning."""
        excess = max(gait.largest_curvature() / self.curvature - 1, 0.0)
        return [
            ("joins", gait.largest_jump(), JOINS, "jump of the joint angles where arcs or symmetric halves meet [rad]"),
            ("curvature", excess, CURVATURE, "of the path between nodes, relative excess over its bound"),
        ]

    def size(self, n_joint: int, n_interval: int) -> int:
        """Number of parameters."""
        return 1 + (n_interval + 1) * (n_joint + (1 if n_joint == 2 else n_joint))

    def split(self, parameters: np.ndarray, n_joint: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Mean shape speed ``(1, 1)``, tangents ``(1 or n_joint, n + 1)``, angles ``(n_joint, n + 1)`` of a parameter vector.

        Works on the parameters' index array as well.
        """
        rows = 1 if n_joint == 2 else n_joint
        n_edge = (parameters.size - 1) // (rows + n_joint)
        tangents = parameters[1 : 1 + rows * n_edge].reshape(n_edge, rows).T
        return parameters[:1].reshape(1, 1), tangents, parameters[1 + rows * n_edge :].reshape(n_edge, n_joint).T

    def member(self, parameters: np.ndarray, n_joint: int, edges: np.ndarray) -> ArcPath:
        """The gait of a parameter vector on the mesh `edges` (phases)."""
        speed, tangents, shapes = self.split(parameters, n_joint)
        return ArcPath(edges, shapes, tangents, 2 * np.pi * speed[0, 0], self.symmetry)

    def parameters(self, path: ArcPath) -> np.ndarray:
        """The parameter vector of a member."""
        return np.concatenate([[path.length / (2 * np.pi)], path.tangents.ravel(order="F"), path.shapes.ravel(order="F")])


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
        Of a bilateral polygon: whether its axis (angle 1 = -angle 2 for two joints) first meets a corner or the middle of
        a side. With an odd number of corners it meets one of each, and this does not matter.
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

    unit_speed = True
    delta_start = _DELTA_START

    def __post_init__(self) -> None:
        if isinstance(self.corners, bool) or not isinstance(self.corners, (int, np.integer)) or not 2 <= self.corners <= 64:
            raise ProblemError(f"gait.corners must be a whole number from 2 to 64, not {self.corners!r}.")
        self._check_symmetry()
        if self.axis not in ("corner", "side"):
            raise ProblemError(f"gait.axis must be 'corner' or 'side', not {self.axis!r}.")
        if self.symmetry == ANTIPODAL and self.corners % 2:
            raise ProblemError(f"an antipodal polygon has an even number of corners, not {self.corners}.")
        if not isinstance(self.shortest_side, (int, float, np.number)) or not 0 < self.shortest_side < np.pi:
            raise ProblemError(f"gait.shortest_side must lie in (0, pi), not {self.shortest_side!r}.")

    def intervals(self, n_joint: int) -> int:
        """Intervals that a first mesh wants: some on every side."""
        return max(24, 4 * self.pieces)

    def describe(self) -> str:
        """The class in words, for reports."""
        axis = f" through a {self.axis}" if self.symmetry == BILATERAL and self.corners % 2 == 0 else ""
        return f"polygons of {self.corners} corners, symmetry {self.symmetry}{axis}"

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

    def series(self, harmonics: int) -> Harmonic:
        """Fourier series in arc length that stand for its gaits."""
        return Harmonic(harmonics, self.symmetry)

    def size(self, n_joint: int, n_interval: int | None = None) -> int:
        """Number of parameters."""
        return n_joint * (self.pieces + 1)

    def split(self, parameters: np.ndarray, n_joint: int) -> np.ndarray:
        """Angles at the ends of the pieces, ``(n_joint, n_piece + 1)``; works on the parameters' index array as well."""
        return parameters.reshape(-1, n_joint).T

    def member(self, parameters: np.ndarray, n_joint: int, edges: np.ndarray | None = None) -> Corners:
        """The gait of a parameter vector; the mesh does not matter."""
        vertices = self.split(parameters, n_joint)
        return Corners(vertices[:, :-1] if self.symmetry == NONE else vertices, self.symmetry)

    def parameters(self, gait: Corners) -> np.ndarray:
        """The parameter vector of a member."""
        return gait.vertices.ravel(order="F")
