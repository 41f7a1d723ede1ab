"""Command line: what a gait of one's own achieves, from a file of joint angles over time; a result
like any other.

Exit codes: 0 all checks hold, 2 bad problem, file or option, 3 not replayed, 4 a check fails.
"""

from __future__ import annotations

import argparse
import re
from pathlib import Path

from colloc.commands.ending import command
from colloc.commands.options import add_printing, add_verbose, new_parser, output_path, tell
from colloc.commands.solve import EXIT
from colloc.commands.summary import kept_facts, kept_lines, summary_dict, summary_lines
from colloc.gaits.problem_file import read_problem_file
from colloc.results.kept import save_result

_EPILOG = """\
The file has a line for each instant: its time, then the angle of each joint. Columns are known by
their names (joint_1 at the tail, joint_2, ...; units as _deg, [deg], time_ms), in any order;
without names they go from tail to head. Delimiters, decimal commas, comments and other columns are
seen to, and one line says what was taken. Angles are radians unless names or --degrees say
otherwise. What colloc export writes can be read. Errors hold what the samples are off by, with two
standard deviations.

  colloc evaluate problems/three_link.py mine.csv                          results/mine-evaluated.h5
  colloc compare results/mine-evaluated.h5 results/three_link.h5
  colloc animate results/mine-evaluated.h5"""


def _parser() -> argparse.ArgumentParser:
    parser = new_parser(
        "evaluate",
        "What a gait of your own achieves: replayed, certified, saved as a result.",
        _EPILOG,
    )
    parser.add_argument(
        "problem", help="a Python file that states PROBLEM: body, friction and limits are meant"
    )
    parser.add_argument("gait", metavar="GAIT.csv", help="times and joint angles")
    parser.add_argument(
        "--period",
        type=float,
        metavar="T",
        help="in the file's unit of time (default: as it repeats itself)",
    )
    parser.add_argument(
        "--harmonics",
        type=int,
        metavar="N",
        help="of the fit (default: as many as the samples are worth)",
    )
    parser.add_argument(
        "--degrees",
        action="store_true",
        help="angles are degrees where names do not say what they are",
    )
    parser.add_argument(
        "--output", metavar="PATH", help="folder or .h5 file (default: results/GAIT-evaluated.h5)"
    )
    add_printing(parser)
    add_verbose(parser)
    return parser


@command(_parser)
def main(options: argparse.Namespace) -> int:
    from colloc.search.evaluate import evaluate

    stated = read_problem_file(options.problem)
    given = {"period": options.period, "harmonics": options.harmonics, "degrees": options.degrees}
    # of letters that a problem's name may have
    name = re.sub(r"[^A-Za-z0-9_.-]", "_", Path(options.gait).stem)
    # not where the result is that it was exported from
    default = Path("results") / f"{name}-evaluated.h5"
    solution = evaluate(stated.problem.with_(name=default.stem), options.gait, **given)
    path = output_path(options.output, default)
    saved = save_result(solution, path)
    facts = {**summary_dict(solution, saved[0].path, None, None), "kept": kept_facts(saved)}
    lines = summary_lines(solution, None, verbose=options.verbose)
    tell(options, facts, [*lines, f"  saved {saved[0].path}", *kept_lines(saved)])
    return EXIT[solution.status]
