"""Paths as a search sees them: arcs or straight pieces on a mesh, and rows that keep them in their
class, by few parameters.

A free path is its mean shape speed, the tangents where arcs meet, and the shape at its start: all
other shapes follow, arc by arc. Tangents of more than two joints are divided by their length, so
that they may be any vectors, and the last one is that of the first where the path closes smoothly.
A polygon is its vertices.
"""

from __future__ import annotations

import casadi as ca
import numpy as np

from colloc.collocation.path_equations import along_arcs, along_shape
from colloc.collocation.path_geometry import path_geometry, path_through
from colloc.collocation.worst_instants import check_values, held_shares, near_peaks
from colloc.gaits.control_problem import ControlProblem
from colloc.gaits.free_path import ArcPath
from colloc.gaits.gait_fields import AnyGait
from colloc.gaits.path_samples import arcs_through
from colloc.gaits.polygon import Corners
from colloc.gaits.symmetry import BILATERAL, NONE
from colloc.mechanics.bodies import Pairs
from colloc.numerics.columns import ChosenRows, ColumnFunction
from colloc.numerics.constraint_rows import selector
from colloc.numerics.sqp import minimised, remembered
from colloc.reduced.constraints import Constraints
from colloc.reduced.given import Given
from colloc.reduced.pointed import pointed
from colloc.system.errors import NotConvergedError

_FOLLOWS = ("path", "unit tangent", "smooth closure")
"""Rows that hold whatever the parameters are; for bilateral paths the last one does not."""

_EXACT, _NEAR, _FITTED, _SETTLED, _ROUNDS = 1e-7, 1e-6, 3e-8, 1e-5, 12
"""Violation at which a gait is a member; accuracy of the squared distance of a new one, at first
and as the last violations go; violation of a start, where the worst instant of a cell swings
between two; rounds of moving the checks to the worst instants: three joints need up to 8."""

_LEAST_CURVATURE, _SOFT = 1e-4, 0.1
"""Of the distance to a gait, as a share of the largest; and of the first guess of the
objective's."""


