"""Any gait as points along its path: the start of a search over another class of paths.

A gait of one class seeds the next through these points: its symmetric part is sampled by arc length
on the part of the period that is solved, and arcs or straight pieces are laid through the samples.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Protocol

import numpy as np

from colloc.gaits.free_path import ArcPath, FreePath, across_the_axis
from colloc.gaits.polygon import Corners, Polygon
from colloc.gaits.symmetry import ANTIPODAL, BILATERAL, fraction, symmetric_samples

_DENSE = 2000
_BEND = 1.5
"""Angle [rad] over whose sharpest allowed bend a corner's intervals are spread."""
_POLYGON_POINTS = 241


class Gait(Protocol):
    """Joint angles and rates of a closed path as functions of the phase."""

    @property
    def theta(self) -> float | None:
        """Where the tail link points at phase 0, if that matters."""

    @property
    def n_joint(self) -> int: ...

    @property
    def delta_unit(self) -> float:
        """What the delta of the gait's class is multiplied by to get delta per period."""

    def angles(self, t: np.ndarray) -> np.ndarray: ...

    def rates(self, t: np.ndarray) -> np.ndarray: ...


def path_length(gait: Gait) -> float:
    """Length of the closed path of a gait [rad], which is its mean shape speed per period."""
    points = gait.angles(np.linspace(0.0, 1.0, _DENSE + 1))
    return float(np.linalg.norm(np.diff(points), axis=0).sum())


def _by_arc_length(points: np.ndarray, at: np.ndarray) -> tuple[np.ndarray, float]:
    """Points at fractions `at` of the length of a polyline, and its length."""
    along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points), axis=0))])
    return np.stack([np.interp(at * along[-1], along, row) for row in points]), float(along[-1])


def graded_edges(gait: Gait, target: FreePath, n: int) -> np.ndarray:
    """Phases of `n` intervals along the path of a gait, half of them spread by length and half by
    how much it turns.

    A turn counts as spread over the length that the sharpest allowed bend needs, so that a corner
    gets several intervals.
    """
    points = symmetric_samples(gait, target.symmetry)
    points, length = _by_arc_length(points, np.linspace(0.0, 1.0, _DENSE + 1))
    step = np.diff(_extended(points, target.symmetry))
    cosine = np.sum(step[:, 1:] * step[:, :-1], axis=0)
    area = np.sqrt(
        np.maximum(
            np.sum(step[:, 1:] ** 2, axis=0) * np.sum(step[:, :-1] ** 2, axis=0) - cosine**2, 0.0
        )
    )
    turn = np.arctan2(area, cosine)
    width = min(_DENSE, max(1, round(_BEND / target.curvature / length * _DENSE)))
    spread = np.convolve(turn, np.ones(width) / width, mode="same")[_DENSE - 1 : 2 * _DENSE]
    density = np.full(_DENSE + 1, 1.0 / _DENSE) + spread / max(spread.sum(), 1e-300)
    along = np.concatenate([[0.0], np.cumsum(0.5 * (density[1:] + density[:-1]))])
    at = np.interp(np.linspace(0.0, along[-1], n + 1), along, np.linspace(0.0, 1.0, _DENSE + 1))
    return fraction(target.symmetry) * at


def arcs_through(gait: Gait, target: FreePath, edges: np.ndarray) -> ArcPath:
    """Arcs near `gait` on the mesh `edges`; they need not join, nor keep the bound on curvature."""
    if isinstance(gait, ArcPath) and gait.symmetry == target.symmetry:
        return gait.resampled(edges)
    points = symmetric_samples(gait, target.symmetry)
    at = edges / edges[-1]
    shapes, length = _by_arc_length(points, at)
    step = 0.25 * float(np.diff(at).min())
    before, after = at - step, at + step
    extended = _extended(points, target.symmetry)
    tangent = (
        _by_arc_length(extended, (1 + after) / 3)[0] - _by_arc_length(extended, (1 + before) / 3)[0]
    )
    tangents = tangent / np.linalg.norm(tangent, axis=0)
    if gait.n_joint == 2:
        tangents = np.unwrap(np.arctan2(tangents[1], tangents[0]))[None]
        tangents = tangents + _end_correction(tangents, target, at)
    return ArcPath(
        edges,
        shapes,
        tangents,
        length / fraction(target.symmetry),
        target.symmetry,
        theta=gait.theta,
    )


