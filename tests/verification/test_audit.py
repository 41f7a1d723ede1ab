"""The program that judges certificates: what it says is so, and what is false is noticed."""

import numpy as np
import pytest

from benchmarks.audit import crossing, path_of, wrong
from benchmarks.independent_replay import Crawler, Gait, Played, played, played_together
from colloc import Chain
from colloc.mechanics.contact import crossing_depth

ELLIPSE = [[0.0, 0.0], [[2.0], [-2.0]], [[1.0], [1.0]]]
TRUE = Played(0.05, 0.1, 2.0, 0.0, 100, 1e-9)
ROW = {
    "number": 0,
    "gait": ELLIPSE,
    "claimed": 0.05,
    "ambiguity": 0.0,
    "efficiency": [0.05, 1e-7],
    "distance": [0.1, 1e-7],
    "work": [2.0, 1e-7],
}


def test_gaits_played_together_are_those_played_alone():
    bodies = [Crawler((0.3, 0.4, 0.3), (1.0, 1.0, 1.0)), Crawler((0.2, 0.3, 0.5), (3.0, 1.0, 2.0))]
    path = path_of(ELLIPSE)
    together = played_together([Gait(body, path, 1e-2) for body in bodies], 1e-3, panels=10)
    for body, found in zip(bodies, together, strict=True):
        alone = played(body, path, 1e-2, 1e-3, panels=10)
        np.testing.assert_allclose(found, alone, rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize("lengths", [(1 / 3, 1 / 3, 1 / 3), (0.45, 0.2, 0.35)])
def test_links_cross_where_collocs_own_test_says_so(lengths):
    angles = np.random.default_rng(0).uniform(-np.pi, np.pi, (2, 4000))
    depth = crossing_depth(Chain(lengths), angles)
    crossed = crossing(lengths, angles)
    assert 0.02 < crossed.mean() < 0.3
    np.testing.assert_array_equal(crossed, depth > 0)


@pytest.mark.parametrize(
    ("change", "noticed"),
    [
        ({}, set()),
        ({"efficiency": [0.0501, 1e-7], "claimed": 0.0501}, {"error of efficiency", "efficiency"}),
        ({"efficiency": [0.0501, 1e-3], "claimed": 0.0501, "ambiguity": 3e-3}, set()),
        ({"distance": [0.1, 1e-9]}, set()),
        ({"work": [2.1, 1e-3]}, {"error of work"}),
        ({"gait": [[0.0, 0.0], [[3.2], [-3.2]], [[0.0], [0.0]]]}, {"joint limit"}),
        ({"gait": [[2.9, 2.9], [[0.0], [0.0]], [[0.0], [0.0]]]}, {"joint limit", "self-contact"}),
    ],
)
def test_a_false_statement_is_noticed(change, noticed):
    assert set(wrong(ROW | change, TRUE)) == noticed


def test_a_turning_body_and_more_than_the_bound_are_noticed():
    assert set(wrong(dict(ROW), TRUE._replace(rotation=1e-3))) & {"rotation"}
    assert "1/min(mu)" in wrong(ROW | {"claimed": 50.0}, TRUE._replace(efficiency=50.0))
