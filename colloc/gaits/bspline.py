"""Joint angles as splines: periodic B-splines of the phase on even knots (C. de Boor, A Practical
Guide to Splines, 2001), function i the cardinal B-spline centred at phase i / knots; or splines
through columns of one's own over time, such as the primitives of a controller.

Splines of degree 1 are polygons. Their pace does not matter: delta is relative to the shape speed,
a program spends as much time on each side, and members are run through at constant shape speed.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from colloc.gaits.gait import (
    ANTIPODAL,
    BILATERAL,
    DELTA_START,
    NONE,
    SYMMETRIES,
    GaitFunction,
    fraction,
    solved_phases,
    symmetric_samples,
)
from colloc.gaits.harmonic import Harmonic, series_of
from colloc.gaits.linear import LinearClass
from colloc.numerics.mesh import Mesh
from colloc.system.arguments import (
    STATED_IF_SET,
    check_choice,
    check_count,
    finite_array,
    is_whole,
    named_arguments,
)
from colloc.system.csv_table import csv_table
from colloc.system.errors import ProblemError

_DRAWN = 3  # harmonics of starts, at most: random coefficients would make rough gaits
_INSTANTS = 32  # phases a side at which polygons are fitted
_INTERVALS, _A_SIDE = 24, 4  # of the first mesh of a polygon, and of each of its sides, at least
_POINTS = 241
_AT_A_CORNER = 1e-9  # distance at which an edge of a mesh is at a corner
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

    def __post_init__(self) -> None:
        check_choice(SYMMETRIES, **{"polygon.symmetry": self.symmetry})
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

    @property
    def n_joint(self) -> int:
        return self.corners.shape[0]

    @property
    def _along(self) -> np.ndarray:
        return np.append(0.0, np.cumsum(np.linalg.norm(np.diff(self.vertices), axis=0)))

    @property
    def length(self) -> float:
        return float(self._along[-1]) / fraction(self.symmetry)

    @property
    def shape_speed(self) -> float:
        return self.length / (2 * np.pi)

    @property
    def phases(self) -> np.ndarray:
        """Phases of `vertices`, from 0 to the solved part of the cycle."""
        return fraction(self.symmetry) * self._along / self._along[-1]

    @cached_property
    def _whole(self) -> tuple[np.ndarray, np.ndarray]:
        phases, half = self.phases, self.vertices
        if self.symmetry == NONE:
            return phases, half
        later, images = phases + 0.5, -half
        if self.symmetry == BILATERAL:  # backwards, seen from the other end
            later, images = 1.0 - phases[::-1], images[::-1, ::-1]
        return np.append(phases, later[1:]), np.hstack([half, images[:, 1:]])

    @property
    def corner_phases(self) -> np.ndarray:
        return self._whole[0][1:-1]

    def __call__(self, t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Angles and rates; at a corner those of the side ahead."""
        phase, _ = solved_phases(NONE, t)
        phases, vertices = self._whole
        k = np.clip(np.searchsorted(phases, phase, side="right") - 1, 0, phases.size - 2)
        rates = (vertices[:, k + 1] - vertices[:, k]) / (phases[k + 1] - phases[k])
        return vertices[:, k] + rates * (phase - phases[k]), rates

    def transform(self, matrix: np.ndarray) -> Corners:
        return Corners(matrix @ self.corners, self.symmetry)

    def grown(self, factor: float) -> Corners:
        mean = self.angles(_EVENLY).mean(axis=1, keepdims=True)
        return Corners(mean + factor * (self.corners - mean), self.symmetry)

    def lines(self) -> list[str]:
        first, n = f"path of length {self.length:.4f} rad", self.corners.shape[1]
        if self.symmetry != NONE:
            first += f", {self.symmetry}: vertices of half of it"
        if n > _MOST_LISTED:
            return [f"{first}, {n} vertices", *self.pointing]
        vertices = (", ".join(f"{a:+.4f}" for a in corner) for corner in self.corners.T)
        return [first, *(f"vertex ({each})" for each in vertices), *self.pointing]


