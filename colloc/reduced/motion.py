r"""Distance, work, net rotation and path length of a collocated gait as functions of the gait alone, with exact gradients.

On a mesh every equation of the collocation fixes one unknown: the balance the tail velocity, its rotation rate the
orientation, both the displacement D (`colloc.motion.collocated`) and the work ``W = sum_ki h_k b_i P_ki``, P being the power.
What is left is a program of the gait's parameters v alone: of |D|, W, the rotation, the length of the path and the driven work.
Gradients take one sweep back through the orientation.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from colloc.gaits.symmetry import fraction
from colloc.mechanics.balance_results import BalanceSolution
from colloc.mechanics.bodies import Body
from colloc.mechanics.law import Law
from colloc.motion.collocated import CollocatedPose, point_weights, stage_weights
from colloc.motion.heading import heading, heading_shares
from colloc.numerics.mesh import Mesh

_TOLERANCE = 1e-12
_ACCEPTED = 1e3
"""Where rounding stops the solver short of the tolerance, a residual of so many times the tolerance will do."""
_OMEGA, _OUTPUTS = 2, slice(2, 6)
"""Among the rows of `colloc.mechanics.bodies.Body.slopes`: rotation rate; the same, velocity of the centre, power."""


class Shapes(Protocol):
    """A class of gaits on the points of a mesh."""

    @property
    def n(self) -> int:
        """Number of parameters v."""

    def at(self, v: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Angles, rates ``(n_joint, n_point)``, and the pace ``(n_point,)`` by which velocities are multiplied.

        A mixture of several directions has a block of `n_point` columns for each, and its velocities are sums over the blocks.
        """

    def pulled_back(self, v: np.ndarray, on_shape: np.ndarray, on_pace: np.ndarray) -> np.ndarray:
        """Derivatives ``(k, n)`` of k numbers, from those with respect to ``(angles, rates)``, ``(k, n_point, 2 n_joint)``,
        and to the pace, ``(k, n_point)``."""


@dataclass(eq=False)
class _State:
    """The collocated motion of one v at one delta."""

    v: np.ndarray
    delta: float
    angles: np.ndarray
    rates: np.ndarray
    pace: np.ndarray
    solved: BalanceSolution
    out: np.ndarray
    pose: CollocatedPose
    displacement: complex
    work: float
    rotation: float


