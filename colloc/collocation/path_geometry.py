"""What makes variables a path of its class: constraint rows and blocks that know nothing of friction."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import sparse

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
from colloc.collocation.shape_checks import ShapeCheck, shape_checks
from colloc.gaits.control_problem import Admissible
from colloc.gaits.free_path import ArcPath, FreePath, across_the_axis
from colloc.gaits.polygon import Corners, Polygon
from colloc.gaits.symmetry import BILATERAL, end_conditions, tangent_conditions
from colloc.mechanics.bodies import Pairs
from colloc.numerics.blocks import LocalFunction
from colloc.numerics.constraint_rows import Group, block_group, equalities, selector
from colloc.numerics.mesh import Mesh

_FASTEST = 30.0
_ANGLE_PER_ARC = 2.5
"""Most that a tangent may turn on one arc [rad]; more could not be told from turning the other way."""


@dataclass(eq=False)
class PathGeometry:
    """Constraint rows and blocks of a path, and where on it the mesh lies."""

    piece: Piece
    """The expression of a point of a piece."""
    shape: np.ndarray
    """Variables of the piece that each mesh interval lies on, ``(n_shape, n_interval)``."""
    on: np.ndarray
    """Which piece that is, ``(n_interval,)``."""
    start: np.ndarray
    width: np.ndarray
    """Where on its piece an interval begins (`start`), and which part of the piece it takes, ``(n_interval,)`` each."""
    second: np.ndarray
    """The second instance parameter of the piece's points (see `colloc.collocation.path_equations`), ``(n_interval,)``."""
    groups: list[Group]
    blocks: dict[str, tuple[LocalFunction, np.ndarray, np.ndarray]]
    """Function, gather, instance parameters, by name."""
    checks: list[ShapeCheck]
    lower: np.ndarray  # (n,)
    upper: np.ndarray  # (n,)
    shares: tuple[LocalFunction, np.ndarray] | None = None
    """Of the pieces in the period, if they grow, by the variables: function and gather. None: the mesh is in phases."""

    def given(self, tau: np.ndarray) -> np.ndarray:
        """Instance parameters ``(2, k)`` of points at fractions tau ``(k,)`` of the intervals, k a multiple of their number."""
        repeat = tau.size // self.start.size
        start, width, second = (np.repeat(a, repeat) for a in (self.start, self.width, self.second))
        return np.stack([start + width * tau, second])

    def evenly(self, turn: float, mesh: Mesh) -> sparse.csr_matrix | None:
        """How fast axes turn at the points that turn evenly, from the block "shares", which is added; None if phases are those
        of the mesh."""
        if self.shares is None or not turn:
            return None
        function, gather = self.shares
        self.blocks["shares"] = function, gather, np.empty((0, 1))
        interval = np.repeat(np.arange(mesh.n), mesh.scheme.s)
        place = np.arange(interval.size), self.on[interval]
        return sparse.csr_matrix((turn * self.second[interval], place), shape=(interval.size, function.n_out))


def _ends(name: str, conditions: tuple[np.ndarray, np.ndarray], columns: np.ndarray, n: int) -> Group:
    first, last = conditions
    return equalities(name, first @ selector(columns[:, 0], n) + last @ selector(columns[:, -1], n))


def _add_checks(geometry: PathGeometry, admissible: Admissible, n: int) -> None:
    n_cell = geometry.start.size
    for check in geometry.checks:
        given = np.vstack([geometry.given(np.full(n_cell, 0.5)), np.full(n_cell, -1.0)])
        geometry.blocks[check.name] = (placed_check(check, geometry.piece), geometry.shape, given)
        geometry.groups.append(check.group(admissible.joint_limit, n_cell, n))


