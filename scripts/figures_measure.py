"""The multipliers of the bound's program over shape space: where the best motion that it knows of would be, and which way."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from colloc.bounds.measure import Measure
from colloc.gaits.polygon import Corners
from colloc.gaits.problem import Problem
from colloc.pictures.figure import draw_allowed
from colloc.pictures.style import BLUE, GREY, PHASE, styled

_AREA, _ARROW = 900.0, 0.3
"""Of the discs of all weights together [square points]; length of a direction [rad]."""


def measure_figure(problem: Problem, measure: Measure, gait: Corners | None = None) -> Figure:
    """A measure of a body of two joints, one of each class of images, and a gait beside it.

    Parameters
    ----------
    problem : Problem
        Whose body and joint limit are meant.
    measure : Measure
    gait : Corners, optional
    """
    with styled():
        figure = Figure(figsize=(6.4, 5.6))
        axes = figure.subplots()
        draw_allowed(axes, problem.body, problem.joint_limit)
        if gait is not None:
            axes.plot(*gait.angles(np.linspace(0.0, 1.0, 4001)), color=BLUE, lw=0.6, label="gait")
        a, b = measure.motion.angles
        points = axes.scatter(
            a, b, s=_AREA * measure.weight, c=np.mod(measure.heading, 2 * np.pi), cmap=PHASE, vmin=0, vmax=2 * np.pi, zorder=3
        )
        x, y = _ARROW * measure.motion.rates
        axes.quiver(a, b, x, y, color=GREY, angles="xy", scale_units="xy", scale=1, width=0.003, headwidth=4, zorder=2)
        figure.colorbar(points, ax=axes, label="heading of the middle link  [rad]")
        limit = 1.02 * np.pi
        axes.set(xlim=(-limit, limit), ylim=(-limit, limit), aspect="equal")
        axes.set(xlabel="joint angle 1  [rad]", ylabel="joint angle 2  [rad]")
        axes.set_title(f"multipliers of the bound: area is work; they travel {measure.efficiency():.4f} per work")
    return figure
