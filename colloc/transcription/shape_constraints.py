"""Constraints on shapes and their rates: joint limits, joint speeds, links that must not cross.

An inequality between nodes is kept by constraining it at its worst instants, repeated at every
solve: the exchange method for semi-infinite programs, here with one instant in every mesh cell in
which it may bind. Links that pass each other's ends give peaks with a kink, so instants are found
by nested sampling.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from typing import Any, NamedTuple

import casadi as ca
import numpy as np
from scipy import sparse

from colloc.dynamics.control_problem import ControlProblem
from colloc.gaits.gait_fields import AnyGait
from colloc.gaits.limits import Limit, range_of
from colloc.mechanics.bodies import Body, Stretch
from colloc.mechanics.contact import (
    Contact,
    Pairs,
    share_of_first,
    smooth_minimum,
    tangent_of_minimum,
)
from colloc.mechanics.densities import JointMap
from colloc.numerics.arrays import Array, namespace
from colloc.numerics.mesh import Mesh
from colloc.numerics.peaks import SAMPLES, peaks, vertex
from colloc.numerics.repeated import Program
from colloc.transcription.layout import Layout

_PLACES, _FLAT = 9, 1e-12
"""On a stretch of a smooth body; a bend of its angle below which it has no peak."""
_NEAR, _FAR = 0.1, 1.0
"""Distances from the bound [rad] below which a cell, or a peak, is watched."""
_HELD_SHARE, _HELD_NEAR = 1e-3, 0.05
"""A check is replaced by its tangent plane where both sums have at least this share in it and it is
this near to its bound [rad]: elsewhere the gait may move far."""
_STEP, _LARGEST, _STEPS = 1e-3, 0.1, 4
"""Sampling and largest step of Newton's method, as parts of a cell; number of steps."""


@dataclass(frozen=True, eq=False)
class ShapeCheck:
    """A scalar function of the shape, or of its rates, between bounds.

    along: its values ``(n_time,)`` at shapes ``(n_joint, n_time)``. share: there, if it is the
    minimum of two functions whose tangent plane shall stand for it, the weight of the first, else
    -1; of the largest angle on a stretch of a smooth body, where on the body it is. cut: of shapes
    and shares ``(n_time,)``, or CasADi's for one, these planes, the function itself where shares
    are negative, or the angles at these places, ``(1, n_time)``. slope: its derivative with respect
    to the shape. row: it per shape coordinate, if it is linear. place: which of the body's angles
    it is, -1 if it is none. fixed: its bounds, if these are not the limits of such an angle.
    derivative: 1 if "shapes" are their rates per period.
    """

    name: str
    along: Callable[[np.ndarray], np.ndarray]
    share: Callable[[np.ndarray], np.ndarray]
    cut: Callable[[Array, Array], Array]
    slope: ca.Function
    row: np.ndarray | None = None
    place: int = -1
    fixed: tuple[float, float] | None = None
    derivative: int = 0

    def bounds(self, limit: Limit) -> tuple[float, float]:
        return self.fixed or range_of(limit[self.place] if isinstance(limit, tuple) else limit)

    def excess(self, values: np.ndarray, limit: Limit) -> np.ndarray:
        lower, upper = self.bounds(limit)
        return np.maximum(values - upper, lower - values)

    def nearer_bounds(self, values: np.ndarray, limit: Limit) -> tuple[np.ndarray, np.ndarray]:
        """The nearer bound of values ``(n,)``; infinite in place of the other."""
        lower, upper = self.bounds(limit)
        below = values - lower < upper - values
        return np.where(below, lower, -np.inf), np.where(below, np.inf, upper)

    def of(self, gait: Any, times: np.ndarray) -> np.ndarray:
        """Shapes of a gait, or their rates, ``(n_joint, n_time)``."""
        return np.asarray(gait.rates(times) if self.derivative else gait.angles(times))

    @cached_property
    def joints(self) -> list[int]:
        """Shape coordinates it depends on."""
        return [int(k) for k in self.slope.sparsity_out(0).row()]

    def matrix(
        self, gaits: Any, times: np.ndarray, n_joint: int, columns: np.ndarray
    ) -> np.ndarray:
        """Some parameters of a class to its shapes, or their rates, ``(n_time, k, m)``."""
        matrix = gaits.angle_matrix(times, n_joint, self.derivative)
        return np.asarray(matrix[:, self.joints][:, :, columns])


