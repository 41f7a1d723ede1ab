"""Relaxed gaits: mixtures of directions, their symmetries, and the polygons that come near them."""

import numpy as np
import pytest

from colloc.gaits.gait_fields import class_from, fields, gait_from
from colloc.gaits.relaxed import Mixture, Relaxed
from colloc.system.errors import ProblemError


def mixture(symmetry="none", pieces=4, directions=3, n_joint=2, seed=0):
    """A random mixture whose mean path closes as its symmetry asks."""
    rng = np.random.default_rng(seed)
    raw = rng.standard_normal((pieces, directions, n_joint))
    raw /= np.linalg.norm(raw, axis=2, keepdims=True)
    gait = Mixture(rng.uniform(0.1, 0.3, (pieces, directions)), raw, np.zeros(n_joint), symmetry)
    start = rng.standard_normal(n_joint)
    if symmetry in ("bilateral", "both"):
        start = start - start[::-1]
    missing = -gait.shapes[:, -1]
    if symmetry == "both":  # ends on a shape that equals its reverse
        missing = 0.5 * (missing + missing[::-1]) + 0.5 * (start[::-1] - start) + 0.5 * (missing - missing[::-1])
    if symmetry == "bilateral":
        missing = 0.5 * (missing + missing[::-1])
    if symmetry == "antipodal":
        missing = missing - 2 * start
    step = missing / np.linalg.norm(missing)
    last = np.zeros((1, directions))
    last[0, 0] = np.linalg.norm(missing)
    return Mixture(
        np.concatenate([gait.durations, last]),
        np.concatenate([gait.directions, np.broadcast_to(step, (1, directions, n_joint))]),
        start,
        symmetry,
    )


@pytest.mark.parametrize("n_joint", [2, 3])
@pytest.mark.parametrize("symmetry", ["none", "bilateral", "antipodal", "both"])
def test_the_whole_period_closes_and_has_the_symmetry(symmetry, n_joint):
    gait = mixture(symmetry, n_joint=n_joint)
    t = np.linspace(0.0, 0.999, 57)
    q = gait.angles(t)
    assert np.abs(gait.angles(np.array([0.0, 1.0])) @ [1, -1]).max() < 1e-12
    assert gait.extent == pytest.approx(np.ptp(gait.angles(gait.phases), axis=1).max())
    if symmetry in ("bilateral", "both"):
        assert np.allclose(gait.angles(1 - t), -q[::-1], atol=1e-12)
    if symmetry in ("antipodal", "both"):
        assert np.allclose(gait.angles((t + 0.5) % 1.0), -q, atol=1e-12)


def test_mixed_rates_are_the_slopes_of_the_mean_shape():
    gait, h = mixture("both"), 1e-6
    t = np.setdiff1d(np.linspace(0.01, 0.99, 41), gait.corner_phases)
    difference = (gait.angles(t + h) - gait.angles(t - h)) / (2 * h)
    assert np.allclose(gait.rates(t), difference, atol=1e-6 * gait.length)
    rates, shares = gait.mixed_rates(t)
    assert np.allclose(shares.sum(axis=0), 1.0)
    assert np.allclose(np.linalg.norm(rates, axis=1), gait.length)


@pytest.mark.parametrize("symmetry", ["none", "bilateral", "antipodal", "both"])
def test_realised_polygons_stay_near_the_mean_shape_the_nearer_the_more_they_repeat(symmetry):
    gait = mixture(symmetry)
    apart = []
    for repeats in (1, 4, 16):
        polygon = gait.realised(repeats)
        assert polygon.length == pytest.approx(gait.length, rel=1e-12)
        t = np.linspace(0.0, 1.0, 2001)
        apart.append(np.abs(polygon.angles(t) - gait.angles(t)).max())
    assert apart[1] < 0.3 * apart[0]
    assert apart[2] < 0.3 * apart[1]


def test_a_piece_of_one_direction_is_one_side_however_often_it_is_repeated():
    gait = Mixture([[1.0, 0.0], [0.5, 0.5], [1.0, 0.0]], [[[1, 0], [0, 1]], [[0, 1], [1, 0]], [[-1, 0], [0, 1]]], [0.0, 0.0])
    assert gait.realised(1).n_corner == 4
    assert gait.realised(5).n_corner == 12


def test_a_mixture_taken_apart_is_the_polygon_and_its_mean_follows_the_same_shapes():
    gait = mixture("both")
    apart = gait.unmixed(2)
    assert apart.durations.shape[1] == 1
    assert np.allclose(apart.shapes[:, -1], gait.shapes[:, -1], atol=1e-12)
    assert np.allclose(apart.realised().corners, gait.realised(2).corners, atol=1e-12)
    assert np.allclose(gait.mean.shapes, gait.shapes, atol=1e-12)