class Splines(LinearClass):
    """Base of `BSpline` and `Polygon`."""

    knots: int
    degree: int
    first_knot = 0.0  # its phase, in spacings of knots
    series = series_of

    @property
    def harmonics(self) -> int:  # type: ignore[override]
        return self.knots // 2

    def functions(self, t: np.ndarray, derivative: int = 0) -> np.ndarray:
        # derivatives at a corner are those of the side ahead
        from scipy.interpolate import BSpline as Piecewise

        width = self.degree + 1
        one = Piecewise.basis_element(np.arange(width + 1), extrapolate=False)
        knots = np.arange(self.knots)[:, None]
        since = (self.knots * t - knots - self.first_knot + 0.5 * width) % self.knots
        values = self.knots**derivative * np.nan_to_num(one(since, nu=derivative), nan=0.0)
        return np.where(since < width, values, 0.0)

    @property
    def _smooth(self) -> Harmonic:
        return self.series(min(self.harmonics, _DRAWN))

    def sample_dimension(self, n_joint: int) -> int:
        return self._smooth.sample_dimension(n_joint)

    def sample(self, unit: np.ndarray, n_joint: int) -> Any:
        return self._smooth.sample(unit, n_joint)

    def perturb(self, gait: Any, step: float, fall: int, rng: np.random.Generator) -> Any:
        """Add smooth random waves, which leave finer features as they are."""
        straight = self._smooth.member(np.zeros(self._smooth.size(gait.n_joint)), gait.n_joint)
        by = self.parameters(self._smooth.perturb(straight, step, fall, rng))
        return self.member(self.parameters(self.through(gait)) + by, gait.n_joint)


@named_arguments
@dataclass(frozen=True)
class BSpline(Splines):
    """The class of gaits whose joint angles are periodic B-splines in time.

    Parameters
    ----------
    knots : int
        In a cycle, evenly spaced, each with a coefficient for every joint; more than the degree,
        64 at most, and an even number for antipodal gaits.
    degree : int
        Of the polynomials between knots, 2 to 5; derivatives below the degree are continuous.
        Splines of degree 1 are polygons, see `Polygon`.
    symmetry : {"none", "bilateral", "antipodal"}

    Raises
    ------
    ProblemError
        If there are no such splines.

    Examples
    --------
    >>> from colloc import BSpline
    >>> BSpline(knots=12, symmetry="bilateral").describe()
    'periodic B-splines of degree 4, 12 knots, symmetry bilateral'
    >>> BSpline(knots=8, symmetry="bilateral").size(n_joint=2)
    8
    """

    knots: int = 8
    degree: int = 4
    symmetry: str = "none"

    def __post_init__(self) -> None:
        if not is_whole(self.degree, 2, 5):
            raise ProblemError(
                f"gait.degree must be 2, 3, 4 or 5 (Polygon has 1), not {self.degree!r}."
            )
        check_count(64, self.degree + 1, **{"gait.knots": self.knots})
        self._check_symmetry()
        if self.symmetry == ANTIPODAL and self.knots % 2:
            raise ProblemError(
                f"antipodal splines repeat after half a cycle: give them an even number of knots, "
                f"not {self.knots}."
            )

    def describe(self) -> str:
        return (
            f"periodic B-splines of degree {self.degree}, {self.knots} knots, symmetry "
            f"{self.symmetry}"
        )


