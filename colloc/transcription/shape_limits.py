"""Rows of path constraints, in the mesh cells in which they may bind."""

from __future__ import annotations

from typing import NamedTuple

import casadi as ca
import numpy as np
from scipy import sparse

from colloc.dynamics.control_problem import ControlProblem
from colloc.mechanics.contact import Pairs
from colloc.numerics.mesh import Mesh
from colloc.numerics.repeated import Rows
from colloc.transcription.layout import Layout
from colloc.transcription.shape_checks import ShapeCheck, shape_checks
from colloc.transcription.worst_instants import held_shares, near_peaks


class _Placed(NamedTuple):
    """A path constraint at its worst instants."""

    check: ShapeCheck
    cells: np.ndarray
    shares: np.ndarray
    matrix: np.ndarray
    """Parameters to shapes, ``(n, n_joint, n_parameter)``."""
    offset: np.ndarray
    bends: np.ndarray
    """Variables of its shape coordinates, ``(k, n)``; none if it is linear."""


class ShapeLimits:
    """Linear path constraints are rows in the parameters; others are functions of angles that are
    variables."""

    def __init__(
        self,
        control: ControlProblem,
        mesh: Mesh,
        layout: Layout,
        parameters: np.ndarray,
        far: Pairs,
    ) -> None:
        admissible, joint_map = control.admissible, control.dynamics.joint_map
        gaits, n_joint = admissible.gait, admissible.n_joint
        gait = gaits.trajectory(parameters, n_joint)
        checks = shape_checks(admissible.body, far, admissible.largest_speeds, joint_map)
        peaks = near_peaks(gait, mesh, checks, admissible.joint_limit)
        self._limit = admissible.joint_limit
        self._p = layout.parameters[:, 0]
        self._first = layout.n
        self._placed, self.n_bend = list[_Placed](), 0
        bends, offsets = [np.empty((0, self._p.size))], [np.empty(0)]
        for check, (cells, times) in zip(checks, peaks, strict=True):
            matrix, offset = check.matrix(gaits, times, n_joint), check.offset(gaits, n_joint)[:, 0]
            joints = check.joints[: 0 if check.linear else None]
            places = np.arange(joints.size * cells.size).reshape(joints.size, cells.size)
            at = self._first + self.n_bend + places
            shares = held_shares(check, gait, times)
            self._placed.append(_Placed(check, cells, shares, matrix, offset, at))
            bends.append(matrix[:, joints].transpose(1, 0, 2).reshape(-1, self._p.size))
            offsets.append(np.repeat(offset[joints], cells.size))
            self.n_bend += places.size
        self._matrix = sparse.csr_matrix(np.concatenate(bends))
        self._offset = np.concatenate(offsets)

    def bends(self, parameters: np.ndarray) -> np.ndarray:
        return np.asarray(self._matrix @ parameters + self._offset)

    def repeat(self, program: Rows) -> dict[str, np.ndarray]:
        delta, share, values = ca.SX.sym("delta"), ca.SX.sym("share"), {}
        for check, _, shares, _, _, bends in self._placed:
            if bends.size:
                local, shape = ca.SX.sym("bend", len(bends)), ca.SX.zeros(check.n_joint)
                shape[check.joints.tolist()] = local
                values[check.name] = program.repeat(
                    local, check.cut(shape, share), bends, share, shares[None], delta=delta
                )
        return values

    def add_rows(self, program: Rows, values: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
        p = program.pick(self._p)
        if self.n_bend:
            bends = program.pick(self._first + np.arange(self.n_bend))
            program.add("bends", bends - self._matrix @ p, self._offset, self._offset)
        for check, cells, shares, matrix, offset, _ in self._placed:
            if check.linear and cells.size:
                slopes = check.slopes(shares)
                linear = sparse.csr_matrix(np.einsum("tj,tjp->tp", slopes, matrix))
                rows = linear @ p + program.constant(slopes @ offset)
            else:
                rows = program.pick(values.get(check.name, cells))
            program.add(check.name, rows, *check.bounds(self._limit))
        return {placed.check.name: placed.cells for placed in self._placed}
