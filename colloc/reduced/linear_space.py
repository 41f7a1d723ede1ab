"""Gaits that are linear in their parameters as a search sees them: shapes on a mesh, and rows that keep them admissible."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from colloc.collocation.shape_checks import ShapeCheck, shape_checks
from colloc.collocation.worst_instants import check_values, followed, held_shares, moving, near_peaks
from colloc.gaits.control_problem import ControlProblem
from colloc.gaits.gait_fields import AnyGait
from colloc.gaits.limits import widest
from colloc.mechanics.bodies import Pairs
from colloc.numerics.mesh import Mesh
from colloc.numerics.sqp import remembered
from colloc.reduced.given import Given


class LinearSpace:
    """Members of a linear class by their parameters v, in which angles and rates are linear, on a mesh (by default the
    first one), with pairs of links `far` apart that are kept from crossing; what it answers is
    told by `colloc.reduced.program.SearchSpace`.

    Rows: shape checks at their worst instants in the mesh cells in which they might bind, then the mean square shape speed.
    """

    knots: np.ndarray | None = None
    _follows: Callable[[np.ndarray], list[_Placed]] | None

    def __init__(self, control: ControlProblem, edges: np.ndarray | None = None, scheme: str = "", far: Pairs = ()) -> None:
        self.control, self.given = control, Given(None, edges, scheme, far)
        self.mesh, self._admissible = control.mesh(edges, scheme), control.admissible
        gait, body, limit, speeds, _ = control.admissible
        self.checks, n_joint = shape_checks(body, far, speeds), body.n_joint
        angles, rates = gait.angle_matrix(self.mesh.times, n_joint), gait.rate_matrix(self.mesh.times, n_joint)
        self._matrix = np.concatenate([angles, rates], axis=1)
        self.n = self._matrix.shape[2]
        self._pace = np.ones(self.mesh.n_point)
        self._square = gait.mean_square_rate(n_joint) / (2 * np.pi) ** 2
        self.upper = gait.largest_parameters(body, widest(limit))
        self.lower = -self.upper
        self.own = np.arange(self.n)
        self.move_checks(np.zeros(self.n))

    def member(self, v: np.ndarray) -> AnyGait:
        return self._admissible.member(v)

    def parameters(self, gait: AnyGait) -> np.ndarray:
        """Parameters ``(n,)`` of the member nearest to a gait."""
        return self._admissible.gait.parameters(self._admissible.gait.through(gait))

    laid = parameters

    def full_parameters(self, v: np.ndarray) -> np.ndarray:
        return v

    def phase_mesh(self, gait: AnyGait) -> Mesh:
        """The mesh in phases of a member: it is the same for all."""
        return self.mesh

    def remeshed(self, gait: AnyGait, edges: np.ndarray, scheme: str) -> LinearSpace:
        """The class on another mesh."""
        return type(self)(self.control, edges, scheme, self.given.far)

    def at(self, v: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Angles, rates per period ``(n_joint, n_point)`` and the pace, 1."""
        angles, rates = np.split((self._matrix @ v).T, 2)
        return angles, rates, self._pace

    def pulled_back(self, v: np.ndarray, on_shape: np.ndarray, on_pace: np.ndarray) -> np.ndarray:
        return np.einsum("ktj,tjp->kp", on_shape, self._matrix)

    def move_checks(self, v: np.ndarray, later: float = 0.0) -> float:
        """Place the checks at the worst instants of the gait v, or later; how far the gait exceeds any bound there [rad, or of
        a largest speed]."""
        gait, n_joint, limit = self.member(v), self._admissible.n_joint, self._admissible.joint_limit
        self._placed, self._follows, self.watched, low, high, excess = [], None, {}, [], [], -np.inf
        for check, (cells, times) in zip(self.checks, near_peaks(gait, self.mesh, self.checks, limit), strict=True):
            self.watched[check.name] = cells
            if not cells.size:
                continue
            times = times + later * self.mesh.h[cells]
            values, matrix = check_values(check, gait, times), check.matrix(self._admissible.gait, times, n_joint)
            may_move = moving(values, check, limit, times, self.mesh, cells)
            self._placed.append(_Placed(check, held_shares(check, gait, times), matrix, times, cells, may_move))
            excess, (lower, upper) = max(excess, float(check.excess(values, limit).max())), check.nearer_bounds(values, limit)
            low.append(lower)
            high.append(upper)
        self.watched["shape speed"] = np.zeros(1, dtype=int)
        self.row_lower = np.concatenate([*low, [self._admissible.smallest_shape_speed**2]])
        self.row_upper = np.concatenate([*high, [np.inf]])
        return excess

    def follow_worst(self) -> None:
        self._follows = remembered(self._at_worst)

    def _at_worst(self, v: np.ndarray) -> list[_Placed]:
        gait, found = self.member(v), []
        for placed in self._placed:
            which, matrix = placed.moving, placed.matrix
            if which.size:
                cells = placed.cells[which]
                where, matrix = (self.mesh.edges[cells], self.mesh.h[cells]), matrix.copy()
                at = placed.check, placed.shares[which], gait, placed.times[which]
                worst = followed(*at, cells=where, limit=self._admissible.joint_limit)
                matrix[which] = placed.check.matrix(self._admissible.gait, worst, self._admissible.n_joint)
            found.append(placed._replace(matrix=matrix))
        return found

    def _rows_at(self, v: np.ndarray) -> list[_Placed]:
        return self._placed if self._follows is None else self._follows(v)

    def metric(self, v: np.ndarray) -> np.ndarray | None:
        """None: parameters are alike."""
        return None

    def rows(self, v: np.ndarray) -> np.ndarray:
        values = [placed.value(v) for placed in self._rows_at(v)]
        return np.concatenate([*values, [v @ self._square @ v]])

    def row_slopes(self, v: np.ndarray) -> np.ndarray:
        return np.vstack([*(placed.slope(v) for placed in self._rows_at(v)), 2 * self._square @ v])


class _Placed(NamedTuple):
    """A check at instants, one in each of some mesh cells: the shares that its cuts hold, what the shapes there are of the
    parameters, ``(n, n_joint, n_parameter)``, and which instants move with the gait."""

    check: ShapeCheck
    shares: np.ndarray
    matrix: np.ndarray
    times: np.ndarray
    cells: np.ndarray
    moving: np.ndarray

    def value(self, v: np.ndarray) -> np.ndarray:
        if self.check.row is not None:
            return (self.check.row @ self.matrix) @ v
        return self.check.cut((self.matrix @ v).T, self.shares[None]).full().ravel()

    def slope(self, v: np.ndarray) -> np.ndarray:
        if self.check.row is not None:
            return self.check.row @ self.matrix
        return np.einsum("jt,tjp->tp", self.check.slope((self.matrix @ v).T, self.shares[None]).full(), self.matrix)
