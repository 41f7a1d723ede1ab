"""A family of gaits that steer: what turning costs, and where they crawl."""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from colloc.pictures.publication import COLUMN, Panel, find_panel
from colloc.pictures.style import BLUE, VERMILION, snapshot_colours, styled
from colloc.studies.steering import Steering

_PERIODS, _PHASES = 6, 60


def steering_figure(family: Steering) -> Figure:
    """Left the efficiency against the turn, right six periods of every gait, the centre of mass and
    a dot a period; gaits that turn on the spot are squares."""
    with styled():
        figure = Figure(figsize=(7.2, 3.4))
        for axes, panel in zip(figure.subplots(1, 2), _panels(family).values(), strict=True):
            panel.draw(axes)
    return figure


def draw_steering(axes: Axes, family: Steering, panel: str = "cost") -> Axes:
    """Draw the panel of that name, "cost" or "tracks", and return the axes. `ProblemError` if there
    is none."""
    return find_panel(_panels(family), panel).draw_on(axes)


def _panels(family: Steering) -> dict[str, Panel]:
    drawn = {"cost": _draw_cost, "tracks": _draw_tracks}
    return {
        name: Panel(COLUMN, COLUMN, partial(draw, family=family)) for name, draw in drawn.items()
    }


def _draw_cost(axes: Axes, family: Steering) -> None:
    turns, values = np.degrees(family.turns), family.efficiency
    axes.plot(turns, values, "-", color=BLUE, lw=0.8, zorder=1)
    axes.scatter(turns, values, c=snapshot_colours(len(turns)), s=28, zorder=2)
    failed = ~np.array([point.success for point in family.points])
    if failed.any():
        look: Any = {"color": VERMILION, "ms": 9, "label": "not certified"}
        axes.plot(turns[failed], values[failed], "x", **look)
    if (spot := family.on_the_spot) is not None:
        look = {"color": VERMILION, "ms": 4, "label": "on the spot, with least work"}
        axes.plot(np.degrees(spot.turns), spot.efficiency, "s", **look)
    axes.set(xlabel="turn of a period  [degrees, + left]", ylabel="efficiency, chord / W")
    axes.set_ylim(0, 1.1 * values.max())
    axes.set_title(family.problem.name)
    if axes.get_legend_handles_labels()[0]:
        axes.legend()


def _draw_tracks(axes: Axes, family: Steering) -> None:
    colours = snapshot_colours(len(family.points))
    tracks: Any = [*zip(family.points, colours, "o" * len(colours), strict=True)]
    if (spot := family.on_the_spot) is not None:
        tracks += [(point, VERMILION, "s") for point in spot.points]
    t = np.linspace(0.0, _PERIODS, _PERIODS * _PHASES + 1)
    for point, colour, mark in tracks:
        track = point.motion.sample(t).centre  # all arcs set out along +x
        axes.plot(*track, color=colour, lw=1.0)
        axes.plot(*track[:, ::_PHASES], mark, color=colour, ms=3)
    what = f"x  [body lengths],  {_PERIODS} periods"
    axes.set(xlabel=what, ylabel="y  [body lengths]", aspect="equal")