class Placed(NamedTuple):
    """A check at instants, one in each of some mesh cells; `matrix` ``(n, k, m)`` takes the m
    parameters on which it depends to its k shape coordinates there."""

    check: ShapeCheck
    cells: np.ndarray
    times: np.ndarray
    shares: np.ndarray
    columns: np.ndarray
    matrix: np.ndarray
    offset: np.ndarray  # (n_joint, 1)

    @classmethod
    def at(
        cls, check: ShapeCheck, cells: np.ndarray, times: np.ndarray, gaits: Any, gait: AnyGait,
        support: np.ndarray,
    ) -> Placed:  # fmt: skip
        """Near a gait in time of a class; `support` as of `shape_support`."""
        shapes, columns = check.of(gait, times), np.flatnonzero(support[check.joints].any(axis=0))
        offset = np.zeros((len(shapes), 1)) if check.derivative else gaits.offset(len(shapes))
        matrix = check.matrix(gaits, times, len(shapes), columns)
        return cls(check, cells, times, check.share(shapes), columns, matrix, offset)

    def move(self, which: np.ndarray, times: np.ndarray, gaits: Any) -> Placed:
        """With some of the instants elsewhere in their cells, but for `times`."""
        matrix = self.matrix.copy()
        matrix[which] = self.check.matrix(gaits, times, len(self.offset), self.columns)
        return self._replace(matrix=matrix)

    def shapes(self, v: np.ndarray) -> np.ndarray:
        """Shapes ``(n_joint, n)``, 0 where the check does not depend on them."""
        joints = self.check.joints
        at = (self.matrix @ v[self.columns]).T + self.offset[joints]
        if len(at) == len(self.offset):
            return at
        shapes = np.zeros((len(self.offset), self.times.size))
        shapes[joints] = at
        return shapes

    def value(self, v: np.ndarray) -> np.ndarray:
        return self.check.cut(self.shapes(v), self.shares)[0]

    def slope(self, v: np.ndarray) -> np.ndarray:
        """Derivatives along parameters, ``(n, n_parameter)``."""
        check, joints = self.check, self.check.joints
        if check.row is not None:
            on_columns = check.row[joints] @ self.matrix
        else:
            on_shape = check.slope(self.shapes(v), self.shares[None]).full()[joints]
            on_columns = (on_shape.T[:, None] @ self.matrix)[:, 0]
        if self.columns.size == v.size:
            return on_columns
        slopes = np.zeros((self.times.size, v.size))
        slopes[:, self.columns] = on_columns
        return slopes


def shape_support(gaits: Any, mesh: Mesh, n_joint: int) -> np.ndarray:
    """Whether shape coordinates depend on parameters, ``(n_joint, n_parameter)``: with many links
    matrices of all would fill the memory."""
    return np.asarray((gaits.angle_matrix(mesh.times, n_joint) != 0).any(axis=0))


@lru_cache(maxsize=64)
def shape_checks(
    body: Body,
    far: Pairs = (),
    speeds: tuple[float, ...] = (),
    joint_map: JointMap | None = None,
) -> list[ShapeCheck]:
    """Angles within the limit, then contacts of near pairs and of pairs `far`, then rates over the
    largest allowed, `speeds` [rad per period]."""
    angles, bounded = ca.SX.sym("q", body.n_joint), body.bounded_angles
    each: Any = bounded.stretches or bounded.rows
    check: Any = _stretch_check if bounded.stretches else _angle_check
    checks = [check(bounded.names[k], angles, part, k) for k, part in enumerate(each)]
    known = _contact_checks(body)
    checks += [
        known.get(contact.name) or known.setdefault(contact.name, _contact_check(contact, angles))
        for contact in body.contacts(far)
    ]
    motors, name = np.eye(body.n_joint), body.defaults.coordinate
    if joint_map:
        motors, name = joint_map.inverse, "motor"
    for j, most in enumerate(speeds):
        rate = _angle_check(f"speed of {name} {j + 1}", angles, motors[j] / most, -1)
        checks.append(replace(rate, fixed=(-1.0, 1.0), derivative=1))
    return checks


@lru_cache(maxsize=64)
def _contact_checks(body: Body) -> dict[str, ShapeCheck]:
    return {}


def _slope(cut: Callable[[Array, Array], Array], angles: ca.SX) -> ca.Function:
    share = ca.SX.sym("share")
    slope = ca.sparsify(ca.jacobian(cut(angles, share), angles).T)
    return ca.Function("slope", [angles, share], [slope])


