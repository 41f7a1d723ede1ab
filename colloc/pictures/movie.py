"""Animations as GIF, or as MP4 where ffmpeg is installed: the body on the plane with the friction
on its links, and beside it the path in shape space, or another gait."""

from __future__ import annotations

import shutil
import subprocess
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from colloc.mechanics.bodies import Body
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
from colloc.results.robot import in_si
from colloc.results.solution import Solution
from colloc.system.arguments import check_range, checked_arguments
from colloc.system.errors import ProblemError
from colloc.system.files import replaced_file
from colloc.system.progress import StatusLine

_ARROW = 0.12  # length of the arrow of the largest friction [body lengths]
_COLOURS, _MOST_PICTURES = 64, 5000


@dataclass(frozen=True, eq=False)
class Frames:
    """Positions in the lab of a cycle from phase 0 to 1, or of several from rest."""

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
    """Frames at `count` phases of a cycle, both ends included, or of another motion of the gait,
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


class _Scene:
    def __init__(
        self, axes: Axes, body: Body, frames: Frames, half: np.ndarray, grid: float
    ) -> None:
        self._shown, middle = frames, 0.5 * sum(frames.window)
        for axis, a, b in zip("xy", middle - half, middle + half, strict=True):
            ticks = grid * np.arange(np.ceil(a / grid), np.floor(b / grid) + 1)
            axes.set(**{f"{axis}ticks": ticks, f"{axis}lim": (a, b)})
        axes.grid(color="#e8ecef", lw=0.8)
        axes.tick_params(length=0, labelbottom=False, labelleft=False)
        axes.spines[:].set_visible(False)
        colours = (SKY, ORANGE, VERMILION)
        self._trails = [axes.plot([], [], color=colour, lw=1)[0] for colour in colours]
        self._marks = BodyMarks(axes, body, INK, (4, 5, 9, 5, 8), ("o", VERMILION))
        self._quiver: Any = None
        if key := self._marks.key():
            where: Any = {"loc": "lower right", "ncols": len(key), "borderaxespad": 0}
            axes.legend(key.values(), key.keys(), **where)

    def show_friction(self, axes: Axes, scale: float) -> None:
        base = self._shown.arrow_base[:, :, 0]
        self._scale = scale
        # below a head's size the head shrinks too, so that weak friction looks weak
        self._quiver = axes.quiver(
            *base, *base, color=VERMILION, angles="xy", scale_units="xy", scale=1,
            width=0.0024, headwidth=4, headlength=5, zorder=4,
        )  # fmt: skip

    def draw(self, number: int) -> np.ndarray:
        frames, motion = self._shown, self._shown.motion
        period, k = divmod(number, motion.t.size - 1)
        before = frames.before[period]
        at = (frames.ends[:, :, k], motion.centre[:, k], frames.feet[..., k])
        self._marks.place(map(before.of, at), frames.holding[:, k])
        paths = frames.ends[:, 0], frames.ends[:, -1], motion.centre
        for trail, path in zip(self._trails, paths, strict=True):
            past = [earlier.of(path) for earlier in frames.before[:period]]
            trail.set_data(*np.concatenate([*past, before.of(path[:, : k + 1])], axis=1))
        if self._quiver is not None:
            self._quiver.set_offsets(before.of(frames.arrow_base[:, :, k]).T)
            forces = self._scale * rotate(frames.arrow[:, :, k], before.rotation)
            self._quiver.set_UVC(*forces)
        return motion.angles[:, k]


def pictures(
    solution: Solution,
    count: int,
    periods: int,
    *,
    arrows: bool = True,
    width: int = 900,
    from_rest: bool = False,
    beside: Solution | None = None,
    names: Sequence[str] = (),
) -> Iterator[np.ndarray]:
    """Images ``(height, width, 3)`` of bytes, `count` in the longer period, of an even width
    [pixels]; else as of `write_movie`."""
    both = [each for each in (solution, beside) if each is not None]
    alone, facts = beside is None, [in_si(each) for each in both]
    real = all(facts)
    sizes = [each.problem.robot.length if real else 1.0 for each in both]  # type: ignore[union-attr]
    times = [each["period_s"] if real else 1.0 for each in facts]
    shots = []
    for each, seconds in zip(both, times, strict=True):
        a_period = max(2, round(count * seconds / max(times)))
        number = -(-periods * count // a_period)
        if from_rest:
            motion = each.from_rest(np.linspace(0.0, number, number * a_period + 1))
            shots.append(frames(each, periods=1, motion=motion))
        else:
            shots.append(frames(each, a_period + 1, periods=number))
    planar = alone and solution.problem.gait.free and solution.problem.body.n_joint >= 2
    share = 0.68 if planar else 0.97 if alone else 0.48
    windows = (np.subtract(*each.window[::-1]) for each in shots)
    span = np.max([size * wide for size, wide in zip(sizes, windows, strict=True)], axis=0)
    tall = float(np.clip(span[1] / span[0], 0.4, 0.9)) * share * width
    height = 2 * round((tall + 0.13 * width) / 2)
    scale = max(span[0] / (share * width), span[1] / tall)  # lengths of a pixel
    strength, small = min(each.arrow_scale for each in shots), min(1.0, width / 640)
    with figure_style():
        figure = Figure(figsize=(width / 100, height / 100), dpi=100)
        figure.set_layout_engine("none")
        canvas, scenes = FigureCanvasAgg(figure), []
        for k, (each, size, one) in enumerate(zip(both, sizes, shots, strict=True)):
            left, bottom = 0.015 + 0.495 * k, 0.03 if alone else 0.095 * width / height
            axes = figure.add_axes((left, bottom, share, tall / height))
            half = 0.5 * scale / size * np.array([share * width, tall])
            scenes.append(_Scene(axes, each.problem.body, one, half, 0.1 / size if real else 0.2))
            if arrows:
                scenes[-1].show_friction(axes, strength)
            title = f"{names[k] if names else each.problem.name}   "
            value = f"{each.problem.objective.name} {each.measured.value:.4f}"
            value += "" if each.success else f"  ({each.status})"
            speed = f"{100 * facts[k]['speed_m_per_s']:.3g} cm/s" if real else ""
            squares = "   (squares of 10 cm)" * real
            if alone:
                value = speed + squares if real else value
                figure.text(left, 0.93, title + value, fontsize=11 * small, weight="bold")
                continue
            way = f"{each.distance:.4f} body lengths per cycle"
            if real:
                way = f"{speed}, {times[k]:.3g} s per cycle"
            upper, lower = 0.085 * width / height, 0.055 * width / height
            figure.text(left, upper, title + squares, fontsize=11 * small, weight="bold", va="top")
            figure.text(left, lower, f"{way}; {value}", fontsize=9 * small, va="top")
        right, unit = (share if alone else 0.99), " s" if real else ""
        top = 0.93 if alone else 1 - 0.028 * width / height
        clock = figure.text(right, top, "", fontsize=10 * small, color=GREY, ha="right")
        if planar:
            plane = figure.add_axes((0.77, 0.2, 0.2, 0.62))
            draw_shape_path(plane, solution)
            plane.tick_params(labelsize=8 * small)
            for axis in (plane.xaxis, plane.yaxis):
                axis.label.set_fontsize(8 * small)
                for text in axis.get_ticklabels()[1::2]:  # a narrow film has no room for all
                    text.set_visible(False)
            (dot,) = plane.plot([], [], "o", color=VERMILION, mec="white", ms=8, zorder=5)
        for number in range(periods * count):
            for scene in scenes:
                angles = scene.draw(number)
            if planar:
                dot.set_data(angles[:1], angles[1:2])
            now, whole = (max(times) * x for x in (number / count, periods))
            clock.set_text(f"t = {now:.2f} of {whole:.4g}{unit}")
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
    seconds: float | None = None,
    fps: float = 20.0,
    width: int = 900,
    arrows: bool = True,
    from_rest: bool = False,
    beside: Solution | None = None,
    names: Sequence[str] = (),
    quiet: bool = True,
) -> Path:
    """Write the motion as GIF or MP4.

    Parameters
    ----------
    solution : Solution
    path : Path
        Ends in ``.gif`` or ``.mp4``.
    periods : int
    seconds : float, optional
        Per period; by default as long as a robot takes, up to 20, or 4.
    fps : float
        Frames per second.
    width : int
        [pixels]
    arrows : bool
        Draw friction.
    from_rest : bool
        Show the first periods of a body with inertia that starts at rest.
    beside : Solution, optional
        Another gait, shown at the same scale and time: body lengths and periods, or metres and
        seconds where both problems state a robot; `seconds` are of the longer period then.
    names : sequence of str
        What stands at both gaits, by default the names of their problems.
    quiet : bool
        Show no progress.

    Raises
    ------
    ProblemError
        If a number or the ending of the path is unusable, there is no gait, or no ffmpeg for MP4.
    """
    both = [each for each in (solution, beside) if each is not None]
    if seconds is None:
        real = [facts["period_s"] for facts in map(in_si, both) if facts]
        seconds = float(np.clip(max(real), 1.0, 20.0)) if real else 4.0
    count = round(seconds * fps) if np.isfinite(seconds * fps) else 0
    if periods < 1 or count < 2 or periods * count > _MOST_PICTURES:
        raise ProblemError(
            f"{periods} cycles of {count:g} frames cannot be drawn; change periods, seconds or fps."
        )
    check_range(200, 4000, width=width)
    writers = {".gif": write_gif, ".mp4": write_mp4}
    if path.suffix not in writers:
        raise ProblemError(f"{path} should end in .gif or .mp4.")
    for each in both:
        each.gait  # noqa: B018  raises where there is none
    begin, even, total = time.monotonic(), 2 * (width // 2), periods * count

    def with_progress(line):
        how: Any = {"arrows": arrows, "width": even, "from_rest": from_rest}
        drawn = pictures(solution, count, periods, **how, beside=beside, names=names)
        for k, picture in enumerate(drawn, 1):
            line.say(f"frame {k} of {total}", (time.monotonic() - begin) / k * (total - k))
            yield picture

    with StatusLine(enabled=not quiet) as line:
        writers[path.suffix](path, with_progress(line), fps)
    return path
