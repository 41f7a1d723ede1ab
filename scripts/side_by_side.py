"""Gaits crawling one above the other at the same work: python -m scripts.side_by_side [FILE.py ...]

Every body spends work at the same rate, counted by the least friction that it meets: with so much
work what is dragged where it slides best comes `WORK` body lengths far, which is the most that any
gait can. Writes results/curated/side_by_side.gif; by default three links that lie on the floor (the
paper's best gait), the same on feet, a snake on wheels, which are bars, and an inchworm. What holds
is filled.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

import colloc
from colloc.mechanics.bodies import Body
from colloc.pictures.figure import BodyMarks
from colloc.pictures.movie import write_gif
from colloc.pictures.style import (
    BLUE,
    GREEN,
    GREY,
    INK,
    ORANGE,
    PURPLE,
    SKY,
    VERMILION,
    figure_style,
)
from colloc.results.motion import lab_feet, lab_outline
from colloc.results.solution import Solution
from scripts.program import command_line

ROOT = Path(__file__).resolve().parents[1]
FILES = {
    "three_link": "three links on their bellies",
    "three_link_feet": "three links on a foot each",
    "wheeled_snake": "three links on a wheel each",
    "inchworm": "an inchworm on four feet",
}
WORK, PICTURES, FPS, REST = 5.0, 160, 12.5, 12
"""Work spent [weight x body length x least friction], pictures of it, pictures a second, and
pictures that the end stays."""
_WIDTH, _LANE, _BEHIND = 640, 0.68, 0.42
_COLOURS = (BLUE, VERMILION, GREEN, PURPLE, ORANGE, SKY)
_GRAIN = 4001


@dataclass(frozen=True)
class Crawl:
    """A gait in its own lane: the ends of its links ``(2, n_link + 1, n_picture)`` and its centre
    ``(2, n_picture)``."""

    label: str
    efficiency: float
    """Over the most that the least friction allows."""
    ends: np.ndarray
    centre: np.ndarray
    feet: np.ndarray
    """Both ends ``(2, 2, n_foot, n_picture)``, and which of them hold ``(n_foot, n_picture)``."""
    holds: np.ndarray
    body: Body


def phases(solution: Solution, work: np.ndarray) -> np.ndarray:
    """The phase at which a gait has spent so much work: the inverse of the integral of its
    power."""
    t = np.linspace(0.0, 1.0, _GRAIN)
    power = solution.power(solution.sample(t))
    spent = np.concatenate([[0.0], np.cumsum(0.5 * (power[1:] + power[:-1]) * np.diff(t))])
    periods, rest = np.divmod(work, spent[-1])
    return periods + np.interp(rest, spent, t)


def crawl(solution: Solution) -> Crawl:
    """What a gait does with the work."""
    problem, body, least = solution.problem, solution.problem.body, solution.problem.law.smallest
    motion = solution.sample(phases(solution, np.linspace(0.0, least * WORK, PICTURES)))
    label, share = FILES.get(problem.name, problem.gait.describe()), least * solution.efficiency
    feet = lab_feet(body, motion), solution.holding(motion), body
    return Crawl(label, share, lab_outline(body, motion), motion.centre, *feet)


def pictures(crawls: list[Crawl]) -> Iterator[np.ndarray]:
    """The frames, best gait last."""
    farthest = max(float(c.ends[0].max()) for c in crawls) + 0.06
    span = (-_BEHIND, farthest)
    height = round(_WIDTH * (_LANE * len(crawls) + 0.3) / (span[1] - span[0]))
    with figure_style(font_size=9):
        figure = Figure(figsize=(_WIDTH / 100, height / 100), dpi=100)
        figure.set_layout_engine("none")
        canvas = FigureCanvasAgg(figure)
        axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
        axes.set(xlim=span, ylim=(-_LANE * len(crawls) - 0.25, 0.05))
        axes.set_axis_off()
        axes.plot([0, 0], [-_LANE * len(crawls), 0], color="#dfe4e8", lw=1)
        for x in np.arange(1, np.floor(farthest) + 1):
            axes.plot([x, x], [-_LANE * len(crawls), 0], color="#dfe4e8", lw=1)
            axes.text(x, -_LANE * len(crawls) - 0.03, f"{x:.0f}", ha="center", va="top", color=GREY)
        axes.text(0, -_LANE * len(crawls) - 0.03, "0 body lengths", ha="left", va="top", color=GREY)
        drawn = []
        for row, (one, colour) in enumerate(zip(crawls, _COLOURS, strict=False)):
            y = -_LANE * (row + 0.58)
            label = f"{one.label}: {100 * one.efficiency:.0f} % of what friction allows"
            axes.text(
                0.03 - _BEHIND, -_LANE * row - 0.02, label, va="top", color=colour, weight="bold"
            )
            (trail,) = axes.plot([], [], color=colour, lw=1.2, alpha=0.5)
            marks = BodyMarks(axes, one.body, INK, (4, 5, 9, 7, 6), ("o", colour))
            drawn.append((one, np.array([0.0, y]), trail, marks))
        for k in [*range(PICTURES), *[PICTURES - 1] * REST]:
            for one, lift, trail, marks in drawn:
                trail.set_data(*(one.centre[:, : k + 1] + lift[:, None]))
                at = (one.ends[:, :, k].T, one.centre[:, k], one.feet[..., k].T)
                marks.place(((points + lift).T for points in at), one.holds[:, k])
            canvas.draw()
            yield np.asarray(canvas.buffer_rgba())[..., :3].copy()


def main() -> None:
    options = command_line(
        __doc__,
        ("files", [ROOT / "problems" / f"{name}.py" for name in FILES]),
        output=ROOT / "results/curated/side_by_side.gif",
    )
    solutions = [
        colloc.solve(file)
        for file in options.files or [ROOT / "problems" / f"{name}.py" for name in FILES]
    ]
    for solution in solutions:
        print(solution)
    write_gif(options.output, pictures([crawl(solution) for solution in solutions]), FPS)
    print(f"saved {options.output} ({options.output.stat().st_size / 1000:.0f} kB)")


if __name__ == "__main__":
    main()
