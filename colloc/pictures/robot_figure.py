"""Torque, speed and power of every joint of a robot over a period."""

from __future__ import annotations

from functools import partial

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from colloc.pictures.figure import draw_key, draw_series
from colloc.pictures.publication import COLUMN, Panel, find_panel
from colloc.pictures.style import Picture, styled
from colloc.results.robot import Robot

_SHOWN = {"torque": "N·m", "speed": "rad/s", "power": "W"}


def robot_figure(robot: Robot) -> Figure:
    """Torque, speed and power over a period, one below the other."""
    with styled():
        figure = Picture(figsize=(6.4, 6.4))
        for axes, panel in zip(
            figure.subplots(len(_SHOWN), sharex=True), robot_panels(robot).values(), strict=True
        ):
            panel.draw(axes)
            axes.label_outer()
    return figure


def draw_robot(axes: Axes, robot: Robot, panel: str = "torque") -> Axes:
    return find_panel(robot_panels(robot), panel).draw_on(axes)


def robot_panels(robot: Robot) -> dict[str, Panel]:
    return {what: Panel(COLUMN, 2.2, partial(_draw, robot=robot, what=what)) for what in _SHOWN}


def _draw(axes: Axes, robot: Robot, what: str) -> None:
    t = robot.columns["t"].values
    draw_series(axes, t, robot.columns[f"joint_{what}s"].values)
    axes.set(xlim=(0, t[-1]), xlabel="time  [s],  one period", ylabel=f"{what}  [{_SHOWN[what]}]")
    draw_key(axes, "joint")
