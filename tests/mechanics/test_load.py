"""A chain under an outside force at its centre of mass: an independent program, creep, and what
friction does not hold."""

import numpy as np
import pytest
from scipy.optimize import least_squares
from shared.instants import random_instants
from shared.loaded_chain import left_over, lying

from colloc import Chain, Friction, ProblemError, solve_balance
from colloc.mechanics.solution_branches import all_balanced_velocities
from tests.mechanics.test_chain_mechanics import random_loads
from tests.shared.laws import coulomb

BODY = Chain((0.2, 0.5, 0.3), weights=(0.5, 0.2, 0.3))


@pytest.mark.parametrize("mu", [(1, 1, 1), (1.7, 1, 1.3)], ids=str)
def test_the_velocities_are_those_of_a_program_of_points(mu):
    (angles, rates), load, delta = random_instants(12), random_loads(12, 0.6), 0.2
    solved = solve_balance(BODY, coulomb(*mu), angles, rates, delta, load=load).require()
    fixed = BODY.lengths, BODY.mass_column()[:, 0], lying(BODY.weights, mu)
    for t in range(12):
        at = *fixed, angles[:, t], rates[:, t], load[:, t], delta
        theirs = least_squares(left_over, np.zeros(3), args=at, xtol=1e-14, ftol=1e-14, gtol=1e-14)
        assert np.abs(theirs.fun).max() < 1e-9
        np.testing.assert_allclose(solved.z[:, t], theirs.x, atol=1e-6)


def test_no_load_is_a_load_of_nothing():
    angles, rates = random_instants(50)
    plain, loaded = (
        solve_balance(BODY, coulomb(1.7, 1, 1.3), angles, rates, 1e-4, load=load)
        for load in (None, np.zeros((2, 50)))
    )
    np.testing.assert_array_equal(plain.z, loaded.z)


def test_a_body_whose_joints_rest_creeps_as_friction_on_a_point_says():
    """Then all points move alike: mu v/sqrt(v^2 + delta^2) is the load, whatever the shape."""
    angles, delta = random_instants(8)[0], 1e-4
    for size in (1e-6, 0.5, 1 - 1e-6):
        load = random_loads(8, size)
        for rates in (np.zeros_like(angles), np.full_like(angles, 1e-30)):
            z = solve_balance(BODY, Friction(), angles, rates, delta, load=load, tolerance=1e-14).z
            creep = delta * size / np.sqrt((1 - size) * (1 + size))
            np.testing.assert_allclose(z[:2], creep * load / size, rtol=0, atol=1e-6 * creep)
            np.testing.assert_allclose(z[2], 0.0, atol=1e-6 * creep)


def test_a_load_beyond_friction_is_not_balanced():
    angles, rates = random_instants(6)
    for law in (Friction(), Friction(mu_t=1.7, mu_f=1, mu_b=1.3)):
        load = random_loads(6, 1.01 * law.largest)
        assert not solve_balance(
            BODY, law, angles, rates, 1e-3, load=load, max_iterations=50
        ).converged.any()


@pytest.mark.parametrize("load", [np.ones((3, 5)), np.full((2, 5), np.nan), "x"])
def test_unusable_loads_are_named(load):
    with pytest.raises(ProblemError, match="load must be"):
        solve_balance(BODY, Friction(), *random_instants(5), 1e-3, load=load)


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


def test_a_body_with_shape_coordinates_of_its_own_is_not_taken_for_its_joints():
    """The kernel would read joint angles that nobody gave."""

    class Belt(Chain):
        n_joint = 1

    with pytest.raises(ProblemError, match="not its 2 joints"):
        solve_balance(Belt(), Friction(), *random_instants(5, n_joint=1), 1e-3)


def test_a_load_in_whole_numbers_counts_as_they_do():
    angles, rates = np.array([[0.5], [0.2]]), np.array([[1.0], [0.0]])
    at = Chain(), Friction(), angles, rates, 1e-3
    load = np.array([[0], [1]])
    solved = solve_balance(*at, load=0.3 * load)
    whole, real = (at[0].motion(*at[1:], solved, load=each) for each in (load, 1.0 * load))
    assert whole.actuator_power == real.actuator_power
