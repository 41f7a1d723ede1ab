"""A start with more symmetry than its class may end on a saddle; the search goes on from there."""

import pytest
from colloc.search.saddles import below_saddle
from scipy.optimize import root

from colloc import Harmonic, Problem, ellipse, solve
from colloc.reduced.program import ReducedProgram
from colloc.reduced.second_order import curvature
from colloc.reduced.spaces import space_near
from colloc.search.confirm import level_found
from colloc.search.converge import Found, searched

PROBLEM = Problem("symmetric", gait=Harmonic(1, "bilateral"), guess=ellipse(0.0, 2.0, 1.0), intervals=60)
SADDLE = ellipse(0.0, 0.30734, 0.76781)


@pytest.fixture(scope="module")
def saddle():
    """Without an offset the gait is its own mirror image, and the gradient has no part that would give it one."""
    space, v = space_near(PROBLEM, SADDLE)
    v = root(ReducedProgram(space, PROBLEM.delta).gradient, v, tol=1e-9).x
    return Found.at(space, v, PROBLEM.delta)


def smallest(found):
    return curvature(ReducedProgram(found.space, found.delta), found.v).smallest


def test_below_a_saddle_lies_an_optimum(saddle):
    assert saddle.optimal
    assert saddle.objective == pytest.approx(-0.04614, abs=2e-5)
    assert smallest(saddle) == pytest.approx(-0.81, abs=0.02)
    below = below_saddle(saddle)
    assert smallest(below) > 0
    assert below.objective < 2 * saddle.objective


def test_a_solve_that_comes_to_a_saddle_goes_on_from_there(saddle):
    heard = []
    solution = solve(PROBLEM.with_(mesh_tolerance=0), heard.append, [level_found(saddle)], 1)
    assert [level.value for level in heard[:1]] == [pytest.approx(0.04614, abs=2e-5)]
    assert solution.status == "solved"
    assert solution.efficiency > -4 * saddle.objective
    assert [level.value for level in solution.history[1:]] == [level.value for level in heard]


def test_nothing_lies_below_an_optimum():
    found, _ = searched(PROBLEM, PROBLEM.guess, lambda level: None)
    assert below_saddle(found) is None
