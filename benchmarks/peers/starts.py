"""Random admissible gaits to start from, the same for every tool, with a feasible motion from
colloc's NumPy solver."""

from __future__ import annotations

import numpy as np

from colloc import Chain, Friction, ellipse, solve_balance
from colloc.mechanics.balance import instant, total_power
from scripts.models.ellipses import admissible


def starts(count: int, seed: int = 0) -> np.ndarray:
    """``(count, 3)`` values of A0, A1, B1."""
    rng = np.random.default_rng(seed)
    found: list[np.ndarray] = []
    while len(found) < count:
        one = rng.uniform([-1.0, 0.2, 0.2], [1.0, 2.5, 1.6])
        if admissible(Chain(), one[:, None])[0]:
            found.append(one)
    return np.array(found)


def feasible_motion(
    parameters: np.ndarray, delta: float, phases: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """States (theta, distance, work) and tail velocities, each ``(3, n)``, of a gait at phases
    0..pi; all per radian."""
    body, friction = Chain(), Friction()
    gait = ellipse(*parameters)
    fine = np.linspace(0, np.pi, 401)
    angles, rates = gait.angles(fine / (2 * np.pi)), gait.rates(fine / (2 * np.pi)) / (2 * np.pi)
    z = solve_balance(body, friction, angles, rates, delta).require().z
    now = instant(body, friction, angles, rates, z, delta)
    cx, cy = (c[0] for c in body.centre_velocity(now.posture, now.velocity))

    def integral(rate: np.ndarray) -> np.ndarray:
        return np.concatenate([[0.0], np.cumsum(0.5 * (rate[1:] + rate[:-1]) * np.diff(fine))])

    theta = integral(z[2])
    dx, dy = (
        integral(r)[-1]
        for r in (np.cos(theta) * cx - np.sin(theta) * cy, np.sin(theta) * cx + np.cos(theta) * cy)
    )
    theta -= np.arctan2(dy, dx)
    states = np.stack(
        [
            theta,
            integral(np.cos(theta) * cx - np.sin(theta) * cy),
            integral(total_power(now.velocity, now.force)[0]),
        ]
    )
    return (
        np.stack([np.interp(phases, fine, row) for row in states]),
        np.stack([np.interp(phases, fine, row) for row in z]),
    )
