"""When a search on one mesh ends: its rows rest at the worst instants of the gait, and it has left
the saddles to which starts of more symmetry than their class lead."""

import pytest
from scipy.optimize import root

from colloc import Friction, Harmonic, Problem, ellipse
from colloc.reduced.program import ReducedProgram
from colloc.reduced.second_order import curvature
from colloc.search.confirm import confirm
from colloc.search.iterate import evaluate_at, space_near
from colloc.search.optimise import leave_saddle
from colloc.search.options import OPTIONS
from colloc.search.solve import finish, solve
from tests.shared.stages import optimum_near

USUAL = {"gait": Harmonic(1, "bilateral"), "guess": ellipse(0.0, 2.0, 1.0)}
PROBLEM = Problem("plain", intervals=60, mesh_tolerance=0, **USUAL)


@pytest.fixture(scope="module")
def found():
    return optimum_near(PROBLEM.with_(intervals=40))


@pytest.mark.parametrize(("beyond", "kept"), [(0.0, False), (1e-7, False), (1e-4, True)])
def test_what_ipopt_finds_is_the_answer_only_where_its_checks_rest(
    found, monkeypatch, beyond, kept
):
    """Up to what a certificate lets pass; else the gait of the search is, if it satisfies the
    first-order conditions."""
    place = ReducedProgram.place_rows
    monkeypatch.setattr(
        ReducedProgram, "place_rows", lambda program, v: (place(program, v), beyond)[1]
    )
    answer = confirm(found)
    assert answer.optimal
    assert ("beyond its limits" in answer.message) == kept
    assert (answer.status == "stationary") == kept
    assert abs(answer.value + found.objective) < OPTIONS.confirm_radius


@pytest.mark.parametrize("changed", [{}, {"mu_b": 2.0}], ids=["symmetric", "unequal"])
def test_a_solve_that_begins_at_its_answer_stays_there_at_one_delta(changed):
    problem = Problem("again", friction=Friction(**changed), delta=1e-3, **USUAL)
    found = solve(problem, 1)
    again = solve(problem.with_(guess=found.gait), 1)
    assert found.history[0].delta == problem.delta_start
    assert {step.delta for step in again.history} == {problem.delta}
    assert again.value == pytest.approx(found.value, rel=problem.mesh_tolerance)
    assert again.success


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


def test_nothing_lies_below_an_optimum(found):
    assert leave_saddle(found) is None
