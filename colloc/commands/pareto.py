"""Command line: the front of two objectives of a problem: certified gaits of which none is better
in both.

Exit codes: 0 found, 2 bad problem or option, 3 not converged, 4 a gap is left where gaits are not
certified, 130 interrupted.
"""

from __future__ import annotations

import argparse
import csv
from dataclasses import asdict
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
from colloc.gaits.objective import EFFICIENCY, SPEED, Objective, objective_from
from colloc.gaits.problem import Problem
from colloc.gaits.problem_file import ProblemFile, read_problem_file
from colloc.results.solution import Solution
from colloc.system.errors import ProblemError
from colloc.system.progress import StatusLine
from colloc.system.replaced_file import replaced_file

_POINTS = 9
_EPILOG = """\
An objective is "efficiency", "speed", "turning", or an expression of distance, work, rotation and
length of a period. Every point is a result like any other: NAME.front/00.h5 is the best by the
first objective, the last one the best by the second.

  colloc pareto problems/three_link.py
  colloc pareto mine.py --objectives distance "distance / work" --points 15"""


def _parser() -> argparse.ArgumentParser:
    what = (
        "Find certified gaits from the best by one objective to the best by another, of which "
        "none is better in both."
    )
    parser = new_parser("pareto", what, _EPILOG)
    add_problem(parser)
    parser.add_argument(
        "--objectives", nargs=2, metavar=("FIRST", "SECOND"), default=[SPEED.name, EFFICIENCY.name],
        help=f"default: {SPEED.name} {EFFICIENCY.name}",
    )  # fmt: skip
    parser.add_argument(
        "--points",
        type=int,
        default=_POINTS,
        metavar="N",
        help=f"of the front, if none hardly differ (default: {_POINTS})",
    )
    parser.add_argument(
        "--starts", type=int, metavar="N", help="starts to find both ends of (default: 32)"
    )
    parser.add_argument(
        "--output", metavar="PATH", help="folder, or .csv file (default: results/NAME.front.csv)"
    )
    parser.add_argument("--no-figure", action="store_true", help="do not draw NAME.front.png")
    add_printing(parser)
    return parser


@command(_parser)
def main(options: argparse.Namespace) -> int:
    if options.starts is not None and options.starts < 1:
        raise ProblemError(f"--starts must be at least 1, not {options.starts}.")
    if options.points < 2:
        raise ProblemError(f"a front has at least 2 points, not {options.points}.")
    stated = read_problem_file(options.problem)
    problem = changed(stated.problem, options)
    first, second = (objective_from(text) for text in options.objectives)
    table = output_path(options.output, Path("results") / f"{problem.name}.front.csv")
    from colloc.studies.saved import members_kept

    with members_kept(table.with_suffix("")):
        return _front(options, stated, problem, (first, second), table)


def _front(
    options: argparse.Namespace,
    stated: ProblemFile,
    problem: Problem,
    aims: tuple[Objective, Objective],
    table: Path,
) -> int:
    first, second = aims
    from colloc.results.kept import save_result
    from colloc.search.explore import STARTS
    from colloc.studies.pareto import pareto_front

    quiet = options.quiet or options.json
    with StatusLine(enabled=not quiet) as line:
        line.say(f"{problem.name}: the ends of the front")
        starts = options.starts or stated.starts or STARTS

        def told(k: int, found: Solution) -> None:
            what = f"point {k} of {options.points - 1}" if k < options.points else "in a gap"
            line.say(f"{problem.name}: {what}: {found}")

        front = pareto_front(problem, first, second, options.points, starts=starts, progress=told)
    rows, kept = [], []
    for k, (point, values) in enumerate(zip(front.points, front.values.tolist(), strict=True)):
        point.source = stated.source
        saved = save_result(point, table.with_suffix("") / f"{k:02d}.h5")
        kept += saved
        rows.append(
            [
                k,
                *values,
                point.measured.distance,
                point.measured.work,
                point.status,
                str(saved[0].path),
            ]
        )
    names = ["point", *(aim.expression for aim in aims), "distance", "work", "status", "file"]
    with (
        replaced_file(table) as temporary,
        open(temporary, "w", newline="", encoding="utf-8") as file,
    ):
        csv.writer(file).writerows([names, *rows])
    files = [table]
    if not options.no_figure:
        from colloc.pictures.style import save as save_figure

        with said_if_interrupted([f"{table}, {rows[0][-1]} ..."]):
            files += save_figure(front.plot(), table.with_suffix(""), ("png",))
    points = [dict(zip(names, row, strict=True)) for row in rows]
    gaps = [asdict(gap) for gap in front.gaps]
    empty = {gap.after: f"\n       nothing was found between: {gap.why}" for gap in front.gaps}
    lines = [
        f"{problem.name}: {first.name} against {second.name}, {len(rows)} points",
        *(
            f"  {k:3d}  {a:11.7f}  {b:11.7f}  {status}{empty.get(k, '')}"
            for k, a, b, _, _, status, _ in rows
        ),
        f"  saved {', '.join(map(str, files))}, {rows[0][-1]} ...",
        *kept_lines(kept),
    ]
    tell(
        options,
        {
            "objectives": [aim.fields() for aim in aims],
            "points": points,
            "gaps": gaps,
            "kept": kept_facts(kept),
        },
        lines,
    )
    return OK if front.certified else FAILED
