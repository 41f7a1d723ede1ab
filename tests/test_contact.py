"""Admissible shapes: smooth bounds against plain segment intersection."""

import numpy as np
import pytest

from colloc.body import Chain
from colloc.contact import SMOOTHING, crossing_bounds, crossing_depth


@pytest.mark.parametrize(
    "lengths", [(1 / 3, 1 / 3, 1 / 3), (0.5, 0.3, 0.2), (0.2, 0.3, 0.5), (0.25, 0.5, 0.25), (0.3, 0.4, 0.3)]
)
def test_bounds_never_allow_a_crossing_and_forbid_little_else(lengths):
    body = Chain(lengths)
    rng = np.random.default_rng(1)
    angles = rng.uniform(-np.pi, np.pi, (2, 40000))
    allowed = crossing_bounds(body, angles).max(axis=0) <= np.pi
    crossing = crossing_depth(body, angles) > 0
    assert not np.any(allowed & crossing)
    exact = crossing_bounds(body, angles).max(axis=0) <= np.pi + 0.5 * SMOOTHING + 1e-9
    assert np.array_equal(exact[~allowed] | crossing[~allowed], np.ones((~allowed).sum(), bool))
    assert (crossing.mean() > 0.02) == (lengths[0] + lengths[2] > lengths[1])


def test_equal_links_touch_where_the_known_lines_say():
    body = Chain()
    a = np.linspace(2 * np.pi / 3, np.pi, 20)
    for b_edge in (2 * np.pi - 2 * a, (2 * np.pi - a) / 2):
        b = np.clip(b_edge, 0, np.pi)
        first, second = 2 * a + b, a + 2 * b
        edge = np.isclose(np.minimum(first, second), 2 * np.pi)
        inside, outside = np.stack([a, b - 1e-6])[:, edge], np.stack([a + 1e-6, b + 1e-6])[:, edge]
        assert crossing_depth(body, inside).max(initial=0) < 1e-5
        assert np.all(crossing_depth(body, outside)[np.abs(outside[0]) < np.pi] > 0)


def test_longer_chains_see_every_pair():
    body = Chain((0.25,) * 4)
    square = np.array([[np.pi / 2 + 0.2], [np.pi / 2 + 0.2], [np.pi / 2 + 0.2]])
    assert crossing_depth(body, square)[0] > 0
    assert crossing_depth(body, square * 0.7)[0] == 0


def test_two_links_cannot_cross():
    assert crossing_bounds(Chain((0.5, 0.5)), np.zeros((1, 3))) is None
    assert np.array_equal(crossing_depth(Chain((0.5, 0.5)), np.array([[3.0, 0.0]])), [0.0, 0.0])
