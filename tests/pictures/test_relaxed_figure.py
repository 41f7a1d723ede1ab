"""Figures of relaxed gaits draw what they are given."""

from types import SimpleNamespace

import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from colloc import Problem, Relaxed
from colloc.gaits.relaxed import Mixture
from colloc.pictures.relaxed_figure import draw_mixture, draw_realised, draw_shares

THIRDS = [[1.0, 0.0], [-0.5, np.sqrt(0.75)], [-0.5, -np.sqrt(0.75)]]
GAIT = Mixture([[0.5, 0.0, 0.0], [0.2, 0.1, 0.1]], [THIRDS, THIRDS], [0.5, -0.5], "bilateral")
PROBLEM = Problem("drawn", gait=Relaxed(3, "bilateral"))


def axes() -> Axes:
    return Figure().subplots()


def test_mixed_pieces_are_drawn_as_loops_and_others_are_not():
    drawn = axes()
    draw_mixture(drawn, PROBLEM, GAIT)
    loops = [np.array(line.get_data()) for line in drawn.lines if len(line.get_xdata()) == 4]
    assert len(loops) == 2  # the mixed piece and its image
    for loop, piece in zip(loops, (1, 2), strict=True):
        assert np.hypot(*np.diff(loop)).sum() == pytest.approx(0.25)
        np.testing.assert_allclose(loop[:, 3] - loop[:, 0], 0.25 * 0.25 * np.array(GAIT.whole.directions[piece][0]), atol=1e-12)
        np.testing.assert_allclose(loop.mean(axis=1), GAIT.whole.shapes[:, piece + 1], atol=1e-12)


def test_shares_of_every_direction_are_drawn_over_the_period():
    drawn = axes()
    draw_shares(drawn, GAIT)
    assert len(drawn.patches) == 3


def test_what_finite_gaits_lose_is_drawn_and_a_line_by_which_it_falls_with_their_repeats():
    """Of a loss that does, the two are one."""
    repeats, lost = (1, 2, 4), np.array([0.02, 0.01, 0.005])
    finite = [
        SimpleNamespace(repeats=m, corners=3 * m, certificate=SimpleNamespace(efficiency=0.5 - less))
        for m, less in zip(repeats, lost, strict=True)
    ]
    drawn = axes()
    draw_realised(drawn, SimpleNamespace(certificate=SimpleNamespace(efficiency=0.5), realised=finite))
    assert len(drawn.lines) == 2
    for line in drawn.lines:
        np.testing.assert_allclose(line.get_xydata(), np.stack([repeats, lost], axis=1))
    assert drawn.get_xlim()[0] < 1 < 4 < drawn.get_xlim()[1] < 10
    assert 0.001 < drawn.get_ylim()[0] < 0.005 < 0.02 < drawn.get_ylim()[1] < 0.1
    assert [text.get_text() for text in drawn.texts] == ["3 corners\n0.4800", "6 corners\n0.4900", "12 corners\n0.4950"]