def _angle_check(name: str, angles: ca.SX, row: np.ndarray, place: int) -> ShapeCheck:

    def cut(shapes: Array, shares: Array) -> Array:
        return namespace(shapes).matmul(row[None], shapes)

    def share(shapes: np.ndarray) -> np.ndarray:
        return np.full(shapes.shape[1], -1.0)

    slope = _slope(cut, angles)
    return ShapeCheck(name, lambda shapes: row @ shapes, share, cut, slope, row, place)


def _stretch_check(name: str, angles: ca.SX, stretch: Stretch, place: int) -> ShapeCheck:
    """The largest angle on a stretch of a smooth body."""
    fine = np.linspace(stretch.first, stretch.last, _PLACES)
    rows = stretch.angles_at(fine)

    def largest(shapes: np.ndarray) -> np.ndarray:
        """Place of the maximum, ``(n_time,)``, by a parabola."""
        heights = np.abs(rows @ shapes)
        inner = np.clip(np.argmax(heights, axis=0), 1, _PLACES - 2)
        every = np.arange(heights.shape[1])
        low, mid, high = (heights[inner + k, every] for k in (-1, 0, 1))
        bent = low - 2 * mid + high < -_FLAT
        offset = np.where(bent, vertex(low, mid, high), np.sign(high - low))
        return fine[inner] + np.clip(offset, -1, 1) * (fine[1] - fine[0])

    def along(shapes: np.ndarray) -> np.ndarray:
        return cut(shapes, largest(shapes))[0]

    def cut(shapes: Array, places: Array) -> Array:
        return namespace(shapes).sum_rows(stretch.angles_at(places).T * shapes)

    return ShapeCheck(name, along, largest, cut, _slope(cut, angles), place=place)


def _contact_check(contact: Contact, angles: ca.SX) -> ShapeCheck:

    def along(shapes: np.ndarray) -> np.ndarray:
        return contact.excess(shapes)[0]

    def share(shapes: np.ndarray) -> np.ndarray:
        first, second = contact.pair(shapes)
        shares = share_of_first(first, second, contact.width)
        near = smooth_minimum(first, second, contact.width) > -_HELD_NEAR
        return np.where(near & (np.abs(shares - 0.5) < 0.5 - _HELD_SHARE), shares, -1.0)[0]

    def cut(shapes: Array, shares: Array) -> Array:
        xp, (first, second) = namespace(shapes), contact.pair(shapes)
        tangent = tangent_of_minimum(first, second, 0.5 * (shares + xp.abs(shares)), contact.width)
        return xp.where(shares < 0, smooth_minimum(first, second, contact.width), tangent)

    slope = _slope(cut, angles)
    return ShapeCheck(contact.name, along, share, cut, slope, fixed=(-np.inf, 0.0))


def near_peaks(
    gait: AnyGait, mesh: Mesh, checks: list[ShapeCheck], limit: Limit
) -> list[tuple[np.ndarray, np.ndarray]]:
    """Cells in which each check might bind soon, and its worst instants there."""
    fine = np.linspace(0.0, 1.0, SAMPLES + 1)
    times, found = (mesh.edges[:-1, None] + mesh.h[:, None] * fine).ravel(), []
    shapes = {check.derivative: check.of(gait, times) for check in checks[:1] + checks[-1:]}
    for check in checks:

        def excess(shapes: np.ndarray, check: ShapeCheck = check) -> np.ndarray:
            return check.excess(check.along(shapes), limit)

        def at_times(t: np.ndarray, check: ShapeCheck = check, excess: Any = excess) -> np.ndarray:
            return excess(check.of(gait, t.ravel())).reshape(t.shape)

        highest = excess(shapes[check.derivative]).reshape(mesh.n, -1).max(axis=1)
        around = np.concatenate([[-np.inf], highest, [-np.inf]])
        peak = (highest >= around[:-2]) & (highest >= around[2:])
        cells = np.flatnonzero((highest > -_NEAR) | (peak & (highest > -_FAR)))
        left, width = mesh.edges[cells], mesh.h[cells]
        found.append((cells, peaks(at_times, left, width)[0] if cells.size else left))
    return found


def moving(placed: Placed, values: np.ndarray, limit: Limit, mesh: Mesh) -> np.ndarray:
    """Instants near their bound and off the edges of their cells, ``(k,)`` int."""
    near = placed.check.excess(values, limit) > -_NEAR
    share = (placed.times - mesh.edges[placed.cells]) / mesh.h[placed.cells]
    return np.flatnonzero(near & (share > _STEP) & (share < 1 - _STEP))


