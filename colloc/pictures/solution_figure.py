"""The figure of a solution: filmstrip, paths in the lab, gait, speeds and power."""

from __future__ import annotations

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
    with styled():
        figure = Picture(figsize=(11, 8.2), layout="none")  # type: ignore[arg-type]
        colour = INK if solution.status == SOLVED else VERMILION
        figure.text(0.015, 0.985, _headline(solution), fontsize=11, va="top", color=colour)
        draw_filmstrip(figure.add_axes((0.015, 0.76, 0.97, 0.135)), solution)
        strip = "one period: phase, and below it the displacement of the centre (disc: head)"
        figure.text(0.015, 0.905, strip)
        grid = figure.add_gridspec(
            2, 2, left=0.075, right=0.985, bottom=0.06, top=0.685, wspace=0.2, hspace=0.33,
            width_ratios=(2, 1), height_ratios=(1.35, 1),
        )  # fmt: skip
        titles = (
            "in the lab (black: at the end)",
            "shape space (disc: t = 0)" if _is_planar(solution) else "shape",
            "sliding speeds (near δ: sticking)",
            f"power; W = {solution.measured.work:.4f} (ticks: mesh)",
        )
        lab, shape, speeds, power = axes = [figure.add_subplot(grid[k]) for k in range(4)]
        draw_lab(lab, solution)
        draw_gait(shape, solution)
        draw_speeds(speeds, solution, _PHASES)
        draw_power(power, solution, _PHASES)
        for each, title in zip(axes, titles, strict=True):
            each.set_title(title)
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


def _is_planar(solution: Solution) -> bool:
    return solution.problem.body.n_joint == 2 and solution.problem.gait.free


def draw_gait(axes: Axes, solution: Solution) -> Axes:
    """Path in the plane of two shape coordinates, or coordinates over time if there are others."""
    angles, problem = solution.gait.angles(_PHASES), solution.problem
    if _is_planar(solution):
        draw_shape_path(axes, problem, angles)
    else:
        draw_angles(axes, _PHASES, angles, problem.body)
    return axes
