"""Chains with fewer motors than joints, against chains without those joints."""

import numpy as np
import pytest

import colloc
from colloc import Chain, Coupled, Friction, Harmonic, Problem, Quantity
from colloc.gaits.gait_fields import CLASSES, fields, gait_from, part_from
from colloc.mechanics.densities import LENGTH, Instants, JointMap
from colloc.results.robot import joint_torques
from colloc.transcription.shape_constraints import shape_checks
from colloc.verification.adaptive_motion import whole_totals
from tests.shared.cases import slow_but

LAW = Friction(mu_t=2.0, mu_f=1.0, mu_b=1.5)
FIVE, FOUR = Chain((0.2,) * 5), Chain((0.25,) * 4)
GEARS = ((1, 0), (0.5, 0), (0, 0.5), (0, 1))
BELTS, BROKEN = Coupled(Harmonic(1), gears=GEARS), Coupled(Harmonic(1), stuck={1: 0.4})


def solved(body, gait, starts=2, **changes):
    problem = Problem("c", body=body, friction=LAW, gait=gait, **{"delta": 1e-2} | changes)
    return colloc.solve(problem, starts=starts)


@pytest.fixture(scope="module")
def broken():
    return solved(FOUR, BROKEN)


@pytest.mark.slow
def test_a_stuck_joint_of_a_straight_body_makes_two_links_one():
    stuck = solved(FOUR, Coupled(Harmonic(1), stuck={1: 0.0}))
    whole = solved(Chain((0.25, 0.5, 0.25)), Harmonic(1))
    assert stuck.status == whole.status == "solved"
    assert stuck.efficiency == pytest.approx(whole.efficiency, rel=1e-7)


def test_the_chain_plays_the_joint_angles_to_the_same_distance_and_work(broken):
    assert broken.status == "solved"
    np.testing.assert_allclose(broken.gait.angles(np.linspace(0, 1, 9))[1], 0.4)
    played = colloc.replay(FOUR, LAW, broken.gait, broken.answer.delta_per_period)
    assert (played.distance, played.work) == pytest.approx((broken.distance, broken.work), rel=1e-6)
    text = str(broken.gait)
    assert "motor 2: " in text
    assert "joint 2: +0.4000" in text


def test_joints_move_at_the_rates_of_their_angles_also_where_a_motor_turns_one_backwards():
    gears = ((1, 0), (-0.5, 0), (0.3, -1), (0, 1))
    t, h = np.linspace(0.0, 1.0, 20), 1e-5
    p = np.random.default_rng(0).normal(size=Harmonic(2).size(2))
    own = Coupled(Harmonic(2)).member(p, 2)  # a motor for every joint: the class of the motors
    np.testing.assert_allclose(own.angles(t), Harmonic(2).member(p, 2).angles(t), atol=1e-14)
    np.testing.assert_allclose(Coupled(Harmonic(2)).parameters(own), p)
    joints = Coupled(Harmonic(1), gears=gears).driven_by(colloc.ellipse(0.1, 0.7, 0.6), 4)
    motors = joints.motor_gait
    rng = np.random.default_rng(1)
    hops = [
        joints.basis.perturb(joints, 0.2, 0, rng).angles(t) - joints.angles(t) for _ in range(50)
    ]
    np.testing.assert_allclose(np.array(hops)[:, 1], -0.5 * np.array(hops)[:, 0], atol=1e-12)
    assert np.std([hop[3].mean() for hop in hops]) == pytest.approx(0.2, rel=0.3)
    slopes = (joints.angles(t + h) - joints.angles(t - h)) / (2 * h)
    np.testing.assert_allclose(joints.rates(t), slopes, atol=1e-7)
    np.testing.assert_allclose(joints.angles(t)[1], -0.5 * motors.angles(t)[0], atol=1e-12)
    bend = Quantity("bend", "sum(angle**2)")
    ways = [whole_totals([LENGTH, bend], path)[0] for path in (joints, motors)]
    assert ways[0] == ways[1]  # what the motors turn
    body = Chain((0.2,) * 5)
    now = Instants(body, LAW, *joints(t), 1e-2, joint_map=joints.joint_map)
    np.testing.assert_allclose(now.angle, motors.angles(t))
    stuck = Coupled(Harmonic(1), gears=(*gears[:3], (0, 0)), stuck={3: 0.3})
    path = Problem("c", body=body, gait=stuck).joint_path(*motors(t))
    known = [[*x[:3], y + 0 * t] for x, y in zip(joints(t), (0.3, 0.0), strict=True)]
    np.testing.assert_allclose(path, known)
    checks = shape_checks(body, (), (9.0, 8.0), joints.joint_map)
    found = checks.values(checks.n_shape + np.repeat([0, 1], 20), np.tile(joints.rates(t), 2))
    known = motors.rates(t) / [[9.0], [8.0]]
    np.testing.assert_allclose(found.reshape(2, 20), known, atol=1e-12)
    np.testing.assert_allclose(
        joints.joint_map.motor_rates(joints.angles(t) - joints.joint_map.offset), motors.angles(t)
    )


