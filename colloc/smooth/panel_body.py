"""Smooth bodies of a few shape coordinates, solved on fixed panels, as
`colloc.mechanics.bodies.Body`."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator
from functools import partial
from typing import Self

import numpy as np

from colloc.mechanics.balance_results import BalancedMotion, BalanceSolution, Sliding
from colloc.mechanics.bodies import Usual
from colloc.mechanics.damped_newton import groups, relative_delta, solve, starting_state
from colloc.mechanics.implicit_slopes import implicit_changes
from colloc.mechanics.law import Law
from colloc.numerics.arrays import Array, namespace
from colloc.smooth.balance import ANCHOR_MOVES, TAIL, PanelBatch, PanelFields
from colloc.smooth.curve import (
    Curve,
    PanelGrid,
    bending_power,
    curve,
    mean_velocity,
    node_velocity,
    pulled_back,
    resultant,
)
from colloc.smooth.smooth_body import SmoothBody

_STEPS = 1000


class PanelBody(SmoothBody):
    """Base of bodies whose tangent angle is a function of a few shape coordinates, for NumPy and
    CasADi, on panels that are the same at all times: `grid`."""

    symmetries = ("none", "antipodal")
    usual = Usual(
        delta=1e-2, delta_start=0.3, limit=1.5, largest_limit=0.5 * np.pi,
        limit_name="tangent angle", excess=1e-3,
        delta_influence=2e-2, instants=400,
    )  # fmt: skip
    """A smooth body has a point at rest at nearly every instant. So its panels have to resolve
    delta over the rotation rate, and the influence of delta is of first order and larger than for
    links. Below pi/2 the body advances along its mean direction and cannot cross itself."""

    @property
    def grid(self) -> PanelGrid:
        raise NotImplementedError

    def angle_slopes(
        self, s: np.ndarray, q: np.ndarray, rates: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Derivatives of the tangent angle and its rate along (shape, rates), ``(n_place, 2
        n_joint, n_time)`` each, or 1 where the same at all times, at places ``(n_place, 1)``."""
        raise NotImplementedError

    def on_panels(self, panels: int) -> Self:
        return dataclasses.replace(self, panels=panels)  # type: ignore[type-var]

    @property
    def bending(self) -> np.ndarray:
        return np.diff(self.limited, axis=0)

    def sliding(
        self, friction: Law, angles: Array, rates: Array, z: Array, delta: Array
    ) -> Sliding:
        """Paper, eqs. ftb and W."""
        grid = self.grid
        theta, rate = self.tangent(grid.nodes, angles), self.turning(grid.nodes, angles, rates)
        now = curve(grid, theta, rate, TAIL, np.zeros((1, 1)))
        vs, vn = node_velocity(now, z)
        fs, fn = friction.density(vs, vn, delta)
        power = -namespace(angles, rates, z).sum_rows(now.weight * (fs * vs + fn * vn))
        return Sliding(resultant(now, fs, fn), mean_velocity(now, vs, vn), power)

    def _fields(self, angles: np.ndarray, rates: np.ndarray) -> PanelFields:
        grid = self.grid
        at_all_times = np.broadcast_to(grid.edges, (grid.n + 1, angles.shape[1]))
        return PanelFields(
            PanelGrid(at_all_times, grid.order),
            self.tangent(grid.nodes, angles),
            self.turning(grid.nodes, angles, rates),
            self.turning(grid.edges, angles, rates),
        )

    def solve(
        self,
        friction: Law,
        angles: np.ndarray,
        rates: np.ndarray,
        delta: float,
        *,
        start: np.ndarray | None = None,
        tolerance: float = 1e-11,
    ) -> BalanceSolution:
        # work in units of the largest rate: the law is homogeneous once delta scales along
        speed = np.abs(self.turning(self.grid.nodes, angles, rates)).max(axis=0)
        speed[(speed == 0) | (friction.degree is None)] = 1.0
        fields = self._fields(angles, rates / speed)
        make = partial(PanelBatch, fields, friction)
        velocity = np.zeros((3, angles.shape[1]))
        if start is not None:
            velocity = start / speed
            velocity[2] += fields.edge_rate[TAIL]
        state = starting_state(np.full(velocity.shape[1], TAIL), velocity)
        solve(state, make, ANCHOR_MOVES, relative_delta(delta, speed), tolerance, _STEPS, "auto")
        z = np.empty_like(velocity)
        for reference, at in groups(state.anchor):
            z[:, at] = make(at, reference).tail_velocity(state.velocity[:, at])
        return BalanceSolution(
            z * speed,
            state.residual,
            state.iterations,
            state.residual <= tolerance,
            state.anchor,
            state.velocity * speed,
        )

    def _anchored(
        self, friction: Law, angles: np.ndarray, rates: np.ndarray, solved: BalanceSolution
    ) -> Iterator[tuple[PanelBatch, np.ndarray]]:
        """Instants that were solved for, by their anchors."""
        fields = self._fields(angles, rates)
        for reference, at in groups(solved.anchor):
            yield PanelBatch(fields, friction, at, reference), at

    def motion(
        self,
        friction: Law,
        angles: np.ndarray,
        rates: np.ndarray,
        delta: float,
        solved: BalanceSolution,
    ) -> BalancedMotion:
        centre, (power, bending) = np.empty((2, angles.shape[1])), np.empty((2, angles.shape[1]))
        for batch, at in self._anchored(friction, angles, rates, solved):
            now, fields = Curve(*batch.curve), batch.fields
            vs, vn, fs, fn = batch.forces(solved.anchor_velocity[:, at], delta)
            centre[:, at] = mean_velocity(now, vs, vn)
            power[at] = -(now.weight * (fs * vs + fn * vn)).sum(axis=0)
            bending[at] = bending_power(fields.panels, now, fs, fn, fields.rate)
        return BalancedMotion(solved.z, centre, power, bending)

    def slopes(
        self,
        friction: Law,
        angles: np.ndarray,
        rates: np.ndarray,
        delta: float,
        solved: BalanceSolution,
    ) -> np.ndarray:
        slopes = np.empty((6, 2 * len(angles), angles.shape[1]))
        for batch, at in self._anchored(friction, angles, rates, solved):
            z = solved.anchor_velocity[:, at]
            slopes[:, :, at] = self._slopes(batch, angles[:, at], rates[:, at], delta, z)
        return slopes

    def _slopes(
        self, batch: PanelBatch, q: np.ndarray, rates: np.ndarray, delta: float, z: np.ndarray
    ) -> np.ndarray:
        """The nodes take the place of a chain's links: their weights that of lengths, without a
        couple."""
        vs, vn, fs, fn = batch.forces(z, delta)
        panels, reference, now = batch.fields.panels, batch.reference, Curve(*batch.curve)
        c, s, weight = now.cos, now.sin, now.weight
        x, y = now.arm_s * s + now.arm_n * c, now.arm_n * s - now.arm_s * c
        none = np.zeros_like(vs)
        turning = batch.fields.rate - batch.fields.edge_rate[reference] + z[2]
        nodes, edge = self.grid.nodes, self.grid.edges[reference : reference + 1]
        dphi, turned = (
            np.broadcast_to(a, (*a.shape[:2], q.shape[1]))
            for a in self.angle_slopes(nodes, q, rates)
        )
        anchor = self.angle_slopes(edge, q, rates)[1][0]

        def along_path(a: np.ndarray) -> np.ndarray:
            return panels.integrate(
                (panels.widths[:, :1, None] * a).reshape(len(a), -1), reference
            ).reshape(a.shape)

        (k_ss, k_sn), (k_ns, k_nn) = jacobian = batch.friction.density_jacobian(vs, vn, delta)
        stiffness = (
            (weight * k_ss, weight * k_sn, none),
            (weight * k_ns, weight * k_nn, none),
            (none, none, none),
        )
        d = implicit_changes(
            (c, s, x, y), (vs, vn, turning), (weight * fs, weight * fn, none), stiffness,
            pulled_back(now, jacobian), along_path, dphi, turned - anchor,
        )  # fmt: skip
        back = (panels.edge_path(reference)[TAIL] * panels.widths[:, 0])[:, None, None]
        full = d.w  # the change of the tangents' rotation rate, that of the anchor included
        swing_x = -(back * (full * s[:, None] + (turning * c)[:, None] * dphi)).sum(axis=0)
        swing_y = (back * (full * c[:, None] - (turning * s)[:, None] * dphi)).sum(axis=0)
        centre_x, centre_y = ((weight[:, None] * v).sum(axis=0) for v in (d.vx, d.vy))
        tail = d.anchor[0] + swing_x, d.anchor[1] + swing_y, d.anchor[2] - anchor
        return np.stack([*tail, centre_x, centre_y, d.power])
