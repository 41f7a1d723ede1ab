"""Figures of relaxed gaits draw what they are given."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from colloc import Problem, Relaxed
from colloc.gaits.relaxed import Mixture
from colloc.pictures.relaxed_figure import draw_mixture, draw_shares

THIRDS = [[1.0, 0.0], [-0.5, np.sqrt(0.75)], [-0.5, -np.sqrt(0.75)]]
GAIT = Mixture([[0.5, 0.0, 0.0], [0.2, 0.1, 0.1]], [THIRDS, THIRDS], [0.5, -0.5], "bilateral")
PROBLEM = Problem("drawn", gait=Relaxed(3, "bilateral"))


def axes() -> Axes:
    return Figure().subplots()


def test_mixed_pieces_are_drawn_as_loops_and_others_are_not():
    drawn = axes()
    draw_mixture(drawn, PROBLEM, GAIT)
    loops = [line for line in drawn.lines if len(line.get_xdata()) == 4]
    assert len(loops) == 2  # the mixed piece and its image


def test_shares_of_every_direction_are_drawn_over_the_period():
    drawn = axes()
    draw_shares(drawn, GAIT)
    assert len(drawn.patches) == 3
