"""Distance, work and rotation of a collocated gait as functions of its parameters, with exact
gradients.

Every equation of the collocation fixes one unknown: the balance the tail velocity, its rotation
rate the orientation, both the displacement (`colloc.dynamics.collocated`) and the work ``W = sum_ki
h_k b_i P_ki``. What is left is a program of the gait's parameters alone. Gradients take one adjoint
sweep.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, Protocol

import numpy as np

from colloc.dynamics.collocated import CollocatedPose, point_weights, stage_weights
from colloc.dynamics.kinds import (
    OMEGA,
    OUTPUTS,
    Inertial,
    Kind,
    PeriodTotals,
    TotalGradient,
    Trajectory,
    initial_heading,
    motion_vjp,
)
from colloc.dynamics.kinds import Shapes as Moving
from colloc.dynamics.torques import limit_share_slopes, limit_shares
from colloc.mechanics.densities import Instants, PathLimits, Quantity
from colloc.mechanics.inertia import STATES
from colloc.numerics.mesh import Mesh


class Shapes(Protocol):
    """Gaits by parameters, on the points of a mesh."""

    def at(self, v: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Angles, rates ``(n_joint, n_point)``, and the pace ``(n_point,)`` that multiplies
        velocities."""

    def vjp(self, v: np.ndarray, on_shape: np.ndarray, on_pace: np.ndarray) -> np.ndarray:
        """Derivatives ``(k, n)`` of k numbers, from those along ``(angles, rates)``, ``(k, n_point,
        2 n_joint)``, and along the pace, ``(k, n_point)``."""


@dataclass(eq=False)
class _State:
    """The collocated motion of one v at one delta; `values` are cached."""

    v: np.ndarray
    delta: float
    angles: np.ndarray
    rates: np.ndarray
    pace: np.ndarray
    along: Trajectory
    out: np.ndarray
    pose: CollocatedPose
    passed: PeriodTotals
    values: dict[str, float] = field(default_factory=dict)

    @property
    def z(self) -> np.ndarray:
        return self.along.z


