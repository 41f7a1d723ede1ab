"""Joints that are no faster, at any instant, than their motors, and joints that bend farther to one
side than to the other."""

import numpy as np
import pytest

import colloc
from colloc import Fourier, Friction, Harmonic, Polygon, Problem, load, save
from colloc.search.solve import solve
from tests.shared.cases import cases

T = np.linspace(0, 1, 20001)
FAR = {"objective": "distance", "friction": Friction(mu_t=2, mu_f=1, mu_b=1.5)}


def fastest(solution):
    """Of every joint [rad per period]."""
    return np.abs(solution.gait.rates(T)).max(axis=1)


@pytest.fixture(scope="module")
def slow():
    return solve(Problem("slow", gait=Harmonic(1, "bilateral"), speed_limit=12), starts=4)


CASES = """
harmonics: gait=Harmonic(2, "bilateral"), speed_limit=(8.0, 8.0), **FAR
splines: gait=BSpline(8, symmetry="bilateral"), speed_limit=8.0, **FAR
serpenoid: gait=Serpenoid(1), speed_limit=3.0, body=Chain((0.2,) * 5), friction=Friction(mu_t=3)
inertia: gait=Harmonic(1, "antipodal"), speed_limit=10.0, froude=0.05
slope: gait=Harmonic(1), speed_limit=6.0, grade=0.05, friction=UNEVEN, objective="distance"
"""
UNEVEN = Friction(mu_t=3, mu_f=1, mu_b=1.5)
CASES = cases(CASES, globals())


@pytest.mark.parametrize("case", CASES)
def test_the_fastest_instants_are_as_fast_as_allowed(case):
    """Also between the points of the mesh, of any class paced by time, and of motions with
    states."""
    found = solve(Problem("limited", **CASES[case]), starts=1)
    assert found.status == "solved"
    share = fastest(found) / np.broadcast_to(found.problem.speed_limit, found.problem.body.n_joint)
    assert share.max() == pytest.approx(1.0, abs=1e-5)


@pytest.mark.slow
def test_a_flat_top_that_the_second_round_comes_back_to_is_no_end():
    """Instants that move far make the first round overshoot; the rounds that follow them settle."""
    asked = {"speed_limit": (7, 11), "objective": "distance"}
    stated = Problem("flat", gait=Harmonic(2), delta=1e-2, mesh_tolerance=1e-3, **asked)
    assert solve(stated, starts=1).status == "solved"


def test_a_certificate_fails_a_gait_that_is_too_fast(slow):
    checked = {c.name: c for c in slow.certificate.checks}
    assert checked["joint speed"].passed
    tighter = colloc.evaluate(slow.problem.with_(speed_limit=11.9, guess=None), slow.gait)
    check = next(c for c in tighter.certificate.checks if c.name == "joint speed")
    assert check.value == pytest.approx(12 / 11.9 - 1, rel=1e-3)
    assert not check.passed


LAW = Friction(mu_t=3, mu_f=1, mu_b=1)
ONE_SIDED = ((-0.6, 1.5), (-1.5, 0.6))


def problem(joint_limit, gait=None, **changes):
    stated = {"friction": LAW, "gait": gait or Harmonic(1), "delta": 1e-3, "mesh_tolerance": 1e-4}
    return Problem("ranges", joint_limit=joint_limit, **(stated | changes))


@pytest.fixture(scope="module")
def one_sided():
    return solve(problem(ONE_SIDED, Harmonic(1, "bilateral")), starts=4)


def test_the_answer_keeps_both_sides_and_uses_one(one_sided, tmp_path):
    assert one_sided.success
    first, second = one_sided.gait.angles(np.linspace(0, 1, 4001))
    low, high = first.min(), first.max()
    assert low == pytest.approx(-0.6, abs=1e-5)
    assert high == pytest.approx(1.5, abs=1e-5)
    assert second.max() < 0.6 + 1e-5
    read = load(save(one_sided, tmp_path / "r.h5"))
    assert read.problem.joint_limit == ONE_SIDED
    assert read.problem.hash == one_sided.problem.hash


def test_mirrored_ranges_give_the_mirrored_gait(one_sided):
    mirrored = solve(
        problem(tuple((-high, -low) for low, high in ONE_SIDED), Harmonic(1, "bilateral")), starts=4
    )
    assert mirrored.efficiency == pytest.approx(one_sided.efficiency, rel=1e-6)


def test_polygons_keep_both_sides_use_them_and_mirror():
    gait = Polygon(3, "bilateral")
    aside = Fourier([0.5, -0.5], [[0.9], [-0.9]], [[0.5], [0.5]])
    stated = Problem("paths", gait=gait, delta=1e-2, mesh_tolerance=1e-2, smallest_shape_speed=0.4)
    here = solve(stated.with_(joint_limit=((-1, 2), (-2, 1)), guess=aside), starts=1)
    there = solve(stated.with_(joint_limit=((-2, 1), (-1, 2)), guess=aside.scaled(-1.0)), starts=1)
    assert here.success
    assert there.efficiency == pytest.approx(here.efficiency, rel=1e-9)
    first, second = here.gait.angles(np.linspace(0, 1, 4001))
    assert first.max() == pytest.approx(2.0, abs=1e-5)
    assert first.min() > -1.0 - 1e-5
    assert second.max() < 1.0 + 1e-5


def test_a_range_that_is_even_is_a_limit_and_one_may_go_to_half_a_turn():
    assert problem(((-1, 1), 2.0)).joint_limit == problem((1.0, 2.0)).joint_limit
    assert problem(((-np.pi, 1), (-1, np.pi))).joint_limit == ((-np.pi, 1), (-1, np.pi))
