"""What joints have to do, and gaits of joints that cannot do everything."""

import re

import numpy as np
import pytest
from shared.instants import random_instants

from colloc import Chain, Friction, Harmonic, PowerLaw, Problem, Viscous, ellipse, replay
from colloc.mechanics.balance import instant, joint_moments
from colloc.mechanics.densities import DRIVEN_WORK, Instants, PathLimits, torque_and_power
from colloc.search.options import OPTIONS
from colloc.search.solve import solve

ONE = PathLimits(torque_and_power((1.0, 1.0), (1.0, 1.0)))
BODY, LAW = Chain((0.2, 0.5, 0.3), weights=(0.3, 0.3, 0.4)), Friction(mu_t=1.7, mu_f=1.0, mu_b=1.3)
USUAL = Problem("limited", ellipse(0.0, 2.8, 1.3), gait=Harmonic(1, "bilateral"))


def moments(body, law, angles, rates, delta):
    z = body.solve(law, angles, rates, delta).require().z
    return joint_moments(body, angles, body.forces(law, angles, rates, z, delta)), z


def test_a_joint_balances_the_friction_on_all_that_lies_ahead_of_it():
    angles, rates = random_instants(6)
    found, z = moments(BODY, LAW, angles, rates, 1e-2)
    for k in range(6):
        # a plain sum over many pieces of every link, in the body's axes
        now = instant(BODY, LAW, angles[:, [k]], rates[:, [k]], z[:, [k]], 1e-2)
        joints = np.stack(BODY.joints(angles[:, [k]]))[:, :, 0]
        for joint in (0, 1):
            total = 0.0
            for link in range(joint + 1, 3):
                length, weight = BODY.lengths[link], BODY.weights[link]
                along = length * ((np.arange(20000) + 0.5) / 20000 - 0.5)
                vs, vn = (float(now.velocity[i][link, 0]) for i in (0, 1))
                vn = vn + float(now.velocity.w[link, 0]) * along
                speed = np.sqrt(vs**2 + vn**2 + 1e-4)
                fs, fn = -(LAW.mu_f if vs > 0 else LAW.mu_b) * vs / speed, -LAW.mu_t * vn / speed
                c, s = float(now.posture.cos[link, 0]), float(now.posture.sin[link, 0])
                x = float(now.posture.x[link, 0]) + along * c - joints[0, joint + 1]
                y = float(now.posture.y[link, 0]) + along * s - joints[1, joint + 1]
                total += weight * np.mean(x * (fs * s + fn * c) - y * (fs * c - fn * s))
            assert found[joint, k] == pytest.approx(-total, abs=1e-7)


def test_torques_of_dry_friction_do_not_know_the_pace_and_powers_double_with_it():
    angles, rates = random_instants(50)
    slow, fast = (moments(BODY, LAW, angles, pace * rates, pace * 1e-3)[0] for pace in (1.0, 2.0))
    np.testing.assert_allclose(fast, slow, rtol=1e-7, atol=1e-9)
    drag = [
        moments(Chain(), Viscous(normal=2, tangential=1), angles, pace * rates, 1e-3)[0]
        for pace in (1.0, 2.0)
    ]
    np.testing.assert_allclose(drag[1], 2 * drag[0], rtol=1e-9)
    z = BODY.solve(LAW, angles, rates, 1e-3).z
    powers = Instants(BODY, LAW, angles, rates, 1e-3, z=z).power
    np.testing.assert_allclose(powers, slow * rates, rtol=1e-12)


@pytest.mark.parametrize(
    ("law", "degree"),
    [
        (LAW, 0),
        (PowerLaw(0.5, mu_t=2.0, mu_f=1.0, mu_b=1.0), 0.5),
        (Viscous(normal=2, tangential=1), 1),
    ],
    ids=str,
)
def test_driven_power_scales_with_the_pace_as_friction_does(law, degree):
    angles, rates = random_instants(50)
    z = Chain().solve(law, angles, rates, 0.1).z
    slow, fast = (
        DRIVEN_WORK.at(Instants(Chain(), law, angles, pace * rates, pace * 0.1, z=pace * z))
        for pace in (1.0, 3.0)
    )
    np.testing.assert_allclose(fast, 3.0 ** (1 + degree) * slow, rtol=1e-9)


@pytest.fixture(scope="module")
def free():
    return solve(USUAL, 1)


@pytest.fixture(scope="module")
def weak():
    return solve(USUAL.with_(power_limit=0.6), 1)


