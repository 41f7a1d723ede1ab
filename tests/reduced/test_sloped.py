"""The collocated motion on a slope: against the differential equation, differences, and the full program."""

import numpy as np
import pytest

from colloc import Chain, Foot, Friction, Harmonic, Pad, Problem, Wheel, ellipse
from colloc.collocation.warm_start import feasible_point
from colloc.reduced.program import ReducedProgram
from colloc.search.ipopt import Solver
from colloc.search.spaces import space_near, transcribed
from colloc.verification.slope import slope_motion

LEVEL = Problem("bilateral", gait=Harmonic(1, "bilateral"), grade=0.4, intervals=60)
SKEW = Problem(
    "skew", body=Chain((0.2, 0.5, 0.3), weights=(0.5, 0.2, 0.3)), friction=Friction(1.7, 1, 1.3), gait=Harmonic(2), grade=0.4,
    intervals=60,
)  # fmt: skip
FEET = SKEW.with_(
    name="feet",
    body=Chain((0.2, 0.5, 0.3), masses=(0.4, 0.3, 0.3), feet=(Foot(0), Pad(1, 0.1, 0.6), Wheel(2, rolling=0.5))),
    grade=0.2,
)  # fmt: skip


def program_at(problem, delta):
    """A program, and a point of it with nothing special."""
    space, v = space_near(problem, ellipse(0, 2.6, 1.3))
    v = np.append(v[:-1] + 0.1 * np.random.default_rng(0).normal(size=v.size - 1), 0.7)
    program = ReducedProgram(space, delta)
    program.place_rows(v)
    return program, v


@pytest.mark.parametrize("problem", [LEVEL, SKEW, FEET], ids=lambda p: p.name)
def test_the_mesh_has_the_motion_of_the_differential_equation(problem):
    program, v = program_at(problem.with_(intervals=120), 0.1)
    ran = slope_motion(problem.body, problem.friction, program.space.member(v), 0.1, problem.grade)
    found = program.motion.values(v, 0.1)
    for name, exact in (("distance", ran.climb), ("work", ran.joint_work), ("rotation", ran.turn), ("across", ran.aside)):
        assert found[name] == pytest.approx(float(np.squeeze(exact)), abs=1e-5), name


@pytest.mark.parametrize("problem", [LEVEL, SKEW, FEET], ids=lambda p: p.name)
@pytest.mark.parametrize(("towards", "objective"), [(None, "efficiency"), (2.0, "distance / (work + 0.01 * length)")])
def test_gradients_are_the_limit_of_differences(problem, towards, objective):
    program, v = program_at(problem.with_(towards=towards, objective=objective), 0.05)
    slopes, gradient, rows = program.motion.gradients(v, 0.05), program.gradient(v), program.row_slopes(v)
    for k in range(v.size):
        step = 1e-5 * np.eye(v.size)[k]
        there, back = (program.motion.values(v + side * step, 0.05) for side in (1, -1))
        for name, slope in slopes.items():
            assert slope[k] == pytest.approx((there[name] - back[name]) / 2e-5, abs=3e-6), name
        change = program.objective(v + step) - program.objective(v - step)
        assert gradient[k] == pytest.approx(change / 2e-5, abs=3e-5)
        np.testing.assert_allclose(rows[:, k], (program.rows(v + step) - program.rows(v - step)) / 2e-5, atol=3e-5)


@pytest.mark.parametrize(("problem", "towards"), [(SKEW, None), (SKEW, 2.0), (FEET, 2.0)])
def test_the_full_program_holds_where_the_reduced_one_is_evaluated(problem, towards):
    """Every equation but those that the gait has still to be found for: no turn, no way across."""
    program, v = program_at(problem.with_(towards=towards), 0.05)
    full = transcribed(program.space.control.problem, program.space.member(v))
    x = feasible_point(full, program.space.full_parameters(v), 0.05)
    found = Solver(full).measured(x, 0.05, np.zeros_like(x), np.zeros(full.constraint_lower.size))
    off = {name for name, rows in full.groups.items() if found.excess[rows].max(initial=0.0) > 1e-9}
    assert off == ({"rotation"} if towards is None else {"rotation", "across"})
    assert found.objective == pytest.approx(program.objective(v), abs=1e-12)
    assert found.excess[full.groups["rotation"]][0] == pytest.approx(abs(program.motion.values(v, 0.05)["rotation"]), abs=1e-9)


def test_what_friction_does_not_hold_has_no_value():
    program, v = program_at(LEVEL.with_(friction=Friction(10, 0.1, 0.1), grade=5.0, intervals=12), 1e-3)
    assert np.isnan(program.objective(v))
