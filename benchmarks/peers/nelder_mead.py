"""What a newcomer would try: Nelder-Mead over (A0, A1, B1): python -m benchmarks.peers.nelder_mead
--starts 20

Every evaluation solves the balance at 16 instants an interval at delta = 1e-4 (`solve_balance`, in
one batch) and sums distance and work. Gaits that cross themselves or exceed pi are worth nothing.
"""

from __future__ import annotations

import numpy as np
from scipy.optimize import minimize

from benchmarks.peers.runs import arguments, found, run
from colloc import Chain, Friction, ellipse, solve_balance
from colloc.mechanics.balance import instant, total_power
from scripts.models.ellipses import admissible

SETTINGS = {"xatol": 1e-3, "fatol": 1e-7, "maxfev": 1000}


def minus_efficiency(parameters: np.ndarray, instants: int) -> float:
    """-d/W of an ellipse by the trapezoidal rule, and 0 for inadmissible ones."""
    body, friction = Chain(), Friction()
    if not admissible(body, parameters[:, None])[0]:
        return 0.0
    gait, t = ellipse(*parameters), np.arange(instants) / instants
    angles, rates = gait.angles(t), gait.rates(t)
    z = solve_balance(body, friction, angles, rates, 1e-4, tolerance=1e-8).z
    now = instant(body, friction, angles, rates, z, 1e-4)
    cx, cy = (c[0] for c in body.centre_velocity(now.posture, now.velocity))
    theta = np.concatenate([[0.0], np.cumsum(0.5 * (z[2, 1:] + z[2, :-1]))]) / instants
    c, s = np.cos(theta), np.sin(theta)
    d = np.hypot(np.mean(c * cx - s * cy), np.mean(s * cx + c * cy))
    return -float(d / total_power(now.velocity, now.force).mean())


def solve(instants: int, start: np.ndarray) -> dict:
    """Where the simplex ends."""
    ended = minimize(minus_efficiency, start, (instants,), method="Nelder-Mead", options=SETTINGS)
    return found(-ended.fun, ended.x) | {"evaluations": ended.nfev}


if __name__ == "__main__":
    chosen = arguments(__doc__)
    run(chosen, lambda: 16 * chosen.intervals, solve)
