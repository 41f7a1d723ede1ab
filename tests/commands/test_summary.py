"""What a solve ends with: a few lines that a person reads, and numbers that mean the same as
everywhere else."""

import re
from dataclasses import replace

import numpy as np
import pytest

import colloc
from colloc import Chain, Fourier, Harmonic, PathLimit, Problem, Robot, ellipse, evaluate, replay
from colloc.commands.solve import summary_dict, summary_lines
from colloc.results import limit_use
from colloc.results.checks import Check
from colloc.results.robot import joint_torques
from tests.shared.cases import slow_but


def test_what_fails_is_told_in_full_and_what_holds_is_counted(three_link):
    bad = [
        Check("closure", 2e-3, 1e-9, "joint angles after one period"),
        Check("second order", 0.3, 1e-2, "a saddle"),
    ]
    failing = {check.name for check in bad}
    good = [check for check in three_link.certificate.checks if check.name not in failing]
    failed = replace(three_link, certificate=replace(three_link.certificate, checks=(*good, *bad)))
    lines = summary_lines(failed, None)
    assert f"  {bad[0].line()}" in lines
    assert f"  {bad[1].line()}" in lines
    assert sum(line.startswith("  NO ") for line in lines) == 2
    assert any(line.startswith(f"  {len(good)} checks passed (tightest: ") for line in lines)


LOOP, T = ellipse(0.0, 1.2, 0.8), np.linspace(0, 1, 4001)


def told_of_limits(gait=LOOP, **limits):
    """What the summary says of the limits of a gait, usually one whose joints bend by 1.2 and 0.8
    rad at two phases."""
    stated = Problem("limited", gait=Harmonic(1), delta=1e-2, **limits)
    found = evaluate(stated, gait)
    return found, [line[18:] for line in summary_lines(found, None) if line.startswith("  limits ")]


def test_the_share_of_every_limit_that_a_gait_uses_is_told_with_its_unit():
    limits = {"torque_limit": 0.05, "power_limit": (0.2, 0.4)}
    found, lines = told_of_limits(joint_limit=2.0, speed_limit=10.0, **limits)
    shares = summary_dict(found, None, None, None)["limits"]
    assert list(shares) == ["joint angles", "joint speed", "torque", "power"]
    t = np.linspace(0, 1, 4001)
    angles, rates = found.gait(t)
    assert shares["joint angles"] == pytest.approx(np.abs(angles).max() / 2.0, rel=1e-5)
    assert shares["joint speed"] == pytest.approx(np.abs(rates).max() / 10.0, rel=1e-5)
    torques = joint_torques(found, t)
    assert shares["torque"] == pytest.approx(np.abs(torques).max() / 0.05, rel=1e-3)
    powers = (torques * rates).max(axis=1) / [0.2, 0.4]
    assert shares["power"] == pytest.approx(powers.max(), rel=1e-3)
    of_speed, of_torque = f"{100 * shares['joint speed']:.0f}", f"{100 * shares['torque']:.0f}"
    assert lines == [
        f"joint angles {100 * shares['joint angles']:.0f} %, joint speed {of_speed} % of 10 rad "
        f"per period, "
        f"torque {of_torque} % of 0.05 weight x body length, power {100 * shares['power']:.0f} %"
    ]


def test_limits_that_no_gait_could_reach_are_named_with_what_it_could_need():
    """1.5 N m and 40 rad/s of a robot's motors, typed where other units are meant: a third of the
    body on a floor of friction 1 has a torque of 1/18 at most, and one harmonic within 2 rad a
    speed of 4 pi."""
    _, lines = told_of_limits(joint_limit=2.0, speed_limit=40.0, torque_limit=1.5, power_limit=2.0)
    assert lines[1:] == [
        "speed_limit 40 cannot matter: no gait needs more than 12.6 rad per period, its unit",
        "torque_limit 1.5 cannot matter: no gait needs more than 0.0556 weight x body length, "
        "its unit",
        "power_limit 2 cannot matter: no gait needs more than 0.698 weight x body length per "
        "period, its unit",
    ]


def test_a_limit_of_speed_that_binds_is_said_to_let_joints_swing_by_half_of_their_way():
    """To and fro, of 2.5 rad to either side."""
    fastest = np.abs(LOOP.rates(np.linspace(0, 1, 4001))).max()
    _, lines = told_of_limits(joint_limit=2.5, speed_limit=fastest)
    swing = f"swing by {np.degrees(fastest / 2):.3g} of {np.degrees(5.0):.3g} degrees at most"
    said = f"speed_limit {fastest:g} rad per period, its unit, lets a joint {swing}"
    assert lines[1:] == [said]


