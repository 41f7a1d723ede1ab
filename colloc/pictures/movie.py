"""Pictures of an animation as a GIF, or as an MP4 where ffmpeg is installed."""

from __future__ import annotations

import shutil
import subprocess
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from colloc.pictures.animation import pictures
from colloc.results.solution import Solution
from colloc.system.arguments import checked_arguments
from colloc.system.errors import ProblemError
from colloc.system.files import replaced_file
from colloc.system.progress import StatusLine

_COLOURS = 64
_MOST_PICTURES = 5000


def write_gif(path: Path, pictures: Iterator[np.ndarray], fps: float) -> None:
    """Write pictures as a GIF that repeats for ever; all share the palette of the first one with
    some of the others'."""
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
    """Write pictures as H.264 video through ffmpeg. `ProblemError` if ffmpeg is not installed, or
    fails."""
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
    """Write the motion as GIF or MP4, by the suffix of `path`.

    Parameters
    ----------
    solution : Solution
    path : Path
        Ends in ``.gif`` or ``.mp4``.
    periods : int
        Periods in a row.
    seconds : float
        A period takes.
    fps : float
        Pictures a second.
    width : int
        Pixels.
    arrows : bool
        Draw friction.
    from_rest : bool
        Show the first periods of a body with inertia, which is at rest before, instead of those
        that are all alike.
    quiet : bool
        Say nothing while it is drawn, also on a terminal.

    Raises
    ------
    ProblemError
        If a number or the ending of the path is unusable, the solution holds no gait, or MP4 is
        asked for without ffmpeg.
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
    drawn = pictures(
        solution, count, periods, arrows=arrows, width=2 * (width // 2), from_rest=from_rest
    )
    with StatusLine(enabled=not quiet) as line:
        writers[path.suffix](path, _with_progress(drawn, periods * count, line), fps)
    return path


def _with_progress(
    pictures: Iterator[np.ndarray], total: int, line: StatusLine
) -> Iterator[np.ndarray]:
    begin = time.monotonic()
    for done, picture in enumerate(pictures, 1):
        line.say(f"picture {done} of {total}", (time.monotonic() - begin) / done * (total - done))
        yield picture
