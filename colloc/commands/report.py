"""Command line: a self-contained web page about a result, and its figures one by one for a
publication.

Exit codes: 0 written, 2 bad file or option.
"""

from __future__ import annotations

import argparse
from pathlib import Path

from colloc.commands.ending import OK, command
from colloc.commands.options import (
    add_pace,
    add_printing,
    add_result,
    add_robot,
    new_parser,
    output_path,
    pace_options,
    robot_options,
    tell,
)
from colloc.gaits.problem_file import Reference
from colloc.pictures.report_page import write_report
from colloc.results.robot import Robot
from colloc.results.solution import Solution
from colloc.results.store import load
from colloc.system.errors import ProblemError
from colloc.system.progress import StatusLine

_EPILOG = """\
The page needs no network and no other file: film with friction, robot, shape space, speeds, power,
certificate, convergence, mesh, problem source, versions, and how to reproduce it. Results that
failed get a page too.

  colloc report results/three_link.h5                 results/three_link.html
  colloc report results/three_link.h5 --figures       also PDF and PNG of each panel
  colloc report results/three_link.h5 --length 1.2 --mass 3 --period 5   of a robot"""


def _parser() -> argparse.ArgumentParser:
    parser = new_parser("report", "Write one self-contained web page about a result.", _EPILOG)
    add_result(parser)
    parser.add_argument(
        "--problem",
        metavar="FILE.py",
        help="problem file whose REFERENCE to hold the result against",
    )
    parser.add_argument(
        "--figures",
        action="store_true",
        help="also write publication figures, PDF and PNG, one panel each",
    )
    add_robot(parser)
    add_pace(parser)
    parser.add_argument(
        "--output", metavar="PATH", help="folder, or .html file (default: beside the result)"
    )
    add_printing(parser)
    return parser


@command(_parser)
def main(options: argparse.Namespace) -> int:
    source = Path(options.result)
    solution = load(source)
    path = output_path(options.output, source.with_suffix(".html"))
    with StatusLine(enabled=not (options.quiet or options.json)) as line:
        line.say("writing the page")
        write_report(
            solution,
            path,
            _reference(options.problem),
            source.parent,
            robot=_robot(solution, options),
        )
        figures: list[Path] = []
        if options.figures:
            from colloc.pictures.publication import save_panels

            line.say("drawing the figures")
            figures = save_panels(solution, path.with_suffix(""))
    size = path.stat().st_size
    facts = {
        "status": "written",
        "file": str(path),
        "bytes": size,
        "figures": [str(f) for f in figures],
    }
    saved = f"saved {path} ({size / 1000:.0f} kB, self-contained)"
    tell(options, facts, [saved, *(f"  {figure}" for figure in figures)])
    return OK


def _robot(solution: Solution, options: argparse.Namespace) -> Robot | None:
    size, pace = robot_options(options), pace_options(options)
    if not size and not any(value is not None for value in pace.values()):
        return None
    if not size or options.period is None:
        raise ProblemError("the page of a robot needs --length, --mass and --period.")
    return Robot(solution, **size, **pace)


def _reference(problem_file: str | None) -> Reference | None:
    if problem_file is None:
        return None
    from colloc.gaits.problem_file import read_problem_file

    return read_problem_file(problem_file).reference