@named_arguments
@dataclass(frozen=True)
class Polygon(Splines):
    """Closed polygons with a given number of corners, which are free: splines of degree 1 with a
    knot at every corner.

    Parameters
    ----------
    corners : int
        At least 2 (a retraced segment), over the whole period. Even if antipodal.
    symmetry : {"none", "bilateral", "antipodal"}
    axis : {"corner", "side"}
        Of a bilateral polygon: whether its axis (angle 1 = -angle 2 for two joints) first meets a
        corner or the middle of a side. With an odd number of corners it meets one of each, and this
        does not matter.

    Examples
    --------
    >>> from colloc import Polygon
    >>> Polygon(corners=3).describe()
    'polygons of 3 corners, symmetry none'
    """

    corners: int = 3
    symmetry: str = "none"
    axis: str = "corner"

    degree = 1
    relative_delta, delta_start = True, DELTA_START

    def __post_init__(self) -> None:
        check_count(64, 2, **{"gait.corners": self.corners})
        self._check_symmetry()
        check_choice(("corner", "side"), **{"gait.axis": self.axis})
        if self.symmetry == ANTIPODAL and self.corners % 2:
            raise ProblemError(
                f"an antipodal polygon has an even number of corners, not {self.corners}."
            )

    @property
    def knots(self) -> int:  # type: ignore[override]
        return self.corners

    @property
    def _has_axis(self) -> bool:
        return self.symmetry == BILATERAL and self.corners % 2 == 0

    @property
    def first_knot(self) -> float:  # type: ignore[override]
        return 0.5 if self._has_axis and self.axis == "side" else 0.0

    def describe(self) -> str:
        axis = f" through a {self.axis}" if self._has_axis else ""
        return f"polygons of {self.corners} corners, symmetry {self.symmetry}{axis}"

    @property
    def instants(self) -> np.ndarray:
        n = _INSTANTS * self.knots
        return np.arange(n) / n

    @property
    def pieces(self) -> np.ndarray:
        corners = (np.arange(self.knots + 1) + self.first_knot) / self.knots
        inner = corners[(corners > _AT_A_CORNER) & (corners < self.fraction - _AT_A_CORNER)]
        return np.concatenate([[0.0], inner, [self.fraction]])

    def intervals(self, n_joint: int) -> int:
        return max(_INTERVALS, _A_SIDE * (self.pieces.size - 1))

    def fewest_intervals(self, per_interval: int) -> tuple[int, str]:
        return 2 * (self.pieces.size - 1), "the sides"

    def rates_on(self, mesh: Mesh, n_joint: int) -> np.ndarray:
        middles = np.empty(mesh.n_point)
        middles[mesh.points] = (mesh.edges[:-1] + 0.5 * mesh.h)[:, None]
        return self.angle_matrix(middles, n_joint, 1)

    def side_rates(self, n_joint: int) -> tuple[np.ndarray, np.ndarray]:
        """Fraction of the time of each side, and joint rates on it per parameter."""
        middles = 0.5 * (self.pieces[1:] + self.pieces[:-1])
        return np.diff(self.pieces) / self.pieces[-1], self.angle_matrix(middles, n_joint, 1)

    def trajectory(self, parameters: np.ndarray, n_joint: int) -> Any:
        return super().member(parameters, n_joint)

    def member(self, parameters: np.ndarray, n_joint: int) -> Corners:
        vertices = self.trajectory(parameters, n_joint).angles(self.pieces)
        return Corners(vertices[:, :-1] if self.symmetry == NONE else vertices, self.symmetry)

    def _has_corners_of(self, gait: Any) -> bool:
        alike = isinstance(gait, Corners) and gait.symmetry == self.symmetry
        return alike and gait.phases.size == self.pieces.size

    def phases(self, gait: Any, times: np.ndarray) -> np.ndarray:
        return np.interp(times, self.pieces, gait.phases)

    def times(self, gait: Any, phases: np.ndarray) -> np.ndarray:
        corners, edges = self.pieces, phases
        if self._has_corners_of(gait):
            edges = np.interp(phases, gait.phases, corners)
        apart = np.abs(edges[:, None] - corners).min(axis=1)
        return np.union1d(edges[apart > _AT_A_CORNER], corners)

    def project(self, gait: Any) -> np.ndarray:
        if getattr(gait, "basis", None) == self:
            return super().project(gait)
        times = self.pieces
        if self._has_corners_of(gait):
            points = gait.vertices
        else:  # on the path, evenly in arc length
            samples = symmetric_samples(gait, self.symmetry)
            steps = np.linalg.norm(np.diff(samples), axis=0)
            along = np.concatenate([[0.0], np.cumsum(steps)])
            even = np.linspace(0.0, along[-1], _POINTS)
            path = np.stack([np.interp(even, along, row) for row in samples])
            points = path[:, _best_corners(path, times.size - 1)]
        knots = self.knots * times - self.first_knot
        corners = np.abs(knots - np.round(knots)) < _AT_A_CORNER  # others are middles of sides
        matrix = self.angle_matrix(times[corners], gait.n_joint)
        values = points[:, corners].T.ravel()
        return np.linalg.lstsq(matrix.reshape(values.size, -1), values, rcond=None)[0]


