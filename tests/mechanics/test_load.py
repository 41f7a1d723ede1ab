"""The balance of a chain under an outside force at its centre of mass: against a quadrature of its
own, and physics."""

import numpy as np
import pytest
from scipy.optimize import least_squares
from shared.instants import random_instants
from shared.loaded_chain import left_over, lying, standing

from colloc import (
    Chain,
    Elliptic,
    Foot,
    Friction,
    OwnLaw,
    PowerLaw,
    ProblemError,
    Viscous,
    Wheel,
    solve_balance,
)
from colloc.mechanics.chain_motion import chain_motion, motion_derivatives
from colloc.mechanics.densities import Instants
from colloc.mechanics.native_kernel import native_kernel, numpy_instead
from colloc.mechanics.solution_branches import all_balanced_velocities
from tests.shared.laws import coulomb

BODY = Chain((0.2, 0.5, 0.3), weights=(0.5, 0.2, 0.3))
ON_FEET = Chain(
    (0.2, 0.5, 0.3), masses=(0.3, 0.3, 0.4),
    feet=(Wheel(0, 0.2, rolling=0.5, weight=0.3), Foot(1, 0.6, 0.1, 0.05), Foot(1, 0.6, 0.1,
    -0.05), Foot(2, 0.9, 0.5)),
)  # fmt: skip
HELD = {BODY: 1.0, ON_FEET: 0.4}
"""What friction of coefficient 1 holds in every shape, about."""
LAWS = [
    Friction(),
    Friction(mu_t=1.7, mu_f=1, mu_b=1.3),
    Friction(mu_t=10, mu_f=1, mu_b=3),
    Elliptic(mu_t=2, mu_f=1, mu_b=1.5),
    OwnLaw("-vs/speed", "-2*vn/speed"),
]


def random_loads(count, size, seed=3):
    """Forces ``(2, count)`` of one magnitude, in all directions."""
    angle = np.random.default_rng(seed).uniform(-np.pi, np.pi, count)
    return size * np.stack([np.cos(angle), np.sin(angle)])


def rows(motion):
    return np.vstack([motion.z, motion.centre, motion.power])


@pytest.mark.parametrize("body", [BODY, ON_FEET], ids=["lying", "standing"])
@pytest.mark.parametrize("mu", [(1, 1, 1), (1.7, 1, 1.3)], ids=str)
def test_the_velocities_are_those_of_a_program_of_points(mu, body):
    angles, rates = random_instants(12)
    load, delta = random_loads(12, 0.6 * HELD[body]), 0.2
    points = standing(body.feet, mu) if body.feet else lying(body.weights, mu)
    solved = solve_balance(body, coulomb(*mu), angles, rates, delta, load=load).require()
    for t in range(12):
        at = (
            body.lengths,
            body.mass_column()[:, 0],
            points,
            angles[:, t],
            rates[:, t],
            load[:, t],
            delta,
        )
        theirs = least_squares(left_over, np.zeros(3), args=at, xtol=1e-14, ftol=1e-14, gtol=1e-14)
        assert np.abs(theirs.fun).max() < 1e-9
        np.testing.assert_allclose(solved.z[:, t], theirs.x, atol=1e-6)


@pytest.mark.parametrize(
    "law", [*LAWS, Viscous(normal=2, tangential=1), PowerLaw(0.5)], ids=lambda law: law.label
)
@pytest.mark.parametrize("size", [0.3, 0.95])
def test_joints_do_the_work_of_friction_less_that_of_the_load(law, size):
    angles, rates = random_instants(60)
    load = random_loads(60, size)
    solved = solve_balance(BODY, law, angles, rates, 1e-5, load=load).require()
    now = chain_motion(BODY, law, angles, rates, 1e-5, solved, load)
    np.testing.assert_allclose(
        now.actuator_power, now.power - (load * now.centre).sum(axis=0), atol=1e-9
    )
    own = Instants(BODY, law, angles, rates, 1e-5, z=now.z, load=load).power
    np.testing.assert_allclose(own.sum(axis=0), now.actuator_power, atol=1e-9)
    assert (now.power >= 0).all()
    assert np.abs((load * now.centre).sum(axis=0)).max() > 1e-3


@pytest.mark.parametrize("body", [BODY, ON_FEET], ids=["lying", "standing"])
@pytest.mark.parametrize("law", LAWS[:4], ids=lambda law: law.label)
def test_slopes_along_shapes_rates_and_load_are_the_limit_of_differences(law, body):
    delta, step = 0.05, 1e-5
    angles, rates = random_instants(40)
    y = np.concatenate([angles, rates, random_loads(40, 0.6 * HELD[body])])

    def moved(y):
        q, r, load = np.split(y, 3)
        solved = solve_balance(body, law, q, r, delta, load=load, tolerance=1e-13)
        at = body, law, q, r, delta, solved, load
        return chain_motion(*at), motion_derivatives(*at)

    motion, slopes = moved(y)
    assert slopes.shape == (6, 6, 40)
    # where a link changes its sense of sliding within the step, a directional law has no derivative
    velocity = body.velocity(body.posture(angles), rates, motion.z)
    smooth = (body.contact.sticking_speeds(law, velocity) > 1e-3).all(axis=0)
    assert smooth.mean() > 0.7
    for k in range(6):
        there, back = (
            rows(moved(y + side * step * np.eye(6)[:, k : k + 1])[0]) for side in (1, -1)
        )
        np.testing.assert_allclose(
            slopes[:, k, smooth], ((there - back) / (2 * step))[:, smooth], atol=2e-6
        )


@pytest.mark.skipif(native_kernel() is None, reason="no C compiler")
@pytest.mark.parametrize(("body", "law"), [*((BODY, law) for law in LAWS), (ON_FEET, LAWS[1])])
def test_compiled_balances_and_slopes_are_those_of_numpy(body, law):
    angles, rates = random_instants(100)
    for delta, size in ((1e-2, 0.9), (1e-8, 0.4)):
        load = random_loads(100, size * HELD[body])
        at = body, law, angles, rates, delta
        solved = solve_balance(*at, load=load).require()
        motion, slopes = chain_motion(*at, solved, load), motion_derivatives(*at, solved, load)
        with numpy_instead():
            same = solve_balance(*at, load=load).require()
            known, reference = (
                chain_motion(*at, solved, load),
                motion_derivatives(*at, solved, load),
            )
        np.testing.assert_allclose(same.z, solved.z, atol=1e-9)
        np.testing.assert_allclose(motion.actuator_power, known.actuator_power, atol=1e-12)
        np.testing.assert_allclose(rows(motion), rows(known), atol=1e-12)
        scale = np.abs(reference).max(axis=(0, 1))
        np.testing.assert_allclose(slopes / scale, reference / scale, atol=1e-9)


def test_no_load_is_a_load_of_nothing():
    angles, rates = random_instants(50)
    plain, loaded = (
        solve_balance(BODY, LAWS[1], angles, rates, 1e-4, load=load)
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
