"""Figures of a result one panel each, in the column widths of journals, as PDF and PNG."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from colloc.gaits.control_problem import control_problem
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
from colloc.pictures.solution_figure import draw_gait
from colloc.pictures.style import BLUE, GREY, ORANGE, VERMILION, save, styled
from colloc.results.solution import Solution
from colloc.system.errors import ProblemError
from colloc.verification.mesh_error import mesh_error

COLUMN, PAGE = 3.4, 7.0
"""Widths of a column and of two [inches]."""
_RESOLUTION = 300


class Panel(NamedTuple):
    """A picture about a solution: width and height [inches], and what draws it."""

    width: float
    height: float
    draw: Callable[[Axes], object]

    def draw_on(self, axes: Axes) -> Axes:
        """Draw it there, and return the axes. `ProblemError` if these are none."""
        if not isinstance(axes, Axes):
            how = 'plot().savefig("mine.png"), or .pdf, or .svg, writes a file'
            raise ProblemError(f"ax must be a matplotlib Axes to draw on, not {axes!r}; {how}.")
        self.draw(axes)
        return axes

    def figure(self) -> Figure:
        """The panel alone."""
        with styled(font_size=8):
            figure = Figure(figsize=(self.width, self.height))
            self.draw(figure.add_subplot())
        return figure


def draw_convergence(axes: Axes, solution: Solution) -> None:
    """The objective at every step of the search against its delta; crosses did not converge."""
    good = [step for step in solution.history if step.optimal]
    bad = [step for step in solution.history if not step.optimal]
    deltas = np.array([step.delta for step in solution.history])
    axes.plot(
        [step.delta for step in good], [step.value for step in good], "o-", color=BLUE, ms=4, lw=1.2
    )
    if good:
        axes.set_ylim(*axes.get_ylim())
    axes.plot(
        [step.delta for step in bad], [step.value for step in bad], "x", color=VERMILION, ms=5
    )
    axes.set(xlabel="δ  [length/period]", ylabel=solution.problem.objective.label)
    axes.ticklabel_format(axis="y", useOffset=False)
    set_log(axes, "x", (deltas.min() / 2, deltas.max() * 2))


def mesh_errors(solution: Solution) -> np.ndarray:
    """Estimated error of the objective from every mesh interval, ``(n,)``, magnitudes."""
    control = control_problem(solution.answer.problem)
    return np.abs(
        mesh_error(control, solution.mesh, solution.gait, solution.delta_per_period).value
    )


def draw_mesh(axes: Axes, solution: Solution, errors: np.ndarray) -> None:
    """Estimated error of the objective from every mesh interval, `mesh_errors`, and what is allowed
    in all."""
    edges, shown, tolerance = (
        solution.mesh.edges,
        np.maximum(errors, 1e-12),
        solution.problem.mesh_tolerance,
    )
    axes.stairs(shown, edges, color=ORANGE, lw=1.2, baseline=None)
    draw_mesh_ticks(axes, edges)
    high = float(shown.max())
    if tolerance > 0:
        axes.axhline(tolerance, color=GREY, lw=1, ls=":")
        high = max(high, tolerance)
    axes.set(xlim=(0, float(edges[-1])), xlabel="phase t", ylabel="error of an interval")
    set_log(axes, "y", (max(0.5 * float(shown.min()), 1e-10 * high), 3 * high))


def panels(solution: Solution) -> dict[str, Panel]:
    """Name to panel."""
    t = np.linspace(0.0, 1.0, 1201)
    angles = solution.gait.angles(t)
    found = {
        "filmstrip": Panel(PAGE, 1.9, lambda axes: draw_filmstrip(axes, solution, count=6)),
        "lab": Panel(PAGE, 3.0, lambda axes: draw_lab(axes, solution)),
        "angles": Panel(
            COLUMN, 2.2, lambda axes: draw_angles(axes, t, angles, solution.problem.body)
        ),
        "speeds": Panel(COLUMN, 2.4, lambda axes: draw_speeds(axes, solution, t)),
        "power": Panel(COLUMN, 2.4, lambda axes: draw_power(axes, solution, t)),
        "convergence": Panel(COLUMN, 2.2, lambda axes: draw_convergence(axes, solution)),
        "mesh": Panel(COLUMN, 2.2, lambda axes: draw_mesh(axes, solution, mesh_errors(solution))),
    }
    for j in range(len(angles) - 1 if solution.problem.gait.free else 0):
        drawn = partial(
            draw_shape_path, problem=solution.problem, angles=angles, first=j, second=j + 1
        )
        found[f"shape-{j + 1}-{j + 2}"] = Panel(COLUMN, 3.2, drawn)
    return found


def draw_panel(axes: Axes, solution: Solution, panel: str = "gait") -> Axes:
    """Draw the panel of that name, and return the axes. `ProblemError` if there is none."""
    found = {"gait": Panel(COLUMN, COLUMN, lambda axes: draw_gait(axes, solution))} | panels(
        solution
    )
    return chosen(found, panel).draw_on(axes)


def chosen(found: dict[str, Panel], name: str) -> Panel:
    """The panel of that name. `ProblemError` if there is none."""
    if name not in found:
        raise ProblemError(f"there is no panel {name!r}; there are {', '.join(found)}.")
    return found[name]


def save_panels(solution: Solution, stem: Path) -> list[Path]:
    """Write ``STEM-PANEL.pdf`` and ``.png`` for every panel; returns the PDFs."""
    named = (
        (stem.with_name(f"{stem.name}-{name}"), panel) for name, panel in panels(solution).items()
    )
    return [save(panel.figure(), path, dpi=_RESOLUTION)[-1] for path, panel in named]
