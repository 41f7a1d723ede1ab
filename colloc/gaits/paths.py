"""Gaits given by their path in joint space: chains of circular arcs, and polygons. Both run at constant shape speed.

Only the part of the period that symmetry leaves is stored; `colloc.gaits.symmetry` gives the rest. The phase is the arc length
from the start over the length of the whole closed path, ``|q'(t)| = length``. Power and distance do not depend on the pace
once delta scales with it: delta of such gaits is measured at unit shape speed, ``delta_unit`` times that per period.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from colloc.gaits.arcs import advance, direction
from colloc.gaits.gait import GaitFunction
from colloc.gaits.symmetry import SYMMETRIES, both_halves, fraction, imaged, reduced
from colloc.system.errors import ProblemError

_BESIDE = 1e-10
_FINE_PHASES = 20000
_MOST_TOLD = 64
"""Vertices of a polygon that are told one by one."""


def _finite(name: str, value: object, ndim: int) -> np.ndarray:
    try:
        array = np.array(value, dtype=float)
    except (TypeError, ValueError):
        raise ProblemError(f"{name} must be numbers, not {value!r}.") from None
    if array.ndim != ndim or not np.isfinite(array).all():
        raise ProblemError(f"{name} must be a finite {ndim}-D array.")
    return array


def _checked_symmetry(symmetry: str) -> None:
    if symmetry not in SYMMETRIES:
        raise ProblemError(f"the symmetry of a path must be one of {', '.join(SYMMETRIES)}, not {symmetry!r}.")


class _UnitSpeed(GaitFunction):
    """A gait that runs along its path at constant shape speed."""

    length: float

    def _both(self, t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Angles and rates."""
        raise NotImplementedError

    @property
    def delta_unit(self) -> float:
        """Shape speed per period: what delta at unit shape speed is multiplied by to get delta per period."""
        return self.length

    @property
    def speed_unit(self) -> float:
        """Speeds among the variables of a program are those per period divided by this: they are at unit shape speed."""
        return self.length

    @property
    def shape_speed(self) -> float:
        """Root-mean-square shape speed, in rad per radian of phase."""
        return self.length / (2 * np.pi)

    def angles(self, t: np.ndarray) -> np.ndarray:
        """Joint angles ``(n_joint, n_time)`` at phases t ``(n_time,)``."""
        return self._both(t)[0]

    def rates(self, t: np.ndarray) -> np.ndarray:
        """Joint rates ``(n_joint, n_time)`` per period at phases t; at a corner those of the side ahead."""
        return self._both(t)[1]


