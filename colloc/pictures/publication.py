"""Figures of a result one panel each, in the column widths of journals, as PDF and PNG."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from colloc.pictures.figure import (
    BLUE,
    RED,
    STYLE,
    draw_angles,
    draw_filmstrip,
    draw_lab,
    draw_power,
    draw_shape_path,
    draw_speeds,
)
from colloc.results.solution import Solution
from colloc.system.replaced_file import replaced_file

COLUMN, PAGE = 3.4, 7.0
"""Widths of a column and of two [inches]."""
_RESOLUTION = 300


def draw_convergence(axes: Axes, solution: Solution) -> None:
    """Efficiency at every level of the continuation against its delta; crosses did not converge."""
    good = [level for level in solution.levels if level.optimal]
    bad = [level for level in solution.levels if not level.optimal]
    axes.semilogx([level.delta for level in good], [level.efficiency for level in good], "o-", color=BLUE, ms=4, lw=1.2)
    if good:
        axes.set_ylim(*axes.get_ylim())
    axes.semilogx([level.delta for level in bad], [level.efficiency for level in bad], "x", color=RED, ms=5)
    axes.set(xlabel="δ  [length/period]", ylabel="efficiency d/W")


def panels(solution: Solution) -> dict[str, tuple[float, float, Callable[[Axes], None]]]:
    """Name to width, height [inches] and what draws the panel."""
    t = np.linspace(0.0, 1.0, 1201)
    angles = solution.sample(t).angles
    found: dict[str, tuple[float, float, Callable[[Axes], None]]] = {
        "filmstrip": (PAGE, 1.9, lambda axes: draw_filmstrip(axes, solution, count=6)),
        "lab": (PAGE, 3.0, lambda axes: draw_lab(axes, solution)),
        "angles": (COLUMN, 2.2, lambda axes: draw_angles(axes, t, angles)),
        "speeds": (COLUMN, 2.4, lambda axes: draw_speeds(axes, solution, t)),
        "power": (COLUMN, 2.2, lambda axes: draw_power(axes, solution, t)),
        "convergence": (COLUMN, 2.2, lambda axes: draw_convergence(axes, solution)),
    }
    for j in range(solution.problem.body.n_joint - 1):
        found[f"shape-{j + 1}-{j + 2}"] = (COLUMN, 3.2, _plane(solution, angles, j))
    return found


def _plane(solution: Solution, angles: np.ndarray, j: int) -> Callable[[Axes], None]:
    return lambda axes: draw_shape_path(axes, solution.problem, angles, j, j + 1)


def save_panels(solution: Solution, stem: Path) -> list[Path]:
    """Write ``STEM-PANEL.pdf`` and ``.png`` for every panel; returns the PDFs."""
    written = []
    with matplotlib.rc_context({**STYLE, "font.size": 8, "savefig.dpi": _RESOLUTION}):
        for name, (width, height, draw) in panels(solution).items():
            figure = Figure(figsize=(width, height), layout="constrained")
            draw(figure.add_subplot())
            for kind in ("png", "pdf"):
                with replaced_file(stem.with_name(f"{stem.name}-{name}.{kind}")) as temporary:
                    figure.savefig(temporary, format=kind)
            written.append(stem.with_name(f"{stem.name}-{name}.pdf"))
    return written