@pytest.mark.parametrize(("n_joint", "drift"), [(2, 0.0), (3, 0.0), (3, 0.8)])
def test_loops_run_counter_clockwise_or_clockwise_as_asked(n_joint, drift):
    """Four directions that add up to nothing, or to a drift across their plane, make one loop there: it encloses the same area
    with either sign."""
    turn = 2 * np.pi * np.array([0.3, 2.3, 1.3, 3.3]) / 4  # neither order of the directions as they are stated
    axes = np.linalg.qr(np.random.default_rng(7).standard_normal((n_joint, n_joint)))[0] if n_joint > 2 else np.eye(2)
    plane, size = axes[:2], np.sqrt(1 - drift**2)
    directions = size * np.stack([np.cos(turn), np.sin(turn)], axis=1) @ plane + drift * axes[-1]
    gait = Mixture([[0.2] * 4], [directions], np.zeros(n_joint))

    def area(sense):
        x, y = plane @ gait.unmixed(1, sense).shapes
        return 0.5 * np.sum(x[:-1] * y[1:] - x[1:] * y[:-1])

    square = (0.2 * size) ** 2
    if n_joint == 2:
        assert (area(1), area(-1)) == pytest.approx((square, -square))
    else:  # which side of their plane is above is not said
        assert sorted((area(1), area(-1))) == pytest.approx([-square, square])


def test_splitting_pieces_changes_no_motion():
    gait = mixture("bilateral")
    finer = gait.split(17)
    t = np.linspace(0.0, 1.0, 301)
    assert len(finer.durations) == 17
    assert np.allclose(finer.angles(t), gait.angles(t), atol=1e-12)


@pytest.mark.parametrize("size", [1e-6, 1.0, 1e6])
def test_what_takes_longest_is_split_and_again_where_a_part_still_does_and_what_takes_no_time_goes(size):
    gait = Mixture(size * np.array([[3.0], [2.0], [1e-10]]), [[[1.0, 0.0]], [[0.0, 1.0]], [[1.0, 0.0]]], [0.0, 0.0])
    np.testing.assert_allclose(gait.split(5).durations[:, 0] / size, np.ones(5))
    np.testing.assert_allclose(gait.split(6).durations[:, 0] / size, [0.75] * 4 + [1.0] * 2)
    np.testing.assert_allclose(gait.mean.durations[:, 0] / size, [3, 2])
    np.testing.assert_allclose(gait.unmixed().durations[:, 0] / size, [3, 2])


def test_a_class_has_240_pieces_a_period_or_some_400_numbers_and_makes_polygons_of_vertices():
    assert [Relaxed(2, symmetry).intervals(2) for symmetry in ("both", "none")] == [60, 100]
    assert [each * Relaxed(2).intervals(n) for n, each in ((3, 8), (4, 10))] == [400, 400]
    assert Relaxed(9).intervals(9) == 8
    kind, vertices = Relaxed(3, "none"), np.random.default_rng(0).normal(size=(5, 3))
    gait = kind.member(vertices.ravel(), 3, np.linspace(0, 1, 5))
    assert kind.size(3, 4) == vertices.size
    np.testing.assert_allclose(gait.corners, vertices.T[:, : gait.n_corner])


def test_gaits_and_classes_survive_being_written_down():
    gait, kind = mixture("both"), Relaxed(2, "antipodal")
    assert class_from(fields(kind)) == kind
    again = gait_from(fields(gait))
    assert (again.durations == gait.durations).all()
    assert again.symmetry == "both"


@pytest.mark.parametrize(
    ("arguments", "complaint"),
    [
        (([[1.0]], [[[2.0, 0.0]]], [0.0, 0.0]), "unit vectors"),
        (([[-1.0, 2.0]], [[[1.0, 0.0]] * 2], [0.0, 0.0]), "negative"),
        (([[0.0]], [[[1.0, 0.0]]], [0.0, 0.0]), "nor all zero"),
        (([[1.0, 1.0]], [[[1.0, 0.0]]], [0.0, 0.0]), "disagree"),
        (([[np.nan]], [[[1.0, 0.0]]], [0.0, 0.0]), "finite"),
    ],
)
def test_a_mixture_that_is_none_is_refused(arguments, complaint):
    with pytest.raises(ProblemError, match=complaint):
        Mixture(*arguments)


def test_a_class_that_is_none_is_refused():
    with pytest.raises(ProblemError, match="directions"):
        Relaxed(0)
    with pytest.raises(ProblemError, match="symmetry"):
        Relaxed(3, "quarter")
