"""Paths of bounded curvature: chains of circular arcs, run through at constant shape speed, and the
class of them.

Without a bound on curvature, corners or bandwidth the efficiency has no maximum among nice paths:
it keeps growing as paths get finer (docs/gait_classes.md). So the class is part of the problem. The
parameters of a member on a mesh are the mean shape speed, that is the length of the whole path over
2 pi (so that it moves about as far as the angles do), then the tangents at all edges, then the
joint angles there.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from colloc.gaits.gait import DELTA_START, ClassOfGaits, UnitSpeedGait, finite_array
from colloc.gaits.harmonic import series_of
from colloc.gaits.polygon import Corners
from colloc.gaits.symmetry import ANTIPODAL, NONE, fraction
from colloc.numerics.arcs import advance, direction
from colloc.system.arguments import STATED_IF_SET, check_positive, is_whole, named_arguments
from colloc.system.errors import ProblemError

_BESIDE = 1e-10
_FINE_PHASES, _CORNERS = 20000, 200
_ARCS, _COARSE_ARCS, _PARAMETERS = 120, 24, 250
"""Arcs of a free path over a period, and at most so many parameters in them all."""
JOINS, CURVATURE = 1e-8, 1e-6
"""Largest jump [rad] and relative excess of the curvature that a certificate allows."""


@named_arguments
@dataclass(frozen=True, eq=False, repr=False)
class ArcPath(UnitSpeedGait):
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
    theta : float, optional
        On a slope: angle of the tail link at phase 0 from straight uphill, positive to the left
        [rad].

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
    theta: float | None = field(default=None, metadata=STATED_IF_SET, kw_only=True)

    def __post_init__(self) -> None:
        self._check_symmetry()
        for name, ndim in (("edges", 1), ("shapes", 2), ("tangents", 2), ("length", 0)):
            object.__setattr__(self, name, finite_array(f"path.{name}", getattr(self, name), ndim))
        object.__setattr__(self, "length", float(self.length))
        n_joint, n_edge = self.shapes.shape
        rows = 1 if n_joint == 2 else n_joint
        if n_joint < 2 or self.edges.size != n_edge or self.tangents.shape != (rows, n_edge):
            raise ProblemError(
                f"path.edges, shapes and tangents disagree: {self.edges.shape}, "
                f"{self.shapes.shape}, {self.tangents.shape}."
            )
        last = fraction(self.symmetry)
        if (
            n_edge < 2
            or (np.diff(self.edges) <= 0).any()
            or abs(self.edges[0]) + abs(self.edges[-1] - last) > 1e-12
        ):
            raise ProblemError(f"path.edges must ascend from 0 to {last:g}.")
        if not self.length > 0:
            raise ProblemError(f"path.length must be positive, not {self.length:g}.")

    @property
    def n_joint(self) -> int:
        return self.shapes.shape[0]

    @property
    def knots(self) -> np.ndarray:
        return self.edges

    def _at(self, t: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        k = np.clip(np.searchsorted(self.edges, t, side="right") - 1, 0, self.edges.size - 2)
        h = np.diff(self.edges)[k]
        return k, h, ((t - self.edges[k]) / h)[None]

    def _angles(self, phase: np.ndarray) -> np.ndarray:
        k, h, tau = self._at(phase)
        return self.shapes[:, k] + self.length * h * advance(
            self.tangents[:, k], self.tangents[:, k + 1], tau
        )

    def _rates(self, phase: np.ndarray) -> np.ndarray:
        k, _, tau = self._at(phase)
        return self.length * direction(self.tangents[:, k], self.tangents[:, k + 1], tau)

    def largest_jump(self) -> float:
        """Largest jump of the angles where arcs meet and where a symmetry continues them [rad]."""
        seams = np.concatenate([self.edges, 1 - self.edges, 0.5 + self.edges])
        seams = seams[(seams > _BESIDE) & (seams < 1 - _BESIDE)]
        jump = np.linalg.norm(
            self.angles(seams + _BESIDE) - self.angles(seams - _BESIDE), axis=0
        ).max()
        return float(max(jump - 2 * _BESIDE * self.length, 0.0))

    def largest_curvature(self) -> float:
        """From the directions of the rates alone, at phases spread over the period [1/rad]."""
        tangent = self.rates(np.linspace(0.0, 1.0, _FINE_PHASES + 1)) / self.length
        turn = 2 * np.arcsin(0.5 * np.linalg.norm(np.diff(tangent), axis=0))
        return float(turn.max()) * _FINE_PHASES / self.length

    def curvatures(self) -> np.ndarray:
        """Curvature of each arc [1/rad], ``(n,)``; signed, positive to the left, for two joints."""
        turn = np.diff(self.tangents)
        size = (
            turn[0]
            if self.n_joint == 2
            else 2 * np.arcsin(np.clip(0.5 * np.linalg.norm(turn, axis=0), 0, 1))
        )
        return size / (self.length * np.diff(self.edges))

    @property
    def winding(self) -> int | None:
        """How often the tangent of a path of two joints turns over a period; None for more
        joints."""
        if self.n_joint != 2:
            return None
        return round(
            float(self.tangents[0, -1] - self.tangents[0, 0])
            / (2 * np.pi * fraction(self.symmetry))
        )

    def lines(self) -> list[str]:
        """Length, winding and sharpest bend."""
        turned = "" if self.winding is None else f", winding {self.winding}"
        sharpest = np.abs(self.curvatures()).max()
        return [
            f"path of length {self.length:.4f} rad{turned}, largest curvature {sharpest:.3f} "
            f"per rad",
            *self.pointing,
        ]

    def mapped(self, matrix: np.ndarray) -> Corners:
        """A polygon of many corners along the path whose shapes are these, multiplied by a matrix
        ``(m, n_joint)``."""
        return Corners.through(
            matrix @ self.angles(np.linspace(0.0, self.edges[-1], _CORNERS + 1)), self.symmetry
        )

    @property
    def mirrored(self) -> ArcPath:
        tangents = self.tangents + np.pi if self.n_joint == 2 else -self.tangents
        return replace(self, shapes=-self.shapes, tangents=tangents)

    def resampled(self, edges: np.ndarray) -> ArcPath:
        """The same path with other edges; exact if every old edge is a new one."""
        k, h, tau = self._at(edges)
        t0, t1 = self.tangents[:, k], self.tangents[:, k + 1]
        shapes = self.shapes[:, k] + self.length * h * advance(t0, t1, tau)
        tangents = t0 + tau * (t1 - t0) if self.n_joint == 2 else direction(t0, t1, tau)
        return replace(self, edges=edges, shapes=shapes, tangents=tangents)


@named_arguments
@dataclass(frozen=True)
class FreePath(ClassOfGaits):
    """Closed paths of bounded curvature at unit shape speed: |q''| <= curvature in arc length.

    Parameters
    ----------
    curvature : float
        Largest curvature [1/rad]; for three and more joints the largest acceleration at unit shape
        speed, the same thing.
    symmetry : {"none", "bilateral", "antipodal"}
    winding : int, optional
        How often the tangent turns over a period, counter-clockwise in the plane of (joint 1, joint
        2): 1 or -1 for simple loops, 0 for an eight; odd if antipodal. Two joints only. By default
        that of the guess.

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
    delta_start = DELTA_START
    of_arcs = may_tell = True
    series = series_of

    def __post_init__(self) -> None:
        check_positive(self, "curvature", of="gait.")
        self._check_symmetry()
        if self.winding is not None:
            if not is_whole(self.winding):
                raise ProblemError(f"gait.winding must be a whole number, not {self.winding!r}.")
            if self.symmetry == ANTIPODAL and self.winding % 2 == 0:
                raise ProblemError(
                    f"gait.winding must be odd for an antipodal path, not {self.winding}."
                )

    def check_joints(self, n_joint: int) -> None:
        super().check_joints(n_joint)
        if self.winding is not None and n_joint != 2:
            raise ProblemError(
                "gait.winding has a meaning for bodies of three links only; leave it out."
            )

    def intervals(self, n_joint: int) -> int:
        """Intervals that a first mesh wants, each of which is an arc."""
        return round(self.fraction * min(_ARCS, self.most_arcs(n_joint)))

    def coarse_intervals(self, n_joint: int) -> int:
        """Intervals on which starts are told apart: arcs are parameters, and these show which way a
        path goes round."""
        return round(self.fraction * _COARSE_ARCS)

    def most_arcs(self, n_joint: int) -> int:
        """Arcs of the solved part that a dense search can take: finer meshes have several intervals
        an arc."""
        return round(_PARAMETERS / (1 if n_joint == 2 else n_joint))

    def describe(self) -> str:
        """The class in words, for reports."""
        turns = "" if self.winding is None else f", winding {self.winding}"
        return f"paths of curvature <= {self.curvature:g} per rad, symmetry {self.symmetry}{turns}"

    def laid_on(self, path: ArcPath, edges: np.ndarray) -> ArcPath:
        """A member with every interval of a mesh an arc, or as it is if those are too many."""
        return path.resampled(edges) if edges.size - 1 <= self.most_arcs(path.n_joint) else path

    def own_checks(self, gait: ArcPath) -> list[tuple[str, float, float, str]]:
        """What a certificate checks of a member beyond what all gaits have to keep: name, value,
        allowed, meaning."""
        excess = max(gait.largest_curvature() / self.curvature - 1, 0.0)
        return [
            (
                "joins",
                gait.largest_jump(),
                JOINS,
                "jump of the joint angles where arcs or symmetric halves meet [rad]",
            ),
            (
                "curvature",
                excess,
                CURVATURE,
                "of the path between nodes, relative excess over its bound",
            ),
        ]

    def size(self, n_joint: int, n_interval: int) -> int:
        return 1 + (n_interval + 1) * (n_joint + (1 if n_joint == 2 else n_joint))

    def split(
        self, parameters: np.ndarray, n_joint: int
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Mean shape speed ``(1, 1)``, tangents ``(1 or n_joint, n + 1)``, angles ``(n_joint, n +
        1)`` of a parameter vector.

        Works on the parameters' index array as well.
        """
        rows = 1 if n_joint == 2 else n_joint
        n_edge = (parameters.size - 1) // (rows + n_joint)
        tangents = parameters[1 : 1 + rows * n_edge].reshape(n_edge, rows).T
        return (
            parameters[:1].reshape(1, 1),
            tangents,
            parameters[1 + rows * n_edge :].reshape(n_edge, n_joint).T,
        )

    def member(self, parameters: np.ndarray, n_joint: int, edges: np.ndarray) -> ArcPath:
        speed, tangents, shapes = self.split(parameters, n_joint)
        return ArcPath(edges, shapes, tangents, 2 * np.pi * speed[0, 0], self.symmetry)

    def parameters(self, path: ArcPath) -> np.ndarray:
        return np.concatenate(
            [
                [path.length / (2 * np.pi)],
                path.tangents.ravel(order="F"),
                path.shapes.ravel(order="F"),
            ]
        )


def across_the_axis(heading: float) -> float:
    """The heading next to a given one [rad] at which a bilateral path of two joints crosses its
    axis, angle 1 = -angle 2."""
    return float(np.pi * np.round((heading - np.pi / 4) / np.pi) + np.pi / 4)
