"""Figures of relaxed gaits and of the bound's measure draw what they are given."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PathCollection
from matplotlib.figure import Figure

from colloc import Problem, Relaxed
from colloc.bounds.coulomb_motion import balanced_motion
from colloc.bounds.measure import Measure
from colloc.gaits.relaxed import Mixture
from colloc.pictures.relaxed_figure import draw_mixture, draw_shares
from scripts.figures_measure import measure_figure

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


def test_the_area_of_a_motion_in_a_measure_is_its_share_of_the_work():
    angles = np.array([[2.0, 1.0], [-2.0, 1.0]])
    motion = balanced_motion(PROBLEM.body, PROBLEM.friction, angles, np.array([[1.0, 0.0], [0.0, 1.0]]))
    figure = measure_figure(PROBLEM, Measure(motion, np.zeros(2), np.array([0.75, 0.25])))
    discs = next(c for c in figure.axes[0].collections if isinstance(c, PathCollection))
    assert np.allclose(discs.get_sizes()[0], 3 * discs.get_sizes()[1])
