"""The balance of a straight body with a bump: one statement for NumPy and CasADi, and the NumPy solver of it.

Forces are in weights, torque is about the bump's rear end, velocities are in bump widths (see `colloc.smooth.bump_body`).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from colloc.mechanics.balance import balance_jacobian, net_force, secant_matrix, total_power
from colloc.mechanics.damped_newton import State, solve, solve3, starting_state
from colloc.mechanics.friction import Friction
from colloc.mechanics.link_friction import LinkForce
from colloc.mechanics.links import LinkVelocity, Posture
from colloc.numerics.arrays import Array, namespace
from colloc.smooth.bump_body import BumpBody
from colloc.smooth.curve import Curve, node_velocity, pulled_back

_ROUNDING = 2e-15


class BumpInstant(NamedTuple):
    """A body with a bump at given instants: the straight parts and the friction on them; the bump and its nodes' velocity."""

    posture: Posture
    velocity: LinkVelocity
    force: LinkForce
    bump: Curve
    vs: Array
    vn: Array


def bump_instant(body: BumpBody, friction: Friction, q: Array, rates: Array, z: Array, delta: Array) -> BumpInstant:
    """Posture, velocities and friction for coordinates and rates ``(n, n_time)``; delta in widths per unit of time."""
    xp = namespace(q, rates, z)
    length = body.link_lengths(q)
    x, y = body.chord(q)
    one = xp.stack([0.0 * x + 1.0, 0.0 * x + 1.0])
    places = xp.stack([-0.5 * length[0:1, :], body.width * x + 0.5 * length[1:2, :]])
    posture = Posture(one, 0.0 * one, places, xp.stack([0.0 * y, body.width * y]))
    velocity = body.links(q, rates, z)
    return BumpInstant(posture, velocity, friction.link_force(*velocity, length, delta), *body.bump(q, rates, z))


def balance_and_power(body: BumpBody, friction: Friction, now: BumpInstant, delta: Array) -> tuple[Array, Array]:
    """Net force and torque ``(3, n_time)``, zero in balance, and the power ``(1, n_time)``."""
    load, power = body.bump_load(now.bump, now.vs, now.vn, delta, friction)
    return net_force(now.posture, now.force) + load, total_power(now.velocity, now.force) + power


class _Lengths:
    """What `balance_jacobian` asks of a body: the lengths of its links, here one column per instant."""

    def __init__(self, lengths: np.ndarray) -> None:
        self._lengths = lengths

    def length_column(self) -> np.ndarray:
        return self._lengths


class _Batch:
    """Instants of a bump body; the only reference is the bump's rear end."""

    def __init__(self, body: BumpBody, friction: Friction, q: np.ndarray, rates: np.ndarray) -> None:
        self.body, self.friction = body, friction
        held = bump_instant(body, friction, q, rates, np.zeros((3, q.shape[1])), np.ones((1, 1)))
        weight = np.broadcast_to(held.bump.weight, held.vs.shape)
        self.bump = np.stack([*held.bump[:-1], weight])
        self.links = np.stack([*held.posture, *held.velocity, body.link_lengths(q)])

    def evaluate(self, select: np.ndarray, z: np.ndarray, delta: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        links, bump = self.links[:, :, select].copy(), Curve(*self.bump[:, :, select])
        posture, length = Posture(*links[:4]), links[7]
        # the straight parts lie along the axis: a rigid motion adds to what they do while the rear end is held
        links[4] += z[0] - posture.y * z[2]
        links[5] += z[1] + posture.x * z[2]
        links[6] += z[2]
        velocity = LinkVelocity(*links[4:7])
        vs, vn = node_velocity(bump, np.stack([z[0], z[1], self.body.width * z[2]]))
        load, _ = self.body.bump_load(bump, vs, vn, delta, self.friction)
        force = net_force(posture, self.friction.link_force(*velocity, length, delta)) + load
        if self.friction.associated:
            inner = np.sum(bump.weight * self.friction.density_potential(vs, vn, delta), axis=0)
            merit = self.friction.link_potential(*velocity, length, delta).sum(axis=0) + self.body.width * inner
        else:
            merit = 0.5 * np.sum(force * force, axis=0)
        nodes = np.stack([*bump, vs, vn]).reshape(-1, z.shape[1])
        return np.concatenate([links.reshape(-1, z.shape[1]), nodes])[None], force, merit

    def step(self, state: np.ndarray, force: np.ndarray, delta: np.ndarray, newton: np.ndarray) -> np.ndarray:
        links, nodes = state[0, :16].reshape(8, 2, -1), state[0, 16:].reshape(9, -1, state.shape[2])
        step = np.empty_like(force)
        for link_law, node_law, chosen in (
            (balance_jacobian, self.friction.density_jacobian, newton),
            (secant_matrix, self.friction.density_secant, ~newton),
        ):
            if not chosen.any():
                continue
            d = delta[:, chosen]
            a, b = links[:, :, chosen], nodes[:, :, chosen]
            lengths = _Lengths(a[7])
            left = link_law(lengths, self.friction, Posture(*a[:4]), LinkVelocity(*a[4:7]), d)  # type: ignore[arg-type]
            inner = pulled_back(Curve(*b[:7]), node_law(b[7], b[8], d))
            # rotation rates reach the bump's nodes through arms measured in widths
            scale = np.array([1.0, 1.0, self.body.width])
            block = np.array([[entry[0] for entry in row] for row in inner]).transpose(2, 0, 1)
            left = left + self.body.width * scale[:, None] * block * scale
            step[:, chosen] = solve3(left, force[:, chosen])
        return step

    def slowest(self, z: np.ndarray, delta: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return np.zeros(z.shape[1], dtype=int), z


def solve_bump(
    body: BumpBody,
    friction: Friction,
    q: np.ndarray,
    rates: np.ndarray,
    delta: float,
    start: np.ndarray | None = None,
    tolerance: float = 1e-10,
) -> State:
    """Velocities ``(3, n_time)`` of the bump's rear end that balance the body, with residuals.

    Parameters
    ----------
    body : BumpBody
    friction : Friction
    q, rates : (body.n, n_time)
    delta : float
        Regularisation speed in body lengths per unit of time of the rates.
    start : (3, n_time), optional
    tolerance : float
        Largest net force or torque over the largest coefficient; not asked for below what rounding of the velocities
        allows at this delta.
    """
    n = q.shape[1]
    tolerance = max(tolerance, _ROUNDING * float(np.abs(rates).max()) * body.width / delta)
    state = starting_state(np.zeros(n, dtype=int), np.zeros((3, n)) if start is None else start.copy())

    def make(members: np.ndarray, reference: int) -> _Batch:
        return _Batch(body, friction, q[:, members], rates[:, members])

    solve(state, make, 1, np.full((1, n), delta / body.width), tolerance, 1000, "auto")
    return state
