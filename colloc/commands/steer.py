"""Command line: gaits of a problem that turn by given angles a period, in one file that a
controller can interpolate.

Exit codes: 0 every gait certified, 2 bad problem or option, 3 not converged, 4 a gait is not
certified, 130 interrupted.
"""

from __future__ import annotations

import argparse
import json
import math
from pathlib import Path

from colloc.commands.ending import FAILED, OK, command, said_if_interrupted
from colloc.commands.options import (
    add_printing,
    add_problem,
    changed,
    new_parser,
    output_path,
    tell,
)
from colloc.commands.summary import kept_facts, kept_lines
from colloc.gaits.problem import Problem
from colloc.gaits.problem_file import ProblemFile, read_problem_file
from colloc.results.solution import Solution
from colloc.system.errors import ProblemError
from colloc.system.progress import StatusLine
from colloc.system.replaced_file import replaced_file

_TURNS = (-30.0, -15.0, 0.0, 15.0, 30.0)
_EPILOG = """\
Positive angles turn left, counter-clockwise. The problem states the gait that goes straight. Every
gait is a result like any other: NAME.steer/00.h5 turns right the most. NAME.steer.json holds all
their joint angles at equal phases: a controller interpolates between two turns. --spot adds the
gaits of least work for their turn, NAME.steer/spot_00.h5 and so on. Chord and radius are those of
the arc that a period crawls, whatever phase it is begun at.

  colloc steer problems/three_link.py
  colloc steer mine.py --turn -40 -20 -10 0 10 20 40 --spot -30 30"""


def _parser() -> argparse.ArgumentParser:
    parser = new_parser(
        "steer",
        "Find certified gaits from sharp right to sharp left, each from its neighbour.",
        _EPILOG,
    )
    add_problem(parser)
    default = " ".join(f"{turn:g}" for turn in _TURNS)
    parser.add_argument(
        "--turn",
        type=float,
        nargs="+",
        metavar="DEG",
        default=list(_TURNS),
        help=f"of a period (default: {default})",
    )
    parser.add_argument(
        "--spot",
        type=float,
        nargs="+",
        metavar="DEG",
        default=[],
        help="turns on the spot, with the least work",
    )
    parser.add_argument(
        "--starts", type=int, metavar="N", help="starts to find the straight gait of (default: 32)"
    )
    parser.add_argument(
        "--output", metavar="PATH", help="folder, or .json file (default: results/NAME.steer.json)"
    )
    parser.add_argument("--no-figure", action="store_true", help="do not draw NAME.steer.png")
    add_printing(parser)
    return parser


@command(_parser)
def main(options: argparse.Namespace) -> int:
    if options.starts is not None and options.starts < 1:
        raise ProblemError(f"--starts must be at least 1, not {options.starts}.")
    if not all(abs(turn) < 180 for turn in (*options.turn, *options.spot)) or 0 in options.spot:
        raise ProblemError(
            "--turn and --spot take degrees between -180 and 180, --spot not 0: by more a body "
            "could turn the other way."
        )
    stated = read_problem_file(options.problem)
    problem = changed(stated.problem, options)
    table = output_path(options.output, Path("results") / f"{problem.name}.steer.json")
    from colloc.studies.saved import members_kept

    with members_kept(table.with_suffix("")):
        return _steered(options, stated, problem, table)


def _steered(
    options: argparse.Namespace, stated: ProblemFile, problem: Problem, table: Path
) -> int:
    from colloc.results.kept import save_result
    from colloc.search.explore import STARTS
    from colloc.studies.steering import steer

    with StatusLine(enabled=not (options.quiet or options.json)) as line:
        line.say(f"{problem.name}: the straight gait")

        def told(turn: float, found: Solution) -> None:
            line.say(f"{problem.name}: {math.degrees(turn):+.4g} degrees a period: {found}")

        turns, spot = (
            [math.radians(turn) for turn in each] for each in (options.turn, options.spot)
        )
        family = steer(
            problem,
            turns,
            spot=spot,
            starts=options.starts or stated.starts or STARTS,
            progress=told,
        )
    kept, rows = [], []
    spots = () if family.on_the_spot is None else family.on_the_spot.points
    named = [(f"{k:02d}", point) for k, point in enumerate(family.points)]
    for name, point in [*named, *((f"spot_{k:02d}", point) for k, point in enumerate(spots))]:
        point.source = stated.source
        kept += (saved := save_result(point, table.with_suffix("") / f"{name}.h5"))
        arc = point.arc
        radius = f"{arc.radius:8.4f}" if math.isfinite(arc.radius) else "       -"
        rows.append(
            f"  {math.degrees(arc.angle):+7.2f}°  radius {radius}  chord {arc.chord:.6f}  work "
            f"{point.work:.6f}"
            f"  efficiency {arc.chord / point.work:.6f}  {point.status}  {saved[0].path}"
        )
    facts = family.table() | {"efficiency": family.efficiency.tolist()}
    with replaced_file(table) as temporary:
        Path(temporary).write_text(json.dumps(facts) + "\n", encoding="utf-8")
    files = [table]
    if not options.no_figure:
        from colloc.pictures.style import save as save_figure

        with said_if_interrupted([str(table)]):
            files += save_figure(family.plot(), table.with_suffix(""), ("png",))
    lines = [
        f"{problem.name}: {len(rows)} gaits that steer",
        *rows,
        f"  saved {', '.join(map(str, files))}",
        *kept_lines(kept),
    ]
    tell(options, facts | {"file": str(table), "kept": kept_facts(kept)}, lines)
    return OK if family.certified else FAILED
