"""Constraints on shapes and their rates: joint limits, joint speeds, links that must not cross.

An inequality between nodes is kept by constraining it at its worst instants, repeated at every
solve: the exchange method for semi-infinite programs, here with one instant in every mesh cell in
which it may bind. Links that pass each other's ends give peaks with a kink, so instants are found
by nested sampling.
"""

from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from scipy import sparse

from colloc.dynamics.control_problem import ControlProblem
from colloc.gaits.robot import Limit, joint_ranges
from colloc.mechanics.bodies import Body
from colloc.mechanics.contact import Pairs, held_minimum, share_of_first
from colloc.mechanics.densities import JointMap
from colloc.mechanics.native_kernel import addresses, native_kernel
from colloc.numerics.mesh import Mesh
from colloc.numerics.peaks import SAMPLES, peaks, vertex
from colloc.numerics.repeated import Program
from colloc.transcription.layout import Layout

_PLACES, _FLAT = 9, 1e-12
"""On a stretch of a smooth body; a bend of its angle below which it has no peak."""
_NEAR, _FAR = 0.1, 1.0
"""Distances from the bound [rad] below which a cell, or a peak, is watched."""
_HELD_SHARE, _HELD_NEAR = 1e-3, 0.05
"""A contact is replaced by its tangent plane where both values have at least this share in it and
it is this near to its bound [rad]: elsewhere the gait may move far."""
_STEP, _LARGEST, _STEPS = 1e-3, 0.1, 4
"""Sampling and largest step of Newton's method, as parts of a cell; number of steps."""
_BLOCK = 4000  # values at once, which stay in the cache
_NONE = np.empty(0)


