"""Initial gaits of a search: first guesses, random starts, optima of other classes and chains."""

import numpy as np
import pytest

from colloc import Chain, Corners, Fourier, Harmonic, Polygon, Problem, ProblemError, ellipse
from colloc.gaits import starts
from colloc.gaits.starts import latin_hypercube_gait, to_body, warm_start
from colloc.mechanics.contact import crossing_depth
from colloc.search.solve import solve

THREE, SIX = Chain((1 / 3,) * 3), Chain((1 / 6,) * 6)
PHASES = np.linspace(0.0, 1.0, 101)
COSINES = np.array([2.50125, -0.00401, -0.12198, 0.00064, -0.03095])
SINES = [0.84175, -0.00217, -0.2703, 0.00101, -0.0018]
BEST_FIVE = Fourier([0.00357, -0.00357], [COSINES, -COSINES], [SINES, SINES])
"""The optimum of five harmonics, efficiency 0.40044."""
GAITS = {
    "Fourier": ellipse(0.2, 1.5, 1.0),
    "Corners": Corners(np.array([[2.0, 2.9, 2.0], [-2.0, -2.0, -2.9]])),
    "bilateral Corners": Corners(np.array([[2.0, 2.5, 2.2], [-2.0, -2.1, -2.2]]), "bilateral"),
}


def test_a_guess_on_the_bound_of_the_shape_speed_counts_as_moving():
    """Sampling cuts the corners of an optimum that lies there, and makes it a little slower."""
    guess = ellipse(0.0, 0.3, 0.2)
    for share in (1.01, 0.995, 0.98):
        stated = {"gait": Harmonic(1, "bilateral"), "smallest_shape_speed": guess.shape_speed}
        stated["smallest_shape_speed"] /= share
        if share > 0.99:
            assert Problem("small", guess, **stated).guess is guess
        else:
            with pytest.raises(ProblemError, match="guess hardly moves"):
                Problem("small", guess, **stated)


@pytest.mark.parametrize(
    ("width", "words"), [(0.0, "links cross each other"), (0.02, "links overlap")]
)
def test_it_is_said_when_a_guess_crosses_itself_most(width, words):
    """In the phases of its class, in which the first joint is bent most at 0."""
    body, wave = Chain(width=width), Fourier([1.9, 1.9], [[0.2], [0.2]], [[0.0], [0.8]])
    with pytest.raises(ProblemError, match=f"{words} at phase") as refused:
        Problem("crossed", wave, body, gait=Harmonic(1))
    phase = float(str(refused.value).split("phase ")[1].split(";")[0])
    phases = np.append(phase, np.arange(400) / 400)
    depth = crossing_depth(body, starts.checked_member(Harmonic(1), wave)[0].angles(phases))
    assert 0.05 < phase < 0.4
    assert depth[0] == pytest.approx(depth.max(), rel=1e-3)


@pytest.mark.parametrize(
    ("speed", "limit"), [(1.6, np.pi), (0.1, (0.1, 1.5)), (0.1, ((-0.1, 1.5), 1.5))]
)
def test_without_a_guess_a_search_begins_where_the_body_moves_enough(speed, limit):
    asked = {"smallest_shape_speed": speed, "joint_limit": limit}
    problem = Problem("fast", gait=Harmonic(1), **asked)
    assert problem.guess.shape_speed > problem.smallest_shape_speed
    assert latin_hypercube_gait(problem, 0, 0).shape_speed > problem.smallest_shape_speed


def test_starts_keep_the_speed_of_the_joints_and_a_swing_of_nine_degrees_to_either_side_is_seen():
    slow = Problem("slow", gait=Harmonic(1), speed_limit=(4.0, 2.0))
    for gait in (slow.guess, *(latin_hypercube_gait(slow, 0, k) for k in range(5))):
        assert (np.abs(gait.rates(PHASES)).max(axis=1) <= np.multiply((4.0, 2.0), 1 + 1e-9)).all()
    seen = [starts.is_visible(ellipse(0, np.radians(x), 0.01)) for x in (8.9, 9.1)]
    assert seen == [False, True]


@pytest.mark.parametrize(
    ("shape", "limit", "factor"),
    [
        ([0.0, 0.0], np.pi, np.inf),
        ([0.5, -0.25], 2.0, starts.SAFE * 4.0),
        ([0.5, -0.25], ((-0.4, 3.0), (-0.5, 1.0)), starts.SAFE * 2.0),
        ([0.5, 0.5], np.pi, starts.SAFE * 4 * np.pi / 3),  # the ends meet as a triangle, at 2 pi/3
    ],
)
def test_shapes_grow_to_the_joint_limit_or_to_where_links_touch(shape, limit, factor):
    grown = starts.largest_factor(Chain(), limit, np.array(shape)[:, None])
    assert grown == pytest.approx(factor, rel=1e-6)


