"""Purcell's swimmer by resistive-force theory, written apart from the library: one matrix of
resistances, three equal links.

State: position of the middle of the middle link, its heading, and the two joint angles (link ahead
less link behind). With the Jacobian J_k of a link's midpoint velocity and spin s_k, drag takes the
power ``v' R v``, ``R = sum l J_k' (c_t t t' + c_n n n') J_k + c_n l^3/12 s_k' s_k``; rigid rates
follow from force-free, torque-free motion.
"""

from __future__ import annotations

import numpy as np

NORMAL, TANGENTIAL, LENGTH = 2.0, 1.0, 1 / 3


def resistance(theta: float, angles: np.ndarray) -> np.ndarray:
    """R, ``(5, 5)``."""
    phi = np.array([theta - angles[0], theta, theta + angles[1]])
    t = np.array([np.cos(phi), np.sin(phi)])
    n = np.array([-t[1], t[0]])
    middle = [-0.5 * LENGTH * (t[:, 1] + t[:, 0]), np.zeros(2), 0.5 * LENGTH * (t[:, 1] + t[:, 2])]
    total = np.zeros((5, 5))
    for k, swing in enumerate(([-1.0, 0.0], [0.0, 0.0], [0.0, 1.0])):
        spin = np.array([0.0, 0.0, 1.0, *swing])
        move = np.zeros((2, 5))
        move[:, :2] = np.eye(2)
        move[:, 2] = [-middle[k][1], middle[k][0]]
        # an outer link turns about its joint: its middle lies half a link beyond
        out = 0.5 * LENGTH * n[:, k] * (k - 1)
        move[:, 3:] += out[:, None] * swing
        drag = TANGENTIAL * np.outer(t[:, k], t[:, k]) + NORMAL * np.outer(n[:, k], n[:, k])
        total += LENGTH * move.T @ drag @ move + NORMAL * LENGTH**3 / 12 * np.outer(spin, spin)
    return total


def connection(angles: np.ndarray) -> np.ndarray:
    """Rigid rates per joint rates in the axes of the middle link, ``(3, 2)``."""
    R = resistance(0.0, angles)
    return -np.linalg.solve(R[:3, :3], R[:3, 3:])


def cost(angles: np.ndarray) -> np.ndarray:
    """Power as a quadratic form of the joint rates, ``(2, 2)``."""
    R = resistance(0.0, angles)
    return R[3:, 3:] + R[3:, :3] @ connection(angles)


def displacement_per_area(step: float = 1e-4) -> float:
    """Net displacement of a small loop round the straight shape, per area of the loop: curl and
    bracket of the connection."""
    ahead, behind = (np.array([connection(sign * step * e) for e in np.eye(2)]) for sign in (1, -1))
    slope = (ahead - behind) / (2 * step)  # (angle, rigid, rate)
    A = connection(np.zeros(2))
    curl = slope[0, :, 1] - slope[1, :, 0]
    bracket = np.array(
        [A[2, 0] * -A[1, 1] + A[1, 0] * A[2, 1], A[2, 0] * A[0, 1] - A[0, 0] * A[2, 1]]
    )
    return float(np.hypot(*(curl[:2] + bracket)))


def best_small_stroke() -> float:
    """Largest displacement per work of small strokes in a period of 1: the isoperimetric problem in
    the metric of the cost."""
    return displacement_per_area() / (4 * np.pi * np.sqrt(np.linalg.det(cost(np.zeros(2)))))
