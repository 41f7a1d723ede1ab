"""All balanced velocities: one for equal coefficients, at some instants several for others."""

import numpy as np
import pytest

from colloc import Chain, Friction, ellipse, solve_balance
from colloc.mechanics import solution_branches
from colloc.mechanics.balance import instant, net_force
from colloc.mechanics.solution_branches import DISTINCT, all_balanced_velocities
from tests.shared.laws import coulomb
from tests.shared.without_kernel import numpy_instead

PRINTED = (np.array([[0.78302927], [1.74481885]]), np.array([[-3.0], [0.0]]))
STEEP = Friction(mu_t=1, mu_f=0.01, mu_b=100)


def random_instants(seed, count, n_joint=2):
    rng = np.random.default_rng(seed)
    rates = rng.normal(size=(n_joint, count))
    return rng.uniform(-np.pi, np.pi, (n_joint, count)), rates / np.abs(rates).max(axis=0)


def test_the_printed_instant_has_three_motions_and_the_middle_one_is_unstable():
    found = all_balanced_velocities(Chain(), STEEP, *PRINTED, 1e-4)
    assert found.number == [3]
    spin = found.z[:, 2, 0]
    order = np.argsort(spin)
    np.testing.assert_allclose(spin[order], [2.95957, 2.99418, 2.99826], atol=5e-6)
    assert found.sign[order, 0].tolist() == [1, -1, 1]
    assert found.complete.all()


@pytest.mark.parametrize("unit", [1e-6, 1e6])
def test_motions_scale_with_the_unit_of_time(unit):
    """Friction knows no speed but delta: the same motions, as many and in the same order."""
    angles, rates = random_instants(4, 60)
    angles, rates = np.hstack([angles, PRINTED[0]]), np.hstack([rates, PRINTED[1]])
    slow = all_balanced_velocities(Chain(), STEEP, angles, rates, 1e-4)
    fast = all_balanced_velocities(Chain(), STEEP, angles, unit * rates, unit * 1e-4)
    np.testing.assert_array_equal(fast.sign, slow.sign)
    np.testing.assert_allclose(fast.z, unit * slow.z, rtol=1e-6, atol=1e-8 * unit)


@pytest.mark.parametrize("n_joint", [2, 3])
def test_equal_coefficients_have_one_motion(n_joint):
    body = Chain((1 / (n_joint + 1),) * (n_joint + 1))
    angles, rates = random_instants(1, 300, n_joint)
    found = all_balanced_velocities(body, Friction(2, 2, 2), angles, rates, 1e-4)
    assert (found.number == 1).all()
    assert (found.sign == 1).all()
    z = solve_balance(body, Friction(2, 2, 2), angles, rates, 1e-4).z
    np.testing.assert_allclose(found.z[0], z, atol=1e-6)


@pytest.mark.parametrize(
    ("law", "lengths", "several"),
    [
        ((10, 1, 1), (1 / 3,) * 3, 5),
        ((100, 1, 1), (1 / 3,) * 3, 23),
        ((1, 0.01, 100), (1 / 3,) * 3, 5),
        ((3, 1, 1), (0.1, 0.4, 0.4, 0.1), 1),
        ((1, 1, 3), (1 / 3,) * 3, 0),
    ],
)
def test_the_signs_of_all_motions_add_up_to_one(law, lengths, several):
    """As the degree of the map demands; so none is missing, or they are missing in pairs."""
    body, friction = Chain(lengths), coulomb(*law)
    angles, rates = random_instants(2, 2000, body.n_joint)
    found = all_balanced_velocities(body, friction, angles, rates, 1e-4)
    assert found.complete.all()
    assert (found.number > 1).sum() == several
    for z, sign in zip(found.z, found.sign, strict=True):
        at = np.flatnonzero(sign)
        now = instant(body, friction, angles[:, at], rates[:, at], z[:, at], 1e-4)
        assert np.abs(net_force(now.posture, now.force)).max(initial=0.0) < 1e-9 * friction.largest
        assert np.isnan(z[:, sign == 0]).all()


def test_links_at_rest_find_at_least_what_hundreds_of_random_starts_find():
    body, friction = Chain(), Friction(mu_t=100, mu_f=1, mu_b=1)
    angles, rates = random_instants(3, 60)
    few = all_balanced_velocities(body, friction, angles, rates, 1e-4)
    rng = np.random.default_rng(4)
    for _ in range(100):
        start = 0.5 * rng.normal(size=(3, 60)) * np.exp(rng.normal(size=60))
        solved = solve_balance(body, friction, angles, rates, 1e-4, start=start, tolerance=1e-12)
        apart = np.nanmin(np.abs(few.z - solved.z).max(axis=1), axis=0)
        assert (apart < DISTINCT)[solved.converged].all()


def test_numpy_finds_the_same_as_the_compiled_solver():
    compiled = all_balanced_velocities(Chain(), STEEP, *PRINTED, 1e-4)
    with numpy_instead():
        found = all_balanced_velocities(Chain(), STEEP, *PRINTED, 1e-4)
    np.testing.assert_allclose(np.sort(found.z, axis=0), np.sort(compiled.z, axis=0), atol=1e-7)


def test_where_no_start_at_rest_leads_to_a_balance_the_long_way_is_gone(monkeypatch):
    def direct_fails(moving, starts, method="direct"):
        z, sign = solved(moving, starts, method)
        return z, sign if method == "auto" else 0.0 * sign

    solved, at = solution_branches._solve, ellipse(0.0, 1.0, 1.0)(np.linspace(0.0, 1.0, 5))
    friction = Friction(mu_t=1.0, mu_f=0.5, mu_b=2.0)
    monkeypatch.setattr(solution_branches, "_solve", direct_fails)
    found = all_balanced_velocities(Chain(), friction, *at, 1e-2)
    np.testing.assert_allclose(found.z[0], solve_balance(Chain(), friction, *at, 1e-2).z, atol=1e-9)
