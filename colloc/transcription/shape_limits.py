"""Rows that keep the shapes of a gait within their limits, in the cells of a mesh in which they may
bind."""

from __future__ import annotations

import casadi as ca
import numpy as np
from scipy import sparse

from colloc.gaits.control_problem import ControlProblem
from colloc.gaits.gait_fields import AnyGait
from colloc.mechanics.bodies import Pairs
from colloc.numerics.mesh import Mesh
from colloc.numerics.repeated import Rows
from colloc.transcription.layout import Layout
from colloc.transcription.shape_checks import shape_checks
from colloc.transcription.worst_instants import held_shares, near_peaks


class ShapeLimits:
    """Shape checks of a program, at the worst instants of a gait in the cells in which they may
    bind. Those that are linear are rows in p; others are functions of the angles between their
    links, which are variables."""

    def __init__(
        self, control: ControlProblem, mesh: Mesh, layout: Layout, gait: AnyGait, far: Pairs
    ) -> None:
        admissible = control.admissible
        checks = shape_checks(admissible.body, far, admissible.largest_speeds)
        peaks = near_peaks(gait, mesh, checks, admissible.joint_limit)
        self.limit, self.p = admissible.joint_limit, layout.parameters[:, 0]
        self.placed, bends, start = [], [], layout.n
        for check, (cells, times) in zip(checks, peaks, strict=True):
            matrix = check.matrix(admissible.gait, times, admissible.n_joint)
            joints = check.joints
            places = np.empty((0, times.size), dtype=int)
            if not check.linear and times.size:
                places = start + np.arange(joints.size * times.size).reshape(-1, times.size)
                bends.append(matrix[:, joints].transpose(1, 0, 2).reshape(-1, self.p.size))
                start += places.size
            self.placed.append((check, cells, held_shares(check, gait, times), matrix, places))
        self.n_bend = start - layout.n
        self.first = layout.n
        self.bends = sparse.csr_matrix(np.concatenate([np.empty((0, self.p.size)), *bends]))

    def repeat(self, program: Rows) -> dict[str, np.ndarray]:
        """Where the values of the checks that are not linear are, by their names."""
        delta, share, found = ca.SX.sym("delta"), ca.SX.sym("share"), {}
        for check, _, shares, _, places in self.placed:
            if places.size:
                local = ca.SX.sym("bend", check.joints.size)
                angles = ca.SX.zeros(check.n_joint)
                angles[check.joints.tolist()] = local
                out = check.cut(angles, share)
                found[check.name] = program.repeat(
                    local, out, places, share, shares[None], delta=delta
                )
        return found

    def add_rows(self, program: Rows, values: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
        """Cells in which each check has its rows, by its name."""
        pick, cells = program.pick, {}
        if self.n_bend:
            bends = pick(self.first + np.arange(self.n_bend))
            program.add("bends", bends - self.bends @ pick(self.p))
        for check, where, shares, matrix, _ in self.placed:
            cells[check.name] = where
            if check.name in values:
                rows = pick(values[check.name])
            elif not where.size:
                rows = pick(where)
            else:
                slopes = check.slopes(shares)
                rows = sparse.csr_matrix(np.einsum("tj,tjp->tp", slopes, matrix)) @ pick(self.p)
            program.add(check.name, rows, *check.bounds(self.limit))
        return cells
