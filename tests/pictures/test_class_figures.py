"""Gaits of classes side by side: small bends are drawn so that they are seen, and words lie on nothing."""

import re
from itertools import pairwise

import numpy as np
import pytest
from shared.readable import assert_readable

from colloc import Corners, Fourier
from colloc.mechanics.chain import Chain
from scripts.figures_classes import GaitPanel, gait_figure, magnified

PI = np.pi
SMALL = Fourier(np.zeros(3), 0.05 * np.ones((3, 1)), 0.04 * np.array([[1.0], [0.0], [-1.0]]))
LARGE = Fourier(np.zeros(3), 1.5 * np.ones((3, 1)), np.array([[1.0], [0.0], [-1.0]]))
FOLDED = Corners(np.array([[PI, PI - 0.1, PI], [-PI, -PI, 0.1 - PI], [PI - 0.1, PI, PI]]))


def test_bends_that_can_be_seen_are_drawn_as_they_are():
    angles = np.array([[0.0, 0.4], [-0.2, 0.1]])
    drawn, factor = magnified(angles)
    assert factor == 1
    np.testing.assert_array_equal(drawn, angles)


@pytest.mark.parametrize("rest", [0.0, PI, -PI])
def test_small_bends_are_drawn_larger_round_the_straight_or_folded_shape(rest):
    bends = np.array([[-0.05, 0.0, -0.02]])
    angles = rest + (bends if rest >= 0 else -bends)
    drawn, factor = magnified(angles)
    assert factor == 12
    np.testing.assert_allclose(drawn - rest, factor * (angles - rest), atol=1e-12)
    assert np.abs(drawn - rest).max() == pytest.approx(0.6)


def test_the_figure_says_what_was_magnified_and_can_be_read():
    panels = [GaitPanel("small", SMALL), GaitPanel("large", LARGE), GaitPanel("fold", FOLDED)]
    texts = assert_readable(gait_figure(panels, Chain((0.25,) * 4)))
    assert "large" in texts
    for small in ("small", "fold"):
        assert any(re.fullmatch(rf"{small}; bends drawn \d+ times as large", text) for text in texts)
    assert "joint angle ∓ π  [rad]" in texts


def test_paths_of_two_joints_can_be_read():
    gait = Corners(np.array([[2.45, 2.78, 2.45], [-2.45, -2.45, -2.78]]))
    assert "joint angle 1  [rad]" in assert_readable(gait_figure([GaitPanel("a", gait), GaitPanel("b", gait)], Chain()))


def test_bodies_do_not_touch_their_neighbours():
    axes = gait_figure([GaitPanel("large", LARGE)], Chain((0.25,) * 4)).axes[0]
    bodies = [line.get_xdata() for line in axes.lines if line.get_linestyle() == "-" and len(line.get_xdata()) == 5]
    at = [bodies[k : k + 2] for k in range(0, len(bodies), 2)]  # the first body in grey, and the one at this phase
    assert len(at) == 7
    for here, there in pairwise(at):
        assert max(x.max() for x in here) < min(x.min() for x in there)
