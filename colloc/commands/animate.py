"""Command line: the motion of a result as a GIF, or as an MP4 where ffmpeg is installed.

Exit codes: 0 written, 2 bad file or option.
"""

from __future__ import annotations

import argparse
import shutil
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from colloc.commands.ending import OK, run
from colloc.commands.options import add_result, new_parser, output_kind, output_path
from colloc.results.relaxed_solution import RelaxedSolution
from colloc.results.relaxed_store import is_relaxed, load_relaxed
from colloc.results.solution import Solution
from colloc.results.store import load
from colloc.system.errors import ProblemError
from colloc.system.progress import StatusLine
from colloc.system.replaced_file import replaced_file

_EPILOG = """\
Orange arrows are the friction on the links; the large disc is the head; the small plane shows the first two joint angles.

  colloc animate results/three_link.h5                            results/three_link.gif
  colloc animate results/three_link.h5 --format mp4 --fps 50      needs ffmpeg
  colloc animate results/three_link.h5 --periods 4 --seconds 2 --no-arrows"""
_COLOURS = 64
_MOST_PICTURES = 5000


def _parser() -> argparse.ArgumentParser:
    parser = new_parser("animate", "Draw the motion of a result as a GIF or MP4.", _EPILOG)
    add_result(parser)
    parser.add_argument("--format", choices=("gif", "mp4"), help="default: by the suffix of --output, else gif")
    parser.add_argument("--periods", type=int, default=2, metavar="N", help="periods in a row (default: 2)")
    parser.add_argument("--seconds", type=float, default=4.0, metavar="S", help="a period takes (default: 4)")
    parser.add_argument("--fps", type=float, default=20.0, metavar="N", help="pictures a second (default: 20)")
    parser.add_argument("--width", type=int, default=900, metavar="PIXELS", help="default: 900")
    parser.add_argument("--no-arrows", action="store_true", help="do not draw friction")
    parser.add_argument("--output", metavar="PATH", help="folder or file (default: beside the result)")
    return parser


def write_gif(path: Path, pictures: Iterator[np.ndarray], fps: float) -> None:
    """Write pictures as a GIF that repeats for ever; all share the palette of the first one with some of the others'."""
    from PIL import Image

    images = [Image.fromarray(picture) for picture in pictures]
    sample = np.concatenate([np.asarray(image) for image in images[:: max(1, len(images) // 4)]])
    palette = Image.fromarray(sample).quantize(_COLOURS)
    flat = [image.quantize(palette=palette, dither=Image.Dither.NONE) for image in images]
    duration = max(20, 10 * round(100 / fps))  # the format counts hundredths of a second
    with replaced_file(path) as temporary:
        flat[0].save(temporary, format="GIF", save_all=True, append_images=flat[1:], duration=duration, loop=0)


def _ffmpeg() -> str:
    program = shutil.which("ffmpeg")
    if program is None:
        raise ProblemError("MP4 needs the program ffmpeg, which is not installed; install it, or write a GIF: --format gif.")
    return program


def write_mp4(path: Path, pictures: Iterator[np.ndarray], fps: float) -> None:
    """Write pictures as H.264 video through ffmpeg.

    Raises
    ------
    ProblemError
        If ffmpeg is not installed, or fails.
    """
    ffmpeg = _ffmpeg()
    first = next(pictures)
    size = f"{first.shape[1]}x{first.shape[0]}"
    raw = ["-f", "rawvideo", "-pix_fmt", "rgb24", "-s", size, "-r", f"{fps:g}", "-i", "-"]
    coded = ["-an", "-c:v", "libx264", "-pix_fmt", "yuv420p", "-movflags", "+faststart", "-f", "mp4"]
    with replaced_file(path) as temporary:
        command = [ffmpeg, "-y", "-loglevel", "error", *raw, *coded, temporary]
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
            raise ProblemError(f"ffmpeg failed: {complaint.splitlines()[-1] if complaint else process.returncode}.")


def animate(
    solution: Solution | RelaxedSolution,
    path: Path,
    *,
    periods: int = 2,
    seconds: float = 4.0,
    fps: float = 20.0,
    width: int = 900,
    arrows: bool = True,
) -> Path:
    """Write the motion as GIF or MP4, by the suffix of `path`.

    Parameters
    ----------
    solution : Solution or RelaxedSolution
    path : Path
        Ends in ``.gif`` or ``.mp4``.
    periods : int
        Periods in a row; one where the body turns.
    seconds : float
        A period takes.
    fps : float
        Pictures a second.
    width : int
        Pixels.
    arrows : bool
        Draw friction.

    Raises
    ------
    ProblemError
        If a number is unusable, the solution holds no gait, or MP4 is asked for without ffmpeg.
    """
    count = round(seconds * fps) if np.isfinite(seconds * fps) else 0
    if periods < 1 or count < 2 or periods * count > _MOST_PICTURES:
        raise ProblemError(f"{periods} periods of {count} pictures cannot be drawn; change --periods, --seconds or --fps.")
    if not 200 <= width <= 4000:
        raise ProblemError(f"--width must lie between 200 and 4000, not {width}.")
    solution.gait  # noqa: B018  raises where there is none
    if path.suffix == ".mp4":
        _ffmpeg()  # before anything is drawn
    from colloc.pictures.animation import pictures

    drawn = pictures(solution, count, periods, arrows=arrows, width=2 * (width // 2))
    with StatusLine() as line:
        counted = _counted(drawn, periods * count, line)
        (write_mp4 if path.suffix == ".mp4" else write_gif)(path, counted, fps)
    return path


def _counted(pictures: Iterator[np.ndarray], total: int, line: StatusLine) -> Iterator[np.ndarray]:
    begin = time.monotonic()
    for done, picture in enumerate(pictures, 1):
        line.say(f"picture {done} of {total}", (time.monotonic() - begin) / done * (total - done))
        yield picture


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line; returns the exit code."""
    return run(_parser(), _animate, arguments)


def _animate(options: argparse.Namespace) -> int:
    source = Path(options.result)
    solution = load_relaxed(source) if is_relaxed(source) else load(source)
    path = output_path(options.output, source.with_suffix(f".{output_kind(options, ('gif', 'mp4'))}"))
    settings = {"periods": options.periods, "seconds": options.seconds, "fps": options.fps, "width": options.width}
    animate(solution, path, **settings, arrows=not options.no_arrows)
    print(f"saved {path} ({path.stat().st_size / 1000:.0f} kB)")
    return OK


if __name__ == "__main__":
    sys.exit(main())