def _nested(mesh: Mesh, knots: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """How long each piece takes, ``(n_piece,)``, and of every interval its piece, where on it it begins, and its part of it."""
    h = np.diff(knots)
    on = np.searchsorted(knots, 0.5 * (mesh.edges[1:] + mesh.edges[:-1])) - 1
    return h, on, (mesh.edges[:-1] - knots[on]) / h[on], mesh.h / h[on]


def arc_geometry(admissible: Admissible, mesh: Mesh, parameters: np.ndarray, n: int, near: ArcPath, far: Pairs) -> PathGeometry:
    """Arcs that join, close, keep the bound on curvature and admissible; the mesh has an edge wherever two of them meet.

    Parameters
    ----------
    admissible : Admissible
    mesh : Mesh
        Of phases.
    parameters : (n_parameter,)
        Indices of the variables of the path.
    n : int
        Number of all variables.
    near : ArcPath
        Fixes which part of the period each arc takes, the winding, and the start phase of a path whose symmetry does not.
    """
    gait: FreePath = admissible.gait
    n_joint, symmetry = admissible.n_joint, gait.symmetry
    speed, tangents, shapes = gait.split(parameters, n_joint)
    piece = arc(n_joint)
    h, on, start, width = _nested(mesh, near.edges)
    n_arc = h.size
    arcs = np.concatenate([shapes[:, :-1], tangents[:, :-1], tangents[:, 1:], np.repeat(speed, n_arc, axis=1)])
    geometry = PathGeometry(
        piece, arcs[:, on], on, start, width, h[on], [], {}, shape_checks(admissible.body, far),
        np.full(n, -np.inf), np.full(n, np.inf),
    )  # fmt: skip
    geometry.lower[speed], geometry.upper[speed] = admissible.smallest_shape_speed, _FASTEST

    function = chord(piece)
    geometry.blocks["chord"] = (function, arcs, h[None])
    columns = selector(shapes[:, 1:].ravel(order="F"), n) - selector(shapes[:, :-1].ravel(order="F"), n)
    joined = {"chord": -sparse.eye(n_joint * n_arc, format="csr")}
    geometry.groups = [
        equalities("path", columns, joined),
        _ends("closure", end_conditions(symmetry, n_joint), shapes, n),
    ]
    if n_joint == 2:
        turn = selector(tangents[0, 1:], n) - selector(tangents[0, :-1], n)
        allowed = sparse.csr_matrix(
            (2 * np.pi * gait.curvature * h, (np.arange(n_arc), np.full(n_arc, speed[0, 0]))), shape=(n_arc, n)
        )
        least, most = np.full(n_arc, -np.inf), np.zeros(n_arc)
        geometry.groups += [
            Group("curvature to the left", least, most, (turn - allowed).tocsr()),
            Group("curvature to the right", least, most, (-turn - allowed).tocsr()),
            Group("turn", np.full(n_arc, -_ANGLE_PER_ARC), np.full(n_arc, _ANGLE_PER_ARC), turn.tocsr()),
        ]
        winding = near.winding if gait.winding is None else gait.winding
        turned = 2 * np.pi * gait.fraction * float(winding or 0)
        if symmetry == BILATERAL:
            first = across_the_axis(near.tangents[0, 0])
            for place, value in ((tangents[0, 0], first), (tangents[0, -1], first + turned)):
                geometry.lower[place] = geometry.upper[place] = value
        else:
            row = selector(tangents[0, -1:], n) - selector(tangents[0, :1], n)
            geometry.groups.append(Group("winding", np.array([turned]), np.array([turned]), row.tocsr()))
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
        geometry.groups.append(Group("start", level, level, sparse.csr_matrix(normal) @ selector(shapes[:, 0], n)))
    _add_checks(geometry, admissible, n)
    return geometry


def side_geometry(
    admissible: Admissible, mesh: Mesh, parameters: np.ndarray, n: int, near: Corners, far: Pairs
) -> PathGeometry:
    """Straight pieces that close and keep admissible; the mesh, in phases of `near`, has an edge at every vertex of it."""
    gait: Polygon = admissible.gait
    n_joint, symmetry = admissible.n_joint, gait.symmetry
    vertices = gait.split(parameters, n_joint)
    span, on, start, width = _nested(mesh, near.phases)
    geometry = PathGeometry(
        side(n_joint), np.concatenate([vertices[:, on], vertices[:, on + 1]]), on, start, width, 1.0 / span[on],
        [_ends("closure", end_conditions(symmetry, n_joint), vertices, n)], {}, shape_checks(admissible.body, far),
        np.full(n, -np.inf), np.full(n, np.inf),
    )  # fmt: skip
    across = tangent_conditions(BILATERAL, n_joint)[0][: n_joint // 2]
    for half, (a, b) in zip(gait.half_ends, ((0, 1), (-1, -2)), strict=True):
        if half:
            row = across @ (selector(vertices[:, b], n) - selector(vertices[:, a], n))
            geometry.groups.append(equalities(f"side across the axis at {'start' if a == 0 else 'end'}", row))
    n_piece, chain = vertices.shape[1] - 1, vertices.ravel(order="F")[:, None]
    geometry.shares = side_shares(n_joint, n_piece), chain
    geometry.blocks["sides"] = (side_lengths(n_joint, n_piece), chain, np.empty((0, 1)))
    shortest = np.full(n_piece, gait.shortest_side)
    shortest[[0, -1]] *= np.where(gait.half_ends, 0.5, 1.0)
    least = np.append(shortest**2, 2 * np.pi * admissible.smallest_shape_speed * gait.fraction)
    geometry.groups.append(block_group("sides", least, np.inf, n_piece + 1, n))
    _add_checks(geometry, admissible, n)
    return geometry
