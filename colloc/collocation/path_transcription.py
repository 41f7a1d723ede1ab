"""Direct collocation of gaits given by their path: arcs of bounded curvature, or polygons.

Decision variables: the path's parameters (see their classes in `gaits`); the tail's orientation theta at every site; distance x
and work W at every edge; in the formulation "full" also joint angles, rates, tail velocity and link forces at every point.
Rates are unit tangents and delta is measured at unit shape speed. As in `collocation.transcription`, x is the displacement of
the centre of mass along a fixed direction and the first orientation is free; theta is seen from axes that turn evenly.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import casadi as ca
import numpy as np
from scipy import sparse

from colloc.collocation.implicit_velocity import ImplicitVelocity
from colloc.collocation.layout import Layout, layout_of
from colloc.collocation.motion_rows import (
    SHAPE,
    BlockParts,
    asked_rows,
    at_points,
    bound_motion,
    motion_groups,
    objective_block,
)
from colloc.collocation.path_equations import arc, full_path_point, path_point, per_phase, side, squared_distance
from colloc.collocation.path_geometry import PathGeometry, arc_geometry, side_geometry
from colloc.collocation.program import GaitProgram, Implicit, assembled
from colloc.collocation.shape_checks import ShapeCheck
from colloc.gaits.control_problem import Admissible, ControlProblem
from colloc.gaits.free_path import ArcPath, FreePath
from colloc.gaits.path_samples import Gait, arcs_through, corners_through, graded_edges
from colloc.gaits.polygon import Corners
from colloc.mechanics.bodies import Body, Pairs
from colloc.numerics.blocks import Block, LocalFunction
from colloc.numerics.constraint_rows import Group, output_group
from colloc.numerics.mesh import Mesh

_BESIDE = 1e-2


@dataclass(frozen=True, eq=False)
class PathProgram(GaitProgram):
    """The nonlinear program of a path, with the path's geometry."""

    geometry: PathGeometry

    def phase_mesh(self, gait: ArcPath | Corners) -> Mesh:
        """The mesh in phases of a member: sides that grew take more of the period than the program's mesh gives them."""
        if isinstance(gait, ArcPath):
            return self.mesh
        on = self.geometry.on
        edges = np.append(gait.phases[on] + self.geometry.start * np.diff(gait.phases)[on], gait.phases[-1])
        return Mesh(self.mesh.scheme, edges)

    def placed(self, check: ShapeCheck, times: np.ndarray, mesh: Mesh) -> np.ndarray:
        """Where the instants lie on their pieces of the path."""
        return self.geometry.given(np.clip((times - mesh.edges[:-1]) / mesh.h, 0.0, 1.0))


def _geometry(
    admissible: Admissible, mesh: Mesh, parameters: np.ndarray, n: int, near: ArcPath | Corners, far: Pairs
) -> PathGeometry:
    if isinstance(near, ArcPath):
        return arc_geometry(admissible, mesh, parameters, n, near, far)
    return side_geometry(admissible, mesh, parameters, n, near, far)


def path_through(
    control: ControlProblem, gait: Gait, edges: np.ndarray | None, scheme: str = ""
) -> tuple[ArcPath | Corners, Mesh]:
    """A path of the class laid through a gait, and the mesh in its phases; it need not keep every constraint.

    Where arcs of a free path meet, the mesh has an edge. Arcs that meet at edges already are kept; else every interval is an
    arc, if those are not too many.
    """
    kind = control.admissible.gait
    if isinstance(kind, FreePath):
        knots = _arc_knots(control, gait, edges)
        return arcs_through(gait, kind, knots), control.mesh(knots if edges is None else with_knots(edges, knots), scheme)
    mesh, corners = control.mesh(edges, scheme), corners_through(gait, kind)
    if isinstance(gait, Corners) and gait.symmetry == kind.symmetry and gait.corners.shape == corners.corners.shape:
        corners = gait
    return corners, Mesh(mesh.scheme, _with_vertices(mesh.edges, corners.phases))


def _arc_knots(control: ControlProblem, gait: Gait, edges: np.ndarray | None) -> np.ndarray:
    kind = control.admissible.gait
    if edges is not None:
        if isinstance(gait, ArcPath) and gait.symmetry == kind.symmetry and np.isin(gait.edges, edges).all():
            return gait.edges
        if edges.size - 1 <= kind.most_arcs(control.admissible.n_joint):
            return edges
    return graded_edges(gait, kind, control.intervals)


def with_knots(edges: np.ndarray, knots: np.ndarray) -> np.ndarray:
    """Edges and knots together; an edge beside a knot, nearer than a hundredth of its neighbours, is that knot."""
    near = np.abs(edges[:, None] - knots).min(axis=1)
    apart = np.minimum(np.diff(edges, prepend=-np.inf), np.diff(edges, append=np.inf))
    return np.union1d(edges[near > _BESIDE * apart], knots)


def _with_vertices(edges: np.ndarray, phases: np.ndarray) -> np.ndarray:
    """Edges moved so that every vertex is one of them: each side keeps its share of the intervals, at least two."""
    if np.abs(edges[:, None] - phases).min(axis=0).max() < 1e-9:
        nearest = np.abs(edges[:, None] - phases).argmin(axis=0)
        edges = edges.copy()
        edges[nearest] = phases
        return edges
    counts = np.maximum(2, np.round((edges.size - 1) * np.diff(phases) / phases[-1]).astype(int))
    parts = [np.linspace(a, b, k + 1)[:-1] for a, b, k in zip(phases, phases[1:], counts, strict=False)]
    return np.concatenate([*parts, phases[-1:]])


