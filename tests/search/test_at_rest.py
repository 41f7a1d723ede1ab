"""When a search on one mesh ends: rows are placed at the worst instants of the gait, which move
with it."""

import pytest

from colloc import Friction, Harmonic, Problem, ellipse
from colloc.reduced.program import ReducedProgram
from colloc.search.confirm import confirm
from colloc.search.options import OPTIONS
from colloc.search.solve import solve
from tests.shared.stages import optimum_near

PROBLEM = Problem(
    "plain",
    gait=Harmonic(1, "bilateral"),
    guess=ellipse(0.0, 2.0, 1.0),
    intervals=40,
    mesh_tolerance=0,
)


@pytest.fixture(scope="module")
def found():
    return optimum_near(PROBLEM)


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
    friction = Friction(**changed)
    problem = Problem(
        "again",
        gait=Harmonic(1, "bilateral"),
        guess=ellipse(0.0, 2.0, 1.0),
        friction=friction,
        delta=1e-3,
    )
    found = solve(problem, 1)
    again = solve(problem.with_(guess=found.gait), 1)
    assert found.history[0].delta == problem.delta_start
    assert {step.delta for step in again.history} == {problem.delta}
    assert again.value == pytest.approx(found.value, rel=problem.mesh_tolerance)
    assert again.success