def test_a_latin_hypercube_has_a_point_in_every_part_of_a_coordinate_and_depends_on_its_seed():
    first, second = (starts.latin_hypercube(7, 4, np.random.default_rng(3)) for _ in range(2))
    np.testing.assert_array_equal(first, second)
    parts = np.sort(np.floor(7 * first), axis=0)
    np.testing.assert_array_equal(parts, np.repeat(np.arange(7)[:, None], 4, axis=1))
    assert len(np.unique(first)) == first.size


@pytest.mark.parametrize("name", GAITS)
def test_links_cut_in_two_move_as_before(name):
    """New joints stay straight, old ones keep their angles; joining the halves undoes it."""
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
    narrow = to_body(ellipse(0, 2.8, 1.3), THREE, Chain(lengths), 1.0).angles(PHASES)
    assert 0.9 < np.abs(narrow).max() <= 1.0
    np.testing.assert_allclose(angles, -angles[::-1, ::-1], rtol=0, atol=1e-12)


def test_a_truncated_path_that_overshoots_its_limits_starts_a_search_all_the_same():
    square = Corners(np.array([[3.1, 3.1, -3.1, -3.1], [-0.6, 0.6, 0.6, -0.6]]))
    problem = Problem("square", square, gait=Polygon(4), intervals=16)
    stated = warm_start(problem, square, Harmonic(3))
    angles = stated.guess.angles(PHASES)
    assert 3.0 < np.abs(angles).max() <= np.pi
    assert crossing_depth(THREE, angles).max() == 0
    with pytest.raises(ProblemError, match="beyond the limit"):
        problem.with_(gait=Harmonic(3))


@pytest.mark.parametrize("symmetry", ["none", "bilateral"])
@pytest.mark.parametrize("gait_class", [Harmonic, Polygon])
def test_a_gait_that_becomes_too_short_grows_about_its_mean(symmetry, gait_class):
    corners = {"none": [[0.4, 0.5, 0.6], [0.2, 0.1, 0.3]]}
    corners["bilateral"] = [[0.4, 0.5, 0.45], [-0.4, -0.42, -0.45]]
    small = Corners(np.array(corners[symmetry]), symmetry)
    laid = starts.to_class(Problem("short", body=THREE), gait_class(3, symmetry), small)
    assert laid.length == pytest.approx(0.2 * np.pi, rel=2e-3)
    np.testing.assert_allclose(
        laid.angles(PHASES[:-1]).mean(axis=1), small.angles(PHASES[:-1]).mean(axis=1), atol=1e-3
    )
    if symmetry == "bilateral":
        np.testing.assert_allclose(laid.angles(PHASES), -laid.angles(-PHASES)[::-1], atol=1e-9)


@pytest.mark.slow
def test_a_richer_class_keeps_what_its_seed_had():
    """From 100 times the final delta the search leaves this optimum: 0.3998."""
    problem = Problem("five", BEST_FIVE, gait=Harmonic(5, "bilateral"), delta=1.5e-3, intervals=60)
    near = warm_start(problem, BEST_FIVE, Harmonic(6, "bilateral"))
    from_afar = solve(near.with_(delta_start=100 * near.delta), 1)
    assert from_afar.status == "solved"
    assert from_afar.certificate.efficiency < 0.4003
    solution = solve(near, 1)
    assert solution.status == "solved"
    assert solution.certificate.efficiency > 0.4010


@pytest.mark.slow
def test_a_hexagon_is_an_octagon_with_corners_on_its_sides():
    half = [[2.58068, 3.11378, 2.97774, 2.81594], [-2.58068, -2.58089, -2.67289, -2.81594]]
    hexagon = Corners(half, "bilateral")
    problem = Problem("six", hexagon, gait=Polygon(6, "bilateral"), intervals=60)
    solution = solve(warm_start(problem, hexagon, Polygon(8, "bilateral"), intervals=80), 1)
    assert solution.status == "solved"
    assert solution.certificate.efficiency > 0.4015


@pytest.mark.parametrize("least", [0.5, 0.99, 1.01, 3.0])
def test_a_factor_below_the_least_asked_for_is_not_looked_for(least):
    angles = np.random.default_rng(7).normal(size=(5, 1)) * np.sin(np.linspace(0, 6, 50))
    largest = starts.largest_factor(Chain((1 / 6,) * 6), np.pi, angles)
    stated = starts.largest_factor(Chain((1 / 6,) * 6), np.pi, angles, least=least * largest)
    assert stated == (largest if least < 1 else 0.0)
    assert largest < np.pi / np.abs(angles).max() - 1e-3  # links cross before that


def test_a_random_gait_at_rest_is_followed_by_another(monkeypatch):
    drawn, sample = [], Harmonic.sample

    def at_rest_first(self, unit, n_joint):
        drawn.append(unit)
        return sample(self, unit, n_joint).scaled(float(len(drawn) > 2))

    monkeypatch.setattr(Harmonic, "sample", at_rest_first)
    assert latin_hypercube_gait(Problem("x", gait=Harmonic(1)), 0, 0).shape_speed > 0.1
    assert len(drawn) >= 3
