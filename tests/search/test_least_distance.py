"""Gaits that must go a distance, as far as a body can."""

import pytest

import colloc
from colloc import Chain, Friction, Harmonic, Problem
from colloc.commands.solve import summary_lines

HOW = {"gait": Harmonic(1, "bilateral"), "delta": 1e-2, "friction": Friction(0.3, 0.3, 0.3)}


def test_where_the_farthest_gait_goes_less_half_of_its_distance_is_asked_for():
    """A long link between two short ones."""
    problem = Problem("stiff", body=Chain((0.2, 0.6, 0.2)), least_distance=0.1, **HOW)
    farthest = colloc.solve(problem.with_(objective="distance", least_distance=None), starts=8)
    solution = colloc.solve(problem, starts=8)
    assert farthest.success
    assert solution.success
    ((aim, least),) = solution.problem.at_least
    assert aim.name == "distance"
    # how far the farthest goes is known on a coarse mesh
    assert least == pytest.approx(0.5 * farthest.distance, rel=0.1)
    assert solution.distance >= least * (1 - 1e-6)
    assert f"The farthest gait goes {2 * least:.3g} body lengths" in solution.message
    assert f"so half of that was: {least:.3g}" in solution.message


@pytest.mark.slow
def test_a_distance_that_can_be_reached_is_kept_and_costs_efficiency():
    free, far = Problem("free", body=Chain((0.25,) * 4), **HOW), 0.22
    best = colloc.solve(free, starts=8)
    assert best.distance < far
    solution = colloc.solve(free.with_(least_distance=far), starts=8)
    assert solution.success
    assert solution.distance == pytest.approx(far, rel=1e-4)  # it binds
    assert solution.efficiency < best.efficiency
    # stated by itself it is the same problem to solve
    stated = colloc.solve(free.with_(at_least={"distance": far}), starts=8)
    assert solution.value == pytest.approx(stated.value, rel=1e-6)


def test_the_full_program_by_itself_keeps_it_too():
    problem = Problem("far", body=Chain((0.25,) * 4), least_distance=0.22, **HOW)
    solution = colloc.solve(problem, search="full")
    assert [least for _, least in solution.problem.at_least] == [0.22]


def test_the_first_line_of_a_gait_that_nobody_sees_says_so():
    problem = Problem(
        "twitch", guess=colloc.ellipse(0, 0.06, 0.05), smallest_shape_speed=0.02, **HOW
    )
    solution = colloc.evaluate(problem, problem.guess)
    assert solution.is_tiny
    assert "tiny gait" in summary_lines(solution, None)[0]
