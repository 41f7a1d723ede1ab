"""A family of gaits that steer: what turning costs, and where they crawl."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from colloc.pictures.style import BLUE, VERMILION, snapshot_colours, styled
from colloc.studies.steering import Steering

_PERIODS, _PHASES = 6, 60


def steering_figure(family: Steering) -> Figure:
    """Left the efficiency against the turn, right six periods of every gait, the centre of mass and a dot a period."""
    turns, colours = np.degrees(family.turns), snapshot_colours(len(family.points))
    t = np.linspace(0.0, _PERIODS, _PERIODS * _PHASES + 1)
    with styled():
        figure = Figure(figsize=(7.2, 3.4))
        cost, floor = figure.subplots(1, 2)
        cost.plot(turns, family.efficiency, "-", color=BLUE, lw=0.8, zorder=1)
        cost.scatter(turns, family.efficiency, c=colours, s=28, zorder=2)
        failed = ~np.array([point.success for point in family.points])
        cost.plot(turns[failed], family.efficiency[failed], "x", color=VERMILION, ms=9, label="not certified")
        cost.set(xlabel="turn of a period  [degrees, + left]", ylabel="efficiency, chord / W")
        cost.set_ylim(0, 1.1 * family.efficiency.max())
        cost.set_title(family.problem.name)
        if failed.any():
            cost.legend()
        for point, turn, colour in zip(family.points, family.turns, colours, strict=True):
            # half the turn lies behind the first chord, so that all tracks leave the origin in one direction
            ahead = np.exp(0.5j * turn) * (point.motion.sample(t).centre * np.array([[1.0], [1j]])).sum(axis=0)
            floor.plot(ahead.real, ahead.imag, color=colour, lw=1.0)
            floor.plot(ahead.real[::_PHASES], ahead.imag[::_PHASES], "o", color=colour, ms=3)
        floor.set(xlabel="x  [body lengths]", ylabel="y  [body lengths]", aspect="equal")
    return figure
