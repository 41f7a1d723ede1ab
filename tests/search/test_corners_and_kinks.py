"""Optima at the corner of the contact region, and meshes whose knots sit on kinks: random starts
that used to fail."""

import numpy as np
import pytest

from colloc import Chain, Friction, Harmonic, NotConvergedError, Problem, ellipse
from colloc.gaits.starts import latin_hypercube_gait
from colloc.search.iterate import evaluate_at, space_near
from colloc.search.optimise import refine
from colloc.search.solve import solve


def from_start(start, friction, symmetry, **fields):
    problem = Problem(
        "case",
        ellipse(0.0, 1.0, 0.5),
        friction=friction,
        gait=Harmonic(1, symmetry),
        delta=1e-4,
        delta_start=0.1,
        **fields,
    )
    return problem.with_(guess=latin_hypercube_gait(problem, 0, start))


def test_an_optimum_that_rounds_the_corner_of_the_contact_region_is_certified():
    """The fourth maximum of the paper's sweep, 0.1240. Constrained at fixed instants it ended 6e-3
    rad inside the region."""
    solution = solve(from_start(2, Friction(), "antipodal", intervals=20), 1)
    assert solution.status == "solved", solution.message
    assert solution.certificate.efficiency == pytest.approx(0.1240, abs=1e-4)
    # it does round the corner: both sums of the angles are near pi at once
    a, b = solution.gait.angles(np.linspace(0, 1, 20001))
    assert np.min(np.maximum(np.abs(b + a / 2 - np.pi), np.abs(a + b / 2 - np.pi))) < 5e-3


@pytest.mark.slow
def test_refinement_encloses_a_kink_instead_of_following_it():
    """Five meshes, each with its knot moved after the kink, had ended at an error of 3.1e-5."""
    first = solve(from_start(6, Friction(mu_t=1.7, mu_f=1.0, mu_b=1.3), "none", intervals=40), 1)
    problem = first.problem.with_(guess=first.gait, delta=1e-6, delta_start=4e-3)
    solution = solve(problem, 1)
    assert solution.status == "solved", solution.message
    checks = {check.name: check for check in solution.certificate.checks}
    assert checks["mesh error"].value < 2e-5
    assert len({step.intervals for step in solution.history}) <= 4


def test_a_gait_that_rests_on_a_kink_is_certified_and_said_to():
    """Nearest to it, no gradient is below 1e-3; those of both sides cancel."""
    problem = Problem(
        "kink",
        body=Chain((0.2, 0.5, 0.3)),
        friction=Friction(mu_t=0.5, mu_f=1.0, mu_b=5.0),
        gait=Harmonic(3, "none"),
        delta=1e-4,
    )
    solution = solve(problem.with_(guess=latin_hypercube_gait(problem, 0, 3)), 1)
    assert solution.status == "solved", solution.message
    assert "kink" in solution.message
    assert solution.certificate.efficiency == pytest.approx(0.4162, abs=2e-4)


def test_a_gait_whose_finer_mesh_has_no_balance_is_kept_and_says_so(monkeypatch):
    def fails(*_):
        raise NotConvergedError("the balance did not converge.")

    gait = ellipse(A0=0, A1=2.8, B1=1.3)
    problem = Problem("coarse", gait, gait=Harmonic(1, "bilateral"), intervals=8)
    found = evaluate_at(*space_near(problem, gait), problem.delta)
    monkeypatch.setattr("colloc.search.optimise.optimise", fails)
    kept = refine(found)
    np.testing.assert_array_equal(kept.v, found.v)
    assert kept.message == "refinement ended, as on a finer mesh: the balance did not converge."