def transcribe_path(
    control: ControlProblem, gait: Gait, edges: np.ndarray | None = None, scheme: str = "", far: Pairs = ()
) -> PathProgram:
    """The nonlinear program for a class that bounds the path, near a gait, which fixes winding, start phase, and which
    interval lies on which side.

    Edges are phases; by default graded by the turns of the gait (free paths), or evenly spread over the sides (polygons).
    """
    near, mesh = path_through(control, gait, edges, scheme)
    layout = layout_of(control, mesh, near.knots)
    body, law, regime, *_ = control.dynamics
    geometry = _geometry(control.admissible, mesh, layout.parameters[:, 0], layout.n, near, far)
    kind = arc if isinstance(near, ArcPath) else side
    full = layout.forces.size > 0
    point = full_path_point(body, law, kind, regime) if full else path_point(body, law, kind)
    n_point = mesh.n_point
    here, given = np.repeat(geometry.shape, mesh.scheme.s, axis=1), geometry.given(np.tile(mesh.scheme.c, mesh.n))
    own = at_points(layout, mesh, ("theta", "angles", "rates", "z", "forces") if full else ("theta",))
    geometry.blocks["point"] = (point, np.concatenate([own, here]), given)
    groups = [
        *geometry.groups,
        *(_full_groups(body, point.n_out, n_point, layout.n) if full else []),
        *motion_groups(control, layout, mesh, point.n_out, 1.0, geometry.evenly(control.dynamics.turn, mesh)),
    ]
    bound_motion(control, layout, geometry.lower, geometry.upper)
    velocity = ImplicitVelocity(body, law, n_point)
    piece = geometry.piece
    place = ca.Function("place", [piece.shape, piece.given], [piece.angles, piece.direction]).map(n_point)
    unknown = ca.DM(np.full((3, n_point), np.nan))

    def balanced(local: ca.MX, delta: ca.MX) -> ca.MX:
        angles, direction = place(local[1:, :], ca.DM(given))
        return velocity(angles, direction, unknown, delta)

    def block(function: LocalFunction, names: Sequence[str]) -> BlockParts:
        placed = names == SHAPE
        own = [] if placed else [at_points(layout, mesh, names)]
        return per_phase(function, piece, placed=placed), np.concatenate([*own, here]), given

    for name, (parts, group) in asked_rows(control, layout, mesh, block, 1.0).items():
        geometry.blocks[name] = parts
        groups.append(group)
    implicit: Implicit = {} if full else {"point": balanced}
    objective = objective_block(control, layout)
    return _program(control, mesh, near.knots, layout, geometry, groups, objective, implicit, velocity)


def _full_groups(body: Body, n_out: int, n_point: int, n: int) -> list[Group]:
    """The equations of every point where nothing is eliminated."""
    n_joint, n_law = body.n_joint, len(body.force_names)
    ends = np.cumsum([0, n_joint, n_joint, n_law, 3])
    names = ("angles", "rates", "force law", "balance")
    return [output_group(name, range(a, b), n_out, n_point, n) for name, a, b in zip(names, ends, ends[1:], strict=False)]


def transcribe_fit(
    control: ControlProblem, gait: Gait, edges: np.ndarray | None = None, scheme: str = "", far: Pairs = ()
) -> PathProgram:
    """The nonlinear program of the member of a path class nearest to a gait, without friction, x or W.

    Nearest means in the sum of the squared distances of edges, or corners, to those of a path laid through the gait.
    """
    near, mesh = path_through(control, gait, edges, scheme)
    admissible = control.admissible
    size = layout_of(control, mesh, near.knots).parameters.size
    own, none = np.arange(size)[:, None], np.empty((1, 0), dtype=int)
    layout = Layout(own, *9 * (none,), size)
    geometry = _geometry(admissible, mesh, own[:, 0], size, near, far)
    shapes = admissible.gait.split(own[:, 0], admissible.n_joint)
    shapes = (shapes[-1] if isinstance(near, ArcPath) else shapes).ravel(order="F")
    target = admissible.gait.parameters(near)[shapes]
    objective = Block(squared_distance(shapes.size), shapes[:, None], sparse.eye(1, format="csr"), target[:, None])
    return _program(control, mesh, near.knots, layout, geometry, geometry.groups, objective, {}, None)


def _program(
    control: ControlProblem,
    mesh: Mesh,
    knots: np.ndarray | None,
    layout: Layout,
    geometry: PathGeometry,
    groups: list[Group],
    objective: Block,
    implicit: Implicit,
    velocity: ImplicitVelocity | None,
) -> PathProgram:
    assembly, names, row_lower, row_upper, rows = assembled(layout, objective, geometry.blocks, groups, implicit)
    lower, upper, checks = geometry.lower, geometry.upper, geometry.checks
    return PathProgram(
        control, mesh, knots, layout, assembly, names, lower, upper, row_lower, row_upper, rows, checks, 1.0, velocity, geometry
    )