def test_the_replay_tells_the_largest_torques_and_powers(free):
    # the best ellipse of three equal links swings an end link broadside, and so does every other of
    # its class
    torques, powers = np.split(replay(Chain(), Friction(), free.gait, 1e-4, limits=ONE).shares, 2)
    np.testing.assert_allclose(torques, 1 / 18, rtol=1e-4)
    assert powers[0] == pytest.approx(powers[1], rel=1e-4)
    assert replay(Chain(), Friction(), free.gait, 1e-4).shares.size == 0


def test_limits_that_nothing_reaches_change_nothing(free):
    same = solve(USUAL.with_(torque_limit=0.06, power_limit=(0.9, 0.9)), 1)
    assert same.status == "solved"
    assert same.efficiency == pytest.approx(free.efficiency, rel=1e-8)


def test_motors_may_brake_harder_than_they_may_drive_but_turn_no_harder_either_way():
    angles, rates = random_instants(200)
    now = Instants(BODY, LAW, angles, rates, 1e-3, z=BODY.solve(LAW, angles, rates, 1e-3).z)
    joint, instant = np.unravel_index(now.power.argmin(), now.power.shape)
    brakes = now.chosen(np.array([instant]))
    power, torque = np.full(2, 100.0), np.full(2, 100.0)
    power[joint], torque[joint] = -0.5 * brakes.power[joint, 0], 0.5 * abs(brakes.moment[joint, 0])
    for limit, share in (
        ({"power_limit": tuple(power)}, 1.0),
        ({"torque_limit": tuple(torque)}, 2.0),
    ):
        limits = Problem("brakes", body=BODY, gait=Harmonic(1), **limit).path_limits
        most = limits.sizes(limits.at(brakes)).max()
        assert most == pytest.approx(share) if share > 1 else most < share, limit


def test_weak_motors_cost_efficiency_and_keep_their_limit_between_the_nodes(free, weak):
    assert weak.status == "solved"
    assert weak.answer.program == "full"
    assert weak.efficiency < 0.95 * free.efficiency
    shares = replay(Chain(), Friction(), weak.gait, 1e-4, instants=6400, limits=ONE).shares
    assert shares[2:].max() == pytest.approx(0.6, rel=1e-4)
    check = next(c for c in weak.certificate.checks if c.name == "actuators")
    assert check.passed


def test_a_certificate_fails_a_gait_whose_joints_do_more_than_they_can(weak):
    from colloc.search.certify import gait_certificate

    weaker = weak.problem.with_(power_limit=0.55)
    checks = gait_certificate(weaker, weak.gait, 1e-4, np.empty(0)).failures
    assert [c.name for c in checks] == ["actuators"]
    assert checks[0].value == pytest.approx(0.6 / 0.55 - 1, rel=1e-3)


@pytest.mark.slow
def test_a_middle_joint_may_be_weaker_than_the_best_gait_wants_and_multipliers_price_it():
    problem = Problem(
        "four",
        body=Chain((0.25,) * 4),
        gait=Harmonic(1, "bilateral"),
        torque_limit=(0.1, 0.047, 0.1),
    )
    found = solve(problem.with_(guess=solve(problem.with_(torque_limit=None), 1).gait), 1)
    assert found.status == "solved"
    # the price of a limit is the sum of the multipliers of its rows: shares are moments over it
    price = np.abs(found.answer.lam_g[-3 * found.mesh.n_point :]).sum() / 0.047
    less, more = (
        found.problem.with_(torque_limit=(0.1, limit, 0.1), guess=found.gait)
        for limit in (0.0465, 0.0475)
    )
    gained = solve(more, 1).efficiency - solve(less, 1).efficiency
    assert gained / 1e-3 == pytest.approx(price, rel=0.05)


HOPELESS = {
    "power": (
        {"power_limit": 0.005},
        r"power of joint \d is 0\.005 weight x body length per period",
    ),
    "torque": (
        {"torque_limit": 0.01},
        r"torque of joint \d is 0\.01 weight x body length, and .* 5",
    ),
    "as far": ({"power_limit": 0.1, "at_least": {"distance": 0.3}}, r"power of joint \d is 0\.1 "),
}


@pytest.mark.parametrize(
    "case",
    [case if case == "power" else pytest.param(case, marks=pytest.mark.slow) for case in HOPELESS],
)
def test_where_no_start_keeps_the_limits_the_search_ends_soon_and_says_what_is_missed(case):
    (changes, words), tried = HOPELESS[case], []
    found = solve(USUAL.with_(guess=None, **changes), progress=lambda news: tried.append(news.done))
    assert max(tried) == OPTIONS.patience
    assert found.status == "not converged"
    assert re.search(f"the limit on the {words}.* allow the joints more", found.message)
    assert "None of 8 starts led to a gait of the class that keeps the limits" in found.message
