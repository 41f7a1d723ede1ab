"""Animations as GIF, or as MP4 where ffmpeg is installed: the body on the plane with the friction
on its links, and the path in shape space beside it."""

from __future__ import annotations

import shutil
import subprocess
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from colloc.mechanics.contact import link_width
from colloc.pictures.figure import FootMarks, draw_shape_path
from colloc.pictures.motion_frames import Frames, foot_kinds, frames, frames_of
from colloc.pictures.style import GREY, INK, ORANGE, SKY, VERMILION, styled
from colloc.results.body_marks import hinges
from colloc.results.motion import rotate
from colloc.results.solution import Solution
from colloc.system.arguments import checked_arguments
from colloc.system.errors import ProblemError
from colloc.system.files import replaced_file
from colloc.system.progress import StatusLine

_COLOURS = 64
_MOST_PICTURES = 5000


def pictures(
    solution: Solution,
    count: int,
    periods: int,
    *,
    arrows: bool = True,
    width: int = 900,
    from_rest: bool = False,
) -> Iterator[np.ndarray]:
    """Images ``(height, width, 3)`` of bytes, `count` a period, of an even width [pixels]."""
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
        self.shown, self.hinges = shown, hinges(body)
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
        middle, half = 0.5 * (low + high), 0.5 * scale * np.array([share * width, tall])
        for axis, a, b in zip("xy", middle - half, middle + half, strict=True):
            ticks = 0.2 * np.arange(np.ceil(a / 0.2), np.floor(b / 0.2) + 1)  # a grid of fifths
            axes.set(**{f"{axis}ticks": ticks, f"{axis}lim": (a, b)})
        axes.grid(color="#e8ecef", lw=0.8)
        axes.tick_params(length=0, labelbottom=False, labelleft=False)
        axes.spines[:].set_visible(False)
        verdict = "" if solution.status == "solved" else f"  ({solution.status})"
        value = f"{problem.objective.name} {solution.measured.value:.4f}"
        title = f"{problem.name}   {value}{verdict}"
        figure.text(0.015, 0.93, title, fontsize=11, weight="bold")
        self.phase = figure.text(share, 0.93, "", fontsize=10, color=GREY, ha="right")

        def line(*look: str, **more: Any) -> Any:
            return axes.plot([], [], *look, **more)[0]

        self.trails = [line(color=colour, lw=1) for colour in (SKY, ORANGE, VERMILION)]
        thickness = 0.72 * link_width(body) / scale or 4  # a pixel is 0.72 points
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
            # below a head's size the head shrinks too, so that weak friction looks weak
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
            force = shown.arrow_scale * rotate(shown.arrow[:, :, k], before.rotation)
            self.quiver.set_offsets(before.of(shown.arrow_base[:, :, k]).T)
            self.quiver.set_UVC(*force)
        if self.dot is not None:
            self.dot.set_data(shown.angles[:1, k], shown.angles[1:2, k])
        self.phase.set_text(f"t = {period + shown.t[k]:.2f} of {len(shown.before) * shown.t[-1]:g}")
        self.canvas.draw()
        return np.asarray(self.canvas.buffer_rgba())[: self.size[0], : self.size[1], :3].copy()


def write_gif(path: Path, pictures: Iterator[np.ndarray], fps: float) -> None:
    """Write a GIF that repeats for ever, with one palette."""
    from PIL import Image

    images = [Image.fromarray(picture) for picture in pictures]
    sample = np.concatenate([np.asarray(image) for image in images[:: max(1, len(images) // 4)]])
    palette = Image.fromarray(sample).quantize(_COLOURS)
    first, *others = (image.quantize(palette=palette, dither=0) for image in images)
    duration = max(20, 10 * round(100 / fps))  # the format counts hundredths of a second
    with replaced_file(path) as temporary:
        how = {"save_all": True, "append_images": others, "duration": duration, "loop": 0}
        first.save(temporary, format="GIF", **how)


def _ffmpeg() -> str:
    program = shutil.which("ffmpeg")
    if program is None:
        raise ProblemError(
            "MP4 needs the program ffmpeg, which is not installed; install it, or write a GIF: "
            "--format gif."
        )
    return program


def write_mp4(path: Path, pictures: Iterator[np.ndarray], fps: float) -> None:
    """Write H.264 video through ffmpeg."""
    first = next(pictures)
    raw = f"-f rawvideo -pix_fmt rgb24 -s {first.shape[1]}x{first.shape[0]} -r {fps:g} -i -"
    coded = "-an -c:v libx264 -pix_fmt yuv420p -movflags +faststart -f mp4"
    with replaced_file(path) as temporary:
        command = [_ffmpeg(), "-y", "-loglevel", "error", *f"{raw} {coded}".split(), temporary]
        with subprocess.Popen(command, stdin=subprocess.PIPE, stderr=subprocess.PIPE) as process:
            assert process.stdin is not None
            assert process.stderr is not None
            try:
                process.stdin.write(first.tobytes())
                for picture in pictures:
                    process.stdin.write(picture.tobytes())
                process.stdin.close()
            except BrokenPipeError:
                pass  # ffmpeg ended early; its own words follow
            complaint = process.stderr.read().decode(errors="replace").strip()
        if process.returncode:
            raise ProblemError(
                f"ffmpeg failed: {complaint.splitlines()[-1] if complaint else process.returncode}."
            )


@checked_arguments
def write_movie(
    solution: Solution,
    path: Path,
    *,
    periods: int = 2,
    seconds: float = 4.0,
    fps: float = 20.0,
    width: int = 900,
    arrows: bool = True,
    from_rest: bool = False,
    quiet: bool = True,
) -> Path:
    """Write the motion as GIF or MP4.

    Parameters
    ----------
    solution : Solution
    path : Path
        Ends in ``.gif`` or ``.mp4``.
    periods : int
    seconds : float
        Per period.
    fps : float
        Frames per second.
    width : int
        [pixels]
    arrows : bool
        Draw friction.
    from_rest : bool
        Show the first periods of a body with inertia that starts at rest.
    quiet : bool
        Show no progress.

    Raises
    ------
    ProblemError
        If a number or the ending of the path is unusable, there is no gait, or no ffmpeg for MP4.
    """
    count = round(seconds * fps) if np.isfinite(seconds * fps) else 0
    if periods < 1 or count < 2 or periods * count > _MOST_PICTURES:
        raise ProblemError(
            f"{periods} periods of {count:g} pictures cannot be drawn; change periods, seconds "
            f"or fps."
        )
    if not 200 <= width <= 4000:
        raise ProblemError(f"width must lie between 200 and 4000, not {width}.")
    writers = {".gif": write_gif, ".mp4": write_mp4}
    if path.suffix not in writers:
        raise ProblemError(f"{path} should end in .gif or .mp4.")
    solution.gait  # noqa: B018  raises where there is none
    if path.suffix == ".mp4":
        _ffmpeg()  # before anything is drawn
    even, total = 2 * (width // 2), periods * count
    drawn = pictures(solution, count, periods, arrows=arrows, width=even, from_rest=from_rest)

    def with_progress(line: StatusLine) -> Iterator[np.ndarray]:
        begin = time.monotonic()
        for k, picture in enumerate(drawn, 1):
            line.say(f"picture {k} of {total}", (time.monotonic() - begin) / k * (total - k))
            yield picture

    with StatusLine(enabled=not quiet) as line:
        writers[path.suffix](path, with_progress(line), fps)
    return path