def test_limits_of_a_robot_are_told_in_its_units():
    """A third of 3 kg and 1.2 m, as above, and 4 pi in 600 s."""
    robot = Robot(length=1.2, mass=3, period=600, max_speed=1, max_torque=50)
    _, lines = told_of_limits(joint_limit=2.0, robot=robot)
    assert re.search(r"joint speed [.\d]+ % of 1 rad/s, torque [.\d]+ % of 50 N m$", lines[0])
    assert lines[1:] == [
        f"max_speed 1 cannot matter: no gait needs more than {np.pi / 150:.3g} rad/s, its unit",
        f"max_torque 50 cannot matter: no gait needs more than {1.2 * 3 * 9.81 / 18:.3g} N m, its unit",
    ]


def test_a_limit_of_all_joints_matters_if_it_does_to_one_and_one_of_each_is_named_by_its_joint():
    """The outer joints of four links with short ends need 0.02 at most, the inner one more than
    that."""
    body = Chain((0.2, 0.3, 0.3, 0.2))
    wave = Fourier(np.zeros(3), [[0.2], [0.9], [0.2]], [[0.5], [0.0], [-0.5]])
    found, lines = told_of_limits(wave, body=body, torque_limit=0.1)
    assert summary_dict(found, None, None, None)["limits"]["torque"] * 0.1 > 0.02
    assert not lines[1:]
    _, lines = told_of_limits(wave, body=body, torque_limit=(0.1, 0.1, 0.01))
    said = "torque_limit 0.1 of joint 1 cannot matter: no gait needs more than 0.02 weight"
    assert [line[: len(said)] for line in lines[1:]] == [said]


def test_the_numbers_of_the_one_object_are_the_certified_ones(three_link, tmp_path):
    """The collocated ones differ from them by more than their errors, so here they are made to
    differ by much."""
    answer = replace(three_link.answer, value=9.0, distance=9.0, work=9.0)
    solution = replace(three_link, answer=answer)
    facts = summary_dict(replace(solution, shrunk=solution), tmp_path, None, None)
    for name in ("value", "efficiency", "distance", "work"):
        assert facts[name] == facts["certificate"][name] == getattr(three_link.certificate, name)
    assert facts["shrunk"] == three_link.certificate.value


@pytest.mark.parametrize("harmonics", slow_but([1], [1, 3]))
def test_a_limit_that_a_gait_reaches_is_never_said_not_to_matter(harmonics):
    rng = np.random.default_rng(harmonics)
    for _ in range(2):
        waves = rng.normal(size=(2, 2, harmonics))
        gait = Fourier(np.zeros(2), *waves)
        gait = gait.scaled(1.2 / np.abs(gait.angles(np.arange(500) / 500)).max())
        most = np.abs(gait.rates(np.arange(500) / 500)).max()
        stated = Problem("reached", gait=Harmonic(harmonics), delta=1e-2)
        ones = PathLimit("torque", "moment", 1), PathLimit("power", "power", 1)
        shares = replay(Chain(), colloc.Friction(), gait, 1e-2, tolerance=1e-3, limits=ones).shares
        torque, power = (0.99 * part.max() for part in np.split(shares, 2))
        limits = {"torque_limit": torque, "power_limit": power, "speed_limit": 0.99 * most}
        limits |= {"joint_limit": 1.2, "guess": None}
        said = limit_use.lines(evaluate(stated.with_(**limits), gait))
        assert not any("cannot matter" in line for line in said)


def test_whatever_shows_a_number_shows_its_own_error_with_it(three_link):
    """On a card and at the end of a command: no two numbers or errors of this certificate are
    alike."""
    known = replace(
        three_link.certificate,
        values=three_link.certificate.values | {"distance": 0.31, "work": 1.07},
        errors={"distance": 1e-3, "work": 2e-3},
        value=0.21, value_error=3e-3, value_at_zero_delta=0.22, value_error_at_zero_delta=4e-3,
        efficiency_at_zero_delta=0.24, error_at_zero_delta=6e-3, efficiency_error=5e-3,
    )  # fmt: skip
    shown = replace(three_link, certificate=known)
    told = "\n".join(summary_lines(shown, None))
    for words in (
        "0.210000 +- 3e-03, re-simulated",
        "0.220000 +- 4e-03 for delta",
        "d      0.310000 +- 1e-03",
        "work W  1.070000 +- 2e-03",
    ):
        assert words in told
    swings = (f"{np.degrees(x):.0f}" for x in np.ptp(three_link.gait.angles(T), axis=1))
    way = f"{', '.join(swings)} degrees (tail to head), the body by 0.31 of its length"
    assert f"joints move by {way}" in told
    card = shown._repr_html_()
    for words in ("0.21000 ± 3e-03", "0.22000 ± 4e-03", "0.31000", "1.07000"):
        assert words in card
