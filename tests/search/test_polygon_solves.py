"""Polygons solved: derivatives, feasibility, certified optima; and what a spline of many knots
does."""

import numpy as np
import pytest

from colloc import Chain, Corners, Friction, Polygon, Problem, ellipse
from colloc.results.solution import SOLVED
from colloc.search.solve import solve
from research.small_gaits import small_gait


def test_a_quadrilateral_at_the_fold_beats_every_symmetric_one_known():
    corners = np.array([[3.1416, 3.13, 3.13, 3.05], [-0.15, 0.0, 0.12, 0.12]])
    corners[0] = np.minimum(corners[0], np.pi)
    problem = Problem("fold", Corners(corners), gait=Polygon(4), intervals=24, delta_start=1e-3)
    solution = solve(problem, 1)
    assert solution.status == "solved"
    assert solution.certificate.efficiency > 0.44
    assert np.abs(solution.gait.corners).max() == pytest.approx(np.pi, abs=1e-6)
    assert solution.gait.length == pytest.approx(2 * np.pi * problem.smallest_shape_speed, rel=1e-6)


def test_ipopt_alone_refines_the_mesh_of_a_polygon_just_until_the_replay_is_as_near_as_asked():
    """Delta is relative to the shape speed: with another one a mesh that will do is refined."""
    stated = Problem(
        "path",
        ellipse(1.0, 0.7, 1.1),
        gait=Polygon(4, "bilateral"),
        delta=0.02,
        delta_start=None,
        intervals=8,
        scheme="gauss-1",
    )
    for tolerance, meshes in ((1e-3, 1), (1e-4, 2)):
        found = solve(stated.with_(mesh_tolerance=tolerance), search="full")
        (error,) = [check for check in found.certificate.checks if check.name == "mesh error"]
        assert error.passed
        assert len(found.history) == meshes


@pytest.mark.slow
def test_triangles_at_the_fold_approach_the_best_infinitesimal_gait_in_proportion_to_their_length():
    limit = small_gait(Chain(), Friction(), np.array([np.pi, 0.0])).efficiency
    shortfalls = []
    for speed in (0.1, 0.04):
        shape, length = np.array([3.0, -0.03]), 2 * np.pi * speed
        guess = Corners(small_gait(Chain(), Friction(), shape).path(shape, 1.1 * length))
        delta = 1e-3 * speed
        stated = Problem(
            "small",
            guess,
            gait=Polygon(3, "none"),
            delta=delta,
            intervals=30,
            smallest_shape_speed=speed,
        )
        solution = solve(stated.with_(delta_start=100 * delta), 1)
        assert solution.status == SOLVED
        assert solution.gait.length == pytest.approx(length, rel=1e-3)
        shortfalls.append((limit - solution.certificate.efficiency) / length)
    assert 0.4560 < limit < 0.4563
    assert shortfalls[1] == pytest.approx(shortfalls[0], rel=0.15)
