"""The balance of a body under isotropic friction and a small outside load: the dual certificate of the bound.

The body minimises its dissipation potential less the load's power. The friction forces found are admissible (|f| <= mu) and
what they leave unbalanced is stated, which is all that `bounds.guaranteed` needs: a solve that stops early gives a weaker
certificate, not a wrong one.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from colloc.mechanics.balance import balance_jacobian, dissipation_potential, instant, net_force, total_power
from colloc.mechanics.body import Chain
from colloc.mechanics.friction import Friction
from colloc.mechanics.native_kernel import compiled_loaded, native_kernel

_UNIT = Friction()
_SHRINK = (0.5,) * 3 + (0.1,) * 5
_TOLERANCE = 1e-10
_STALLED = 1e-7
_SOFTEST = 1e-2
_RUNAWAY = 1e6
"""Speed beyond which a load is more than friction can hold: nothing balances it, and the search ends."""


class Loaded(NamedTuple):
    """States under load, one a column; vectors in the axes of the middle link, about its midpoint.

    velocity (3, n): of the middle link. potential (n,): J_delta. power (n,): of the friction forces. forces (n_link, 3, n):
    minus the friction force on each link in its own axes (tangential, normal, couple). residual (2, n): force and torque left.
    leftover_power (n,): power of what is left, load plus friction, on the motion.
    """

    velocity: np.ndarray
    potential: np.ndarray
    power: np.ndarray
    forces: np.ndarray
    residual: np.ndarray
    leftover_power: np.ndarray


def _turn(vector: np.ndarray, angle: np.ndarray) -> np.ndarray:
    """The plane part of ``(3, n)`` vectors turned by `angle`."""
    c, s = np.cos(angle), np.sin(angle)
    return np.stack([c * vector[0] - s * vector[1], s * vector[0] + c * vector[1], vector[2]])


def loaded_balance(
    body: Chain, angles: np.ndarray, rates: np.ndarray, load: np.ndarray, start: np.ndarray, delta: float, steps: int = 40
) -> Loaded:
    """Balance with unit isotropic friction under `load` ``(3, n)`` (force, torque on the middle link), from `start` ``(3, n)``.

    Where Newton's method stalls on the creases of the potential, it is run again through falling delta.
    """
    library = native_kernel(body)
    if library is not None:
        return Loaded(*compiled_loaded(library, body, _UNIT, angles, rates, load, start, delta, steps))
    state = _newton(body, angles, rates, load, start, delta, steps)
    stalled = np.flatnonzero(state.residual.max(axis=0) > _STALLED)
    if stalled.size:
        again = state.velocity[:, stalled]
        for softer in np.geomspace(_SOFTEST, delta, int(np.ceil(np.log10(_SOFTEST / delta))) + 1):
            retried = _newton(body, angles[:, stalled], rates[:, stalled], load[:, stalled], again, softer, steps)
            again = retried.velocity
        for field, new in zip(state, retried, strict=True):
            field[..., stalled] = new
    return state


def _newton(
    body: Chain, angles: np.ndarray, rates: np.ndarray, load: np.ndarray, start: np.ndarray, delta: float, steps: int
) -> Loaded:
    middle = body.n_link // 2
    lean = angles[:middle].sum(axis=0)
    n = angles.shape[1]
    z, load = _turn(start, lean), _turn(load, lean)
    deltas = np.full((1, n), delta)

    def evaluate(chosen: np.ndarray, z: np.ndarray):
        now = instant(body, _UNIT, angles[:, chosen], rates[:, chosen], z, deltas[:, chosen], middle)
        force = net_force(now.posture, now.force) + load[:, chosen]
        potential = dissipation_potential(body, _UNIT, now.velocity, deltas[:, chosen])
        return now, force, potential - (load[:, chosen] * z).sum(axis=0)

    active = np.arange(n)
    for _ in range(steps):
        now, force, merit = evaluate(active, z[:, active])
        going = np.abs(force).max(axis=0) > _TOLERANCE
        if not going.any():
            break
        matrix = balance_jacobian(body, _UNIT, now.posture, now.velocity, deltas[:, active])[going]
        active, force, merit = active[going], force[:, going], merit[going]
        scale = np.sqrt(np.einsum("tii->ti", matrix)) + 1e-300
        regular = matrix / scale[:, :, None] / scale[:, None, :] + 1e-13 * np.eye(3)
        step = (np.linalg.solve(regular, (force.T / scale)[:, :, None])[:, :, 0] / scale).T
        slope = (force * step).sum(axis=0)
        trial = z[:, active] + step
        alpha = np.ones(active.size)
        failed = ~(evaluate(active, trial)[2] <= merit - 1e-4 * slope + 1e-15)
        for shrink in _SHRINK:
            retry = np.flatnonzero(failed)
            if not retry.size:
                break
            alpha[retry] *= shrink
            trial[:, retry] = z[:, active[retry]] + alpha[retry] * step[:, retry]
            failed[retry] = ~(
                evaluate(active[retry], trial[:, retry])[2] <= merit[retry] - 1e-4 * alpha[retry] * slope[retry] + 1e-15
            )
        z[:, active[~failed]] = trial[:, ~failed]
        active = active[~failed & (np.abs(z[:, active]).max(axis=0) < _RUNAWAY)]
        if not active.size:
            break
    everything = np.arange(n)
    now, force, merit = evaluate(everything, z)
    return Loaded(
        _turn(z, -lean),
        merit + (load * z).sum(axis=0),
        total_power(now.velocity, now.force)[0],
        -np.stack([now.force.tangential, now.force.normal, now.force.couple], axis=1),
        np.stack([np.hypot(force[0], force[1]), np.abs(force[2])]),
        (force * z).sum(axis=0),
    )
