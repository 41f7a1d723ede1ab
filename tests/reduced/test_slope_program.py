"""The collocated motion on a slope: against the differential equation, and its gradients against differences."""

import numpy as np
import pytest

from colloc import Chain, Friction, Harmonic, Problem, ellipse
from colloc.reduced.harmonic_space import HarmonicSpace
from colloc.reduced.slope_program import SlopeProgram
from colloc.verification.slope import slope_motion

LEVEL = Problem("bilateral", gait=Harmonic(1, "bilateral"))
SKEW = Problem("skew", body=Chain((0.2, 0.5, 0.3), weights=(0.5, 0.2, 0.3)), friction=Friction(1.7, 1, 1.3), gait=Harmonic(2))


def program_at(problem, grade, delta, intervals=60, towards=None):
    """A program, and a point of it with nothing special."""
    space = HarmonicSpace(problem, np.linspace(0.0, 1.0, intervals + 1), "gauss-3")
    v = space.parameters(ellipse(0, 2.6, 1.3)) + 0.1 * np.random.default_rng(0).normal(size=space.n)
    program, u = SlopeProgram(space, grade, delta, towards), np.append(v, 0.7)
    program.place_rows(u)
    return program, u


@pytest.mark.parametrize("problem", [LEVEL, SKEW], ids=lambda p: p.name)
def test_the_mesh_has_the_motion_of_the_differential_equation(problem):
    program, u = program_at(problem, 0.4, 0.1, intervals=120)
    ran = slope_motion(problem.body, problem.friction, program.space.member(u[:-1]), 0.1, 0.4, theta=u[-1])
    np.testing.assert_allclose(program.values(u), [ran.climb[0], ran.joint_work[0], ran.turn, ran.aside[0]], atol=1e-5)


@pytest.mark.parametrize("problem", [LEVEL, SKEW], ids=lambda p: p.name)
@pytest.mark.parametrize("towards", [None, 2.0])
def test_gradients_are_the_limit_of_differences(problem, towards):
    program, u = program_at(problem, 0.4, 0.05, towards=towards)
    slopes, gradient, rows = program.gradients(u), program.gradient(u), program.row_slopes(u)
    for k in range(u.size):
        step = 1e-5 * np.eye(u.size)[k]
        there, back = (program.values(u + side * step) for side in (1, -1))
        np.testing.assert_allclose(slopes[:, k], (there - back) / 2e-5, atol=3e-6)
        change = program.objective(u + step) - program.objective(u - step)
        assert gradient[k] == pytest.approx(change / 2e-5, abs=3e-5)
        np.testing.assert_allclose(rows[:, k], (program.rows(u + step) - program.rows(u - step)) / 2e-5, atol=3e-5)


def test_what_friction_does_not_hold_has_no_value():
    skates = Problem("skates", friction=Friction(10, 0.1, 0.1), gait=Harmonic(1, "bilateral"))
    program, u = program_at(skates, 5.0, 1e-3)
    assert np.isnan(program.objective(u))