@dataclass(frozen=True, eq=False, repr=False)
class ArcPath(_UnitSpeed):
    """A closed path of circular arcs that join smoothly.

    Parameters
    ----------
    edges : (n + 1,)
        Phases where arcs meet, from 0 to the part of the period that symmetry leaves.
    shapes : (n_joint, n + 1)
        Joint angles there [rad].
    tangents : (1, n + 1) or (n_joint, n + 1)
        Headings [rad] for two joints, unit vectors for more.
    length : float
        Of the whole closed path [rad].
    symmetry : {"none", "bilateral", "antipodal"}

    Examples
    --------
    >>> from colloc import ArcPath
    >>> import numpy as np
    >>> circle = ArcPath(  # four quarters of a circle of radius 1 round the straight body
    ...     edges=np.linspace(0, 1, 5),
    ...     shapes=[[1, 0, -1, 0, 1], [0, 1, 0, -1, 0]],
    ...     tangents=[np.pi * np.array([0.5, 1, 1.5, 2, 2.5])],
    ...     length=2 * np.pi,
    ... )
    >>> circle.curvatures().round(6).tolist()
    [1.0, 1.0, 1.0, 1.0]
    """

    edges: np.ndarray
    shapes: np.ndarray
    tangents: np.ndarray
    length: float
    symmetry: str = "none"

    def __post_init__(self) -> None:
        _checked_symmetry(self.symmetry)
        for name, ndim in (("edges", 1), ("shapes", 2), ("tangents", 2), ("length", 0)):
            object.__setattr__(self, name, _finite(f"path.{name}", getattr(self, name), ndim))
        object.__setattr__(self, "length", float(self.length))
        n_joint, n_edge = self.shapes.shape
        rows = 1 if n_joint == 2 else n_joint
        if n_joint < 2 or self.edges.size != n_edge or self.tangents.shape != (rows, n_edge):
            raise ProblemError(
                f"path.edges, shapes and tangents disagree: {self.edges.shape}, {self.shapes.shape}, {self.tangents.shape}."
            )
        last = fraction(self.symmetry)
        if n_edge < 2 or (np.diff(self.edges) <= 0).any() or abs(self.edges[0]) + abs(self.edges[-1] - last) > 1e-12:
            raise ProblemError(f"path.edges must ascend from 0 to {last:g}.")
        if not self.length > 0:
            raise ProblemError(f"path.length must be positive, not {self.length:g}.")

    @property
    def n_joint(self) -> int:
        return self.shapes.shape[0]

    def _at(self, t: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        k = np.clip(np.searchsorted(self.edges, t, side="right") - 1, 0, self.edges.size - 2)
        h = np.diff(self.edges)[k]
        return k, h, ((t - self.edges[k]) / h)[None]

    def _both(self, t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        phase, image = reduced(self.symmetry, t)
        k, h, tau = self._at(phase)
        t0, t1 = self.tangents[:, k], self.tangents[:, k + 1]
        angles = self.shapes[:, k] + self.length * h * advance(t0, t1, tau)
        return imaged(self.symmetry, angles, self.length * direction(t0, t1, tau), image)

    @property
    def corner_phases(self) -> np.ndarray:
        """Phases in (0, 1) where the rates jump: none."""
        return np.empty(0)

    def largest_jump(self) -> float:
        """Largest jump of the angles where arcs meet and where a symmetry continues them [rad]."""
        seams = np.concatenate([self.edges, 1 - self.edges, 0.5 + self.edges])
        seams = seams[(seams > _BESIDE) & (seams < 1 - _BESIDE)]
        jump = np.linalg.norm(self.angles(seams + _BESIDE) - self.angles(seams - _BESIDE), axis=0).max()
        return float(max(jump - 2 * _BESIDE * self.length, 0.0))

    def largest_curvature(self) -> float:
        """From the directions of the rates alone, at phases spread over the period [1/rad]."""
        tangent = self.rates(np.linspace(0.0, 1.0, _FINE_PHASES + 1)) / self.length
        turn = 2 * np.arcsin(0.5 * np.linalg.norm(np.diff(tangent), axis=0))
        return float(turn.max()) * _FINE_PHASES / self.length

    def curvatures(self) -> np.ndarray:
        """Curvature of each arc [1/rad], ``(n,)``; signed, positive to the left, for two joints."""
        turn = np.diff(self.tangents)
        size = turn[0] if self.n_joint == 2 else 2 * np.arcsin(np.clip(0.5 * np.linalg.norm(turn, axis=0), 0, 1))
        return size / (self.length * np.diff(self.edges))

    @property
    def winding(self) -> int | None:
        """How often the tangent of a path of two joints turns over a period; None for more joints."""
        if self.n_joint != 2:
            return None
        return round(float(self.tangents[0, -1] - self.tangents[0, 0]) / (2 * np.pi * fraction(self.symmetry)))

    def lines(self, coordinate: str = "joint") -> list[str]:
        """Length, winding and sharpest bend."""
        turned = "" if self.winding is None else f", winding {self.winding}"
        sharpest = np.abs(self.curvatures()).max()
        return [f"path of length {self.length:.4f} rad{turned}, largest curvature {sharpest:.3f} per rad"]

    def resampled(self, edges: np.ndarray) -> ArcPath:
        """The same path with other edges; exact if every old edge is a new one."""
        k, h, tau = self._at(edges)
        t0, t1 = self.tangents[:, k], self.tangents[:, k + 1]
        shapes = self.shapes[:, k] + self.length * h * advance(t0, t1, tau)
        tangents = t0 + tau * (t1 - t0) if self.n_joint == 2 else direction(t0, t1, tau)
        return ArcPath(edges, shapes, tangents, self.length, self.symmetry)


@dataclass(frozen=True, eq=False, repr=False)
class Corners(_UnitSpeed):
    """A closed polygon.

    Parameters
    ----------
    corners : (n_joint, n)
        Joint angles [rad] at the corners, in order. Without a symmetry the last is joined to the first. With one these are
        the vertices of half the path, ends included; an end that lies within an edge is no corner of the polygon.
    symmetry : {"none", "bilateral", "antipodal"}

    Examples
    --------
    >>> from colloc import Corners
    >>> triangle = Corners([[2.0, 2.9, 2.0], [-2.0, -2.0, -2.9]])
    >>> round(triangle.length, 3)
    3.073
    """

    corners: np.ndarray
    symmetry: str = "none"

    def __post_init__(self) -> None:
        _checked_symmetry(self.symmetry)
        object.__setattr__(self, "corners", _finite("polygon.corners", self.corners, 2))
        if self.corners.shape[0] < 1 or self.corners.shape[1] < 2:
            raise ProblemError("polygon.corners needs a row per joint and at least two columns.")
        if (self._lengths() == 0).any():
            raise ProblemError("polygon.corners has two equal neighbours.")

    @property
    def vertices(self) -> np.ndarray:
        """Ends of the straight pieces of the stored part, ``(n_joint, n_piece + 1)``."""
        closed = self.symmetry == "none"
        return np.concatenate([self.corners, self.corners[:, :1]], axis=1) if closed else self.corners

    def _lengths(self) -> np.ndarray:
        return np.linalg.norm(np.diff(self.vertices), axis=0)

    @property
    def n_joint(self) -> int:
        return self.corners.shape[0]

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

    def _both(self, t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        phase, image = reduced(self.symmetry, t)
        phases, vertices = self.phases, self.vertices
        k = np.clip(np.searchsorted(phases, phase, side="right") - 1, 0, phases.size - 2)
        slope = np.diff(vertices) / np.diff(phases)
        return imaged(self.symmetry, vertices[:, k] + slope[:, k] * (phase - phases[k]), slope[:, k], image)

    def lines(self, coordinate: str = "joint") -> list[str]:
        """Length and, if they are few, corners."""
        n = self.corners.shape[1]
        if n > _MOST_TOLD:
            return [f"path of length {self.length:.4f} rad, {n} vertices"]
        corners = [f"vertex ({', '.join(f'{a:+.4f}' for a in corner)})" for corner in self.corners.T]
        return [f"path of length {self.length:.4f} rad", *corners]
