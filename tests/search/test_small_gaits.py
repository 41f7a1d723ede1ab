"""Gaits that shrink to the bound on the shape speed are slow, and delta with them."""

import pytest

from colloc import Friction, Harmonic, Problem
from colloc.gaits.starts import latin_hypercube_gait, on_speed_floor
from colloc.results.solution import SOLVED
from colloc.search.solve import solve

ASKED = 0.02


@pytest.fixture(scope="module")
def shrunk():
    """An optimum on the bound, of a problem whose delta is far too large for it."""
    problem = Problem(
        "tiny",
        friction=Friction(mu_t=0.5, mu_f=1, mu_b=5),
        gait=Harmonic(1, "bilateral"),
        delta=ASKED,
    )
    return solve(problem.with_(guess=latin_hypercube_gait(problem, 0, 0)), 1)


def test_delta_is_lowered_until_it_matters_no_more(shrunk):
    assert shrunk.status == SOLVED
    assert on_speed_floor(shrunk.problem, shrunk.gait)
    assert shrunk.answer.delta == shrunk.answer.problem.delta < shrunk.problem.delta == ASKED
    influence = next(
        check for check in shrunk.certificate.checks if check.name == "delta influence"
    )
    assert abs(influence.value) < 1e-2


def test_the_message_says_what_was_asked_and_what_was_done(shrunk):
    assert f"lowered from {ASKED:g} to {shrunk.answer.delta:.1g}" in shrunk.message
