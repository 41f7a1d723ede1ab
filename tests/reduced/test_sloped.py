"""The collocated motion on a slope: against the differential equation, differences, and the full
program."""

import numpy as np
import pytest

import colloc
from colloc import Basis, BSpline, Chain, Foot, Harmonic, Pad, Polygon, Problem, Wheel, ellipse
from colloc.dynamics.control_problem import control_problem
from colloc.gaits.gait import delta_per_period
from colloc.gaits.gait_fields import fields, gait_from
from colloc.reduced.program import ReducedProgram
from colloc.search.iterate import space_near
from colloc.verification.differential_motion import slope_motion


def bump(t):
    return np.exp(np.cos(2 * np.pi * t))


LEVEL = Problem("bilateral", gait=Harmonic(1, "bilateral"), grade=0.4, intervals=60)
SKEW = Problem(
    "skew", body=Chain((0.2, 0.5, 0.3), weights=(0.5, 0.2, 0.3)),
    friction=colloc.Friction(mu_t=1.7, mu_b=1.3), gait=Harmonic(2), grade=0.4,
    intervals=60,
)  # fmt: skip
PARTS = {"feet": (Foot(0), Pad(1, 0.1, 0.6), Wheel(2, rolling=0.5)), "masses": (0.4, 0.3, 0.3)}
FEET = SKEW.with_(name="feet", body=Chain((0.2, 0.5, 0.3), **PARTS), grade=0.2)
SPLINE = SKEW.with_(name="spline", gait=BSpline(7, degree=3), guess=None)
SIDES = SKEW.with_(name="sides", gait=Polygon(5), guess=None)


def program_at(problem, delta):
    """A program, and a point of it with nothing special; of paths one that is closed."""
    space, v = space_near(
        problem, ellipse(0, 2.6, 1.3) if problem.body.n_joint == 2 else problem.guess
    )
    size = 0.0 if problem.gait.relative_delta else 0.1
    v = np.append(v[:-1] + size * np.random.default_rng(0).normal(size=v.size - 1), 0.7)
    program = ReducedProgram(space, delta)
    program.place_rows(v)
    return program, v


@pytest.mark.parametrize("problem", [LEVEL, SKEW, FEET, SPLINE, SIDES], ids=lambda p: p.name)
def test_the_mesh_has_the_motion_of_the_differential_equation(problem):
    program, v = program_at(problem.with_(intervals=120), 0.1)
    gait = program.space.member(v)
    delta = delta_per_period(problem.gait, gait, 0.1)
    at = problem.body, problem.friction, gait, delta, problem.grade
    ran = slope_motion(*at, breaks=gait.corner_phases)
    found = program.motion.values(v, 0.1)
    exact = {"distance": ran.climb, "work": ran.joint_work, "rotation": ran.turn}
    for name, value in (exact | {"across": ran.aside}).items():
        assert found[name] == pytest.approx(float(np.squeeze(value)), abs=1e-5), name


@pytest.mark.parametrize("problem", [SKEW, SPLINE, SIDES], ids=lambda p: p.name)
def test_where_the_ground_is_nearly_level_a_gait_goes_up_as_far_as_on_the_level(problem):
    (up, v), (level, w) = (
        space_near(problem.with_(grade=grade), problem.guess) for grade in (1e-9, 0.0)
    )
    found, known = (
        ReducedProgram(space, 0.01).motion.values(at, 0.01) for space, at in ((up, v), (level, w))
    )
    turned = up.member(np.append(v[:-1], v[-1] + 0.3))
    assert up.parameters(turned)[-1] == pytest.approx(v[-1] + 0.3)
    assert found["work"] == pytest.approx(known["work"], abs=1e-7)
    assert np.hypot(found["distance"], found["across"]) == pytest.approx(
        known["distance"], abs=1e-7
    )
    # where it points is found at a larger delta
    assert found["distance"] > 0.98 * known["distance"]


@pytest.mark.parametrize(
    "gait", [Harmonic(2), BSpline(8, symmetry="bilateral"), Basis([bump, lambda t: bump(t - 0.3)])]
)
def test_a_member_that_points_somewhere_is_known_by_its_parameters_and_kept_in_files(gait):
    problem = LEVEL.with_(gait=gait, guess=None)
    v = np.append(np.random.default_rng(1).normal(size=gait.size(2)), 0.7)
    gaits = control_problem(problem).admissible
    member = gaits.member(v)
    assert member.theta == 0.7
    assert "points +40.11°" in str(member)
    np.testing.assert_allclose(gaits.parameters(gait_from(fields(member))), v, atol=1e-12)
    free = gaits.parameters(gait.member(v[:-1], 2))
    np.testing.assert_allclose(free[:-1], v[:-1], atol=1e-12)
    assert np.isnan(free[-1])
    assert problem.gait == problem.with_(grade=0.0).gait == gait
