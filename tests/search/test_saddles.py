"""A start with more symmetry than its class may end on a saddle; the search goes on from there."""

import pytest
from scipy.optimize import root

from colloc import Harmonic, Problem, ellipse
from colloc.reduced.program import ReducedProgram
from colloc.reduced.second_order import curvature
from colloc.search.confirm import confirm
from colloc.search.iterate import evaluate_at, space_near
from colloc.search.optimise import leave_saddle
from colloc.search.solve import finish
from tests.shared.stages import optimum_near

PROBLEM = Problem(
    "symmetric",
    gait=Harmonic(1, "bilateral"),
    guess=ellipse(0.0, 2.0, 1.0),
    intervals=60,
    mesh_tolerance=0,
)
SADDLE = ellipse(0.0, 0.30734, 0.76781)


@pytest.fixture(scope="module")
def saddle():
    """Without an offset the gait is its own mirror image, and the gradient has no part that would
    give it one."""
    space, v = space_near(PROBLEM, SADDLE)
    v = root(ReducedProgram(space, PROBLEM.delta).gradient, v, tol=1e-9).x
    return evaluate_at(space, v, PROBLEM.delta)


def smallest(found):
    return curvature(ReducedProgram(found.space, found.delta), found.v).smallest


def test_below_a_saddle_lies_an_optimum(saddle):
    assert saddle.optimal
    assert saddle.objective == pytest.approx(-0.04614, abs=2e-5)
    assert smallest(saddle) == pytest.approx(-0.81, abs=0.02)
    below = leave_saddle(saddle)
    assert smallest(below) > 0
    assert below.objective < 2 * saddle.objective


def test_a_search_that_comes_to_a_saddle_goes_on_from_there(saddle):
    assert confirm(saddle).second_order.smallest < 0
    found = finish(PROBLEM, saddle)
    assert found.success
    assert found.answer.second_order.smallest > 0
    assert found.answer.value > -4 * saddle.objective
    assert found.answer.history[0].value == pytest.approx(0.04614, abs=2e-5)


def test_nothing_lies_below_an_optimum():
    assert leave_saddle(optimum_near(PROBLEM)) is None
