"""Newton steps with the fixed point as fallback find what the damped solver finds, and say where they do not."""

import numpy as np
import pytest
from shared.instants import random_instants

import colloc.collocation.newton_balance
from colloc import Chain, Friction
from colloc.collocation.newton_balance import balanced_near
from colloc.collocation.point_equations import balance_steps
from colloc.mechanics.balance import instant, net_force, secant_matrix
from colloc.mechanics.body import TAIL
from colloc.mechanics.fixed_point import solve_balance
from colloc.mechanics.native_kernel import numpy_instead

THIRD = Chain((1 / 3,) * 3)
pytestmark = pytest.mark.usefixtures("without_the_kernel")
LAWS = [(1, 1, 1), (1.7, 1, 1.3), (10, 1, 1), (0.5, 1, 5), (1, 1, 3)]


@pytest.fixture
def without_the_kernel():
    with numpy_instead():
        yield


@pytest.mark.parametrize("law", LAWS)
def test_the_fixed_point_step_is_that_of_the_numpy_solver(law):
    friction, delta = Friction(*law), 1e-2
    angles, rates = random_instants(40, 0)
    z = np.random.default_rng(1).normal(size=(3, 40))
    now = instant(THIRD, friction, angles, rates, z, delta, TAIL)
    matrix = secant_matrix(THIRD, friction, now.posture, now.velocity, np.full((1, 40), delta))
    expected = z + np.linalg.solve(matrix, net_force(now.posture, now.force).T[:, :, None])[:, :, 0].T
    _, fixed_point, residual = balance_steps(THIRD, friction)(angles, rates, z, np.full((1, 40), delta))
    np.testing.assert_allclose(fixed_point.full(), expected, rtol=0, atol=1e-11)
    worst = np.abs(net_force(now.posture, now.force)).max(axis=0) / friction.largest
    np.testing.assert_allclose(residual.full()[0], worst, rtol=1e-9)


@pytest.mark.parametrize("delta", [1e-1, 1e-4, 1e-8])
@pytest.mark.parametrize("law", LAWS)
def test_near_and_far_starts_end_in_the_balance_of_the_damped_solver(law, delta):
    friction = Friction(*law)
    angles, rates = random_instants(200, 2)
    known = solve_balance(THIRD, friction, angles, rates, delta).require().z
    rng = np.random.default_rng(3)
    for size in (1e-3, 10.0):
        start = known + size * rng.normal(size=known.shape)
        z, converged = balanced_near(THIRD, friction, angles, rates, delta, start, 1e-12)
        assert converged.all()
        now = instant(THIRD, friction, angles, rates, z, delta)
        assert np.abs(net_force(now.posture, now.force)).max() < 4 * friction.largest * max(1e-12, 1e-16 / delta)
        if friction.isotropic:  # only then is the balance known to be unique
            np.testing.assert_allclose(z, known, atol=1e-8)


def test_the_damped_solver_is_left_few_instants(monkeypatch):
    left = []

    def counted(body, friction, angles, *arguments, **named):
        left.append(angles.shape[1])
        return solve_balance(body, friction, angles, *arguments, **named)

    monkeypatch.setattr(colloc.collocation.newton_balance, "solve_balance", counted)
    angles, rates = random_instants(1000, 4)
    for law in LAWS:
        friction = Friction(*law)
        known = solve_balance(THIRD, friction, angles, rates, 1e-4).require().z
        start = known + 0.03 * np.random.default_rng(5).normal(size=known.shape)
        balanced_near(THIRD, friction, angles, rates, 1e-4, start, 1e-12)
    assert sum(left) < 0.1 * 1000 * len(LAWS)


def test_an_instant_that_no_method_solves_is_reported(monkeypatch):
    friction = Friction(10, 1, 1)
    angles, rates = random_instants(50, 6)
    monkeypatch.setattr(colloc.collocation.newton_balance, "_STEPS", 1)
    monkeypatch.setattr(
        colloc.collocation.newton_balance,
        "solve_balance",
        lambda *a, **k: solve_balance(*a, **k, max_iterations=1, method="newton"),
    )
    z, converged = balanced_near(THIRD, friction, angles, rates, 1e-4, np.ones((3, 50)), 1e-12)
    assert not converged.any()
    assert np.isfinite(z).all()