class PathSpace:
    """Members of a class of paths near one of them, which fixes winding, start phase, and which
    interval lies on which side; edges of the mesh are phases of that one. Attributes as
    `colloc.reduced.program.SearchSpace`."""

    def __init__(
        self,
        control: ControlProblem,
        near: AnyGait,
        edges: np.ndarray | None = None,
        scheme: str = "",
        far: Pairs = (),
    ) -> None:
        self.control, self.given = control, Given(near, edges, scheme, far)
        self._paths = paths = path_geometry(control, near, edges, scheme, far)
        self.mesh, self._rows, self.phase_mesh = paths.mesh, paths.rows, paths.phase_mesh
        free = paths.lower < paths.upper
        self._fixed = np.where(free, 0.0, paths.lower)
        self.own = np.arange(free.size)
        gait, n_joint = control.admissible.gait, control.admissible.n_joint
        self._arcs, parts = gait.of_arcs, gait.split(self.own, n_joint)
        self._closed = self._arcs and n_joint > 2 and gait.symmetry != BILATERAL
        self._side = 1.0 if gait.symmetry == NONE else -1.0
        self.shapes = parts[-1] if self._arcs else parts
        if self._arcs:
            speed, self._tangents, shapes = parts
            self._speed, last = speed[0, 0], self._tangents[:, : -1 if self._closed else None]
            self.own = np.concatenate(
                [speed[0], last.ravel(order="F"), shapes[:, 0], self.own[shapes[-1, -1] + 1 :]]
            )
            self.own = self.own[free[self.own]]
            chord, self._on_arcs, arc_h = paths.blocks["chord"]
            self._chord, self._chord_slope = (
                ColumnFunction(chord.value),
                ColumnFunction(chord.jacobian),
            )
            self._chord_entries, self._along = (
                (chord.jac_row, chord.jac_col),
                (arc_h, np.zeros_like(arc_h)),
            )
        self.n = self.own.size
        self.lower, self.upper = paths.lower[self.own], paths.upper[self.own]
        dropped = _FOLLOWS[: 2 if gait.symmetry == BILATERAL else 3] if self._arcs else ()
        moving = [*dropped, *(check.name for check in paths.checks)]
        self._fixed_rows = {
            n: np.arange(r.stop - r.start) for n, r in self._rows.groups.items() if n not in moving
        }
        self._place()
        self._followed, self._steep = remembered(self._follow), remembered(self._chord_jacobian)

    def _place(self) -> None:
        """Where the collocation points lie, as functions of the parameters."""
        mesh, piece = self.mesh, self._paths.piece
        out = ca.vertcat(piece.angles, piece.direction, piece.speed)
        arguments = [piece.shape, piece.given]
        self._value = ColumnFunction(ca.Function("place", arguments, [out]))
        n_joint = self.control.admissible.n_joint
        self._pulled = along_arcs(n_joint) if self._arcs and n_joint > 2 else along_shape(piece)
        self._given = self._paths.given(np.tile(mesh.scheme.c, mesh.n))
        self._gather = np.repeat(self._paths.shape, mesh.scheme.s, axis=1)
        self._scatter = selector(self._gather.ravel(), self._fixed.size).T.tocsr()

    def full_parameters(self, v: np.ndarray) -> np.ndarray:
        """The parameters of `colloc.gaits.free_path`: shapes where arcs meet follow from the
        start."""
        return self._followed(v).copy()

    def _raw(self, v: np.ndarray) -> np.ndarray:
        """Full parameters with tangents of any length, and shapes only at the start."""
        p = self._fixed.copy()
        p[self.own] = v
        if self._closed:
            p[self._tangents[:, -1]] = self._side * p[self._tangents[:, 0]]
        return p

    def _follow(self, v: np.ndarray) -> np.ndarray:
        p = self._raw(v)
        if self._arcs:
            if len(self._tangents) > 1:
                p[self._tangents] /= np.linalg.norm(p[self._tangents], axis=0)
            step = self._chord(p[self._on_arcs], *self._along)
            start = p[self.shapes[:, :1]]
            p[self.shapes] = np.concatenate([start, start + np.cumsum(step, axis=1)], axis=1)
        return p

    def from_full(self, v: np.ndarray, on_full: np.ndarray) -> np.ndarray:
        """Derivatives ``(k, n)`` along v of k numbers, from those along the full parameters, ``(k,
        m)``: one sweep back."""
        if not self._arcs:
            return on_full[:, self.own]
        on, shapes, tangents = on_full.copy(), self.shapes, self._tangents
        on_shapes = on_full[:, shapes]
        # a step moves all shapes after it; it does not depend on where it starts
        later = np.cumsum(on_shapes[:, :, :0:-1], axis=2)[:, :, ::-1]
        on_arcs = np.einsum("kja,ajs->ksa", later, self._steep(v))
        on[:, shapes[:, 0]] = on_shapes.sum(axis=2)
        on[:, self._speed] += on_arcs[:, -1].sum(axis=1)
        rows = len(tangents)
        on[:, tangents[:, :-1]] += on_arcs[:, len(shapes) : len(shapes) + rows]
        on[:, tangents[:, 1:]] += on_arcs[:, len(shapes) + rows : -1]
        if rows > 1:
            if self._closed:
                on[:, tangents[:, 0]] += self._side * on[:, tangents[:, -1]]
            raw = self._raw(v)[tangents]
            length = np.linalg.norm(raw, axis=0)
            along, unit = on[:, tangents], raw / length
            on[:, tangents] = (along - (along * unit).sum(axis=1, keepdims=True) * unit) / length
        return on[:, self.own]

    def _chord_jacobian(self, v: np.ndarray) -> np.ndarray:
        """How far every arc leads, derived by its locals ``(n_arc, n_joint, n_local)``."""
        local = self.full_parameters(v)[self._on_arcs]
        jacobian = np.zeros((local.shape[1], len(self.shapes), len(local)))
        jacobian[:, *self._chord_entries] = self._chord_slope(local, *self._along).T
        return jacobian

    def frame(self, v: np.ndarray) -> np.ndarray:
        """Derivatives of the shapes where pieces meet, edge by edge, ``(n_joint n_edge, n)``."""
        return self.from_full(v, np.eye(self._fixed.size)[self.shapes.ravel(order="F")])

    def member(self, v: np.ndarray) -> ArcPath | Corners:
        return self._member(self.full_parameters(v))

    def _member(self, full: np.ndarray) -> ArcPath | Corners:
        return self.control.admissible.member(full, self._paths.knots)

    def parameters(self, gait: AnyGait) -> np.ndarray:
        """Parameters ``(n,)`` of the member nearest to a gait, in the sum of squared distances
        where arcs or sides meet. `NotConvergedError` if no path of the class is found near the
        gait."""
        laid = self._pointed(gait)
        v, target, accuracy = laid[self.own], laid, _NEAR
        for _ in range(_ROUNDS):
            asked = self.constraints(v)
            values = asked.values(v)
            outside = max((asked.lower - values).max(), (values - asked.upper).max(), asked.excess)
            if outside < _EXACT and (
                accuracy == _FITTED or np.abs(self.full_parameters(v) - laid).max() < _EXACT
            ):
                return v
            # the first round goes near the gait, later ones the shortest way into the class, which
            # moves with its checks
            nearest = _Nearest(self, asked, target)
            v = minimised(nearest, v, np.inf, accuracy, curvature=nearest.curvature(v)).v
            target, accuracy = self.full_parameters(v), _FITTED
        if outside < _SETTLED:
            return v
        kind = self.control.admissible.gait
        bound = f"; allow more curvature than {kind.curvature:g}" if self._arcs else ""
        raise NotConvergedError(
            f"found no {kind.describe()} near the guess; try another guess{bound}."
        )

    def laid(self, gait: AnyGait) -> np.ndarray:
        """Parameters of a path through a gait, which need not be a member: it may bend more than it
        should."""
        return self._pointed(gait)[self.own]

    def _pointed(self, gait: AnyGait) -> np.ndarray:
        """Full parameters of a path through a gait, which need not keep every constraint, and where
        it points."""
        laid = self._through(gait)
        if np.isnan(laid[-1]):
            laid[-1] = pointed(self.control, self.mesh, self, laid[self.own])[-1]
        return laid

    def _through(self, gait: AnyGait) -> np.ndarray:
        kind = self.control.admissible.gait
        if gait is self.given.near:
            return kind.parameters(self._paths.near)
        if self._arcs:
            return kind.parameters(arcs_through(gait, kind, self._paths.near.edges))
        return kind.parameters(path_through(self.control, gait, self.mesh.edges)[0])

    def at(self, v: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Angles, unit tangents ``(n_joint, n_point)`` and the length of path per unit of phase
        ``(n_point,)``."""
        out = self._value(self.full_parameters(v)[self._gather], self._given).copy()
        n_joint = len(self.shapes)
        return out[:n_joint], out[n_joint:-1], out[-1]

    def pulled_back(self, v: np.ndarray, on_shape: np.ndarray, on_pace: np.ndarray) -> np.ndarray:
        on_local = self._pulled(
            self.full_parameters(v)[self._gather], self._given, on_shape, on_pace
        )
        return self.from_full(v, (self._scatter @ on_local.reshape(len(on_local), -1).T).T)

    def constraints(self, v: np.ndarray, later: float = 0.0) -> Constraints:
        """The rows of the class, and checks where they might bind. They stay where they are placed:
        no path was seen to swing, and rows that follow cost as much as all else."""
        paths, rows, limit = self._paths, self._rows, self.control.admissible.joint_limit
        gait, excess, kinds = self._member(self.full_parameters(v)), -np.inf, dict(self._fixed_rows)
        mesh, given = (
            paths.phase_mesh(gait),
            {name: parameters.copy() for name, (*_, parameters) in paths.blocks.items()},
        )
        for check, (cells, times) in zip(
            paths.checks, near_peaks(gait, mesh, paths.checks, limit), strict=True
        ):
            kinds[check.name] = cells
            if not cells.size:
                continue
            times, instants = (
                times + later * mesh.h[cells],
                0.5 * (mesh.edges[1:] + mesh.edges[:-1]),
            )
            instants[cells], values = times, check_values(check, gait, times)
            given[check.name][:-1] = paths.placed(check, instants, mesh)
            given[check.name][-1, cells] = held_shares(check, gait, times)
            excess = max(excess, float(check.excess(values, limit).max()))
        kept = np.concatenate([rows.groups[name].start + own for name, own in kinds.items()])
        chosen = ChosenRows(rows.linear, rows.blocks, kept, list(given.values()))
        return Constraints(
            kinds,
            rows.lower[kept],
            rows.upper[kept],
            excess,
            lambda v: chosen.values(self.full_parameters(v)),
            lambda v: self.from_full(v, chosen.slopes(self.full_parameters(v))),
        )

    def metric(self, v: np.ndarray) -> np.ndarray | None:
        """The mean squared distance that a step of the parameters moves the shapes, and a little
        for every parameter.

        A tangent early on a path moves all that comes after it, so parameters are far from equal:
        with it SQP settles free paths of 130 parameters in 50 iterations instead of 250 to 300.
        """
        if not self._arcs:
            return None
        frame = self.frame(v)
        metric = frame.T @ frame / len(self.shapes.T)
        return np.asarray(metric + _SOFT * metric.diagonal().max() * np.eye(self.n))


class _Nearest:
    """The program of the member nearest to a given vector of full parameters."""

    def __init__(self, space: PathSpace, asked: Constraints, target: np.ndarray) -> None:
        self.space, self._target = space, target
        self.lower, self.upper, self.row_lower, self.row_upper = (
            space.lower,
            space.upper,
            asked.lower,
            asked.upper,
        )
        self.rows, self.row_slopes = asked.values, asked.slopes
        self._shapes = space.shapes.ravel(order="F")

    def objective(self, v: np.ndarray) -> float:
        """Half the sum of squared distances of the shapes."""
        return 0.5 * float(np.sum(self._apart(v) ** 2))

    def gradient(self, v: np.ndarray) -> np.ndarray:
        """Of the objective."""
        on_full = np.zeros((1, self._target.size))
        on_full[0, self._shapes] = self._apart(v)
        return self.space.from_full(v, on_full)[0]

    def _apart(self, v: np.ndarray) -> np.ndarray:
        return (self.space.full_parameters(v) - self._target)[self._shapes]

    def curvature(self, v: np.ndarray) -> np.ndarray:
        """Of the objective near the target (Gauss and Newton); lengths of tangents, which nothing
        depends on, keep a little."""
        frame = self.space.frame(v)
        metric = frame.T @ frame
        return metric + _LEAST_CURVATURE * metric.diagonal().max() * np.eye(v.size)
