"""Results checked again without CasADi and compared as paths; and the few lines of a solve's end."""

import json
import re
import subprocess
import sys
from dataclasses import replace
from types import SimpleNamespace

import h5py
import numpy as np
import pytest

import colloc
from colloc import Chain, Fourier, Friction, Problem, Solution, ellipse, evaluate, save
from colloc.commands import results as recheck
from colloc.commands.solve import summary_dict, summary_lines
from colloc.results import checks
from colloc.results.checks import UNCERTIFIED
from colloc.results.comparison import compare, gait_distance
from colloc.results.robot import joint_torques, limit_lines
from tests.shared.cases import slow_but

LOOP = ellipse(0.0, 1.2, 0.8)
STATED = ("distance", "work", "rotation", "length")
NUMBERS = [*STATED, "distance_error", "work_error", *checks.NUMBERS, "driven_work"]
NUMBERS.remove("instants")


def test_verify_certifies_without_loading_casadi_or_matplotlib(three_link, tmp_path):
    file = save(three_link, tmp_path / "x.h5")
    code = (
        "import sys; from colloc.commands.main import main; code = main(['verify', sys.argv[1]]);"
        "print(code, [m for m in ('casadi', 'matplotlib') if m in sys.modules])"
    )
    words = [sys.executable, "-c", code, str(file)]
    result = subprocess.run(words, capture_output=True, text=True, check=True)
    assert result.stdout.splitlines()[-1] == "0 []"
    assert "three_link: verified" in result.stdout
    assert result.stderr == ""


def test_verify_uses_other_instants_and_agrees(three_link, tmp_path, capsys):
    assert recheck.verify([str(save(three_link, tmp_path / "x.h5")), "--json"]) == 0
    again = json.loads(capsys.readouterr().out)
    assert again["instants"] % three_link.certificate.instants
    assert again["passed"]
    assert abs(again["efficiency"] - three_link.certificate.efficiency) < 1e-6


def test_verify_finds_a_tampered_gait(three_link, tmp_path, capsys):
    x = three_link.answer.x.copy()
    x[three_link.answer.layout.parameters[1, 0]] += 0.05
    file = save(replace(three_link, answer=replace(three_link.answer, x=x)), tmp_path / "gait.h5")
    failed = replace(three_link, answer=replace(three_link.answer, optimal=False))
    for path, said in (
        (file, "three_link: NOT VERIFIED"),
        (save(failed, tmp_path / "failed.h5"), "the solve itself ended as: not converged."),
    ):
        assert recheck.verify([str(path)]) == 4
        assert said in capsys.readouterr().out


def test_verify_holds_the_interval_of_dry_friction_in_a_file_against_its_own(three_link, tmp_path):
    for factor, code in ((1.0, 0), (1.01, 4)):
        dry = tuple(factor * end for end in three_link.dry().efficiency)
        stated = replace(three_link, certificate=replace(three_link.certificate, dry=dry))
        assert recheck.verify([str(save(stated, tmp_path / "dry.h5"))]) == code


@pytest.mark.parametrize("name", NUMBERS)
def test_each_number_of_a_certificate_is_held_against_a_new_one(name, three_link, tmp_path, capsys):
    path = save(three_link, tmp_path / "x.h5")
    with h5py.File(path, "r+") as file:  # as anybody can
        numbers = file["certificate"].attrs
        numbers.modify(name, 0.01 + 1.01 * numbers.get(name, 1.0))  # also one that no replay has
    assert recheck.verify([str(path), "--json"]) == 4
    told = json.loads(capsys.readouterr().out)
    assert not told["certified"]
    assert told["complaint"].startswith("the file certifies ")
    assert re.search("which is off by|with an error of .*, where", told["complaint"])
    assert [p.name for p in tmp_path.iterdir()] == ["x.h5"]


