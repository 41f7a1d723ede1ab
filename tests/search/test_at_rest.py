"""When a search on one mesh ends: rows are placed at the worst instants of the gait, which move
with it."""

from types import SimpleNamespace

import numpy as np
import pytest

from colloc import Friction, Harmonic, Problem, ellipse
from colloc.reduced.program import ReducedProgram
from colloc.search.confirm import RADIUS, confirm
from colloc.search.converge import at_rest
from colloc.search.effort import FINE
from colloc.search.solve import solve
from tests.shared.stages import optimum_near

PROBLEM = Problem(
    "plain",
    gait=Harmonic(1, "bilateral"),
    guess=ellipse(0.0, 2.0, 1.0),
    intervals=40,
    mesh_tolerance=0,
)


GOAL = np.array([1.0, 2.0])


class OneOfTwo:
    """Least (x - 1)^2 + (y - 2)^2 with x, y <= 0; only the worse of the two is a row, wherever that
    was placed last."""

    lower, upper = np.full(2, -3.0), np.full(2, 3.0)
    row_lower, row_upper = np.array([-np.inf]), np.zeros(1)
    space = SimpleNamespace(metric=lambda v: None)

    def __init__(self):
        self.placed, self._row = 0, 0

    def follow_worst(self):
        """It stays where it was placed."""

    def objective(self, v):
        return float(np.sum((v - GOAL) ** 2))

    def gradient(self, v):
        return 2 * (v - GOAL)

    def rows(self, v):
        return v[[self._row]]

    def row_slopes(self, v):
        return np.eye(2)[[self._row]]

    def place_rows(self, v):
        self.placed, self._row = self.placed + 1, int(np.argmax(v))
        return float(v.max())


def test_a_gait_that_swings_between_two_instants_is_left_to_finer_cells():
    program = OneOfTwo()
    rested = at_rest(program, np.array([0.5, -0.5]), FINE)
    assert program.placed <= 5
    assert min(abs(rested.conditions.violation - 1), abs(rested.conditions.violation - 2)) < 1e-6


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
    assert abs(answer.value + found.objective) < RADIUS


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
