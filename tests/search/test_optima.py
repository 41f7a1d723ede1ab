"""Collocation optima against maxima of grid sweeps that this file does itself with the NumPy
solver."""

import numpy as np
import pytest

from colloc import Chain, Friction, Harmonic, Problem, solve, solve_balance
from colloc.mechanics.balance import instant, total_power
from colloc.mechanics.contact import crossing_depth

DELTA = 1e-4
BODY, FRICTION = Chain(), Friction()


def efficiencies(A, n):
    """d/W of ellipses, one per row (A0, A1, B1), by the midpoint rule on the whole period; 0 where
    inadmissible."""
    t = (np.arange(n) + 0.5) / n
    c, s = np.cos(2 * np.pi * t), np.sin(2 * np.pi * t)
    A0, A1, B1 = (A[:, k, None] for k in range(3))
    q = np.stack([A0 + A1 * c + B1 * s, -A0 - A1 * c + B1 * s])
    r = 2 * np.pi * np.stack([-A1 * s + B1 * c, A1 * s + B1 * c])
    shape = q.shape[1:]
    q, r = q.reshape(2, -1), r.reshape(2, -1)
    z = solve_balance(BODY, FRICTION, q, r, DELTA).require().z
    now = instant(BODY, FRICTION, q, r, z, DELTA)
    omega, power = z[2].reshape(shape), total_power(now.velocity, now.force)[0].reshape(shape)
    theta = (np.cumsum(omega, axis=1) - 0.5 * omega) / n
    cx, cy = (a[0].reshape(shape) for a in BODY.centre_velocity(now.posture, now.velocity))
    move = (np.exp(1j * theta) * (cx + 1j * cy)).sum(axis=1)
    value = np.abs(move) / power.sum(axis=1)
    outside = np.abs(A[:, 0]) + np.hypot(A[:, 1], A[:, 2]) > np.pi + 1e-12
    crossing = crossing_depth(BODY, q).reshape(shape).max(axis=1) > 0
    return np.where(outside | crossing, 0.0, value)


def swept_maximum(centre, width, n=240):
    """Maximum over grids that shrink around their best point until they are 1e-3 wide; (value,
    point)."""
    centre = np.array(centre)
    while width > 2e-3:
        axis = np.linspace(-width, width, 7)
        grid = centre + np.stack(np.meshgrid(axis, axis, axis), axis=-1).reshape(-1, 3)
        # the joint limit is a curved edge of the admissible set: add points on it
        direction = grid[:, 1:] / np.hypot(grid[:, 1], grid[:, 2])[:, None]
        on_edge = np.column_stack([grid[:, 0], direction * (np.pi - np.abs(grid[:, 0]))[:, None]])
        near = np.abs(on_edge - centre).max(axis=1) <= width
        grid = np.concatenate([grid, on_edge[near]])
        value = efficiencies(grid, n)
        centre = grid[np.argmax(value)]
        width *= 0.35
    return efficiencies(centre[None], 4 * n)[0], centre


@pytest.mark.parametrize(
    ("name", "around", "width"),
    [
        ("three_link", (0.05, 2.8, 1.35), 0.15),
        ("three_link_offset", (1.05, 0.7, 1.1), 0.15),
        ("three_link_folded", (2.55, 0.38, 0.45), 0.06),
    ],
)
def test_collocation_finds_the_maximum_of_a_grid_sweep(name, around, width, solved):
    solution, reference = solved(name)
    assert solution.status == "solved"
    value, point = swept_maximum(around, width)
    assert abs(solution.certificate.efficiency / value - 1) < 1e-4
    found = abs(solution.gait.mean[0]), solution.gait.cos[0, 0], solution.gait.sin[0, 0]
    np.testing.assert_allclose(found, np.abs(point), atol=0.02)
    assert abs(solution.certificate.efficiency - reference.efficiency) < reference.tolerance


def test_with_slow_joints_it_is_the_maximum_over_ellipses_that_are_small_enough():
    """Joints of one harmonic of amplitude a are at most 2 pi a fast: all that is swept is (A0, a,
    B1 / A1)."""
    speed = 12.0
    solution = solve(Problem("slow", gait=Harmonic(1, "bilateral"), speed_limit=speed), 4)
    centre, width = np.array([0.0, 0.8, 0.8]), np.array([1.5, 0.2, 0.7])
    while width[0] > 0.01:
        steps = np.linspace(-1, 1, 7)
        grid = centre + width * np.stack(np.meshgrid(*[steps] * 3), axis=-1).reshape(-1, 3)
        grid[:, 1] = np.minimum(grid[:, 1], 1.0)
        a, turn = grid[:, 1] * speed / (2 * np.pi), grid[:, 2]
        ellipses = np.column_stack([grid[:, 0], a * np.cos(turn), a * np.sin(turn)])
        value = efficiencies(ellipses, 240)
        best = int(np.argmax(value))
        centre, width = grid[best], 0.5 * width
    assert centre[1] == 1.0
    value = efficiencies(ellipses[[best]], 960)[0]
    assert solution.certificate.efficiency == pytest.approx(value, rel=1e-4)
