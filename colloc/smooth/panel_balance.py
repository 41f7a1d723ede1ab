"""The balance of a smooth body of a few shape coordinates, on its panels: the velocities that keep
it, and what follows.

The velocity ``z = (u, v, omega)`` is that of the tail, in the axes in which Theta is measured, and
the rotation rate of those axes; ``(3, n_time)``. A batch's omega, and that of an anchor, is the
rotation rate of the tangent there.
"""

from __future__ import annotations

from typing import NamedTuple, Protocol

import numpy as np

from colloc.mechanics.balance_results import BalancedMotion, BalanceSolution, Sliding
from colloc.mechanics.damped_newton import groups, relative_delta, solve, starting_state
from colloc.mechanics.implicit_slopes import implicit_changes
from colloc.mechanics.law import Law
from colloc.numerics.arrays import Array, namespace
from colloc.smooth.batch import PanelBatch, PanelFields
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

TAIL = 0
_ANCHOR_MOVES = 5
_STEPS = 1000


class PanelShapes(Protocol):
    """Tangent angles on fixed panels, as functions of a few shape coordinates."""

    @property
    def grid(self) -> PanelGrid:
        """The panels, the same at all times."""

    def angle(self, s: np.ndarray, q: Array) -> Array:
        """Theta ``(n_place, n_time)`` at places s ``(n_place,)`` of shapes ``(n_joint, n_time)``;
        NumPy and CasADi."""

    def angle_rate(self, s: np.ndarray, q: Array, rates: Array) -> Array:
        """Its rate; NumPy and CasADi."""

    def angle_slopes(
        self, s: np.ndarray, q: np.ndarray, rates: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Derivatives of both along (shape, rates), ``(n_place, 2 n_joint, n_time)`` each, or 1
        where the same at all times."""


def panel_sliding(
    body: PanelShapes, friction: Law, angles: Array, rates: Array, z: Array, delta: Array
) -> Sliding:
    """The balance for shapes and their rates ``(n_joint, n_time)`` (paper, eqs. ftb and W); NumPy
    and CasADi."""
    xp, grid = namespace(angles, rates, z), body.grid
    s = grid.nodes[:, 0]
    now: Curve = curve(
        grid, body.angle(s, angles), body.angle_rate(s, angles, rates), TAIL, np.zeros((1, 1))
    )
    vs, vn = node_velocity(now, z)
    fs, fn = friction.density(vs, vn, delta)
    power = -xp.sum_rows(now.weight * (fs * vs + fn * vn))
    return Sliding(resultant(now, fs, fn), mean_velocity(now, vs, vn), power)


def _fields(body: PanelShapes, q: np.ndarray, rates: np.ndarray) -> PanelFields:
    own = body.grid
    s, ends = own.nodes[:, 0], own.edges[:, 0]
    grid = PanelGrid(np.broadcast_to(own.edges, (ends.size, q.shape[1])), own.order)
    return PanelFields(
        grid, body.angle(s, q), body.angle_rate(s, q, rates), body.angle_rate(ends, q, rates)
    )


def solved_on_panels(
    body: PanelShapes,
    friction: Law,
    angles: np.ndarray,
    rates: np.ndarray,
    delta: float,
    start: np.ndarray | None = None,
    tolerance: float = 1e-11,
) -> BalanceSolution:
    """Velocities z that balance the body at shapes and rates ``(n_joint, n_time)``, begun at
    `start` ``(3, n_time)`` or at rest.

    Delta is in body lengths per unit of time of the rates; the tolerance is the largest residual
    that counts as converged.
    """
    n = angles.shape[1]
    # work in units of the largest rate: the law is homogeneous once delta scales along
    speed = np.abs(body.angle_rate(body.grid.nodes[:, 0], angles, rates)).max(axis=0)
    speed[(speed == 0) | (friction.degree is None)] = 1.0
    fields = _fields(body, angles, rates / speed)

    def make(members: np.ndarray, reference: int) -> PanelBatch:
        return PanelBatch(fields, friction, members, reference)

    velocity = np.zeros((3, n))
    if start is not None:
        velocity = start / speed
        velocity[2] += fields.edge_rate[TAIL]
    state = starting_state(np.full(n, TAIL), velocity)
    solve(state, make, _ANCHOR_MOVES, relative_delta(delta, speed), tolerance, _STEPS, "auto")
    z = np.empty((3, n))
    for reference, members in groups(state.anchor):
        z[:, members] = make(members, reference).edge_velocity(state.velocity[:, members])[:, TAIL]
    z[2] -= fields.edge_rate[TAIL]
    converged = state.residual <= tolerance
    return BalanceSolution(
        z * speed, state.residual, state.iterations, converged, state.anchor, state.velocity * speed
    )


class _At(NamedTuple):
    """Instants of one anchor: their batch, curve, nodes' velocities and forces per length."""

    batch: PanelBatch
    curve: Curve
    vs: np.ndarray
    vn: np.ndarray
    fs: np.ndarray
    fn: np.ndarray


def _at_anchor(
    body: PanelShapes,
    friction: Law,
    q: np.ndarray,
    rates: np.ndarray,
    delta: float,
    reference: int,
    z: np.ndarray,
) -> _At:
    batch = PanelBatch(_fields(body, q, rates), friction, np.arange(q.shape[1]), reference)
    now = Curve(*batch.curve)
    vs, vn = node_velocity(now, z)
    return _At(batch, now, vs, vn, *friction.density(vs, vn, delta))


def panel_motion(
    body: PanelShapes,
    friction: Law,
    angles: np.ndarray,
    rates: np.ndarray,
    delta: float,
    solved: BalanceSolution,
) -> BalancedMotion:
    """The motion at instants that were solved for."""
    n = angles.shape[1]
    centre, power, bending = np.empty((2, n)), np.empty(n), np.empty(n)
    for reference, at in groups(solved.anchor):
        velocity = solved.anchor_velocity[:, at]
        batch, now, vs, vn, fs, fn = _at_anchor(
            body, friction, angles[:, at], rates[:, at], delta, reference, velocity
        )
        centre[:, at] = mean_velocity(now, vs, vn)
        power[at] = -(now.weight * (fs * vs + fn * vn)).sum(axis=0)
        bending[at] = bending_power(batch.panels, now, fs, fn, batch.fields.rate)
    return BalancedMotion(solved.z, centre, power, bending)


def panel_slopes(
    body: PanelShapes,
    friction: Law,
    angles: np.ndarray,
    rates: np.ndarray,
    delta: float,
    solved: BalanceSolution,
) -> np.ndarray:
    """Derivatives ``(6, 2 n_joint, n_time)`` of (z, centre, power) with respect to shapes and
    rates."""
    slopes = np.empty((6, 2 * len(angles), angles.shape[1]))
    for reference, at in groups(solved.anchor):
        velocity = solved.anchor_velocity[:, at]
        slopes[:, :, at] = _slopes(
            body, friction, angles[:, at], rates[:, at], delta, reference, velocity
        )
    return slopes


def _slopes(
    body: PanelShapes,
    friction: Law,
    q: np.ndarray,
    rates: np.ndarray,
    delta: float,
    reference: int,
    z: np.ndarray,
) -> np.ndarray:
    """The nodes take the place of a chain's links: their weights that of lengths, without a
    couple."""
    batch, now, vs, vn, fs, fn = _at_anchor(body, friction, q, rates, delta, reference, z)
    panels, n_time = batch.panels, q.shape[1]
    c, s, weight = now.cos, now.sin, now.weight
    x, y = now.arm_s * s + now.arm_n * c, now.arm_n * s - now.arm_s * c
    none = np.zeros_like(vs)
    turning = batch.fields.rate - batch.edge_rate[reference] + z[2]
    dphi, turned = (
        np.broadcast_to(a, (*a.shape[:2], n_time))
        for a in body.angle_slopes(body.grid.nodes[:, 0], q, rates)
    )
    anchor = body.angle_slopes(body.grid.edges[reference], q, rates)[1][0]

    def along_path(a: np.ndarray) -> np.ndarray:
        return panels.integrate(
            (panels.widths[:, :1, None] * a).reshape(len(a), -1), reference
        ).reshape(a.shape)

    (k_ss, k_sn), (k_ns, k_nn) = friction.density_jacobian(vs, vn, delta)
    left = pulled_back(now, ((k_ss, k_sn), (k_ns, k_nn)))
    stiffness = (
        (weight * k_ss, weight * k_sn, none),
        (weight * k_ns, weight * k_nn, none),
        (none, none, none),
    )
    d = implicit_changes(
        (c, s, x, y), (vs, vn, turning), (weight * fs, weight * fn, none), stiffness, left,
        along_path,
        dphi, turned - anchor,
    )  # fmt: skip
    back = (panels.edge_path(reference)[TAIL] * panels.widths[:, 0])[:, None, None]
    full = d.w  # the change of the tangents' rotation rate, that of the anchor included
    swing_x = -(back * (full * s[:, None] + (turning * c)[:, None] * dphi)).sum(axis=0)
    swing_y = (back * (full * c[:, None] - (turning * s)[:, None] * dphi)).sum(axis=0)
    axes = d.anchor[2] - anchor
    centre_x, centre_y = ((weight[:, None] * v).sum(axis=0) for v in (d.vx, d.vy))
    return np.stack(
        [d.anchor[0] + swing_x, d.anchor[1] + swing_y, axes, centre_x, centre_y, d.power]
    )
