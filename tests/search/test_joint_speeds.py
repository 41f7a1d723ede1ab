"""Joints that are no faster, at any instant, than their motors."""

import numpy as np
import pytest

import colloc
from colloc import Chain, Friction, Harmonic, Problem, Serpenoid
from colloc.reduced.program import ReducedProgram
from colloc.search.iterate import space_near
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
    stated = Problem(
        "flat",
        gait=Harmonic(2),
        speed_limit=(7, 11),
        objective="distance",
        delta=1e-2,
        mesh_tolerance=1e-3,
    )
    assert solve(stated, starts=1).status == "solved"


def test_derivatives_of_the_rows_are_those_of_differences():
    problem = Problem(
        "rows",
        gait=Serpenoid(2),
        body=Chain((0.25,) * 4),
        friction=Friction(mu_t=2, mu_f=1, mu_b=1.5),
        speed_limit=(5, 6, 7),
    )
    space, v = space_near(problem, problem.guess)
    program, h = ReducedProgram(space, 1e-2), 1e-6
    program.place_rows(v)
    along = np.random.default_rng(0).normal(size=v.size)
    steps = (program.rows(v + h * along) - program.rows(v - h * along)) / (2 * h)
    assert any("speed of joint" in name for name, _ in program.row_names)
    np.testing.assert_allclose(program.row_slopes(v) @ along, steps, rtol=1e-5, atol=1e-6)


def test_a_certificate_fails_a_gait_that_is_too_fast(slow):
    checked = {c.name: c for c in slow.certificate.checks}
    assert checked["joint speed"].passed
    tighter = colloc.evaluate(slow.problem.with_(speed_limit=11.9, guess=None), slow.gait)
    check = next(c for c in tighter.certificate.checks if c.name == "joint speed")
    assert check.value == pytest.approx(12 / 11.9 - 1, rel=1e-3)
    assert not check.passed
