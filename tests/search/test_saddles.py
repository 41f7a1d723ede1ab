"""A start with more symmetry than its class may end on a saddle; the search goes on from there."""

import pytest
from scipy.optimize import root

from colloc import Harmonic, Problem, ellipse
from colloc.reduced.program import ReducedProgram
from colloc.reduced.second_order import curvature
from colloc.reduced.spaces import space_near
from colloc.search.reduced_search import Found, searched
from colloc.search.saddles import off_saddles

PROBLEM = Problem("symmetric", gait=Harmonic(1, "bilateral"), guess=ellipse(0.0, 2.0, 1.0), intervals=60)
SADDLE = ellipse(0.0, 0.30734, 0.76781)


def kept_to_itself(_):
    """No report."""


def smallest(found):
    return curvature(ReducedProgram(found.space, found.delta), found.v).smallest


def test_a_saddle_is_left_for_an_optimum():
    """Without an offset the gait is its own mirror image, and the gradient has no part that would give it one."""
    space, v = space_near(PROBLEM, SADDLE)
    v = root(ReducedProgram(space, PROBLEM.delta).gradient, v, tol=1e-9).x
    found = Found.at(space, v, PROBLEM.delta)
    assert found.optimal
    assert found.objective == pytest.approx(-0.04614, abs=2e-5)
    assert smallest(found) == pytest.approx(-0.81, abs=0.02)
    left, lacks = off_saddles(found, "", kept_to_itself)
    assert smallest(left) > 0
    assert left.objective < 2 * found.objective
    assert lacks == ""


def test_an_optimum_is_left_alone():
    found, lacks = searched(PROBLEM, PROBLEM.guess, kept_to_itself)
    assert off_saddles(found, lacks, kept_to_itself)[0] is found
