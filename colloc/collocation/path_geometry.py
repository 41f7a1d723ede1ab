"""What makes parameters a path of its class: constraint rows and blocks that know nothing of
friction."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from scipy import sparse

from colloc.collocation.motion_rows import BlockParts
from colloc.collocation.path_equations import (
    Piece,
    arc,
    chord,
    excess_turn,
    placed_check,
    side,
    side_lengths,
    side_shares,
    unit_norm,
)
from colloc.collocation.program import ProgramRows, stacked_rows
from colloc.collocation.shape_checks import ShapeCheck, shape_checks
from colloc.gaits.control_problem import Admissible, ControlProblem
from colloc.gaits.free_path import ArcPath, FreePath, across_the_axis
from colloc.gaits.path_samples import Gait, arcs_through, corners_through, graded_edges
from colloc.gaits.polygon import Corners, Polygon
from colloc.gaits.symmetry import BILATERAL, end_conditions, tangent_conditions
from colloc.mechanics.bodies import Pairs
from colloc.numerics.blocks import LocalFunction
from colloc.numerics.constraint_rows import Group, block_group, equalities, selector
from colloc.numerics.mesh import Mesh

_BESIDE = 1e-2
_FASTEST = 30.0
_ANGLE_PER_ARC = 2.5
"""Most that a tangent may turn on one arc [rad]; more could not be told from turning the other
way."""


@dataclass(eq=False)
class PathGeometry:
    """Paths of a class near one of them: rows and blocks over their parameters alone, and where on
    a path the mesh lies."""

    near: Any
    """An `ArcPath` or `Corners`."""
    mesh: Mesh
    checks: list[ShapeCheck]
    lower: np.ndarray
    upper: np.ndarray
    """Bounds of the parameters, ``(n,)`` each."""
    piece: Piece
    """The expression of a point of a piece."""
    shape: np.ndarray
    """Variables of the piece that each mesh interval lies on, ``(n_shape, n_interval)``."""
    on: np.ndarray
    """Which piece that is, ``(n_interval,)``."""
    start: np.ndarray
    width: np.ndarray
    """Where on its piece an interval begins (`start`), and which part of the piece it takes,
    ``(n_interval,)`` each."""
    second: np.ndarray
    """The second instance parameter of the piece's points (see
    `colloc.collocation.path_equations`), ``(n_interval,)``."""
    groups: list[Group] = field(default_factory=list)
    blocks: dict[str, BlockParts] = field(default_factory=dict)
    shares: tuple[LocalFunction, np.ndarray] | None = None
    """Of the pieces in the period, if they grow, by the variables: function and gather. None: the
    mesh is in phases."""

    @property
    def knots(self) -> np.ndarray | None:
        return self.near.knots

    @property
    def rows(self) -> ProgramRows:
        return stacked_rows(self.lower.size, self.blocks, self.groups)

    def phase_mesh(self, gait: Any) -> Mesh:
        """The mesh in phases of a member: sides that grew take more of the period than the mesh
        gives them."""
        if self.shares is None:
            return self.mesh
        edges = np.append(
            gait.phases[self.on] + self.start * np.diff(gait.phases)[self.on], gait.phases[-1]
        )
        return Mesh(self.mesh.scheme, edges)

    def placed(self, check: ShapeCheck, times: np.ndarray, mesh: Mesh) -> np.ndarray:
        """Where instants lie on their pieces of the path, one of every interval of a mesh in
        phases."""
        return self.given(np.clip((times - mesh.edges[:-1]) / mesh.h, 0.0, 1.0))

    def given(self, tau: np.ndarray) -> np.ndarray:
        """Instance parameters ``(2, k)`` of points at fractions tau ``(k,)`` of the intervals, k a
        multiple of their number."""
        repeat = tau.size // self.start.size
        start, width, second = (np.repeat(a, repeat) for a in (self.start, self.width, self.second))
        return np.stack([start + width * tau, second])

    def evenly(self, turn: float) -> sparse.csr_matrix | None:
        """How fast axes turn at the points that turn evenly, from the block "shares", which is
        added; None if phases are those of the mesh."""
        if self.shares is None or not turn:
            return None
        function, gather = self.shares
        self.blocks["shares"] = function, gather, np.empty((0, 1))
        interval = np.repeat(np.arange(self.mesh.n), self.mesh.scheme.s)
        place = np.arange(interval.size), self.on[interval]
        return sparse.csr_matrix(
            (turn * self.second[interval], place), shape=(interval.size, function.n_out)
        )


def _ends(
    name: str, conditions: tuple[np.ndarray, np.ndarray], columns: np.ndarray, n: int
) -> Group:
    first, last = conditions
    return equalities(name, first @ selector(columns[:, 0], n) + last @ selector(columns[:, -1], n))


def _with_checks(geometry: PathGeometry, admissible: Admissible) -> PathGeometry:
    n_cell = geometry.start.size
    for check in geometry.checks:
        given = np.vstack([geometry.given(np.full(n_cell, 0.5)), np.full(n_cell, -1.0)])
        geometry.blocks[check.name] = (placed_check(check, geometry.piece), geometry.shape, given)
        geometry.groups.append(check.group(admissible.joint_limit, n_cell, geometry.lower.size))
    return geometry


def _nested(mesh: Mesh, knots: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """How long each piece takes, ``(n_piece,)``, and of every interval its piece, where on it it
    begins, and its part of it."""
    h = np.diff(knots)
    on = np.searchsorted(knots, 0.5 * (mesh.edges[1:] + mesh.edges[:-1])) - 1
    return h, on, (mesh.edges[:-1] - knots[on]) / h[on], mesh.h / h[on]


def path_geometry(
    control: ControlProblem,
    gait: Gait,
    edges: np.ndarray | None = None,
    scheme: str = "",
    far: Pairs = (),
) -> PathGeometry:
    """Paths of a class near a gait, which fixes winding, start phase, and which interval lies on
    which side.

    Edges are phases; by default graded by the turns of the gait (free paths), or evenly spread over
    the sides (polygons).
    """
    near, mesh = path_through(control, gait, edges, scheme)
    made = _arc_geometry if control.admissible.gait.of_arcs else _side_geometry
    size = control.admissible.gait.size(
        near.n_joint, (mesh.edges if near.knots is None else near.knots).size - 1
    )
    bounds = np.full(size, -np.inf), np.full(size, np.inf)
    return made(control.admissible, near, mesh, shape_checks(control.dynamics.body, far), bounds)


def path_through(
    control: ControlProblem, gait: Gait, edges: np.ndarray | None, scheme: str = ""
) -> tuple[Any, Mesh]:
    """A path of the class laid through a gait, and the mesh in its phases; it need not keep every
    constraint.

    Where arcs of a free path meet, the mesh has an edge. Arcs that meet at edges already are kept;
    else every interval is an arc, if those are not too many.
    """
    kind = control.admissible.gait
    if kind.of_arcs:
        knots = _arc_knots(control, gait, edges)
        return arcs_through(gait, kind, knots), control.mesh(
            knots if edges is None else with_knots(edges, knots), scheme
        )
    mesh, corners = control.mesh(edges, scheme), corners_through(gait, kind)
    return corners, Mesh(mesh.scheme, _with_vertices(mesh.edges, corners.phases))


def _arc_knots(control: ControlProblem, gait: Gait, edges: np.ndarray | None) -> np.ndarray:
    kind = control.admissible.gait
    if edges is not None:
        if (
            isinstance(gait, ArcPath)
            and gait.symmetry == kind.symmetry
            and np.isin(gait.edges, edges).all()
        ):
            return gait.edges
        if edges.size - 1 <= kind.most_arcs(control.admissible.n_joint):
            return edges
    return graded_edges(gait, kind, control.intervals)


def with_knots(edges: np.ndarray, knots: np.ndarray) -> np.ndarray:
    """Edges and knots together; an edge beside a knot, nearer than a hundredth of its neighbours,
    is that knot."""
    near = np.abs(edges[:, None] - knots).min(axis=1)
    apart = np.minimum(np.diff(edges, prepend=-np.inf), np.diff(edges, append=np.inf))
    return np.union1d(edges[near > _BESIDE * apart], knots)


def _with_vertices(edges: np.ndarray, phases: np.ndarray) -> np.ndarray:
    """Edges moved so that every vertex is one of them: each side keeps its share of the intervals,
    at least two."""
    if np.abs(edges[:, None] - phases).min(axis=0).max() < 1e-9:
        nearest = np.abs(edges[:, None] - phases).argmin(axis=0)
        edges = edges.copy()
        edges[nearest] = phases
        return edges
    counts = np.maximum(2, np.round((edges.size - 1) * np.diff(phases) / phases[-1]).astype(int))
    parts = [
        np.linspace(a, b, k + 1)[:-1] for a, b, k in zip(phases, phases[1:], counts, strict=False)
    ]
    return np.concatenate([*parts, phases[-1:]])


def _arc_geometry(
    admissible: Admissible,
    near: ArcPath,
    mesh: Mesh,
    checks: list[ShapeCheck],
    bounds: tuple[np.ndarray, np.ndarray],
) -> PathGeometry:
    """Arcs that join, close, keep the bound on curvature and admissible; the mesh has an edge
    wherever two of them meet."""
    gait: FreePath = admissible.gait
    n_joint, symmetry, n = admissible.n_joint, gait.symmetry, bounds[0].size
    speed, tangents, shapes = gait.split(np.arange(n), n_joint)
    piece = arc(n_joint)
    h, on, start, width = _nested(mesh, near.edges)
    n_arc = h.size
    arcs = np.concatenate(
        [shapes[:, :-1], tangents[:, :-1], tangents[:, 1:], np.repeat(speed, n_arc, axis=1)]
    )
    on_mesh = {"shape": arcs[:, on], "on": on, "start": start, "width": width, "second": h[on]}
    geometry = PathGeometry(near, mesh, checks, *bounds, piece=piece, **on_mesh)
    geometry.lower[speed], geometry.upper[speed] = admissible.smallest_shape_speed, _FASTEST

    function = chord(piece)
    geometry.blocks["chord"] = (function, arcs, h[None])
    columns = selector(shapes[:, 1:].ravel(order="F"), n) - selector(
        shapes[:, :-1].ravel(order="F"), n
    )
    joined = {"chord": -sparse.eye(n_joint * n_arc, format="csr")}
    geometry.groups = [
        equalities("path", columns, joined),
        _ends("closure", end_conditions(symmetry, n_joint), shapes, n),
    ]
    if n_joint == 2:
        turn = selector(tangents[0, 1:], n) - selector(tangents[0, :-1], n)
        allowed = sparse.csr_matrix(
            (2 * np.pi * gait.curvature * h, (np.arange(n_arc), np.full(n_arc, speed[0, 0]))),
            shape=(n_arc, n),
        )
        least, most = np.full(n_arc, -np.inf), np.zeros(n_arc)
        geometry.groups += [
            Group("curvature to the left", least, most, (turn - allowed).tocsr()),
            Group("curvature to the right", least, most, (-turn - allowed).tocsr()),
            Group(
                "turn",
                np.full(n_arc, -_ANGLE_PER_ARC),
                np.full(n_arc, _ANGLE_PER_ARC),
                turn.tocsr(),
            ),
        ]
        winding = near.winding if gait.winding is None else gait.winding
        turned = 2 * np.pi * gait.fraction * float(winding or 0)
        if symmetry == BILATERAL:
            first = across_the_axis(near.tangents[0, 0])
            for place, value in ((tangents[0, 0], first), (tangents[0, -1], first + turned)):
                geometry.lower[place] = geometry.upper[place] = value
        else:
            row = selector(tangents[0, -1:], n) - selector(tangents[0, :1], n)
            geometry.groups.append(
                Group("winding", np.array([turned]), np.array([turned]), row.tocsr())
            )
    else:
        norms = tangents if symmetry == BILATERAL else tangents[:, :-1]
        geometry.blocks["norm"] = (unit_norm(n_joint), norms, np.empty((0, norms.shape[1])))
        geometry.blocks["turn"] = (excess_turn(n_joint, gait.curvature), arcs[n_joint:], h[None])
        geometry.groups += [
            block_group("unit tangent", 0.0, 0.0, norms.shape[1], n, "norm"),
            block_group("curvature", -np.inf, 0.0, n_arc, n, "turn"),
            _ends("smooth closure", tangent_conditions(symmetry, n_joint), tangents, n),
        ]
    if symmetry != BILATERAL:
        # the start phase: start on the plane across the guess at its start
        normal = near.rates(np.zeros(1))[:, 0] / near.length
        level = np.array([normal @ near.shapes[:, 0]])
        geometry.groups.append(
            Group("start", level, level, sparse.csr_matrix(normal) @ selector(shapes[:, 0], n))
        )
    return _with_checks(geometry, admissible)


def _side_geometry(
    admissible: Admissible,
    near: Corners,
    mesh: Mesh,
    checks: list[ShapeCheck],
    bounds: tuple[np.ndarray, np.ndarray],
) -> PathGeometry:
    """Straight pieces that close and keep admissible; the mesh, in phases of `near`, has an edge at
    every vertex of it."""
    gait: Polygon = admissible.gait
    n_joint, symmetry, n = admissible.n_joint, gait.symmetry, bounds[0].size
    vertices = gait.split(np.arange(n), n_joint)
    span, on, start, width = _nested(mesh, near.phases)
    shape = np.concatenate([vertices[:, on], vertices[:, on + 1]])
    on_mesh = {"shape": shape, "on": on, "start": start, "width": width, "second": 1.0 / span[on]}
    geometry = PathGeometry(near, mesh, checks, *bounds, piece=side(n_joint), **on_mesh)
    geometry.groups = [_ends("closure", end_conditions(symmetry, n_joint), vertices, n)]
    across = tangent_conditions(BILATERAL, n_joint)[0][: n_joint // 2]
    for half, (a, b) in zip(gait.half_ends, ((0, 1), (-1, -2)), strict=True):
        if half:
            row = across @ (selector(vertices[:, b], n) - selector(vertices[:, a], n))
            geometry.groups.append(
                equalities(f"side across the axis at {'start' if a == 0 else 'end'}", row)
            )
    n_piece, chain = vertices.shape[1] - 1, vertices.ravel(order="F")[:, None]
    geometry.shares = side_shares(n_joint, n_piece), chain
    geometry.blocks["sides"] = (side_lengths(n_joint, n_piece), chain, np.empty((0, 1)))
    shortest = np.full(n_piece, gait.shortest_side)
    shortest[[0, -1]] *= np.where(gait.half_ends, 0.5, 1.0)
    least = np.append(shortest**2, 2 * np.pi * admissible.smallest_shape_speed * gait.fraction)
    geometry.groups.append(block_group("sides", least, np.inf, n_piece + 1, n))
    return _with_checks(geometry, admissible)
