"""Animations as GIF, or as MP4 where ffmpeg is installed: the body on the plane with the friction
on its links, and the path in shape space beside it."""

from __future__ import annotations

import shutil
import subprocess
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from colloc.pictures.figure import BodyMarks, draw_shape_path
from colloc.pictures.style import GREY, INK, ORANGE, SKY, VERMILION, figure_style
from colloc.results.motion import (
    RigidMotion,
    SampledMotion,
    friction_arrows,
    lab_feet,
    lab_outline,
    rotate,
)
from colloc.results.solution import SOLVED, Solution
from colloc.system.arguments import checked_arguments
from colloc.system.errors import ProblemError
from colloc.system.files import replaced_file
from colloc.system.progress import StatusLine

_ARROW = 0.12  # length of the arrow of the largest friction [body lengths]
_COLOURS, _MOST_PICTURES = 64, 5000


@dataclass(frozen=True, eq=False)
class Frames:
    """Positions in the lab of a period from phase 0 to 1, or of several from rest."""

    motion: SampledMotion
    ends: np.ndarray  # (2, n_point, n_time), outline, tail first
    arrow_base: np.ndarray  # (2, n_arrow, n_time), where friction is shown
    arrow: np.ndarray  # (2, n_arrow, n_time), force per length
    holding: np.ndarray  # (n_foot, n_time), feet that stick
    feet: np.ndarray  # (2, 2, n_foot, n_time), both their ends
    before: tuple[RigidMotion, ...]  # of the periods before each one that is shown

    @property
    def window(self) -> tuple[np.ndarray, np.ndarray]:
        """Low and high corner ``(2,)`` of all periods with their arrows."""
        ends = self.ends.reshape(2, -1)
        reach = np.concatenate([moved.of(ends) for moved in self.before], axis=1)
        return reach.min(axis=1) - _ARROW, reach.max(axis=1) + _ARROW

    @property
    def arrow_scale(self) -> float:
        """Length of an arrow [body lengths] per force."""
        return _ARROW / max(float(np.hypot(*self.arrow).max()), 1e-300)