class ReducedMotion:
    """Totals of a period as functions of parameters; the mesh covers the solved part of it."""

    def __init__(
        self, kind: Kind, mesh: Mesh, shapes: Shapes, integrals: Sequence[Quantity] = ()
    ) -> None:
        self.body, self.friction, self.shapes, self.mesh = kind.body, kind.friction, shapes, mesh
        self._space: Any = shapes  # a `SearchSpace` where actuators are limited
        self.kind = kind
        self._integrals = integrals
        self._weight = stage_weights(mesh)
        self._point_weight = point_weights(mesh)
        self._last: _State | None = None
        self._near: tuple[_State, np.ndarray, np.ndarray] | None = None
        self.solves = 0

    def at(self, v: np.ndarray, delta: float) -> _State:
        """The collocated motion; NaN where the balance cannot be solved."""
        last = self._last
        if last is not None and last.delta == delta and np.array_equal(last.v, v):
            return last
        angles, rates, pace = self.shapes.at(v)
        begin = v[v.size - len(self.kind.static_parameters) :]
        along = self.kind.along(
            self.mesh,
            Moving(angles, rates, delta, pace=pace),
            begin,
            self._start(angles, rates, begin),
        )
        self.solves += 1
        now, mesh = along.now, self.mesh
        out = np.vstack([now.z[OMEGA] - self._even(pace), now.centre, now.power])
        out[:, ~along.held] = np.nan
        omega, cx, cy, power = out * pace
        first = initial_heading(self.kind, begin)
        pose = CollocatedPose.on_mesh(mesh, omega, np.array([cx, cy]), first)
        work = float((self._weight * power[mesh.points]).sum())
        passed = PeriodTotals(complex(pose.place[-1]), float(pose.theta[-1]) - first, work, begin)
        found = _State(v.copy(), delta, angles, rates, pace, along, out, pose, passed)
        if not self.kind.states or along.held.all():  # a search goes on from states that there are
            self._last = found
        return found

    def _even(self, pace: np.ndarray) -> float:
        """Rotation rate of axes that turn evenly, over the pace."""
        return self.kind.turn / float(self._point_weight @ pace) if self.kind.turn else 0.0

    def _start(
        self, angles: np.ndarray, rates: np.ndarray, begin: np.ndarray
    ) -> tuple[np.ndarray | None, np.ndarray | None]:
        """States and tail velocities to start from: those of the last gait, or of the last one
        differentiated moved along its slopes."""
        if self._near is None or self.kind.states:
            last = self._last
            if last is None:
                return None, None
            states = last.along.states.copy()
            for name, moved in zip(
                self.kind.static_parameters, begin - last.along.begin, strict=True
            ):
                states[[name == state for state in self.kind.states]] += moved
            return states, last.z
        near, slopes, _ = self._near
        moved = np.concatenate([angles - near.angles, rates - near.rates])
        return None, near.z + np.einsum("ijt,jt->it", slopes[:3], moved)

    def values(self, v: np.ndarray, delta: float) -> dict[str, float]:
        """Totals of a period and integrals by name; NaN where there is no motion."""
        s = self.at(v, delta)
        if not s.values:
            s.values = self.kind.totals(s.passed)
            if self._integrals:
                now = self.instants(v, delta)
                weight = self.kind.periods * s.pace * self._point_weight
                s.values |= {each.name: float(each.at(now)[0] @ weight) for each in self._integrals}
        return s.values

    def shares(
        self, limits: PathLimits, v: np.ndarray, delta: float, t: np.ndarray | None = None
    ) -> np.ndarray:
        """Shares of actuator limits ``(n_share, n_time)`` at the points of the mesh, or at times of
        it."""
        if limits.needs_forces and isinstance(self.kind, Inertial):
            y = self._torque_arguments(self.kind, v, delta, t)
            return limit_shares(self.kind.chain, self.friction, limits, y, delta)
        if t is None:
            return np.asarray(limits.at(self.instants(v, delta)))
        angles, rates = self._space.at_times(v, t)
        shapes = Moving(angles, rates, delta)
        return np.asarray(limits.at(self.kind.instants(shapes, self.theta(v, delta, t))))

    def share_slopes(
        self, limits: PathLimits, v: np.ndarray, delta: float, rows: np.ndarray
    ) -> np.ndarray:
        """Derivatives ``(n_row, n)`` of shares of actuator limits; `rows` ``(2, n_row)`` are their
        shares and points."""
        share, point = rows
        if limits.needs_forces and isinstance(self.kind, Inertial):
            return self._torque_share_slopes(self.kind, limits, v, delta, rows)
        from colloc.reduced.density_slopes import density_slopes  # loads CasADi

        slopes = density_slopes(limits, self.instants(v, delta).chosen(point))
        each = np.arange(share.size)
        on_points = np.zeros((share.size, slopes.shape[1], self.mesh.n_point))
        on_points[each, :, point] = slopes[share, :, each]
        return self.through_points(v, delta, on_points)

    def _torque_arguments(
        self, kind: Inertial, v: np.ndarray, delta: float, t: np.ndarray | None = None
    ) -> np.ndarray:
        """(angles, rates, accelerations, momenta, Froude number) that joint torques depend on."""
        s, mesh = self.at(v, delta), self.mesh
        times, angles, rates, momenta = mesh.times, s.angles, s.rates, s.along.states
        if t is not None:
            times, (angles, rates) = t, self._space.at_times(v, t)
            k = np.clip(np.searchsorted(mesh.edges, t, side="right") - 1, 0, mesh.n - 1)
            weights = mesh.scheme.with_begin((t - mesh.edges[k]) / mesh.h[k])
            at_stages = s.along.states[: len(STATES), mesh.points]
            nodes = np.concatenate([s.along.edges[:, :-1, None], at_stages], axis=2)
            momenta = np.einsum("nj,anj->an", weights, nodes[:, k])
        froude = kind.froude_at(Moving(angles, rates, delta), s.passed.static_parameters)
        accelerations = self._space.accelerations(v, times)
        rows = (
            angles,
            rates,
            accelerations,
            momenta[: len(STATES)],
            np.full((1, times.size), froude),
        )
        return np.concatenate(rows)

    def _torque_share_slopes(
        self, kind: Inertial, limits: PathLimits, v: np.ndarray, delta: float, rows: np.ndarray
    ) -> np.ndarray:
        y, (share, point) = self._torque_arguments(kind, v, delta), rows
        s, n, n_row = self.at(v, delta), len(self.at(v, delta).angles), share.size
        slopes = limit_share_slopes(kind.chain, self.friction, limits, y[:, point], delta)
        at_points = np.zeros((n_row, len(y), self.mesh.n_point))
        each = np.arange(n_row)
        at_points[each, :, point] = slopes[share, :, each]
        on_shape, on_accelerations, on_states, on_froude = np.split(
            at_points, [2 * n, 3 * n, 3 * n + len(STATES)], axis=1
        )
        no_pace = np.zeros((n_row, self.mesh.n_point))
        on_points = np.concatenate([on_shape, no_pace[:, None]], axis=1)
        by_states = np.zeros((n_row, len(kind.states), self.mesh.n_point))
        by_states[:, : len(STATES)] = on_states
        totals = [TotalGradient()] * n_row
        if "log_period" in kind.static_parameters:  # Fr = exp(-2 log_period)
            on_log_period = (-2.0 * y[-1] * on_froude[:, 0]).sum(axis=1)
            totals = [TotalGradient(static=value) for value in on_log_period]
        through = self._through(s, totals, on_points, no_pace, by_states)
        return through + self._space.accelerations_vjp(v, on_accelerations)

    def instants(self, v: np.ndarray, delta: float) -> Instants:
        s = self.at(v, delta)
        return self.kind.instants(Moving(s.angles, s.rates, delta), s.pose.theta_on(self.mesh), s.z)

    def theta(self, v: np.ndarray, delta: float, t: np.ndarray) -> np.ndarray:
        """Orientation at times t of the mesh, ``(n_time,)``; 0 where it is no state."""
        edges = self.mesh.edges
        if "theta" not in self.kind.states:
            return np.zeros(t.size)
        k = np.clip(np.searchsorted(edges, t, side="right") - 1, 0, self.mesh.n - 1)
        return self.at(v, delta).pose.at(k, (t - edges[k]) / self.mesh.h[k])[0]

    def gradients(self, v: np.ndarray, delta: float) -> dict[str, np.ndarray]:
        """Derivatives of `values`, ``(n,)`` each."""
        s, kind = self.at(v, delta), self.kind
        shares, weight, n_joint = kind.total_gradients(s.passed), self._point_weight, len(s.rates)
        on_points = np.zeros((len(shares) + len(self._integrals), 2 * n_joint + 1, s.pace.size))
        on_pace = np.zeros((len(on_points), s.pace.size))
        if self._integrals:
            # loads CasADi, which a certificate can do without
            from colloc.reduced.density_slopes import (
                density_slopes,
            )

            now = self.instants(v, delta)
        for row, quantity in enumerate(self._integrals, len(shares)):
            on_points[row] = kind.periods * weight * s.pace * density_slopes(quantity, now)[0]
            on_pace[row] = kind.periods * weight * quantity.at(now)[0]
        found = self._through(
            s, [*shares.values(), *(TotalGradient() for _ in self._integrals)], on_points, on_pace
        )
        return dict(zip((*shares, *(each.name for each in self._integrals)), found, strict=True))

    def through_points(self, v: np.ndarray, delta: float, on_points: np.ndarray) -> np.ndarray:
        """Derivatives ``(m, n)`` of m numbers, from those along (angles, rates, orientation) at the
        points, ``(m, 2 n_joint + 1, n_point)``."""
        on_pace = np.zeros((len(on_points), on_points.shape[2]))
        if not on_points[:, -1].any():
            return self.shapes.vjp(v, on_points[:, :-1].transpose(0, 2, 1), on_pace)
        return self._through(
            self.at(v, delta), [TotalGradient()] * len(on_points), on_points, on_pace
        )

    def _through(
        self,
        s: _State,
        shares: Sequence[TotalGradient],
        on_points: np.ndarray,
        on_pace: np.ndarray,
        by_states: np.ndarray | float = 0.0,
    ) -> np.ndarray:
        """Derivatives of numbers that depend on shapes, pace, and totals of the period."""
        mesh, kind = self.mesh, self.kind
        slopes, on_states = self._slopes(s)
        rows, on_begin, _ = motion_vjp(
            kind,
            mesh,
            s.pose,
            shares,
            on_states * s.pace,
            on_points[:, -1][:, mesh.points],
            by_states,
        )
        on_out = np.zeros((*rows.shape[:2], mesh.n_point))
        for stage, points in enumerate(mesh.points.T):  # neighbours may share a point
            on_out[:, :, points] += rows[..., stage]
        on_pace = on_pace + np.einsum("krt,rt->kt", on_out[:, : len(s.out)], s.out)
        if kind.turn:  # the axes turn less on what a longer path makes a smaller part of the period
            weight, even = self._point_weight, self._even(s.pace)
            on_pace += np.outer(on_out[:, 0] @ s.pace, even / (weight @ s.pace) * weight)
        on_shape = np.einsum("krt,rjt->ktj", on_out * s.pace, slopes[OUTPUTS]) + on_points[
            :, :-1
        ].transpose(0, 2, 1)
        found = self.shapes.vjp(s.v, on_shape, on_pace)
        if kind.static_parameters:
            found[:, -len(kind.static_parameters) :] += on_begin
            found[:, -len(kind.static_parameters)] += [share.static for share in shares]
        return found

    def _slopes(self, s: _State) -> tuple[np.ndarray, np.ndarray]:
        if self._near is None or self._near[0] is not s:
            self._near = (s, *self.kind.slopes(Moving(s.angles, s.rates, s.delta), s.along))
        return self._near[1:]
