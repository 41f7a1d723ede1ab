"""Command line: solve a problem file, certify the result, save it and draw it."""

from __future__ import annotations

import argparse
import math
import sys
from dataclasses import replace
from pathlib import Path

from colloc.commands import ending
from colloc.commands.ending import BAD_PROBLEM, FAILED, NONE_FOUND, OK, command, said_if_interrupted
from colloc.commands.options import (
    add_bound,
    add_printing,
    add_problem,
    add_verbose,
    changed,
    new_parser,
    output_path,
    tell,
)
from colloc.commands.summary import kept_facts, kept_lines, summary_dict, summary_lines
from colloc.gaits.problem_file import read_problem_file
from colloc.results.solution import CERTIFICATE_FAILED, INTERRUPTED, NOT_CONVERGED, SOLVED, Solution
from colloc.system.errors import CollocError, ProblemError, StoreError
from colloc.system.progress import StatusLine, duration

_MANY_INTERVALS, _SECONDS_AN_INTERVAL = 1000, 0.02
"""Where to say beforehand how long it will take; measured on three links with 1,000 and 5,000
intervals."""
SEARCHES = ("reduced", "full")
EXIT = {
    SOLVED: OK,
    NOT_CONVERGED: NONE_FOUND,
    CERTIFICATE_FAILED: FAILED,
    INTERRUPTED: ending.INTERRUPTED,
}
_EPILOG = """\
Exit codes: 0 solved; 2 bad problem or option; 3 not converged; 4 certificate failed; 130
interrupted.

A failed solve is kept as NAME.failed.h5 and never replaces a good NAME.h5. A former result of
another problem called NAME, or a better one of this problem, is kept as NAME.former-1.h5. What is
found on the way is kept in NAME.run.sqlite; after Ctrl-C or a crash the same command goes on, and
ends as if nothing had happened. Ctrl-C leaves the best gait so far in NAME.interrupted.h5.

  colloc solve problems/three_link.py
  colloc solve problems/three_link.py --delta 1e-6 --output results/dry.h5
  colloc solve mine.py --start results/three_link.h5      begin with the gait of another result"""


def _parser() -> argparse.ArgumentParser:
    what = (
        "Find the best gait of a problem file, by default the most efficient, and certify "
        "it by "
        "an independent replay."
    )
    parser = new_parser("solve", what, _EPILOG)
    add_problem(parser)
    parser.add_argument(
        "--start", metavar="FILE.h5", help="start from the gait of an earlier result"
    )
    parser.add_argument("--fresh", action="store_true", help="do not go on from an interrupted run")
    parser.add_argument(
        "--output", metavar="PATH", help="folder, or .h5 file (default: results/NAME.h5)"
    )
    parser.add_argument(
        "--starts",
        type=int,
        metavar="N",
        help="starts to find the best gait of, at least (default: 32); 1: the guess alone",
    )
    parser.add_argument(
        "--seconds",
        type=float,
        default=math.inf,
        metavar="S",
        help="wall time allowed; then the best gait so far is the result",
    )
    parser.add_argument(
        "--search",
        choices=SEARCHES,
        default=SEARCHES[0],
        help="reduced: SQP on the gait's parameters, answered by IPOPT on the full program "
        "(default); full: IPOPT on the full "
        "program at every level of delta, from the guess alone",
    )
    add_bound(parser)
    parser.add_argument(
        "--dry",
        action="store_true",
        help="certify it also under dry friction, with no delta (a second)",
    )
    parser.add_argument("--no-figure", action="store_true", help="do not draw NAME.png")
    parser.add_argument("--pdf", action="store_true", help="draw NAME.pdf too")
    add_printing(parser)
    add_verbose(parser)
    return parser


@command(_parser)
def main(options: argparse.Namespace) -> int:
    if options.starts is not None and options.starts < 1:
        raise ProblemError(f"--starts must be at least 1, not {options.starts}.")
    if not options.seconds > 0:
        raise ProblemError(f"--seconds must be positive, not {options.seconds:g}.")
    stated = read_problem_file(options.problem)
    problem = changed(stated.problem, options)
    path = output_path(options.output, Path("results") / f"{problem.name}.h5")
    # heavy imports only now: a bad problem is refused at once
    from colloc.bounds.optimality_gap import gap_line, upper_bound
    from colloc.studies.saved import resumed, save_end

    quiet = options.quiet or options.json
    if not quiet and problem.intervals > _MANY_INTERVALS:
        seconds = duration(_SECONDS_AN_INTERVAL * problem.intervals)
        hint = "mesh_tolerance refines a small mesh where it has to be fine"
        print(
            f"colloc: {problem.intervals} intervals will take about {seconds} or more; {hint}.",
            file=sys.stderr,
        )
    # a gait that is given on the command line is to be improved, not left for another
    starts = options.starts or (1 if options.start else stated.starts)
    with StatusLine(enabled=not quiet) as line:
        solution = resumed(
            replace(stated, problem=problem),
            path,
            starts=starts,
            seconds=options.seconds,
            search=options.search,
            fresh=options.fresh,
            progress=lambda news: line.say(f"{problem.name}: {news}"),
        )
    bound, complaints, saved, kept = None, [], [], []
    if options.dry and solution.certificate.replayed:
        try:
            solution.certify_dry()
        except CollocError as error:  # what is solved is not lost for it
            complaints.append(f"no bounds under dry friction: {error}")
    try:
        kept = save_end(solution, path)
        path = kept[0].path
        saved = [str(path), *(f"{one.path} (the gait that shrank)" for one in kept[1:])]
    except StoreError as error:  # what was found is told all the same
        complaints.append(f"the result is not saved: {error}")
    with said_if_interrupted(saved):
        with StatusLine(enabled=not quiet) as line:
            if options.bound:
                line.say("computing an upper bound on every gait")
            try:
                bound = upper_bound(
                    problem, path.parent, compute=options.bound and not solution.interrupted
                )
            except CollocError as error:  # what is solved is not lost for it
                complaints.append(f"no bound: {error}")
        facts = {
            **summary_dict(solution, path if saved else None, stated.reference, bound),
            "kept": kept_facts(kept),
        }
        said = summary_lines(solution, stated.reference, verbose=options.verbose)
        tell(
            options,
            facts,
            [*said, gap_line(problem, solution.measured.efficiency, bound, asked=options.bound)],
        )
        if saved and not options.no_figure and not solution.interrupted:
            with StatusLine(enabled=not quiet) as line:
                line.say("drawing")
                try:
                    saved += _drawn(solution, path, pdf=options.pdf)
                except CollocError as error:
                    complaints.append(f"no figure: {error}")
    if saved and not options.json:
        print("\n".join([f"  saved {', '.join(saved)}", *kept_lines(kept)]))
    if solution.interrupted:
        complaints.append("interrupted; the same command goes on from there.")
    for complaint in complaints:
        print(f"colloc: {complaint}", file=sys.stderr)
    return BAD_PROBLEM if complaints and not solution.interrupted else EXIT[solution.status]


def _drawn(solution: Solution, path: Path, *, pdf: bool) -> list[str]:
    """Draw the figure beside a result; the files."""
    from colloc.pictures.solution_figure import solution_figure
    from colloc.pictures.style import save as save_figure

    return [
        str(file)
        for file in save_figure(
            solution_figure(solution), path.with_suffix(""), ("png", "pdf")[: 1 + pdf]
        )
    ]
