"""The velocity map: the paper's "connection" over shapes and ratios of rates."""

import numpy as np
import pytest

from colloc import Chain, Friction, solve_balance
from scripts.paper.study import Context
from scripts.paper.three_link import connection, faces_needed

DELTA = 1e-3


def test_its_nodes_are_balanced_velocities_at_unit_larger_rate_and_those_of_reversed_rates_mirror():
    made = connection(Context({"delta": DELTA, "angles": 8, "ratios": 5}, {}, 1))
    rng, (n, m) = np.random.default_rng(3), (8, 5)
    i, j, k, face = (rng.integers(size, size=60) for size in (n, n, m, 2))
    angles = np.stack([made["angles"][i], made["angles"][j]])
    rates = np.where(np.arange(2)[:, None] == face, 1.0, made["ratios"][k])
    stored = np.stack([made["z"][face, row, i, j, k] for row in range(3)])
    for scale in (1.0, -7.3):
        direct = solve_balance(Chain(), Friction(), angles, scale * rates, abs(scale) * DELTA).z
        np.testing.assert_allclose(scale * stored, direct, atol=1e-9)


def test_two_more_faces_are_needed_where_friction_backwards_is_another():
    small = connection(Context({"delta": DELTA, "angles": 2, "ratios": 2}, {}, 1))
    assert small["anisotropic_faces"] == 4
    assert faces_needed(Friction(mu_t=1.7), DELTA) == 2


def test_kink_where_a_joint_rests():
    """Two links rest beside a joint at rest, and the velocity has a kink there."""
    angles = np.array([[0.75 * np.pi], [0.0]])

    def omega(ratio: float) -> float:
        rates = np.array([[1.0], [ratio]])
        return float(solve_balance(Chain(), Friction(), angles, rates, 1e-8).require().z[2, 0])

    assert abs(omega(0.0) + 1) < 1e-6  # the tail link alone turns, against joint 1
    jumps = [(omega(h) - omega(0.0)) / h - (omega(0.0) - omega(-h)) / h for h in (1e-2, 1e-3, 1e-4)]
    assert abs(jumps[2]) > 0.05
    assert jumps[1] == pytest.approx(jumps[2], rel=0.1)  # a smooth function's would fall with h
