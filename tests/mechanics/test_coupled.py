"""Chains with fewer motors than joints: against chains without those joints, and against the chain
itself."""

import numpy as np
import pytest

import colloc
from colloc import Chain, Coupled, Foot, Friction, Harmonic, Problem, ProblemError
from colloc.gaits.gait_fields import body_from, fields
from colloc.mechanics.bodies import Body

LAW = Friction(mu_t=2.0, mu_f=1.0, mu_b=1.5)
BELTS = Coupled(Chain((0.2,) * 5), gears=((1, 0), (0.5, 0), (0, 0.5), (0, 1)))
BROKEN = Coupled(Chain((0.25,) * 4), stuck={1: 0.4})


def solved(body, **changes):
    return colloc.solve(
        Problem("c", body=body, friction=LAW, gait=Harmonic(1), delta=1e-3, **changes), starts=2
    )


@pytest.fixture(scope="module")
def broken():
    return solved(BROKEN)


def test_a_stuck_joint_of_a_straight_body_makes_two_links_one():
    stuck, whole = (
        solved(Coupled(Chain((0.25,) * 4), stuck={1: 0.0})),
        solved(Chain((0.25, 0.5, 0.25))),
    )
    assert stuck.status == whole.status == "solved"
    assert stuck.efficiency == pytest.approx(whole.efficiency, rel=1e-7)


def test_a_motor_for_every_joint_is_the_chain():
    chain, y = Chain((0.2, 0.5, 0.3)), np.random.default_rng(0).normal(size=(4, 20))
    own = Coupled(chain)
    a, b = (body.solve(LAW, y[:2], y[2:], 1e-3) for body in (own, chain))
    np.testing.assert_array_equal(a.z, b.z)
    np.testing.assert_array_equal(
        own.slopes(LAW, y[:2], y[2:], 1e-3, a), chain.slopes(LAW, y[:2], y[2:], 1e-3, b)
    )
    assert own.symmetries == chain.symmetries


def test_the_chain_plays_the_joint_angles_to_the_same_distance_and_work(broken):
    assert broken.status == "solved"
    joints = BROKEN.joint_path(broken.gait)
    np.testing.assert_allclose(joints(np.linspace(0, 1, 9))[0][1], 0.4)
    played = colloc.replay(BROKEN.chain, LAW, joints, broken.answer.delta_per_period)
    assert (played.distance, played.work) == pytest.approx((broken.distance, broken.work), rel=1e-6)


def test_joints_move_at_the_rates_of_their_angles_also_where_a_motor_turns_one_backwards():
    body, gait = (
        Coupled(Chain((0.2,) * 5), gears=((1, 0), (-0.5, 0), (0.3, -1), (0, 1))),
        colloc.ellipse(0.1, 0.7, 0.6),
    )
    joints, t, h = body.joint_path(gait), np.linspace(0.0, 1.0, 20), 1e-5
    np.testing.assert_allclose(
        joints(t)[1], (joints(t + h)[0] - joints(t - h)[0]) / (2 * h), atol=1e-7
    )
    np.testing.assert_allclose(joints(t)[0][1], -0.5 * gait(t)[0][0], atol=1e-12)


def test_slopes_are_those_of_differences():
    body, h = (
        Coupled(Chain((0.2,) * 5), gears=((1, 0), (0.5, 0), (0, 0), (0.3, 1)), stuck={2: -0.3}),
        1e-6,
    )
    y = np.array([0.7, -0.4, 1.0, 2.0])[:, None]

    def motion(y):
        found = body.solve(LAW, y[:2], y[2:], 1e-2, tolerance=1e-13)
        now = body.motion(LAW, y[:2], y[2:], 1e-2, found)
        return found, np.concatenate([now.z, now.centre, now.power[None]])

    slopes = body.slopes(LAW, y[:2], y[2:], 1e-2, motion(y)[0])
    for j, step in enumerate(h * np.eye(4)[:, :, None]):
        numeric = (motion(y + step)[1] - motion(y - step)[1]) / (2 * h)
        np.testing.assert_allclose(slopes[:, j], numeric, atol=1e-6)


@pytest.mark.parametrize("symmetry", ["bilateral", "antipodal"])
def test_what_is_the_same_from_both_ends_has_both_symmetries(symmetry):
    found = colloc.solve(
        Problem("belts", body=BELTS, friction=LAW, gait=Harmonic(1, symmetry), delta=1e-3), starts=2
    )
    assert found.status == "solved"
    (motors,) = (found.gait.angles(np.linspace(0, 1, 9)),)
    image = -motors[::-1, ::-1] if symmetry == "bilateral" else -np.roll(motors[:, :-1], 4, axis=1)
    np.testing.assert_allclose(image, motors[:, : image.shape[1]], atol=1e-9)


