"""A body with a width: which shapes it may take, by walking points along its links, and what a
search makes of it."""

import numpy as np
import pytest

from colloc import Chain, Harmonic, Problem, ProblemError, ellipse, solve
from colloc.bounds.motions import admissible
from colloc.mechanics.contact import crossing_depth, ends_and_links, lacking_width


def nearest(body, angles, first, second, points=301):
    """Distance of two links [body lengths], from points along both; exact to half the distance of
    two points at an end."""
    ends, part = np.stack(body.joints(angles)), np.linspace(0.0, 1.0, points)
    a, b = (
        ends[:, k, :, None] * (1 - part) + ends[:, k + 1, :, None] * part for k in (first, second)
    )
    return np.hypot(*(a[:, :, :, None] - b[:, :, None, :])).min(axis=(1, 2))


def distance(body, angles, end, link):
    return np.sqrt(body.width**2 - 2 * body.width * lacking_width(body, angles, end, link)[0])


@pytest.mark.parametrize("lengths", [(1 / 3, 1 / 3, 1 / 3), (0.2, 0.35, 0.15, 0.3)])
def test_links_that_are_not_neighbours_keep_the_width_where_nothing_overlaps(lengths):
    body = Chain(lengths, width=0.05)
    angles = np.random.default_rng(4).uniform(-np.pi, np.pi, (body.n_joint, 400))
    apart = crossing_depth(body, angles) == 0
    assert 0.3 < apart.mean() < 0.95
    for first in range(body.n_link):
        for second in range(first + 2, body.n_link):
            assert nearest(body, angles[:, apart], first, second).min() >= body.width


def test_the_distance_that_a_search_sees_is_that_of_the_points_of_a_link():
    body, part = Chain((0.2, 0.35, 0.15, 0.3), width=0.05), np.linspace(0.0, 1.0, 2001)
    angles = np.random.default_rng(5).uniform(-np.pi, np.pi, (3, 30))
    ends = np.stack(body.joints(angles))
    assert len(ends_and_links(body)) == body.n_link * (body.n_link - 1)
    for end, link in ends_and_links(body):
        points = ends[:, link, :, None] * (1 - part) + ends[:, link + 1, :, None] * part
        naive = np.hypot(*(points - ends[:, end, :, None])).min(axis=1)
        assert distance(body, angles, end, link) == pytest.approx(naive, abs=0.35 / 2000)


def test_what_a_search_bounds_is_to_first_order_the_width_that_is_lacking():
    body = Chain((0.2, 0.35, 0.15, 0.3), width=0.05)
    angles = np.random.default_rng(7).uniform(-np.pi, np.pi, (3, 4000))
    checked = 0
    for end, link in ends_and_links(body):
        lacks = body.width - distance(body, angles, end, link)
        near = np.abs(lacks) < 2e-3
        np.testing.assert_allclose(
            lacking_width(body, angles, end, link)[0, near], lacks[near], atol=2e-3**2 / 0.05
        )
        checked += near.sum()
    assert checked > 50


@pytest.mark.parametrize("width", [0.01, 0.03, 0.2])
def test_a_joint_folds_until_the_free_end_lies_beside_its_neighbour(width):
    body, last = Chain(width=width), np.pi - np.arcsin(3 * width)
    folded = np.array([[last - 1e-6, last + 1e-6], [0.0, 0.0]])
    for shapes in (folded, -folded, folded[::-1]):
        assert np.array_equal(admissible(body, shapes), [True, False])
        assert np.array_equal(crossing_depth(body, shapes) > 0, [False, True])
    # of unequal neighbours the shorter decides
    uneven = Chain((0.5, 0.3, 0.2), width=width * 0.9)
    last = np.pi - np.arcsin(uneven.width / 0.3)
    beside = np.array([[last - 1e-6, last + 1e-6], [0.0, 0.0]])
    assert np.array_equal(crossing_depth(uneven, beside) > 0, [False, True])


def test_without_a_width_nothing_is_different():
    assert Problem("lines", body=Chain(width=0.0)).hash == Problem("lines").hash
    assert "width" not in Problem("lines").to_dict()["body"]
    assert len(Chain().contacts()) == 2
    wide = Problem("strips", body=Chain(width=0.02))
    assert wide.hash != Problem("strips").hash
    assert Problem.from_dict(wide.to_dict()).body == Chain(width=0.02)


@pytest.mark.parametrize("width", [-0.01, 1 / 3, np.nan, np.inf, True, "thick", None])
def test_a_width_is_less_than_the_shortest_link(width):
    with pytest.raises(ProblemError, match="width"):
        Chain(width=width)


def test_a_guess_that_overlaps_is_refused():
    guess = ellipse(A0=2.4, A1=0.3, B1=0.5)
    with pytest.raises(ProblemError, match="links overlap"):
        Problem("thick", guess, Chain(width=0.12), gait=Harmonic(1, "bilateral"))


def test_the_best_folded_gait_keeps_its_width_and_pays_for_it():
    guess, width = ellipse(A0=2.4, A1=0.3, B1=0.5), 0.03
    at = {"gait": Harmonic(1, "bilateral"), "delta_start": 1e-3, "intervals": 12}
    problem = Problem("folded", guess, Chain(width=width), **at)
    wide = solve(problem, 1)
    assert wide.status == "solved"
    # as lines the links lie on each other, at 0.1030 (problems/three_link_folded.py)
    assert 0.09 < wide.certificate.efficiency < 0.098
    angles = wide.gait.angles(np.linspace(0.0, 1.0, 4001))
    assert np.max(np.abs(angles)) < np.pi - np.arcsin(width * 3) + 1e-6
    assert nearest(Chain(), angles[:, ::20], 0, 2).min() > width
    wider = Chain(width=width + 1e-4)
    assert crossing_depth(wider, angles).max() == pytest.approx(1e-4, abs=1e-6)