class ShapeChecks:
    """Functions of the shape, or of its rates, between bounds, one after the other by `names`:
    angles within the limit, contacts, and rates over the largest allowed, `speeds` [rad per
    period]. They are evaluated for many instants at once, `which` ``(n,)`` each, with a column of
    shapes ``(n_joint, n)``, or of rates per period, for each.

    shares ``(n,)``: of a contact, if the tangent plane of a minimum stands for it, the weight of
    the first value, else -1; of the largest angle on a stretch of a smooth body, where that is.
    """

    def __init__(
        self,
        body: Body,
        far: Pairs = (),
        speeds: tuple[float, ...] = (),
        joint_map: JointMap | None = None,
    ) -> None:
        bounded, motors, motor = body.bounded_angles, np.eye(body.n_joint), body.defaults.coordinate
        if joint_map:
            motors, motor = joint_map.inverse, "motor"
        self._stretches, self.contacts = bounded.stretches, body.contacts(far)
        self.n_angle = len(bounded.names)
        self.n_shape = self.n_angle + len(self.contacts)
        rates = (f"speed of {motor} {j + 1}" for j in range(len(speeds)))
        self.names = [*bounded.names, *(each.name for each in self.contacts), *rates]
        # those that are linear
        self.rows = np.zeros((len(self.names), body.n_joint))
        self.rows[: self.n_angle] = 0.0 if self._stretches else bounded.rows
        self.rows[self.n_shape :] = motors[: len(speeds)] / np.reshape(speeds, (-1, 1))
        each = [np.array([0.0, *row]) for row in self.rows]  # 0: linear, in native/contacts.h
        each[self.n_angle : self.n_shape] = [contact.kernel_numbers for contact in self.contacts]
        first = np.cumsum([0, *(numbers.size for numbers in each)])
        self.kernel_numbers = np.concatenate([*each, np.empty(0)]), first
        self._numbers = addresses(self.kernel_numbers)

    def bounds(self, limit: Limit) -> tuple[np.ndarray, np.ndarray]:
        n_rate = len(self.names) - self.n_shape
        each = [*joint_ranges(limit, self.n_angle), *[(-np.inf, 0.0)] * len(self.contacts)]
        lower, upper = np.array([*each, *[(-1.0, 1.0)] * n_rate]).reshape(-1, 2).T
        return lower, upper

    def functions(self, gaits: Any, which: np.ndarray, times: np.ndarray) -> np.ndarray:
        """Functions of a class ``(n_function, n)``, or derivatives, of which shapes are sums."""
        values, rates = np.array(gaits.functions(times)), which >= self.n_shape
        if rates.any():
            values[:, rates] = gaits.functions(times[rates], 1)
        return values

    def shapes(
        self, gaits: Any, table: np.ndarray, which: np.ndarray, times: np.ndarray
    ) -> np.ndarray:
        """Of the gait with a table."""
        rest = gaits.offset(len(table)) * (which < self.n_shape)
        return table @ self.functions(gaits, which, times) + rest

    def fresh_shares(self, which: np.ndarray, shapes: np.ndarray) -> np.ndarray:
        shares = np.full(which.size, -1.0)
        for k in np.unique(which[which < self.n_angle]) if self._stretches else ():
            shares[which == k] = self._largest(int(k), shapes[:, which == k])
        return shares

    def shares(self, which: np.ndarray, shapes: np.ndarray) -> np.ndarray:
        """Shares that are held as the gait moves."""
        fresh = self.fresh_shares(which, shapes)
        values, of_first, _ = self._evaluate(which, shapes, fresh)
        both = (values > -_HELD_NEAR) & (np.abs(of_first - 0.5) < 0.5 - _HELD_SHARE)
        contact = (which >= self.n_angle) & (which < self.n_shape)
        return np.where(contact & both, of_first, fresh)

    def _largest(self, k: int, shapes: np.ndarray) -> np.ndarray:
        """Place of the largest angle on a stretch ``(n,)``, by a parabola."""
        first, last, angles_at = self._stretches[k]
        fine = np.linspace(first, last, _PLACES)
        heights = np.abs(angles_at(fine) @ shapes)
        inner = np.clip(np.argmax(heights, axis=0), 1, _PLACES - 2)
        every = np.arange(heights.shape[1])
        low, mid, high = (heights[inner + k, every] for k in (-1, 0, 1))
        bent = low - 2 * mid + high < -_FLAT
        offset = np.where(bent, vertex(low, mid, high), np.sign(high - low))
        return fine[inner] + np.clip(offset, -1, 1) * (fine[1] - fine[0])

    def linear_rows(self, which: np.ndarray, shares: np.ndarray) -> np.ndarray:
        """Slopes of those that are linear, or at a place, ``(n, n_joint)``."""
        rows = self.rows[which]
        if self._stretches and (on_stretch := which < self.n_angle).any():
            rows[on_stretch] = self._stretches[0].angles_at(shares[on_stretch])
        return rows

    def values(
        self,
        which: np.ndarray,
        shapes: np.ndarray,
        shares: np.ndarray | None = None,
        column: np.ndarray | None = None,
    ) -> np.ndarray:
        """Values ``(n,)``, by default with no share held, at some columns of the shapes, by default
        one each."""
        if shares is None:
            shares = self.fresh_shares(which, shapes if column is None else shapes[:, column])
        return self._evaluate(which, shapes, shares, column)[0]

    def slopes(self, which: np.ndarray, shapes: np.ndarray, shares: np.ndarray) -> np.ndarray:
        """Derivatives ``(n_joint, n)`` along the shapes."""
        slopes = np.empty((len(shapes), which.size))
        return self._evaluate(which, shapes, shares, slopes=slopes)[2]

    def _evaluate(
        self,
        which: np.ndarray,
        shapes: np.ndarray,
        shares: np.ndarray,
        column: np.ndarray | None = None,
        slopes: np.ndarray | None = None,
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Values, shares of the first values of contacts, and slopes, if there is room for them."""
        shares, shapes = shares.copy(), np.ascontiguousarray(shapes)
        kernel = None if self._stretches else native_kernel()
        if kernel is None:
            at = shapes if column is None else shapes[:, column]
            return self._evaluate_by_numpy(which, at, shares)
        column = np.arange(which.size) if column is None else column
        where = np.ascontiguousarray(which), column, shapes.shape[1], shapes
        values = np.empty(which.size)
        of = len(shapes), which.size, *self._numbers
        if kernel.colloc_shape_functions(*of, *where, shares, values, slopes):
            raise MemoryError("no memory for the angles of a body.")
        return values, shares, slopes if slopes is not None else _NONE

    def _evaluate_by_numpy(
        self, which: np.ndarray, shapes: np.ndarray, shares: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        slopes = self.linear_rows(which, shares).T.copy()
        values = np.einsum("jn,jn->n", slopes, shapes)
        for k, contact in enumerate(self.contacts, self.n_angle):
            here = np.flatnonzero(which == k)
            first, second = (value[0] for value in contact.pair(shapes[:, here]))
            values[here] = held_minimum(first, second, shares[here], contact.width)
            of_first = share_of_first(first, second, contact.width)
            shares[here] = share = np.where(shares[here] < 0, of_first, shares[here])
            for weight, order, numbers in zip(
                (share, 1 - share), contact.order, contact.numbers, strict=True
            ):
                joints = np.array(contact.joints)[order, None]
                slopes[joints, here] += weight * contact.slopes(
                    shapes[joints, here], numbers[:, None]
                )
        return values, shares, slopes


shape_checks = lru_cache(maxsize=64)(ShapeChecks)


def near_peaks(
    gaits: Any, table: np.ndarray, mesh: Mesh, checks: ShapeChecks, limit: Limit, reach: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Checks, cells in which each might bind soon, or by changes of `reach`, for the gait of a
    class with a table, and its worst instants there, ``(n,)`` each."""
    lower, upper = checks.bounds(limit)

    def excess(which, values):
        return np.maximum(values - upper[which], lower[which] - values)

    fine, every = np.linspace(0.0, 1.0, SAMPLES + 1), np.arange(len(checks.names))
    times = (mesh.edges[:-1, None] + mesh.h[:, None] * fine).ravel()
    shapes = table @ gaits.functions(times) + gaits.offset(len(table))
    if checks.n_shape < every.size:
        shapes = np.concatenate([shapes, table @ gaits.functions(times, 1)], axis=1)
    most, size = np.empty((every.size, mesh.n)), max(1, _BLOCK // times.size)
    best = np.empty(most.shape, dtype=int)
    for some in (slice(k, k + size) for k in range(0, every.size, size)):
        which = np.repeat(every[some], times.size)
        column = np.resize(np.arange(times.size), which.size)
        column += times.size * (which >= checks.n_shape)
        sampled = excess(which, checks.values(which, shapes, column=column))
        sampled = sampled.reshape(-1, mesh.n, SAMPLES + 1)
        most[some], best[some] = sampled.max(axis=2), sampled.argmax(axis=2)
    around = np.full((every.size, mesh.n + 2), -np.inf)
    around[:, 1:-1] = most
    peak = (most >= around[:, :-2]) & (most >= around[:, 2:])
    which, cells = np.nonzero((most > -max(_NEAR, reach)) | (peak & (most > -_FAR)))

    def at_times(t):
        of, values = np.repeat(which, t.shape[1]), np.empty(t.size)
        for at in (slice(k, k + _BLOCK) for k in range(0, t.size, _BLOCK)):
            shapes = checks.shapes(gaits, table, of[at], t.ravel()[at])
            values[at] = checks.values(of[at], shapes)
        return excess(of, values).reshape(t.shape)

    h, before = mesh.h[cells], np.clip(best[which, cells], 1, SAMPLES - 1) - 1
    left = mesh.edges[cells] + h * fine[before]
    return which, cells, peaks(at_times, left, 2 * h / SAMPLES, 2)[0]


class CheckTimes(NamedTuple):
    """Checks at instants, in each of some mesh cells, with the shares that are held there, ``(n,)``
    each."""

    checks: ShapeChecks
    which: np.ndarray
    cells: np.ndarray
    times: np.ndarray
    shares: np.ndarray

    @property
    def cells_of(self) -> dict[str, np.ndarray]:
        ends = np.searchsorted(self.which, np.arange(1, len(self.checks.names)))
        return dict(zip(self.checks.names, np.split(self.cells, ends), strict=True))

    def moving(self, excess: np.ndarray, mesh: Mesh) -> np.ndarray:
        """Those near their bound and off the edges of their cells, ``(k,)`` int."""
        share = (self.times - mesh.edges[self.cells]) / mesh.h[self.cells]
        return np.flatnonzero((excess > -_NEAR) & (share > _STEP) & (share < 1 - _STEP))

    def follow(
        self, chosen: np.ndarray, gaits: Any, table: np.ndarray, mesh: Mesh, limit: Limit
    ) -> np.ndarray:
        """Worst instants of the gait with a table near some of these of another one, in the same
        cells, by Newton's method."""
        which, cells, times, held = (each[chosen] for each in self[1:])
        left, h, checks = mesh.edges[cells], mesh.h[cells], self.checks
        step, every, held = _STEP * h, np.tile(which, 3), np.tile(held, 3)

        def heights(t):
            times = np.concatenate([t - step, t, t + step])
            shapes = checks.shapes(gaits, table, every, times)
            return checks.values(every, shapes, held).reshape(3, -1)

        lower, upper = (each[which] for each in checks.bounds(limit))
        around, going = heights(times), np.ones(which.size, dtype=bool)
        sign = np.where(around[1] - lower < upper - around[1], -1.0, 1.0)
        for _ in range(_STEPS):
            move = np.clip(vertex(*(sign * around)) * step, -_LARGEST * h, _LARGEST * h)
            last, times = times, np.clip(times + going * move, left + step, left + h - step)
            going &= np.abs(times - last) >= _STEP * step
            if not going.any():
                break
            around = heights(times)
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
        n_joint, table = body.n_joint, gaits.table(parameters, body.n_joint)
        checks = shape_checks(body, far, speeds, control.dynamics.joint_map)
        which, cells, times = near_peaks(gaits, table, mesh, checks, self._limit, 0.0)
        shares = checks.shares(which, checks.shapes(gaits, table, which, times))
        self._placed = placed = CheckTimes(checks, which, cells, times, shares)
        self._gaits, self._p = gaits, layout.parameters[:, 0]
        self._first, self.n_bend = layout.n, 0
        self._bends = dict[str, np.ndarray]()
        matrices, self._rest = [np.empty((0, self._p.size))], gaits.offset(n_joint)
        offsets = [np.empty(0)]
        for k, contact in enumerate(checks.contacts, checks.n_angle):
            times, joints = placed.times[placed.which == k], list(contact.joints)
            places = np.arange(len(joints) * times.size).reshape(len(joints), times.size)
            self._bends[contact.name] = self._first + self.n_bend + places
            self.n_bend += places.size
            matrix = gaits.angle_matrix(times, n_joint)[:, joints].transpose(1, 0, 2)
            matrices.append(matrix.reshape(-1, self._p.size))
            offsets.append(np.repeat(self._rest[joints, 0], times.size))
        self._matrix = sparse.csr_matrix(np.concatenate(matrices))
        self._offset = np.concatenate(offsets)

    def bends(self, parameters: np.ndarray) -> np.ndarray:
        return self._matrix @ parameters + self._offset

    def repeat(self, program: Program) -> dict[str, np.ndarray]:
        """Add the functions of angles; places of their values by the contacts' names."""
        placed, values = self._placed, {}
        for k, contact in enumerate(placed.checks.contacts, placed.checks.n_angle):
            bends, shares = self._bends[contact.name], placed.shares[placed.which == k]
            if bends.size:
                values[contact.name] = program.repeat(contact.held, [bends], [shares])
        return values

    def add_rows(self, program: Program, values: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
        """Add the rows; cells by the checks' names."""
        placed, p, checks = self._placed, program.pick(self._p), self._placed.checks
        which, cells_of = placed.which, placed.cells_of
        if self.n_bend:
            bends = program.pick(self._first + np.arange(self.n_bend))
            program.add("bends", bends - self._matrix @ p, self._offset, self._offset)
        rows = checks.linear_rows(which, placed.shares)
        functions = checks.functions(self._gaits, which, placed.times)
        matrix = self._gaits.pull_back(rows.T, functions)
        rest = (rows @ self._rest)[:, 0] * (which < checks.n_shape)
        for k, (name, *bounds) in enumerate(
            zip(checks.names, *checks.bounds(self._limit), strict=True)
        ):
            at = which == k
            if name in values:
                value = program.pick(values[name])
            else:
                value = sparse.csr_matrix(matrix[at]) @ p + program.constant(rest[at])
            program.add(name, value, *bounds)
        return cells_of