def test_symmetries_that_gears_or_stuck_joints_break_are_refused():
    uneven = Coupled(Chain((0.2,) * 5), gears=((1, 0), (0.5, 0), (0, 1), (0, 1)))
    assert (uneven.symmetries, BROKEN.symmetries) == (("none", "antipodal"), ("none",))
    assert not uneven.symmetric
    assert not BROKEN.symmetric  # though its gears are
    assert BELTS.symmetric
    with pytest.raises(ProblemError, match="may have the symmetry none"):
        Problem("no", body=BROKEN, gait=Harmonic(1, "antipodal"))


def test_limits_are_those_of_the_joints_that_move():
    narrow = solved(BELTS, joint_limit=0.5)
    joints = BELTS.joint_angles(narrow.gait.angles(np.linspace(0, 1, 2001)))
    assert narrow.status == "solved"
    assert np.abs(joints).max() == pytest.approx(0.5, abs=1e-6)
    assert BROKEN.limit_names == ("joint 1", "joint 3")
    assert solved(BROKEN, joint_limit=0.6).status == "solved"


def test_torque_and_power_are_those_of_the_motors(broken):
    """A motor that turns several joints does the work of all of them; with its share of each
    joint's torque."""
    from colloc.mechanics.actuators import joint_moments

    rng = np.random.default_rng(2)
    angles, rates = 0.8 * rng.normal(size=(2, 10)), rng.normal(size=(2, 10))
    z = BELTS.solve(LAW, angles, rates, 1e-2).z
    both = [
        joint_moments(body, LAW, q, body.forces(LAW, q, r, z, 1e-2), 1e-2)
        for body, q, r in (
            (BELTS, angles, rates),
            (BELTS.chain, BELTS.joint_angles(angles), BELTS.joint_rates(rates)),
        )
    ]
    np.testing.assert_allclose(both[0], np.array(BELTS.gears).T @ both[1], atol=1e-12)
    sheet = broken.robot(length=1.0, mass=1.0, period=10.0)
    assert "motor 2" in str(sheet)
    assert sheet.facts["slow_enough_period_s"] > 0


def test_its_sensitivity_is_to_the_chain_that_it_moves(broken):
    """Forces are proportional to friction: its slopes add up to minus the value."""
    found = broken.sensitivity()
    slopes = [found[f"friction {way}"].slope for way in ("sideways", "forwards", "backwards")]
    assert sum(slopes) == pytest.approx(-broken.value, rel=1e-3)
    assert found["length of link 4"].slope != 0


def test_it_is_kept_in_files_with_what_it_stands_on(tmp_path, broken):
    feet = (Foot(link=0), Foot(link=1), Foot(link=2))
    for body in (BELTS, BROKEN, Coupled(Chain((0.3, 0.4, 0.3), feet=feet), stuck={0: 0.1})):
        assert isinstance(body, Body)
        assert body_from(fields(body)) == body
    read = colloc.load(colloc.save(broken, tmp_path / "b.h5"))
    assert (read.problem.body, read.problem.hash) == (BROKEN, broken.problem.hash)


@pytest.mark.parametrize(
    ("stated", "words"),
    [
        ({"stuck": {5: 0.1}}, "joint 5: the chain has joints 0 to 2"),
        ({"stuck": {0: 4.0}}, "between -pi and pi"),
        ({"stuck": {0: 0.0, 1: 0.0, 2: 0.0}}, "all joints are stuck"),
        ({"stuck": {0: 3.0, 1: 3.0}}, "links cross where joints are stuck"),
        ({"gears": ((1, 0), (0, 1))}, "2 rows, and the chain has 3 joints"),
        ({"gears": ((1, 0), (0, 1), (0, 0))}, "joint 2 .* hangs on no motor"),
        ({"gears": ((1, 0), (0, 1), (1, 1)), "stuck": {2: 0.0}}, "is stuck, and hangs on a motor"),
        ({"gears": ((1, 1), (1, 1), (1, 1))}, "two motors do the same"),
        ({"gears": "belts"}, "a row of numbers for each joint"),
        ({"gears": 3}, "a row of numbers for each joint"),
        ({"stuck": 5}, "stuck gives joints and their angles"),
        ({"stuck": [1, 2]}, "stuck gives joints and their angles"),
        ({"stuck": [(1, 0.1), (1, 0.2)]}, "names a joint twice"),
    ],
)
def test_what_cannot_be_is_refused_in_a_sentence(stated, words):
    with pytest.raises(ProblemError, match=words):
        Coupled(Chain((0.25,) * 4), **stated)


def test_other_bodies_and_inertia_are_refused_in_a_sentence():
    with pytest.raises(ProblemError, match="joints of a Chain"):
        Coupled(colloc.ModalBody(3))
    with pytest.raises(ProblemError, match="inertia is known of a Chain"):
        Problem("fast", body=BROKEN, gait=Harmonic(1), froude=0.05)
    with pytest.raises(ProblemError, match="only a Chain"):
        Problem("up", body=BROKEN, gait=Harmonic(1), grade=0.05)
    with pytest.raises(
        ProblemError, match=r"a body with one motor .* Give the body a second motor"
    ):
        Problem("scallop", body=Coupled(Chain((0.2,) * 5), gears=((1,),) * 4))
