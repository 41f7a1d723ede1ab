"""Friction as steep as 1 / delta: a gait that is stationary in the space of its class is an
answer."""

import pytest

from benchmarks.robustness import DELTA, NEXT_DELTA, SMALL_DELTA, Table, case_problem
from colloc import Chain
from colloc.gaits.starts import latin_hypercube_gait
from colloc.results.solution import SOLVED
from colloc.search.solve import solve

TABLE = Table(Chain((0.4, 0.2, 0.4)), 3)


@pytest.mark.slow
def test_a_gait_followed_to_a_tiny_delta_is_certified():
    law, symmetry = (3, 1, 1), "none"
    first = case_problem(law, symmetry, DELTA, 0.1, TABLE)
    near = solve(first.with_(guess=latin_hypercube_gait(first, 0, 4)), 1)
    assert near.status == SOLVED
    solution = solve(
        case_problem(law, symmetry, SMALL_DELTA, NEXT_DELTA, TABLE).with_(guess=near.gait), 1
    )
    assert solution.status == SOLVED, solution.message
    assert solution.answer.kkt_error < 1e-6
    assert solution.answer.violation < 1e-8
    assert solution.efficiency == pytest.approx(near.efficiency, rel=1e-2)