def frames(
    solution: Solution,
    count: int = 241,
    arrows: int = 12,
    periods: int = 3,
    motion: SampledMotion | None = None,
) -> Frames:
    """Frames at `count` phases of a period, both ends included, or of another motion of the gait,
    with about so many arrows of friction."""
    problem, body = solution.problem, solution.problem.body
    motion = motion or solution.sample(np.linspace(0.0, 1.0, count))
    at = (motion.angles, motion.rates, solution.delta_per_period, motion.z)
    places, forces = friction_arrows(body, problem.law, *at, arrows)
    way = complex(*(motion.centre[:, -1] - motion.centre[:, 0]))
    period = RigidMotion(float(motion.theta[-1] - motion.theta[0]), way)
    return Frames(
        motion,
        lab_outline(body, motion),
        motion.tail[:, None] + rotate(places, motion.theta),
        rotate(forces, motion.theta),
        solution.holding(motion),
        lab_feet(body, motion),
        tuple(period.repeat(k) for k in range(periods)),
    )


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
    problem, body = solution.problem, solution.problem.body
    if from_rest:
        motion = solution.from_rest(np.linspace(0.0, periods, periods * count + 1))
        shown = frames(solution, periods=1, motion=motion)
    else:
        shown = frames(solution, count + 1, periods=periods)
    motion, (low, high) = shown.motion, shown.window
    planar = problem.gait.free and body.n_joint >= 2
    share, span = 0.68 if planar else 0.97, high - low
    tall = float(np.clip(span[1] / span[0], 0.4, 0.9)) * share * width
    height = 2 * round((tall + 0.13 * width) / 2)
    scale = max(span[0] / (share * width), span[1] / tall)  # body lengths of a pixel
    middle, half = 0.5 * (low + high), 0.5 * scale * np.array([share * width, tall])
    verdict = "" if solution.status == SOLVED else f"  ({solution.status})"
    title = f"{problem.name}   {problem.objective.name} {solution.measured.value:.4f}{verdict}"
    with figure_style():
        figure = Figure(figsize=(width / 100, height / 100), dpi=100)
        figure.set_layout_engine("none")
        canvas = FigureCanvasAgg(figure)
        axes = figure.add_axes((0.015, 0.03, share, tall / height))
        for axis, a, b in zip("xy", middle - half, middle + half, strict=True):
            ticks = 0.2 * np.arange(np.ceil(a / 0.2), np.floor(b / 0.2) + 1)  # a grid of fifths
            axes.set(**{f"{axis}ticks": ticks, f"{axis}lim": (a, b)})
        axes.grid(color="#e8ecef", lw=0.8)
        axes.tick_params(length=0, labelbottom=False, labelleft=False)
        axes.spines[:].set_visible(False)
        figure.text(0.015, 0.93, title, fontsize=11, weight="bold")
        phase = figure.text(share, 0.93, "", fontsize=10, color=GREY, ha="right")
        colours = (SKY, ORANGE, VERMILION)
        trails = [axes.plot([], [], color=colour, lw=1)[0] for colour in colours]
        marks = BodyMarks(axes, body, INK, (4, 5, 9, 5, 8), ("o", VERMILION))
        if key := marks.key():
            where: Any = {"loc": "lower right", "ncols": len(key), "borderaxespad": 0}
            axes.legend(key.values(), key.keys(), **where)
        if arrows:
            base = shown.arrow_base[:, :, 0]
            # below a head's size the head shrinks too, so that weak friction looks weak
            quiver = axes.quiver(
                *base, *base, color=VERMILION, angles="xy", scale_units="xy", scale=1,
                width=0.0024, headwidth=4, headlength=5, zorder=4,
            )  # fmt: skip
        if planar:
            plane = figure.add_axes((0.755, 0.2, 0.235, 0.62))
            draw_shape_path(plane, solution)
            (dot,) = plane.plot([], [], "o", color=VERMILION, mec="white", ms=8, zorder=5)
        whole = f"{len(shown.before) * motion.t[-1]:g}"
        for number in range(periods * count):
            period, k = divmod(number, motion.t.size - 1)
            before = shown.before[period]
            at = (shown.ends[:, :, k], motion.centre[:, k], shown.feet[..., k])
            marks.place(map(before.of, at), shown.holding[:, k])
            paths = shown.ends[:, 0], shown.ends[:, -1], motion.centre
            for trail, path in zip(trails, paths, strict=True):
                past = [earlier.of(path) for earlier in shown.before[:period]]
                trail.set_data(*np.concatenate([*past, before.of(path[:, : k + 1])], axis=1))
            if arrows:
                quiver.set_offsets(before.of(shown.arrow_base[:, :, k]).T)
                quiver.set_UVC(*shown.arrow_scale * rotate(shown.arrow[:, :, k], before.rotation))
            if planar:
                dot.set_data(motion.angles[:1, k], motion.angles[1:2, k])
            phase.set_text(f"t = {period + motion.t[k]:.2f} of {whole}")
            canvas.draw()
            yield np.asarray(canvas.buffer_rgba())[:height, :width, :3].copy()


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


def write_mp4(path: Path, pictures: Iterator[np.ndarray], fps: float) -> None:
    ffmpeg = shutil.which("ffmpeg")
    if ffmpeg is None:
        raise ProblemError(
            "MP4 needs the program ffmpeg, which is not installed; install it, or write a GIF: "
            "--format gif."
        )
    first = next(pictures)
    raw = f"-f rawvideo -pix_fmt rgb24 -s {first.shape[1]}x{first.shape[0]} -r {fps:g} -i -"
    coded = "-an -c:v libx264 -pix_fmt yuv420p -movflags +faststart -f mp4"
    with replaced_file(path) as temporary:
        command = [ffmpeg, "-y", "-loglevel", "error", *f"{raw} {coded}".split(), temporary]
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
            why = complaint.splitlines()[-1] if complaint else process.returncode
            raise ProblemError(f"ffmpeg failed: {why}.")


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
    begin, even, total = time.monotonic(), 2 * (width // 2), periods * count

    def with_progress(line: StatusLine) -> Iterator[np.ndarray]:
        drawn = pictures(solution, count, periods, arrows=arrows, width=even, from_rest=from_rest)
        for k, picture in enumerate(drawn, 1):
            line.say(f"picture {k} of {total}", (time.monotonic() - begin) / k * (total - k))
            yield picture

    with StatusLine(enabled=not quiet) as line:
        writers[path.suffix](path, with_progress(line), fps)
    return path
