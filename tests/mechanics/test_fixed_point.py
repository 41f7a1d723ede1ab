"""The balance solver: its methods, starts and folds that are hard, and outside forces at the centre
of mass; its invariances are in tests/hard/test_properties.py and test_chain_mechanics.py."""

import numpy as np
import pytest

from benchmarks.zoo import feet_problem
from colloc import Chain, Friction, NotConvergedError, solve_balance
from colloc.mechanics.balance import instant, net_force
from colloc.mechanics.solution_branches import all_balanced_velocities
from tests.shared.mechanics import random_instants, random_loads

LOPSIDED = Chain((0.2, 0.5, 0.3), weights=(0.5, 0.2, 0.3))
UNEQUAL = Friction(mu_t=1.7, mu_f=1, mu_b=1.3)


@pytest.mark.parametrize("delta", [1e-1, 1e-4])
def test_fixed_point_and_newton_agree(delta):
    angles, rates = random_instants(200, seed=13)
    rates[0, ::10] = 0.0
    at = Chain(), Friction(), angles, rates, delta
    newton = solve_balance(*at, tolerance=1e-13)
    fixed = solve_balance(*at, tolerance=1e-13, method="fixed_point", max_iterations=5000)
    assert newton.converged.all()
    assert fixed.converged.all()
    np.testing.assert_allclose(newton.z, fixed.z, atol=1e-10)
    assert np.median(newton.iterations) <= 8
    assert np.median(newton.iterations) < 0.7 * np.median(fixed.iterations)


def test_a_start_next_to_the_answer_does_not_lose_it():
    """One joint moves 4e-5 times as fast as the other: from a wrong anchor nothing converges."""
    angles = np.array([[-2.450491783538704], [3.0288778624868327]])
    rates = np.array([[-11.194977583218439], [4.929179798711658e-04]])
    start = np.array([[6.882907034601281e-04], [-3.7304329219234784], [11.192336543699575]])
    law = Friction(mu_t=3, mu_f=1, mu_b=1)
    from_rest, from_start = (
        solve_balance(Chain(), law, angles, rates, 1e-6, start=s).require() for s in (None, start)
    )
    assert np.abs(from_start.z - from_rest.z).max() < 1e-9
    assert np.abs(start - from_rest.z).max() < 1e-3


def test_what_does_not_converge_is_reported_and_required_loudly():
    at = Chain(), Friction(), *random_instants(50), 1e-6
    solved = solve_balance(*at, max_iterations=2, method="newton")
    assert not solved.converged.all()
    assert np.array_equal(solved.converged, solved.residual <= 1e-11)
    with pytest.raises(NotConvergedError, match="of 50 time points"):
        solved.require()


BESIDE_A_FOLD = [
    (
        Chain((0.2, 0.2, 0.2, 0.2, 0.2)), Friction(mu_t=0.3732971441138048, mu_f=1.0, mu_b=1.0),
        1e-4,
        [0.2902139692001954, 0.41142221419266584, -0.24741914938788861, 0.5570036473833548],
        [1.5208964099572015, -0.442939356313379, -3.631156061252283, 2.5549055153555553],
    ),
    (
        Chain((0.12294025905001435, 0.3350092716615993, 0.2503457939937866, 0.29170467529459976)),
        Friction(mu_t=3.041129126875383, mu_f=1.0, mu_b=1.0), 1e-6,
        [-0.3771453161256885, 1.8087369384145267, 0.4682390817703179],
        [-0.030994899599743775, 0.0007943275201016675, -3.2631510952794907],
    ),
    (
        Chain((0.18256804397346088, 0.19015637257632248, 0.2545511669004333, 0.19015637257632248,
        0.18256804397346094)),
        Friction(mu_t=0.4809270258518652, mu_f=1.0, mu_b=3.636603686191716), 1e-4,
        [2.597688063049994, -2.786161703726339, 3.0860764570646855, -2.866002211321948],
        [0.0026765635702248325, 2.586684889251715, -0.9621272363129159, -2.9613888780556366],
    ),
    (
        feet_problem(25).body, feet_problem(25).friction, 1e-4,
        [-1.5005173, -2.18419046], [-4.88692124, 7.64204799],
    ),
]  # fmt: skip
CASES = ["five links", "four links", "backward friction", "on three feet"]


@pytest.mark.parametrize("case", BESIDE_A_FOLD, ids=CASES)
def test_beside_a_fold_of_the_balance_the_other_solution_is_found_in_few_steps(case):
    """Two solutions have just met and vanished: every step from rest ends at a minimum."""
    body, friction, delta, angles, rates = case
    at = body, friction, np.array(angles)[:, None], np.array(rates)[:, None]
    first, found = solve_balance(*at, delta, method="direct"), solve_balance(*at, delta)
    assert found.converged.all()
    assert not first.converged.any()
    now = instant(*at, found.z, delta)
    assert np.abs(net_force(now.posture, now.force)).max() < 1e-9
    # forty with each link as the anchor
    assert max(first.iterations.max(), found.iterations.max()) <= 40 * body.n_link


def test_a_body_whose_joints_rest_creeps_as_friction_on_a_point_says():
    """Then all points move alike: mu v/sqrt(v^2 + delta^2) is the load, whatever the shape."""
    angles, delta = random_instants(8)[0], 1e-4
    for size in (1e-6, 0.5, 1 - 1e-6):
        load = random_loads(8, size)
        for rates in (np.zeros_like(angles), np.full_like(angles, 1e-30)):
            z = solve_balance(
                LOPSIDED, Friction(), angles, rates, delta, load=load, tolerance=1e-14
            ).z
            creep = delta * size / np.sqrt((1 - size) * (1 + size))
            np.testing.assert_allclose(z[:2], creep * load / size, rtol=0, atol=1e-6 * creep)
            np.testing.assert_allclose(z[2], 0.0, atol=1e-6 * creep)


def test_all_motions_under_a_load_are_balanced_and_counted_by_their_signs():
    law = Friction(mu_t=1, mu_f=0.01, mu_b=100)  # as in the printed example of several motions
    angles, rates = (np.tile(a, 9) for a in ([[0.78302927], [1.74481885]], [[-3.0], [0.0]]))
    load = np.vstack([np.linspace(-0.004, 0.004, 9), np.full(9, 1e-4)])
    found = all_balanced_velocities(Chain(), law, angles, rates, 1e-4, load)
    assert found.number.max() == 3
    assert found.complete.all()
    for z, sign in zip(found.z, found.sign, strict=True):
        at = np.flatnonzero(sign)
        stays = solve_balance(
            Chain(), law, angles[:, at], rates[:, at], 1e-4, load=load[:, at], start=z[:, at]
        )
        np.testing.assert_allclose(stays.z, z[:, at], atol=1e-6)


def test_a_load_beyond_friction_is_not_balanced_and_one_in_whole_numbers_counts_as_they_do():
    for law in (Friction(), UNEQUAL):
        at, load = (LOPSIDED, law, *random_instants(6), 1e-3), random_loads(6, 1.01 * law.largest)
        assert not solve_balance(*at, load=load, max_iterations=50).converged.any()
    angles, rates = np.array([[0.5], [0.2]]), np.array([[1.0], [0.0]])
    at = Chain(), Friction(), angles, rates, 1e-3
    load = np.array([[0], [1]])
    solved = solve_balance(*at, load=0.3 * load)
    whole, real = (at[0].motion(*at[1:], solved, load=each) for each in (load, 1.0 * load))
    assert whole.actuator_power == real.actuator_power
