"""The figure of a solution: filmstrip and paths in the lab, then what tells most about its kind of
gait."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from colloc.pictures.figure import (
    draw_angles,
    draw_filmstrip,
    draw_lab,
    draw_power,
    draw_shape_path,
    draw_speeds,
)
from colloc.pictures.style import INK, VERMILION, Picture, styled
from colloc.results.solution import SOLVED, Solution

_PHASES = np.linspace(0.0, 1.0, 1201)


def solution_figure(solution: Solution) -> Figure:
    """Filmstrip and lab paths of a solution; shape space, speeds and power."""
    with styled():
        figure = Picture(figsize=(11, 8.2), layout="none")  # type: ignore[arg-type]  # the places are known: drawn once
        colour = INK if solution.status == SOLVED else VERMILION
        figure.text(0.015, 0.985, _headline(solution), fontsize=11, va="top", color=colour)
        draw_filmstrip(figure.add_axes((0.015, 0.76, 0.97, 0.135)), solution)
        figure.text(
            0.015,
            0.905,
            "one period, frame by frame: phase, and below it how far the centre has come "
            "(disc: head)",
        )
        grid = figure.add_gridspec(
            2, 2, left=0.075, right=0.985, bottom=0.06, top=0.685, wspace=0.2, hspace=0.33,
            width_ratios=(2, 1), height_ratios=(1.35, 1),
        )  # fmt: skip
        for k, (title, draw) in enumerate(_panels(solution).items()):
            axes = figure.add_subplot(grid[k])
            draw(axes)
            axes.set_title(title)
    return figure


def _headline(solution: Solution) -> str:
    problem = solution.problem
    verdict = "" if solution.status == SOLVED else f"   —   {solution.status.upper()}"
    return (
        f"{problem.name}: {problem.objective.label} = {solution.measured.value:.5f}   "
        f"{problem.law.label},  δ = {solution.answer.delta:.0e}{verdict}\n"
        f"class: {problem.gait.describe()}{f';  {problem.scene}' if problem.scene else ''}"
        f"{f';  {solution.turning}' if solution.turning else ''}"
    )


def _panels(solution: Solution) -> dict[str, Callable[[Axes], object]]:
    """Title to what draws it."""
    t, work = _PHASES, solution.measured.work
    shape = "shape space (disc: t = 0)" if _is_planar(solution) else "shape"
    return {
        "in the lab (black: at the end)": lambda axes: draw_lab(axes, solution),
        shape: lambda axes: draw_gait(axes, solution),
        "speeds along the body; what is near δ sticks": lambda axes: draw_speeds(axes, solution, t),
        f"power; W = {work:.4f} (ticks: mesh)": lambda axes: draw_power(axes, solution, t),
    }


def _is_planar(solution: Solution) -> bool:
    return solution.problem.body.n_joint == 2 and solution.problem.gait.free


def draw_gait(axes: Axes, solution: Solution) -> Axes:
    """The gait of a solution: its path in the plane of two shape coordinates, or where that is not
    all of it their course in time; returns the axes."""
    angles, problem = solution.gait.angles(_PHASES), solution.problem
    if _is_planar(solution):
        draw_shape_path(axes, problem, angles)
    else:
        draw_angles(axes, _PHASES, angles, problem.body)
    return axes
