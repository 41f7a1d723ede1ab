"""The figure of a solution, and figures of one panel each in the column widths of journals."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from colloc.dynamics.control_problem import control_problem
from colloc.pictures.figure import (
    draw_angles,
    draw_filmstrip,
    draw_lab,
    draw_mesh_ticks,
    draw_power,
    draw_shape_path,
    draw_speeds,
    set_log,
)
from colloc.pictures.style import BLUE, GREY, INK, ORANGE, VERMILION, Picture, save, styled
from colloc.results.solution import SOLVED, Solution
from colloc.system.errors import ProblemError
from colloc.verification.mesh_error import mesh_error

COLUMN, PAGE = 3.4, 7.0  # widths of a column and of two [inches]
_RESOLUTION = 300
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


class Panel(NamedTuple):
    """Width and height of a picture [inches], and what draws it."""

    width: float
    height: float
    draw: Callable[[Axes], object]

    def draw_on(self, axes: Axes) -> Axes:
        if not isinstance(axes, Axes):
            how = 'plot().savefig("mine.png"), or .pdf, or .svg, writes a file'
            raise ProblemError(f"ax must be a matplotlib Axes to draw on, not {axes!r}; {how}.")
        self.draw(axes)
        return axes

    def figure(self) -> Figure:
        with styled(font_size=8):
            figure = Figure(figsize=(self.width, self.height))
            self.draw(figure.add_subplot())
        return figure


def draw_convergence(axes: Axes, solution: Solution) -> None:
    """Objective against delta at every step of the search; crosses did not converge."""
    deltas, values, good = np.array(
        [(step.delta, step.value, step.optimal) for step in solution.history]
    ).T
    good = good > 0
    axes.plot(deltas[good], values[good], "o-", color=BLUE, ms=4, lw=1.2)
    if good.any():
        axes.set_ylim(*axes.get_ylim())
    axes.plot(deltas[~good], values[~good], "x", color=VERMILION, ms=5)
    axes.set(xlabel="δ  [length/period]", ylabel=solution.problem.objective.label)
    axes.ticklabel_format(axis="y", useOffset=False)
    set_log(axes, "x", (deltas.min() / 2, deltas.max() * 2))


def mesh_errors(solution: Solution) -> np.ndarray:
    """Estimated error of the objective from every mesh interval, ``(n,)``."""
    control = control_problem(solution.answer.problem)
    at = (solution.mesh, solution.gait, solution.delta_per_period)
    return np.abs(mesh_error(control, *at).value)


def draw_mesh(axes: Axes, solution: Solution, errors: np.ndarray) -> None:
    """`mesh_errors` and the tolerance of their sum."""
    edges, shown = solution.mesh.edges, np.maximum(errors, 1e-12)
    tolerance, high = solution.problem.mesh_tolerance, float(shown.max())
    axes.stairs(shown, edges, color=ORANGE, lw=1.2, baseline=None)
    draw_mesh_ticks(axes, edges)
    if tolerance > 0:
        axes.axhline(tolerance, color=GREY, lw=1, ls=":")
        high = max(high, tolerance)
    axes.set(xlim=(0, float(edges[-1])), xlabel="phase t", ylabel="error of an interval")
    set_log(axes, "y", (max(0.5 * float(shown.min()), 1e-10 * high), 3 * high))


def panels(solution: Solution) -> dict[str, Panel]:
    t, problem = _PHASES, solution.problem
    angles = solution.gait.angles(t)
    drawn: dict[str, tuple[float, float, Callable[[Axes], object]]] = {
        "filmstrip": (PAGE, 1.9, lambda axes: draw_filmstrip(axes, solution, count=6)),
        "lab": (PAGE, 3.0, lambda axes: draw_lab(axes, solution)),
        "angles": (COLUMN, 2.2, lambda axes: draw_angles(axes, t, angles, problem.body)),
        "speeds": (COLUMN, 2.4, lambda axes: draw_speeds(axes, solution, t)),
        "power": (COLUMN, 2.4, lambda axes: draw_power(axes, solution, t)),
        "convergence": (COLUMN, 2.2, lambda axes: draw_convergence(axes, solution)),
        "mesh": (COLUMN, 2.2, lambda axes: draw_mesh(axes, solution, mesh_errors(solution))),
    }
    for j in range(len(angles) - 1 if problem.gait.free else 0):
        draw = partial(draw_shape_path, problem=problem, angles=angles, first=j, second=j + 1)
        drawn[f"shape-{j + 1}-{j + 2}"] = (COLUMN, 3.2, draw)
    return {name: Panel(*panel) for name, panel in drawn.items()}


def draw_panel(axes: Axes, solution: Solution, panel: str = "gait") -> Axes:
    gait = Panel(COLUMN, COLUMN, lambda axes: draw_gait(axes, solution))
    return find_panel({"gait": gait} | panels(solution), panel).draw_on(axes)


def find_panel(panels: dict[str, Panel], name: str) -> Panel:
    if name not in panels:
        raise ProblemError(f"there is no panel {name!r}; there are {', '.join(panels)}.")
    return panels[name]


def save_panels(solution: Solution, stem: Path) -> list[Path]:
    """Write ``STEM-PANEL.pdf`` and ``.png`` for every panel; returns the PDFs."""
    return [
        save(panel.figure(), stem.with_name(f"{stem.name}-{name}"), dpi=_RESOLUTION)[-1]
        for name, panel in panels(solution).items()
    ]
