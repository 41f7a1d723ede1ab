"""Starts that are small loops: members of the class, where small gaits go far, and found to be the
best where they are."""

from __future__ import annotations

import numpy as np
import pytest

from colloc import Chain, Friction, Harmonic, Polygon, Problem, Viscous
from colloc.mechanics.contact import crossing_depth
from colloc.results.distinct_optima import distance
from colloc.search.explore import multistart
from colloc.search.small_starts import small_loops

PROBLEMS = {
    "any": Problem("any", gait=Harmonic(2)),
    "bilateral": Problem("bilateral", gait=Harmonic(3, "bilateral"), joint_limit=2.5),
    "antipodal": Problem(
        "antipodal", body=Chain((0.3, 0.2, 0.2, 0.3)), gait=Harmonic(1, "antipodal")
    ),
    "limits": Problem(
        "limits", body=Chain((0.3, 0.3, 0.4)), gait=Harmonic(1), joint_limit=(0.5, 2.0)
    ),
    "polygon": Problem("polygon", friction=Friction(mu_t=0.4, mu_f=1, mu_b=2), gait=Polygon(8)),
}


@pytest.mark.parametrize("problem", PROBLEMS.values(), ids=PROBLEMS)
def test_loops_are_admissible_members_of_the_class_hardly_longer_than_they_must_be(problem):
    loops, own = small_loops(problem), problem.gait.start_class
    assert 2 <= len(loops) <= 4
    for loop in loops:
        n_joint = problem.body.n_joint
        again = own.member(own.parameters(loop), n_joint)
        assert distance(again, loop, problem.body, problem.friction) < 1e-9
        angles = loop.angles(np.linspace(0, 1, 200))
        assert (np.abs(angles).max(axis=1) <= np.broadcast_to(problem.joint_limit, n_joint)).all()
        assert not crossing_depth(problem.body, angles).any()
        assert (
            0.9 < loop.shape_speed / problem.smallest_shape_speed < 2
        )  # pressed against its limits, a loop is a little smaller


def test_viscous_drag_has_none():
    """In first order what a small loop goes forth it goes back."""
    assert (
        small_loops(
            Problem(
                "drag",
                friction=Viscous(normal=2.0, tangential=1.0),
                gait=Harmonic(1),
                objective="towing",
            )
        )
        == []
    )


def test_a_small_gait_at_the_fold_is_found_where_it_is_the_best():
    """Two harmonics, joints up to pi: 0.37 at the fold, 0.35 for gaits of any size."""
    problem = Problem("fold", gait=Harmonic(2))
    known, _ = multistart(problem, 8)
    best = known[0].iterate.gait
    assert -known[0].dry_objective > 0.36
    assert best.shape_speed < 2 * problem.smallest_shape_speed
    assert np.sort(np.abs(best.mean)) == pytest.approx([0, np.pi], abs=0.2)