class ReducedMotion:
    """What a period of gaits comes to, as functions of their parameters; the mesh is that of the part of the period that is
    solved, and `besides` says which of "length" and "driven_work" are asked for, too."""

    def __init__(
        self, body: Body, friction: Law, symmetry: str, mesh: Mesh, shapes: Shapes, besides: Sequence[str] = ()
    ) -> None:
        self.body, self.friction, self.shapes, self.mesh = body, friction, shapes, mesh
        self._periods, self._besides = 1.0 / fraction(symmetry), besides
        self._symmetry, self._weight = symmetry, stage_weights(mesh)
        self._last: _State | None = None
        self._near: tuple[_State, np.ndarray] | None = None
        self.solves = 0

    def at(self, v: np.ndarray, delta: float) -> _State:
        """The collocated motion; NaN where the balance cannot be solved."""
        last = self._last
        if last is not None and last.delta == delta and np.array_equal(last.v, v):
            return last
        angles, rates, pace = self.shapes.at(v)
        at = (self.friction, angles, rates, delta)
        solved = self.body.solve(*at, start=self._start(angles, rates), tolerance=_TOLERANCE)
        self.solves += 1
        now = self.body.motion(*at, solved)
        out = np.vstack([now.z[_OMEGA], now.centre, now.power])
        out[:, ~(solved.residual < _ACCEPTED * _TOLERANCE)] = np.nan
        mesh = self.mesh
        omega, cx, cy, power = (out * pace).reshape(4, -1, mesh.n_point).sum(axis=1)
        pose = CollocatedPose.on_mesh(mesh, omega, np.array([cx, cy]))
        displacement, rotation = complex(pose.place[-1]), float(pose.theta[-1])
        work = float((self._weight * power[mesh.points]).sum())
        self._last = _State(v.copy(), delta, angles, rates, pace, solved, out, pose, displacement, work, rotation)
        return self._last

    def _start(self, angles: np.ndarray, rates: np.ndarray) -> np.ndarray | None:
        """Tail velocities to start from: those of the last gait differentiated, moved along their slopes."""
        if self._near is None:
            return None if self._last is None else self._last.solved.z
        near, slopes = self._near
        moved = np.concatenate([angles - near.angles, rates - near.rates])
        return near.solved.z + np.einsum("ijt,jt->it", slopes[:3], moved)

    def _direction(self, s: _State) -> complex:
        """Unit vector along which the displacement counts."""
        bend = float((self._weight * self._bending(s)).sum())
        return complex(np.exp(1j * heading(self._symmetry, s.displacement, s.rotation, bend)))

    def _bending(self, s: _State) -> np.ndarray:
        """Rate of the sum of all joint angles at the stages, ``(n, s)``."""
        return (s.rates.sum(axis=0) * s.pace).reshape(-1, self.mesh.n_point).sum(axis=0)[self.mesh.points]

    def values(self, v: np.ndarray, delta: float) -> dict[str, float]:
        """Distance along the direction of travel and work of a whole period, net rotation over the part that is solved [rad],
        and, if asked for, the length of the path."""
        s = self.at(v, delta)
        distance = float((s.displacement * np.conj(self._direction(s))).real)
        found = {"distance": self._periods * distance, "work": self._periods * s.work, "rotation": s.rotation}
        for name in self._besides:
            found[name] = self._periods * float((self._density(name, s)[0] * s.pace) @ self._on_columns(s))
        return found

    def _density(self, name: str, s: _State) -> tuple[np.ndarray, np.ndarray]:
        """What grows the length of path or the driven work at every column, ``(n_column,)``, and its derivatives along (angles,
        rates)."""
        if name == "driven_work":
            from colloc.reduced.actuator_slopes import driven_slopes  # loads CasADi, which a certificate can do without

            return driven_slopes(self.body, self.friction, s.angles, s.rates, s.solved.z, s.delta)
        size = np.linalg.norm(s.rates, axis=0)
        return size, np.concatenate([np.zeros_like(s.angles), s.rates / np.maximum(size, 1e-300)])

    def _on_columns(self, s: _State) -> np.ndarray:
        """Weight of every point of every block in an integral over the part of the period that is solved."""
        weight = point_weights(self.mesh)
        return np.tile(weight, s.pace.size // self.mesh.n_point)

    def gradients(self, v: np.ndarray, delta: float) -> dict[str, np.ndarray]:
        """Derivatives of `values`, ``(n,)`` each."""
        s, mesh = self.at(v, delta), self.mesh
        slopes = self.body.slopes(self.friction, s.angles, s.rates, delta, s.solved)
        self._near = (s, slopes)
        axis = self._direction(s)
        on_omega, on_cx, on_cy = s.pose.pulled_back(axis)
        # a heading that turns with the gait
        aside = (s.displacement * np.conj(axis)).imag
        on_rotation, on_bend = (part * aside for part in heading_shares(self._symmetry) or (0.0, 0.0))
        on_omega = on_omega + on_rotation * self._weight
        zero = np.zeros_like(self._weight)
        rows = np.array(
            [
                [on_omega, on_cx, on_cy, zero],
                [zero, zero, zero, self._weight],
                [self._weight, zero, zero, zero],
            ]
        )
        on_out = np.zeros((*rows.shape[:2], mesh.n_point))
        for stage, points in enumerate(mesh.points.T):  # neighbours may share a point
            on_out[:, :, points] += rows[..., stage]
        on_out = np.tile(on_out, s.pace.size // mesh.n_point)
        on_pace = np.einsum("krt,rt->kt", on_out, s.out)
        on_shape = np.einsum("krt,rjt->ktj", on_out * s.pace, slopes[_OUTPUTS])
        if on_bend:
            weight = on_bend * self._on_columns(s)
            on_shape[0, :, len(s.rates) :] += (weight * s.pace)[:, None]
            on_pace[0] += weight * s.rates.sum(axis=0)
        for name in self._besides:
            weight, (density, slope) = self._on_columns(s), self._density(name, s)
            on_shape = np.concatenate([on_shape, (weight * s.pace * slope).T[None]])
            on_pace = np.concatenate([on_pace, (weight * density)[None]])
        d, w, rotation, *more = self.shapes.pulled_back(v, on_shape, on_pace)
        found = {"distance": self._periods * d, "work": self._periods * w, "rotation": rotation}
        return found | {name: self._periods * row for name, row in zip(self._besides, more, strict=True)}