@pytest.mark.parametrize("symmetry", slow_but(["bilateral"], ["bilateral", "antipodal"]))
def test_what_is_the_same_from_both_ends_has_both_symmetries(symmetry):
    found = solved(FIVE, Coupled(Harmonic(1, symmetry), gears=GEARS))
    assert found.status == "solved"
    joints = found.gait.angles(np.linspace(0, 1, 9))
    image = -joints[::-1, ::-1] if symmetry == "bilateral" else -np.roll(joints[:, :-1], 4, axis=1)
    np.testing.assert_allclose(image, joints[:, : image.shape[1]], atol=1e-9)


@pytest.mark.slow
def test_limits_are_those_of_the_joints_that_move():
    for body, gait, limit in ((FIVE, BELTS, 0.5), (FOUR, BROKEN, 0.6)):
        narrow = solved(body, gait, joint_limit=limit, starts=1, delta=1e-3)
        assert narrow.status == "solved"
        joints = narrow.gait.angles(np.linspace(0, 1, 2001))
        assert np.abs(joints).max() == pytest.approx(limit, abs=1e-6)


@pytest.mark.slow
def test_torque_and_power_are_those_of_the_motors(broken):
    """A motor that turns several joints does the work of all, with its share of each torque."""
    torques = np.random.default_rng(2).normal(size=(4, 10))
    joints, motors = JointMap(GEARS, (0.0,) * 4), np.random.default_rng(3).normal(size=(2, 10))
    powers = joints.motor_moments(torques) * motors
    np.testing.assert_allclose(
        powers.sum(axis=0), (torques * joints.joint_rates(motors)).sum(axis=0), atol=1e-12
    )
    sheet = broken.robot(length=1.0, mass=1.0, period=10.0)
    assert "motor 2" in str(sheet)
    assert sheet.facts["slow_enough_period_s"] > 0
    limited = solved(FOUR, BROKEN, torque_limit=(0.12, 0.1), speed_limit=9.0)
    assert limited.status == "solved"
    assert limited.efficiency < broken.efficiency
    t = np.linspace(0, 1, 401)
    torque = np.abs(joint_torques(limited, t)).max(axis=1)
    assert (torque <= np.array([0.12, 0.1]) * (1 + 1e-4)).all()
    assert np.abs(limited.gait.motor_gait.rates(t)).max() <= 9.0 * (1 + 1e-6)


@pytest.mark.slow
def test_its_sensitivity_is_to_the_chain_that_it_moves(broken):
    """Forces are proportional to friction: its slopes add up to minus the value."""
    found = broken.sensitivity()
    slopes = [found[f"friction {way}"].slope for way in ("sideways", "forwards", "backwards")]
    assert sum(slopes) == pytest.approx(-broken.value, rel=1e-3)
    assert found["length of link 4"].slope != 0


def test_it_is_kept_in_files(tmp_path, broken):
    assert Coupled(Harmonic(1, "antipodal"), gears=GEARS).with_symmetry("none") == BELTS
    for gait in (BELTS, BROKEN):
        assert part_from(CLASSES, fields(gait)) == gait
    t = np.linspace(0, 1, 9)
    read = gait_from(fields(broken.gait))
    np.testing.assert_array_equal(read.angles(t), broken.gait.angles(t))
    read = colloc.load(colloc.save(broken, tmp_path / "b.h5"))
    assert (read.problem.gait, read.problem.hash) == (BROKEN, broken.problem.hash)
    np.testing.assert_array_equal(read.gait.angles(t), broken.gait.angles(t))
