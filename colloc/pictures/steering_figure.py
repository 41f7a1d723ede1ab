"""A family of gaits that steer: what turning costs, and where they crawl."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from colloc.pictures.style import BLUE, VERMILION, snapshot_colours, styled
from colloc.studies.steering import Steering

_PERIODS, _PHASES = 6, 60


def steering_figure(family: Steering) -> Figure:
    """Left the efficiency against the turn, right six periods of every gait, the centre of mass and a dot a period; gaits that
    turn on the spot are squares."""
    turns, colours = np.degrees(family.turns), snapshot_colours(len(family.points))
    tracks = [*zip(family.points, family.turns, colours, "o" * len(colours), strict=True)]
    if (spot := family.on_the_spot) is not None:
        tracks += zip(spot.points, spot.turns, [VERMILION] * len(spot.points), "s" * len(spot.points), strict=True)
    t = np.linspace(0.0, _PERIODS, _PERIODS * _PHASES + 1)
    with styled():
        figure = Figure(figsize=(7.2, 3.4))
        cost, floor = figure.subplots(1, 2)
        cost.plot(turns, family.efficiency, "-", color=BLUE, lw=0.8, zorder=1)
        cost.scatter(turns, family.efficiency, c=colours, s=28, zorder=2)
        failed = ~np.array([point.success for point in family.points])
        if failed.any():
            cost.plot(turns[failed], family.efficiency[failed], "x", color=VERMILION, ms=9, label="not certified")
        if spot is not None:
            cost.plot(np.degrees(spot.turns), spot.efficiency, "s", color=VERMILION, ms=4, label="on the spot, with least work")
        cost.set(xlabel="turn of a period  [degrees, + left]", ylabel="efficiency, chord / W")
        cost.set_ylim(0, 1.1 * family.efficiency.max())
        cost.set_title(family.problem.name)
        if cost.get_legend_handles_labels()[0]:
            cost.legend()
        for point, turn, colour, mark in tracks:
            # half the turn lies behind the first chord, so that all tracks leave the origin in one direction
            ahead = np.exp(0.5j * turn) * (point.motion.sample(t).centre * np.array([[1.0], [1j]])).sum(axis=0)
            floor.plot(ahead.real, ahead.imag, color=colour, lw=1.0)
            floor.plot(ahead.real[::_PHASES], ahead.imag[::_PHASES], mark, color=colour, ms=3)
        floor.set(xlabel="x  [body lengths]", ylabel="y  [body lengths]", aspect="equal")
    return figure