def _best_corners(points: np.ndarray, pieces: int) -> np.ndarray:
    """Indices of ``pieces + 1`` points whose chords are nearest to all (dynamic programming)."""
    n = points.shape[1]
    cost, before = np.full((n, n), np.inf), np.triu(np.ones((n, n)), 1)
    for i in range(n - 1):
        # the chord from point i to each later one, and all points between
        seen = points[:, i + 1 :] - points[:, i : i + 1]
        dots, squares = seen.T @ seen, np.sum(seen**2, axis=0)
        along = np.clip(dots / np.maximum(squares, 1e-300), 0.0, 1.0)
        nearer = along * (2 * dots - along * squares)
        between = before[: n - i - 1, : n - i - 1]
        cost[i, i + 1 :] = np.cumsum(squares) - squares - np.einsum("kj,kj->j", nearer, between)
    best, back = cost[0].copy(), []
    for _ in range(pieces - 1):
        total = best[:, None] + cost
        back.append(np.argmin(total, axis=0))
        best = np.min(total, axis=0)
    chosen = [n - 1]
    for step in reversed(back):
        chosen.append(int(step[chosen[-1]]))
    return np.array([0, *chosen[::-1]])


_DEGREE, _FEWEST, _SAMPLED, _ROUNDING = 5, 24, 192, 1e-15
"""Degree of the spline; samples at least; samples of functions; rounding."""
_ROUGH = 0.02  # relative error of interpolation at which columns are refused
_EVEN = 1e-3  # relative difference of even steps
_RESOLVED, _MOST = 1e-6, 24
"""Share of the mean square rate in harmonics left out, and the most harmonics of a mesh."""


