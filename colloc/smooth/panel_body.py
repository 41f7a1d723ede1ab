"""Smooth bodies of a few shape coordinates, solved on fixed panels."""

from __future__ import annotations

import dataclasses
from functools import partial

import numpy as np

from colloc.mechanics.bodies import BalancedMotion, BalanceSolution, Body, Defaults, Sliding
from colloc.mechanics.damped_newton import groups, relative_delta, solve, starting_state
from colloc.mechanics.law import Law
from colloc.numerics.arrays import Array, namespace
from colloc.smooth.balance import ANCHOR_MOVES, TAIL, PanelBatch, PanelFields
from colloc.smooth.curve import PanelGrid, curve, mean_velocity, node_velocity, resultant
from colloc.smooth.smooth_body import SmoothBody

_STEPS = 1000


class PanelBody(SmoothBody):
    """A body whose tangent angle is a function of a few shape coordinates, for NumPy and CasADi, on
    panels that are the same at all times.

    It has a point at rest at nearly every time: panels have to resolve delta over the rotation
    rate, and the influence of delta is of first order. Below pi/2 it advances along its mean
    direction and cannot cross itself.
    """

    panels: int
    defaults = Defaults(
        coordinate="mode", quantity="mode",
        delta=1e-2, delta_start=0.3, limit=1.5, largest_limit=0.5 * np.pi,
        limit_name="tangent angle", excess=1e-3, delta_influence=2e-2, instants=400,
    )  # fmt: skip

    @property
    def grid(self) -> PanelGrid:
        raise NotImplementedError

    def sliding(
        self, friction: Law, angles: Array, rates: Array, z: Array, delta: Array
    ) -> Sliding:
        nodes = self.grid.nodes
        theta, rate = self.tangent(nodes, angles), self.turning(nodes, angles, rates)
        now = curve(self.grid, theta, rate, TAIL, np.zeros((1, 1)))
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
        state = starting_state(np.full(speed.size, TAIL), velocity)
        solve(state, make, ANCHOR_MOVES, relative_delta(delta, speed), tolerance, _STEPS, "auto")
        z = np.empty_like(velocity)
        for reference, at in groups(state.anchor):
            z[:, at] = make(at, reference).tail_velocity(state.velocity[:, at])
        converged = state.residual <= tolerance
        return BalanceSolution(
            z * speed, state.residual, state.iterations, converged, state.anchor,
            state.velocity * speed,
        )  # fmt: skip

    def motion(
        self,
        friction: Law,
        angles: np.ndarray,
        rates: np.ndarray,
        delta: float,
        solved: BalanceSolution,
    ) -> BalancedMotion:
        fields, values = self._fields(angles, rates), np.empty((4, angles.shape[1]))
        for reference, at in groups(solved.anchor):
            batch = PanelBatch(fields, friction, at, reference)
            centre, sums, bending = batch.motion(solved.anchor_velocity[:, at], delta)
            values[:, at] = *centre, sums[3].sum(axis=0), bending
        return BalancedMotion(solved.z, values[:2], values[2], values[3])


def panels_of(body: Body) -> int:
    """Panels of its quadrature, which a search doubles; 0 where there is none to refine."""
    return body.panels if isinstance(body, PanelBody) else 0


def on_panels(body: Body, panels: int) -> Body:
    return dataclasses.replace(body, panels=panels) if isinstance(body, PanelBody) else body  # type: ignore[type-var]
