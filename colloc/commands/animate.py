"""Command line: the motion of a result as a GIF, or as an MP4 where ffmpeg is installed.

Exit codes: 0 written, 2 bad file or option.
"""

from __future__ import annotations

import argparse
from pathlib import Path

from colloc.commands.ending import OK, command
from colloc.commands.options import (
    add_printing,
    add_result,
    new_parser,
    output_kind,
    output_path,
    tell,
)
from colloc.results.store import load

_EPILOG = """\
Orange arrows are the friction on the links; the large disc is the head; the small plane shows the
first two joint angles.

  colloc animate results/three_link.h5                            results/three_link.gif
  colloc animate results/three_link.h5 --format mp4 --fps 50      needs ffmpeg
  colloc animate results/three_link.h5 --periods 4 --seconds 2 --no-arrows"""


def _parser() -> argparse.ArgumentParser:
    parser = new_parser("animate", "Draw the motion of a result as a GIF or MP4.", _EPILOG)
    add_result(parser)
    parser.add_argument(
        "--format", choices=("gif", "mp4"), help="default: by the suffix of --output, else gif"
    )
    parser.add_argument(
        "--periods", type=int, default=2, metavar="N", help="periods in a row (default: 2)"
    )
    parser.add_argument(
        "--seconds", type=float, default=4.0, metavar="S", help="a period takes (default: 4)"
    )
    parser.add_argument(
        "--fps", type=float, default=20.0, metavar="N", help="pictures a second (default: 20)"
    )
    parser.add_argument("--width", type=int, default=900, metavar="PIXELS", help="default: 900")
    parser.add_argument(
        "--from-rest",
        action="store_true",
        help="with inertia: the first periods of a body that is at rest before",
    )
    parser.add_argument("--no-arrows", action="store_true", help="do not draw friction")
    parser.add_argument(
        "--output", metavar="PATH", help="folder or file (default: beside the result)"
    )
    add_printing(parser)
    return parser


@command(_parser)
def main(options: argparse.Namespace) -> int:
    source = Path(options.result)
    solution = load(source)
    path = output_path(
        options.output, source.with_suffix(f".{output_kind(options, ('gif', 'mp4'))}")
    )
    settings = {
        "periods": options.periods,
        "seconds": options.seconds,
        "fps": options.fps,
        "width": options.width,
    }
    settings["from_rest"] = options.from_rest
    # heavy imports only now: a bad option is refused at once
    from colloc.pictures.movie import (
        write_movie,
    )

    write_movie(
        solution,
        path,
        **settings,
        arrows=not options.no_arrows,
        quiet=options.quiet or options.json,
    )
    size = path.stat().st_size
    tell(
        options,
        {"status": "written", "file": str(path), "bytes": size},
        [f"saved {path} ({size / 1000:.0f} kB)"],
    )
    return OK