def test_what_is_no_number_of_a_replay_is_held_against_it_too(three_link, tmp_path, capsys):
    checks = three_link.certificate.checks
    lax = tuple(
        replace(check, threshold=1.0) if check.name == "second order" else check for check in checks
    )
    for other, said in (
        (lax, "allows 1e+00 for the check 'second order'"),
        (checks[:-1], "lacks the checks"),
    ):
        certificate = replace(three_link.certificate, checks=other)
        file = save(replace(three_link, certificate=certificate), tmp_path / "x.h5")
        assert recheck.verify([str(file), "--json"]) == 4
        assert said in json.loads(capsys.readouterr().out)["complaint"]
    known, failed = three_link.certificate, tuple(replace(each, value=np.inf) for each in checks)
    now = replace(known, checks=failed)
    assert "passed all checks, the new one does not" in recheck.disagreement(known, now)
    assert recheck.disagreement(now, now) == ""
    assert "holds no certificate" in recheck.disagreement(UNCERTIFIED, known)


@pytest.mark.parametrize(
    ("friction", "lengths", "alike"),
    [
        (Friction(), (1 / 3, 1 / 3, 1 / 3), {"turned", "backwards", "both"}),
        (Friction(mu_t=1, mu_f=1, mu_b=1.5), (1 / 3, 1 / 3, 1 / 3), {"both"}),
        (Friction(), (0.2, 0.5, 0.3), {"backwards"}),
    ],
)
def test_gaits_are_compared_where_phase_and_symmetries_bring_them_nearest(friction, lengths, alike):
    mean, cos, sin = np.array([0.3, -0.1]), np.array([[1.0], [0.2]]), np.array([[0.1], [0.8]])
    problem = Problem("p", body=Chain(lengths), friction=friction)

    def found(*parts):
        return SimpleNamespace(problem=problem, gait=Fourier(*parts))

    # the mirror image, begun elsewhere
    c, s = np.cos(0.777), np.sin(0.777)
    gait, later = found(mean, cos, sin), found(-mean, -c * cos - s * sin, s * cos - c * sin)
    assert gait_distance(gait, later) < 1e-9
    assert gait_distance(gait, found(mean + np.array([0.1, 0.0]), cos, sin)) == pytest.approx(0.1)
    turned = -mean[::-1], -cos[::-1], -sin[::-1]
    others = {"turned": turned, "backwards": (mean, cos, -sin), "both": (*turned[:2], -turned[2])}
    assert {name for name, at in others.items() if gait_distance(gait, found(*at)) < 1e-9} == alike


def test_on_two_floors_gaits_are_one_by_what_both_floors_leave_alike():
    mean, cos, sin = np.array([0.3, -0.1]), np.array([[1.0], [0.2]]), np.array([[0.1], [0.8]])
    smooth, rough = (Problem("p", friction=Friction(mu_t=1, mu_f=1, mu_b=b)) for b in (1, 1.5))
    one = SimpleNamespace(problem=smooth, gait=Fourier(mean, cos, sin))
    back = SimpleNamespace(problem=rough, gait=Fourier(mean, cos, -sin))
    assert gait_distance(one, back) == pytest.approx(gait_distance(back, one))
    assert gait_distance(one, back) > 0.1


def test_the_same_gait_found_for_another_objective_is_not_the_same_optimum(three_link):
    other = SimpleNamespace(problem=Problem("p", body=Chain((0.2, 0.5, 0.3))))
    assert gait_distance(three_link, other) is None  # of another body
    fast = replace(three_link, problem=three_link.problem.with_(objective="speed"))
    assert recheck.verdict(three_link, fast) == (False, "other objectives: efficiency and speed.")
    bodies = (Chain(feet=[*map(colloc.Foot, (0, 1)), colloc.Foot(2, x)]) for x in (0.5, 0.6))
    stated = (Problem("p", body=x, gait=colloc.Harmonic(1, "none")) for x in bodies)
    both = [replace(three_link, problem=problem) for problem in stated]
    assert [x[0] for x in compare(*both)[1] if x[1][:30] != x[2][:30]] == ["body feet"]


