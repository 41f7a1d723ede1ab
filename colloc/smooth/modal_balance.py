"""The balance of a smooth body of few modes: one statement for NumPy and CasADi, and the NumPy solver of it.

The velocity ``z = (u, v, omega)`` is that of the tail, in the axes in which Theta is measured, and the rotation rate of those
axes; ``(3, n_time)``.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from colloc.mechanics.damped_newton import State, solve, starting_state
from colloc.mechanics.friction import Friction, force_density
from colloc.numerics.arrays import Array, namespace
from colloc.smooth.batch import PanelBatch, PanelFields
from colloc.smooth.curve import Curve, Panels, curve, node_velocity, resultant
from colloc.smooth.modal_body import ModalBody

TAIL = 0
_ANCHOR_MOVES = 5


class ModalBalance(NamedTuple):
    """Net force and torque about the tail ``(3, n_time)``, zero in balance, and the power ``(1, n_time)``."""

    force: Array
    power: Array


def modal_balance(body: ModalBody, friction: Friction, q: Array, rates: Array, z: Array, delta: Array) -> ModalBalance:
    """Balance and power for amplitudes and their rates ``(modes, n_time)`` (paper, eqs. ftb and W)."""
    xp, grid = namespace(q, rates, z), body.grid
    modes = body.modes_at(grid.nodes[:, 0])
    now: Curve = curve(grid, xp.matmul(modes, q), xp.matmul(modes, rates), TAIL, np.zeros((1, 1)))
    vs, vn = node_velocity(now, z)
    fs, fn = force_density(vs, vn, delta, friction)
    return ModalBalance(resultant(now, fs, fn), -xp.sum_rows(now.weight * (fs * vs + fn * vn)))


def solve_modal(
    body: ModalBody,
    friction: Friction,
    q: np.ndarray,
    rates: np.ndarray,
    delta: float,
    start: np.ndarray | None = None,
    tolerance: float = 1e-11,
) -> State:
    """Velocities z that balance the body at amplitudes and rates ``(modes, n_time)``, with residuals.

    Parameters
    ----------
    body : ModalBody
    friction : Friction
    q, rates : (modes, n_time)
    delta : float
        Regularisation speed in body lengths per unit of time of the rates.
    start : (3, n_time), optional
        NaN where nothing is known.
    tolerance : float
        Largest net force or torque over the largest coefficient.
    """
    n = q.shape[1]
    grid = Panels(np.broadcast_to(body.grid.edges, (body.panels + 1, n)), body.order)
    modes, at_edges = body.modes_at(body.grid.nodes[:, 0]), body.modes_at(body.grid.edges[:, 0])
    fields = PanelFields(grid, modes @ q, modes @ rates, at_edges @ rates)

    def make(members: np.ndarray, reference: int) -> PanelBatch:
        return PanelBatch(fields, friction, members, reference)

    velocity = np.zeros((3, n)) if start is None else np.nan_to_num(start)
    velocity = velocity + np.array([[0.0], [0.0], [1.0]]) * fields.edge_rate[TAIL]  # a batch's omega is that of the tangent
    state = starting_state(np.full(n, TAIL), velocity)
    solve(state, make, _ANCHOR_MOVES, np.full((1, n), delta), tolerance, 1000, "auto")
    for reference in np.unique(state.anchor):
        members = np.flatnonzero(state.anchor == reference)
        tail = make(members, int(reference)).edge_velocity(state.velocity[:, members])[:, TAIL]
        tail[2] -= fields.edge_rate[TAIL, members]
        state.velocity[:, members] = tail
    state.anchor[:] = TAIL
    return state
