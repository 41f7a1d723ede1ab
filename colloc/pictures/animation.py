"""Pictures of an animation: the body on the plane with the friction on its links, and the path in
shape space beside it."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from colloc.pictures.figure import draw_shape_path
from colloc.pictures.foot_marks import FootMarks
from colloc.pictures.motion_frames import Frames, foot_kinds, frames, frames_of
from colloc.pictures.style import GREY, INK, ORANGE, SKY, VERMILION, styled
from colloc.results.motion import turned
from colloc.results.solution import Solution


def pictures(
    solution: Solution,
    count: int,
    periods: int,
    *,
    arrows: bool = True,
    width: int = 900,
    from_rest: bool = False,
) -> Iterator[np.ndarray]:
    """Images of `periods` periods in a row, `count` a period, each ``(height, width, 3)`` of bytes,
    of an even width [pixels]; with arrows friction is drawn. A body with inertia can be shown from
    rest (`colloc.Solution.from_rest`)."""
    if from_rest:
        t = np.linspace(0.0, periods, periods * count + 1)
        shown = frames_of(solution, solution.from_rest(t))
    else:
        shown = frames(solution, count + 1, periods=periods)
    with styled():
        scene = _Scene(solution, shown, arrows, width)
        for k in range(periods * count):
            yield scene.picture(*divmod(k, shown.t.size - 1))


class _Scene:
    """A figure whose artists move."""

    def __init__(self, solution: Solution, shown: Frames, arrows: bool, width: int) -> None:
        problem, body = solution.problem, solution.problem.body
        self.shown, self.hinges = shown, body.hinges
        low, high = shown.window
        planar = problem.gait.free and body.n_joint >= 2
        share, span = 0.68 if planar else 0.97, high - low
        tall = float(np.clip(span[1] / span[0], 0.4, 0.9)) * share * width
        height = 2 * round((tall + 0.13 * width) / 2)
        figure = Figure(figsize=(width / 100, height / 100), dpi=100)
        figure.set_layout_engine("none")
        self.canvas, self.size = FigureCanvasAgg(figure), (height, width)
        axes = figure.add_axes((0.015, 0.03, share, tall / height))
        scale = max(span[0] / (share * width), span[1] / tall)  # body lengths of a pixel
        _show_window(axes, 0.5 * (low + high), 0.5 * scale * np.array([share * width, tall]))
        verdict = "" if solution.status == "solved" else f"  ({solution.status})"
        value = f"{problem.objective.name} {solution.measured.value:.4f}"
        title = f"{problem.name}   {value}{verdict}"
        figure.text(0.015, 0.93, title, fontsize=11, weight="bold")
        self.phase = figure.text(share, 0.93, "", fontsize=10, color=GREY, ha="right")

        def line(*look: str, **more: Any) -> Any:
            return axes.plot([], [], *look, **more)[0]

        self.trails = [line(color=colour, lw=1) for colour in (SKY, ORANGE, VERMILION)]
        thickness = 0.72 * body.drawn_width / scale or 4  # a pixel is 0.72 points
        round_ends: Any = {"solid_capstyle": "round", "solid_joinstyle": "round"}
        self.body = line("-", color=INK, lw=thickness, **round_ends)
        self.joints = line("o", color="white", mec=INK, ms=5)
        self.head = line("o", color=INK, ms=9)
        self.centre = line("o", color=VERMILION, ms=5)
        self.feet = FootMarks(axes, foot_kinds(body), 8.0)
        if key := self.feet.key():
            where: Any = {"loc": "lower right", "ncols": len(key), "borderaxespad": 0}
            axes.legend(key.values(), key.keys(), **where)
        self.quiver: Any = None
        if arrows:
            base = shown.arrow_base[:, :, 0]
            # of lengths below a head's size the head shrinks too, so that weak friction looks weak
            self.quiver = axes.quiver(
                *base, *base, color=VERMILION, angles="xy", scale_units="xy", scale=1,
                width=0.0024, headwidth=4, headlength=5, zorder=4,
            )  # fmt: skip
        self.dot = None
        if planar:
            plane = figure.add_axes((0.755, 0.2, 0.235, 0.62))
            draw_shape_path(plane, problem, shown.angles)
            (self.dot,) = plane.plot([], [], "o", color=VERMILION, mec="white", ms=8, zorder=5)

    def picture(self, period: int, k: int) -> np.ndarray:
        shown, before = self.shown, self.shown.before[period]
        ends = before.of(shown.ends[:, :, k])
        self.body.set_data(*ends)
        self.joints.set_data(*ends[:, self.hinges])
        self.head.set_data(*ends[:, -1:])
        self.centre.set_data(*before.of(shown.centre[:, [k]]))
        paths = shown.ends[:, 0], shown.ends[:, -1], shown.centre
        for line, path in zip(self.trails, paths, strict=True):
            whole = [earlier.of(path) for earlier in shown.before[:period]]
            line.set_data(*np.concatenate([*whole, before.of(path[:, : k + 1])], axis=1))
        self.feet.place(before.of(shown.feet[..., k]), shown.holding[:, k])
        if self.quiver is not None:
            force = shown.arrow_scale * turned(shown.arrow[:, :, k], before.rotation)
            self.quiver.set_offsets(before.of(shown.arrow_base[:, :, k]).T)
            self.quiver.set_UVC(*force)
        if self.dot is not None:
            self.dot.set_data(shown.angles[:1, k], shown.angles[1:2, k])
        self.phase.set_text(f"t = {period + shown.t[k]:.2f} of {len(shown.before) * shown.t[-1]:g}")
        self.canvas.draw()
        return np.asarray(self.canvas.buffer_rgba())[: self.size[0], : self.size[1], :3].copy()


def _show_window(axes: Axes, middle: np.ndarray, half: np.ndarray) -> None:
    """A part of the floor on a grid of fifths of a body length."""
    low, high = middle - half, middle + half
    ticks = [
        np.arange(np.ceil(a / 0.2), np.floor(b / 0.2) + 1) * 0.2
        for a, b in zip(low, high, strict=True)
    ]
    axes.set(xticks=ticks[0], yticks=ticks[1])
    axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]))
    axes.grid(color="#e8ecef", lw=0.8)
    axes.tick_params(length=0, labelbottom=False, labelleft=False)
    axes.spines[:].set_visible(False)
