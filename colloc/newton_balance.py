"""Tail velocities in balance near known ones: a few undamped Newton steps in CasADi, the damped solver for the rest.

What a search evaluates thousands of times has a good start each time. `colloc.fixed_point`, which converges from anywhere and
shares nothing with CasADi, then only has to take the instants that undamped steps lose.
"""

from __future__ import annotations

import numpy as np

from colloc.body import Chain
from colloc.fixed_point import solve_balance
from colloc.friction import Friction
from colloc.kernels import newton_step

_ROUNDING = 1e-16
_NEWTON_STEPS = 8
_ACCEPTED = 1e3
"""Where the damped solver stops short of the tolerance, by rounding, a residual of so many times the tolerance will do."""


def balanced_near(
    body: Chain,
    friction: Friction,
    angles: np.ndarray,
    rates: np.ndarray,
    delta: float,
    start: np.ndarray | None,
    tolerance: float,
) -> tuple[np.ndarray, np.ndarray]:
    """Tail velocities ``(3, n_time)`` in balance, and whether they are ``(n_time,)``.

    Parameters
    ----------
    body, friction
    angles, rates : (n_joint, n_time)
    delta : float
    start : (3, n_time), optional
        Tail velocities near by; without it everything is left to the damped solver.
    tolerance : float
        Residual asked for, as in `colloc.fixed_point.solve_balance`. Newton steps on the tail's velocity of order one cannot
        represent speeds of order delta any better than to 1e-16 / delta, and are content with that.
    """
    n_time = angles.shape[1]
    todo, converged = np.arange(n_time), np.ones(n_time, dtype=bool)
    z = np.zeros((3, n_time)) if start is None else start.copy()
    enough = max(tolerance, _ROUNDING / delta)
    if start is not None:
        step, deltas = newton_step(body, friction).map(n_time), np.full((1, n_time), delta)
        for _ in range(_NEWTON_STEPS):
            new, residual = (a.full() for a in step(angles, rates, z, deltas))
            todo = np.flatnonzero(~(residual[0] <= enough))
            if not todo.size:
                return z, converged
            moved = todo[np.isfinite(new[:, todo]).all(axis=0)]
            z[:, moved] = new[:, moved]
    near = None if start is None else start[:, todo]
    solved = solve_balance(body, friction, angles[:, todo], rates[:, todo], delta, start=near, tolerance=tolerance)
    z[:, todo], converged[todo] = solved.z, solved.residual < _ACCEPTED * tolerance
    return z, converged