def test_compare_tells_the_same_optimum_from_another(three_link, solved, tmp_path, capsys):
    offset = solved("three_link_offset")[0]
    a, b = save(three_link, tmp_path / "a.h5"), save(offset, tmp_path / "b.h5")
    mirror = three_link.problem.with_(intervals=30)
    other = save(Solution(mirror, three_link.answer, three_link.certificate), tmp_path / "c.h5")
    assert recheck.verify([str(a), "--compare", str(b)]) == 1
    printed = capsys.readouterr().out
    assert "different: efficiencies differ by 20" in printed
    assert "guess" in printed
    assert recheck.verify([str(a), "--compare", str(other), "--json"]) == 0
    report = json.loads(capsys.readouterr().out)
    assert report["same"]
    assert report["problem"] == {"intervals": ["24", "30"]}
    assert recheck.verify([str(a), "--compare", str(tmp_path / "none.h5")]) == 2


def told_of_limits(gait=LOOP, **limits):
    """A gait and what its summary says of its limits."""
    found = evaluate(Problem("limited", gait=colloc.Harmonic(1), delta=1e-2, **limits), gait)
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
    """The outer joints of four links with short ends need 0.02 at most, the inner one more."""
    body = Chain((0.2, 0.3, 0.3, 0.2))
    wave = Fourier(np.zeros(3), [[0.2], [0.9], [0.2]], [[0.5], [0.0], [-0.5]])
    found, lines = told_of_limits(wave, body=body, torque_limit=0.1)
    assert summary_dict(found, None, None, None)["limits"]["torque"] * 0.1 > 0.02
    assert not lines[1:]
    _, lines = told_of_limits(wave, body=body, torque_limit=(0.1, 0.1, 0.01))
    said = "torque_limit 0.1 of joint 1 cannot matter: no gait needs more than 0.02 weight"
    assert [line[: len(said)] for line in lines[1:]] == [said]


def test_the_numbers_of_the_one_object_are_the_certified_ones(three_link, tmp_path):
    """Not the collocated ones, which are made to differ by much here."""
    answer = replace(three_link.answer, value=9.0, distance=9.0, work=9.0)
    solution = replace(three_link, answer=answer)
    facts = summary_dict(replace(solution, shrunk=solution), tmp_path, None, None)
    for name in ("value", "efficiency", "distance", "work"):
        assert facts[name] == facts["certificate"][name] == getattr(three_link.certificate, name)
    assert facts["shrunk"] == three_link.certificate.value
    assert [x["value"] for x in facts["others"]] == [x.value for x in three_link.others]
    assert facts["swings_rad"] == pytest.approx([2 * np.hypot(2.8593, 1.3015)] * 2, rel=1e-4)


@pytest.mark.parametrize("harmonics", slow_but([1], [1, 3]))
def test_a_limit_that_a_gait_reaches_is_never_said_not_to_matter(harmonics):
    rng = np.random.default_rng(harmonics)
    for _ in range(2):
        gait = Fourier(np.zeros(2), *rng.normal(size=(2, 2, harmonics)))
        gait = gait.scaled(1.2 / np.abs(gait.angles(np.arange(500) / 500)).max())
        most = np.abs(gait.rates(np.arange(500) / 500)).max()
        stated = Problem("reached", gait=colloc.Harmonic(harmonics), delta=1e-2)
        ones = colloc.PathLimit("torque", "moment", 1), colloc.PathLimit("power", "power", 1)
        shares = colloc.replay(Chain(), Friction(), gait, 1e-2, tolerance=1e-3, limits=ones).shares
        torque, power = (0.99 * part.max() for part in np.split(shares, 2))
        limits = {"torque_limit": torque, "power_limit": power, "speed_limit": 0.99 * most}
        limits |= {"joint_limit": 1.2, "guess": None}
        said = limit_lines(evaluate(stated.with_(**limits), gait))
        assert not any("cannot matter" in line for line in said)