def following_instants(
    placed: Placed, which: np.ndarray, gait: AnyGait, mesh: Mesh, limit: Limit
) -> np.ndarray:
    """Worst instants of a gait near some of those of another one, in the same cells, by Newton's
    method."""
    check, times, cells = placed.check, placed.times[which], placed.cells[which]
    left, h, held = mesh.edges[cells], mesh.h[cells], np.tile(placed.shares[which], 3)
    step = _STEP * h

    def heights(t: np.ndarray) -> np.ndarray:
        shapes = check.of(gait, np.concatenate([t - step, t, t + step]))
        return check.cut(shapes, held).reshape(3, -1)

    sign = np.where(np.isinf(check.nearer_bounds(heights(times)[1], limit)[0]), 1.0, -1.0)
    for _ in range(_STEPS):
        last, move = times, vertex(*(sign * heights(times))) * step
        move = np.clip(move, -_LARGEST * h, _LARGEST * h)
        times = np.clip(times + move, left + step, left + h - step)
        if np.abs(times - last).max() < _STEP * step.min():
            break
    return times


class ShapeLimits:
    """Rows of a full program in the cells in which checks might bind for a gait: linear ones in the
    parameters, others as functions of angles that are variables, `bends`."""

    def __init__(
        self,
        control: ControlProblem,
        mesh: Mesh,
        layout: Layout,
        parameters: np.ndarray,
        far: Pairs,
    ) -> None:
        gaits, body, self._limit, speeds, *_ = control.admissible
        gait = gaits.trajectory(parameters, body.n_joint)
        checks = shape_checks(body, far, speeds, control.dynamics.joint_map)
        self._p, self._first, self.n_bend = layout.parameters[:, 0], layout.n, 0
        self._placed = list[tuple[Placed, np.ndarray]]()
        matrices, offsets = [np.empty((0, self._p.size))], [np.empty(0)]
        support = shape_support(gaits, mesh, body.n_joint)
        for check, (cells, times) in zip(
            checks, near_peaks(gait, mesh, checks, self._limit), strict=True
        ):
            each = Placed.at(check, cells, times, gaits, gait, support)
            linear = check.row is not None or check.place >= 0
            joints = [] if linear else check.joints
            places = np.arange(len(joints) * cells.size).reshape(len(joints), cells.size)
            self._placed.append((each, self._first + self.n_bend + places))
            self.n_bend += places.size
            if joints:
                matrix = np.zeros((places.size, self._p.size))
                matrix[:, each.columns] = each.matrix.transpose(1, 0, 2).reshape(
                    -1, each.columns.size
                )
                matrices.append(matrix)
                offsets.append(np.repeat(each.offset[joints, 0], cells.size))
        self._matrix = sparse.csr_matrix(np.concatenate(matrices))
        self._offset = np.concatenate(offsets)

    def bends(self, parameters: np.ndarray) -> np.ndarray:
        return np.asarray(self._matrix @ parameters + self._offset)

    def repeat(self, program: Program) -> dict[str, np.ndarray]:
        """Add the functions of angles; places of their values by the checks' names."""
        values = {}
        for placed, bends in self._placed:
            if bends.size:

                def value(local: ca.SX, share: Any, of: Placed = placed) -> ca.SX:
                    shape = ca.SX.zeros(len(of.offset))
                    shape[of.check.joints] = local
                    return of.check.cut(shape, share)

                values[placed.check.name] = program.repeat(value, [bends], [placed.shares])
        return values

    def add_rows(self, program: Program, values: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
        """Add the rows; cells by the checks' names."""
        p = program.pick(self._p)
        if self.n_bend:
            bends = program.pick(self._first + np.arange(self.n_bend))
            program.add("bends", bends - self._matrix @ p, self._offset, self._offset)
        still, cells_of = np.zeros(self._p.size), {}
        for placed, bends in self._placed:
            check, cells = placed.check, placed.cells
            if cells.size and not bends.size:
                linear = sparse.csr_matrix(placed.slope(still))
                rows = linear @ p + program.constant(placed.value(still))
            else:
                rows = program.pick(values.get(check.name, cells))
            program.add(check.name, rows, *check.bounds(self._limit))
            cells_of[check.name] = cells
        return cells_of
