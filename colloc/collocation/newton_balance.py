"""Tail velocities in balance near known ones: by the compiled kernel, or by undamped Newton steps in CasADi.

What a search evaluates thousands of times has a good start each time. NumPy would spend more on small batches than on the
steps, so without the kernel the first ones are CasADi's. Where a Newton step makes the residual worse, a step of
the paper's fixed point is taken instead, from where it was better. `mechanics.fixed_point`, which converges from anywhere and
shares nothing with CasADi, then only has to take the few instants that such steps lose.
"""

from __future__ import annotations

import numpy as np

from colloc.collocation.point_equations import balance_steps
from colloc.mechanics.body import Chain
from colloc.mechanics.fixed_point import solve_balance
from colloc.mechanics.friction import Friction
from colloc.mechanics.native_kernel import native_kernel

_ROUNDING = 1e-16
_STEPS = 40
"""Steps before the damped solver takes over, which costs as much as hundreds of them: with 8, 15, 25 and 40 it was left 4200,
1080, 320 and 160 instants of nine starts at (1, 1, 3)."""
_FAR = 1e3
"""No body moves so many times faster than its joints. Steps that say so end where squares overflow and forces vanish."""
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
        Residual asked for, as in `mechanics.fixed_point.solve_balance`. Newton steps on the tail's velocity of order one cannot
        represent speeds of order delta any better than to 1e-16 / delta, and are content with that.
    """
    n_time = angles.shape[1]
    z = np.zeros((3, n_time)) if start is None else start.copy()
    todo, converged = np.arange(n_time), np.ones(n_time, dtype=bool)
    enough = max(tolerance, _ROUNDING / delta)
    if start is not None and native_kernel(body) is None:
        steps = balance_steps(body, friction)
        fallback, best = z.copy(), np.full(n_time, np.inf)
        limit = _FAR * np.abs(rates).max(axis=0)
        for _ in range(_STEPS):
            at = (angles[:, todo], rates[:, todo], z[:, todo], np.full((1, todo.size), delta))
            newton, fixed_point, residual = (a.full() for a in steps(*at))
            keep = ~(residual[0] <= enough)
            if not keep.any():
                return z, converged
            todo, newton, fixed_point, residual = todo[keep], newton[:, keep], fixed_point[:, keep], residual[0, keep]
            sane = (np.abs(newton) <= limit[todo]).all(axis=0) & np.isfinite(fixed_point).all(axis=0)
            better = (residual < best[todo]) & sane
            fallback[:, todo] = np.where(better, fixed_point, fallback[:, todo])
            best[todo] = np.where(better, residual, np.inf)
            z[:, todo] = np.where(better, newton, fallback[:, todo])
    near = None if start is None else start[:, todo]
    solved = solve_balance(body, friction, angles[:, todo], rates[:, todo], delta, start=near, tolerance=tolerance)
    z[:, todo], converged[todo] = solved.z, solved.residual < _ACCEPTED * tolerance
    return z, converged