@named_arguments
@dataclass(frozen=True)
class Basis(LinearClass):
    """The class of gaits that are linear in columns of one's own over time.

    A column is known at evenly spaced phases and interpolated by a periodic spline of degree 5.
    Where the search is, only its multiple can change: neither its shape nor its phase.

    Parameters
    ----------
    columns : sequence, or path of a CSV file
        Each column is ``(n_time,)``, a function of time that every joint has a coefficient of; or
        ``(n_joint, n_time)``, angles of all joints, with one coefficient [rad]. Samples are evenly
        spaced over one cycle, the first not repeated, at least 24; or a column is a function of
        phases ``(n_time,)`` that returns such values. A file has times in its first column and
        functions of time in the others.
    symmetry : {"none", "bilateral", "antipodal"}
        One that the columns have: images of columns have to be combinations of columns.

    Raises
    ------
    ProblemError
        If the columns cannot be read, are not finite, do not close, are too rough to be
        interpolated, or depend on one another.

    Examples
    --------
    >>> import numpy as np
    >>> from colloc import Basis
    >>> bump = lambda t: np.exp(2 * np.cos(2 * np.pi * t))
    >>> four = Basis([bump, lambda t: bump(t - 0.25), lambda t: bump(t - 0.5),
    ...     lambda t: bump(t - 0.75)])
    >>> four.size(n_joint=2)
    8
    >>> four.describe()
    '4 columns over time, interpolated to 2e-11, symmetry none'
    """

    columns: tuple
    symmetry: str = "none"

    series = series_of

    def __post_init__(self) -> None:
        object.__setattr__(self, "columns", _check_columns(self.columns))
        self._check_symmetry()
        if self.error > _ROUGH:
            raise ProblemError(
                f"the columns are too rough: a spline through their samples is off by "
                f"{self.error:.2g} of the largest one. "
                "Give columns that close after one cycle, more samples, or smoother ones."
            )

    @property
    def _whole(self) -> bool:
        # columns are angles of all joints
        return isinstance(self.columns[0][0], tuple)

    @cached_property
    def _spline(self) -> tuple[Any, float, int]:
        from scipy.interpolate import make_interp_spline

        values = np.array(self.columns)
        values = values.reshape(-1, values.shape[-1]).T
        n, largest = len(values), np.abs(values).max()
        phases, closed = np.arange(n + 1) / n, np.vstack([values, values[:1]])
        spline = make_interp_spline(phases, closed, _DEGREE, bc_type="periodic")

        def residual(every):
            knots = np.append(np.arange(0, n, every), n)
            coarse = make_interp_spline(phases[knots], closed[knots], _DEGREE, bc_type="periodic")
            return float(np.abs(coarse(phases) - closed).max() / largest)

        # the error falls from each halving of the step to the next by about the same factor
        half, quarter = residual(2), residual(4)
        falls = np.clip(half / max(quarter, _ROUNDING), 0.5 ** (_DEGREE + 1), 1.0)
        power = np.arange(n // 2 + 1)[:, None] ** 2 * np.abs(np.fft.rfft(values, axis=0)) ** 2
        power = power.sum(axis=1)
        left = 1 - np.cumsum(power) / power.sum()
        return spline, float(half * falls), int(np.clip(np.argmax(left < _RESOLVED), 1, _MOST))

    @property
    def error(self) -> float:
        """Estimated error of interpolation, relative to the largest value."""
        return self._spline[1]

    @property
    def harmonics(self) -> int:  # type: ignore[override]
        return self._spline[2]

    def functions(self, t: np.ndarray, derivative: int = 0) -> np.ndarray:
        return self._spline[0](np.asarray(t) % 1.0, nu=derivative).T

    def label(self, number: int) -> str:
        return super().label(number // len(self.columns[0]) if self._whole else number)

    def table_basis(self, n_joint: int) -> np.ndarray:
        if not self._whole:
            return super().table_basis(n_joint)
        count = len(self.columns)
        return np.einsum("jk,cp->jckp", np.eye(n_joint), np.eye(count)).reshape(-1, count)

    def check_joints(self, n_joint: int) -> None:
        if self._whole and len(self.columns[0]) != n_joint:
            raise ProblemError(
                f"the columns have angles of {len(self.columns[0])} joints, and the body has "
                f"{n_joint}."
            )
        super().check_joints(n_joint)

    def describe(self) -> str:
        count = len(self.columns)
        kind = "of angles of all joints" if self._whole else "over time"
        return (
            f"{count} column{'s' * (count > 1)} {kind}, interpolated to {self.error:.0e}, "
            f"symmetry {self.symmetry}"
        )


def _check_columns(columns: str | os.PathLike[str] | Sequence[Any]) -> tuple:
    phases = np.arange(_SAMPLED) / _SAMPLED
    if isinstance(columns, (str, os.PathLike)):
        columns = _read(Path(columns))
    try:
        arrays = [np.array(each(phases) if callable(each) else each, float) for each in columns]
    except (TypeError, ValueError):
        arrays = []
    if len({each.shape for each in arrays}) != 1 or arrays[0].ndim not in (1, 2):
        raise ProblemError(
            "gait.columns must be a sequence of columns, samples over a cycle or functions of the "
            "phase, all alike: (n_time,) or (n_joint, n_time)."
        )
    values = np.array(arrays)
    what = ""
    if values.shape[-1] < _FEWEST:
        what = f"have {values.shape[-1]} samples of a cycle: give at least {_FEWEST}"
    elif not np.isfinite(values).all():
        what = "must be finite numbers"
    elif np.ptp(values, axis=-1).max() == 0:
        what = "do not change over time: nothing would move"
    if what:
        raise ProblemError(f"gait.columns {what}.")
    if values.ndim == 2:
        return tuple(map(tuple, values.tolist()))
    return tuple(tuple(map(tuple, column)) for column in values.tolist())


def _read(path: Path) -> list[np.ndarray]:
    _, table = csv_table(path, _FEWEST)
    steps = np.diff(table[:, 0])
    if steps.min() <= 0 or np.ptp(steps) > _EVEN * steps.mean():
        raise ProblemError(f"{path}: the times in the first column must rise by even steps.")
    values = table[:, 1:]
    step = np.abs(np.diff(values, axis=0)).max(axis=1).mean()
    repeats = np.abs(values[-1] - values[0]).max() <= 0.1 * step
    return list(values[:-1].T if repeats else values.T)
