"""What a solve ends with: a few lines that a person reads, and numbers that mean the same as
everywhere else."""

from dataclasses import replace

import numpy as np
import pytest

import colloc
from colloc import Chain, Fourier, Harmonic, PathLimit, Problem, ellipse, evaluate, replay
from colloc.commands.solve import summary_dict, summary_lines
from colloc.results.robot import joint_torques, limit_lines
from tests.shared.cases import slow_but

LOOP = ellipse(0.0, 1.2, 0.8)


def told_of_limits(gait=LOOP, **limits):
    """What the summary says of the limits of a gait, usually one whose joints bend by 1.2 and 0.8
    rad at two phases."""
    stated = Problem("limited", gait=Harmonic(1), delta=1e-2, **limits)
    found = evaluate(stated, gait)
    return found, [line[18:] for line in summary_lines(found, None) if line.startswith("  limits ")]


def test_the_share_of_every_limit_that_a_gait_uses_is_told():
    limits = {"torque_limit": 0.05, "power_limit": (0.2, 0.4)}
    found, _ = told_of_limits(joint_limit=2.0, speed_limit=10.0, **limits)
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
        said = limit_lines(evaluate(stated.with_(**limits), gait))
        assert not any("cannot matter" in line for line in said)