def _extended(points: np.ndarray, symmetry: str) -> np.ndarray:
    """The part of a path before and after the solved one added, each as long as that."""
    if symmetry == BILATERAL:
        image = -points[::-1, ::-1]
        return np.concatenate([image[:, :-1], points, image[:, 1:]], axis=1)
    sign = -1 if symmetry == ANTIPODAL else 1
    return np.concatenate([sign * points[:, :-1], points, sign * points[:, 1:]], axis=1)


def _end_correction(headings: np.ndarray, target: FreePath, at: np.ndarray) -> np.ndarray:
    """What makes headings turn by the whole windings asked for, spread evenly (a rough guess for
    another winding)."""
    share = fraction(target.symmetry)
    turned = float(headings[0, -1] - headings[0, 0])
    unit = 2 * np.pi * share
    winding = round(turned / unit) if target.winding is None else target.winding
    if target.symmetry == ANTIPODAL and winding % 2 == 0:
        winding += 1
    first = 0.0
    if target.symmetry == BILATERAL:
        first = across_the_axis(headings[0, 0]) - headings[0, 0]
    return first + at * (winding * unit - turned)


def corners_through(gait: Gait, target: Polygon) -> Corners:
    """The polygon of the class nearest to the path of `gait`, its corners on the path (least
    squares, exact search); one that is in the class already as it is."""
    if (
        isinstance(gait, Corners)
        and gait.symmetry == target.symmetry
        and gait.vertices.shape[1] == target.pieces + 1
    ):
        return gait
    points = symmetric_samples(gait, target.symmetry)
    points, _ = _by_arc_length(points, np.linspace(0.0, 1.0, _POLYGON_POINTS))
    chosen = _best_corners(points, target.pieces)
    vertices = points[:, chosen]
    for half, end, inner in zip(target.half_ends, (0, -1), (1, -2), strict=True):
        if half:
            # the middle of a side between the last corner and its image
            vertices[:, end] = 0.5 * (vertices[:, inner] - vertices[::-1, inner])
    return replace(Corners.through(vertices, target.symmetry), theta=gait.theta)


def _best_corners(points: np.ndarray, pieces: int) -> np.ndarray:
    """Indices of the ``pieces + 1`` points, ends included, whose chords are nearest to all points
    (dynamic programming)."""
    n = points.shape[1]
    cost, before = np.full((n, n), np.inf), np.triu(np.ones((n, n)), 1)
    for i in range(n - 1):
        # points beyond i, seen from it: the chord to each of them, and all that lie before that one
        seen = points[:, i + 1 :] - points[:, i : i + 1]
        dots, squares = seen.T @ seen, np.sum(seen**2, axis=0)
        along = dots / np.maximum(squares, 1e-300)
        np.clip(along, 0.0, 1.0, out=along)
        nearer = along * (2 * dots - along * squares)
        cost[i, i + 1 :] = (
            np.cumsum(squares)
            - squares
            - np.einsum("kj,kj->j", nearer, before[: n - i - 1, : n - i - 1])
        )
    best, back = cost[0].copy(), []
    for _ in range(pieces - 1):
        total = best[:, None] + cost
        back.append(np.argmin(total, axis=0))
        best = np.min(total, axis=0)
    chosen = [n - 1]
    for step in reversed(back):
        chosen.append(int(step[chosen[-1]]))
    return np.array([0, *chosen[::-1]])
