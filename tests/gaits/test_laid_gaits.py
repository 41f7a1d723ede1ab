"""From class to class and from chain to chain: what an optimum keeps on the way."""

import numpy as np
import pytest

from colloc import Chain, Corners, Fourier, Harmonic, Polygon, Problem, ellipse
from colloc.gaits.starts import prolong, to_body, to_class
from colloc.mechanics.contact import crossing_depth
from colloc.search.solve import solve
from colloc.system.errors import ProblemError

THREE, SIX = Chain((1 / 3,) * 3), Chain((1 / 6,) * 6)
PHASES = np.linspace(0.0, 1.0, 101)
COSINES = np.array([2.50125, -0.00401, -0.12198, 0.00064, -0.03095])
SINES = [0.84175, -0.00217, -0.2703, 0.00101, -0.0018]
FIVE_HARMONICS = Fourier([0.00357, -0.00357], [COSINES, -COSINES], [SINES, SINES])
"""The optimum of five harmonics, efficiency 0.40044."""
GAITS = {
    "Fourier": ellipse(0.2, 1.5, 1.0),
    "Corners": Corners(np.array([[2.0, 2.9, 2.0], [-2.0, -2.0, -2.9]])),
    "bilateral Corners": Corners(np.array([[2.0, 2.5, 2.2], [-2.0, -2.1, -2.2]]), "bilateral"),
}


@pytest.mark.parametrize("name", GAITS)
def test_links_cut_in_two_move_as_before(name):
    """New joints in the middles of links stay straight, old ones keep their angles; joining the
    halves undoes it."""
    gait = GAITS[name]
    cut = to_body(gait, THREE, SIX)
    np.testing.assert_allclose(cut.angles(PHASES)[1::2], gait.angles(PHASES), rtol=0, atol=1e-12)
    np.testing.assert_allclose(cut.angles(PHASES)[::2], 0, rtol=0, atol=1e-12)
    x, y = THREE.joints(gait.angles(PHASES))
    x6, y6 = SIX.joints(cut.angles(PHASES))
    np.testing.assert_allclose([x6[::2], y6[::2]], [x, y], rtol=0, atol=1e-12)
    np.testing.assert_allclose(
        to_body(cut, SIX, THREE).angles(PHASES), gait.angles(PHASES), rtol=0, atol=1e-12
    )


@pytest.mark.parametrize("lengths", [(0.25,) * 4, (0.2,) * 5, (0.1, 0.4, 0.4, 0.1)])
def test_a_large_gait_is_admissible_in_any_chain(lengths):
    laid = to_body(ellipse(0, 2.8, 1.3), THREE, Chain(lengths))
    angles = laid.angles(np.linspace(0, 1, 2001))
    assert np.abs(angles).max() <= np.pi
    assert crossing_depth(Chain(lengths), angles).max() == 0
    np.testing.assert_allclose(angles, -angles[::-1, ::-1], rtol=0, atol=1e-12)


def test_a_truncated_path_that_overshoots_its_limits_starts_a_search_all_the_same():
    square = Corners(np.array([[3.1, 3.1, -3.1, -3.1], [-0.6, 0.6, 0.6, -0.6]]))
    problem = Problem("square", square, gait=Polygon(4), intervals=16)
    stated = prolong(problem, square, Harmonic(3))
    angles = stated.guess.angles(PHASES)
    assert 3.0 < np.abs(angles).max() <= np.pi
    assert crossing_depth(THREE, angles).max() == 0
    with pytest.raises(ProblemError, match="beyond the limit"):
        problem.with_(gait=Harmonic(3))


@pytest.mark.parametrize("symmetry", ["none", "bilateral"])
@pytest.mark.parametrize("gait_class", [Harmonic, Polygon])
def test_a_gait_that_becomes_too_short_grows_about_its_mean(symmetry, gait_class):
    corners = {
        "none": [[0.4, 0.5, 0.6], [0.2, 0.1, 0.3]],
        "bilateral": [[0.4, 0.5, 0.45], [-0.4, -0.42, -0.45]],
    }
    small = Corners(np.array(corners[symmetry]), symmetry)
    laid = to_class(gait_class(3, symmetry), small, THREE)
    assert laid.length == pytest.approx(0.2 * np.pi, rel=2e-3)
    np.testing.assert_allclose(
        laid.angles(PHASES[:-1]).mean(axis=1), small.angles(PHASES[:-1]).mean(axis=1), atol=1e-3
    )
    if symmetry == "bilateral":
        np.testing.assert_allclose(laid.angles(PHASES), -laid.angles(-PHASES)[::-1], atol=1e-9)


def test_a_richer_class_keeps_what_its_seed_had():
    """From 100 times the final delta, where friction is regularised most, the search leaves this
    optimum: 0.3998."""
    problem = Problem(
        "five", FIVE_HARMONICS, gait=Harmonic(5, "bilateral"), delta=1.5e-3, intervals=60
    )
    near = prolong(problem, FIVE_HARMONICS, Harmonic(6, "bilateral"))
    from_afar = solve(near.with_(delta_start=100 * near.delta), 1)
    assert from_afar.status == "solved"
    assert from_afar.certificate.efficiency < 0.4003
    solution = solve(near, 1)
    assert solution.status == "solved"
    assert solution.certificate.efficiency > 0.4010


def test_a_hexagon_is_an_octagon_with_corners_on_its_sides():
    hexagon = Corners(
        np.array([[2.58068, 3.11378, 2.97774, 2.81594], [-2.58068, -2.58089, -2.67289, -2.81594]]),
        "bilateral",
    )
    problem = Problem("six", hexagon, gait=Polygon(6, "bilateral"), intervals=60)
    solution = solve(prolong(problem, hexagon, Polygon(8, "bilateral"), intervals=80), 1)
    assert solution.status == "solved"
    assert solution.certificate.efficiency > 0.4015
