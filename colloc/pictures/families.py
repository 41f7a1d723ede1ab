"""Figures of Pareto fronts, of gaits that steer, and of the joints of a robot."""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from colloc.pictures.figure import draw_key, draw_series
from colloc.pictures.publication import COLUMN, Panel, find_panel
from colloc.pictures.style import BLUE, VERMILION, Picture, snapshot_colours, styled
from colloc.results.robot import Robot
from colloc.studies.families import ParetoFront, Steering

_FINE = np.linspace(0.0, 1.0, 1001)
_PERIODS, _PHASES = 6, 60  # of a track, and drawn points of a period
_QUANTITIES = {"torque": "N·m", "speed": "rad/s", "power": "W"}


def front_figure(front: ParetoFront) -> Figure:
    """Left the front, right the paths of its gaits in the plane of the first two joints."""
    planar = front.problem.body.n_joint > 1
    with styled():
        figure = Figure(figsize=(7.2 if planar else 3.8, 3.4))
        axes, *plane = figure.subplots(1, 1 + planar, squeeze=False)[0]
        draw_front(axes, front)
        last = front.points[-1].gait.angles(_FINE)
        for panel in plane:
            for point, colour in zip(
                front.points, snapshot_colours(len(front.points)), strict=True
            ):
                path = point.gait.angles(_FINE)
                # a mirror image is the same gait
                mirror = np.abs(path + last).sum() < np.abs(path - last).sum()
                panel.plot(*(-path if mirror else path)[:2], color=colour, lw=1.0)
            what = front.problem.body.defaults.quantity
            panel.set(xlabel=f"{what} 1  [rad]", ylabel=f"{what} 2  [rad]", aspect="equal")
    return figure


def draw_front(axes: Axes, front: ParetoFront) -> Axes:
    """Both objectives of every gait, joined but for gaps."""
    first, second = front.objectives
    values = front.values
    after = [gap.after + 1 for gap in front.gaps]
    whole = np.insert(values, after, np.nan, axis=0)
    axes.plot(whole[:, 1], whole[:, 0], "-", color=BLUE, lw=0.8, zorder=1)
    for k in after:
        label = "nothing found between" if k == after[0] else None
        ends = values[k - 1 : k + 1].T[::-1]
        axes.plot(*ends, ":", color=VERMILION, lw=0.8, zorder=1, label=label)
    axes.scatter(values[:, 1], values[:, 0], c=snapshot_colours(len(front.points)), s=28, zorder=2)
    axes.set(xlabel=second.label, ylabel=first.label)
    axes.set_title(front.problem.name)
    if after:
        axes.legend()
    return axes


def steering_figure(family: Steering) -> Figure:
    """Left the efficiency against the turn, right the tracks of six periods."""
    with styled():
        figure = Figure(figsize=(7.2, 3.4))
        for axes, draw in zip(figure.subplots(1, 2), (_draw_cost, _draw_tracks), strict=True):
            draw(axes, family)
    return figure


def draw_steering(axes: Axes, family: Steering, panel: str = "cost") -> Axes:
    """Draw the panel "cost" or "tracks"."""
    draws = {"cost": _draw_cost, "tracks": _draw_tracks}
    panels = {x: Panel(COLUMN, COLUMN, partial(draw, family=family)) for x, draw in draws.items()}
    return find_panel(panels, panel).draw_on(axes)


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


def robot_figure(robot: Robot) -> Figure:
    """Torque, speed and power of every joint over a period, one below the other."""
    with styled():
        figure = Picture(figsize=(6.4, 6.4))
        rows = figure.subplots(len(_QUANTITIES), sharex=True)
        for axes, panel in zip(rows, robot_panels(robot).values(), strict=True):
            panel.draw(axes)
            axes.label_outer()
    return figure


def draw_robot(axes: Axes, robot: Robot, panel: str = "torque") -> Axes:
    return find_panel(robot_panels(robot), panel).draw_on(axes)


def robot_panels(robot: Robot) -> dict[str, Panel]:
    def draw(axes: Axes, what: str, unit: str) -> None:
        t = robot.columns["t"].values
        draw_series(axes, t, robot.columns[f"joint_{what}s"].values)
        axes.set(xlim=(0, t[-1]), xlabel="time  [s],  one period", ylabel=f"{what}  [{unit}]")
        draw_key(axes, "joint")

    return {
        what: Panel(COLUMN, 2.2, partial(draw, what=what, unit=unit))
        for what, unit in _QUANTITIES.items()
    }
