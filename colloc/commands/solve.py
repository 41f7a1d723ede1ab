"""Command line: solve a problem file, certify the result, save it and draw it."""

from __future__ import annotations

import argparse
import math
import sys
import time
from collections.abc import Sequence
from pathlib import Path

from colloc.commands.ending import BAD_PROBLEM, FAILED, NONE_FOUND, OK, run, said_if_interrupted
from colloc.commands.options import add_bound, add_printing, add_problem, add_verbose, changed, new_parser, output_path, tell
from colloc.commands.summary import kept_facts, kept_lines, summary_dict, summary_lines
from colloc.gaits.problem import Problem
from colloc.gaits.problem_file import ProblemFile, read_problem_file
from colloc.results.solution import CERTIFICATE_FAILED, NOT_CONVERGED, SOLVED, Solution
from colloc.results.steps import Level, SearchStep
from colloc.system.errors import CollocError, ProblemError, StoreError
from colloc.system.progress import StatusLine, duration
from colloc.system.result_names import PARTIAL, beside

_MANY_INTERVALS, _SECONDS_AN_INTERVAL = 1000, 0.02
"""Where to say beforehand how long it will take; measured on three links with 1,000 and 5,000 intervals."""
SEARCHES = ("reduced", "full")
EXIT = {SOLVED: OK, NOT_CONVERGED: NONE_FOUND, CERTIFICATE_FAILED: FAILED}
_EPILOG = """\
Exit codes: 0 solved; 2 bad problem or option; 3 not converged; 4 certificate failed; 130 interrupted.

A failed solve is kept as NAME.failed.h5 and never replaces a good NAME.h5. A former result of another problem called NAME, or
a better one of this problem, is kept as NAME.former-1.h5. Levels are kept in NAME.partial.h5 as they
end; after Ctrl-C or a crash the same command goes on from there.

  colloc solve problems/three_link.py
  colloc solve problems/three_link.py --delta 1e-6 --output results/dry.h5
  colloc solve mine.py --start results/three_link.h5      begin with the gait of another result"""


def _parser() -> argparse.ArgumentParser:
    what = "Find the best gait of a problem file, by default the most efficient, and certify it by an independent replay."
    parser = new_parser("solve", what, _EPILOG)
    add_problem(parser)
    parser.add_argument("--start", metavar="FILE.h5", help="start from the gait of an earlier result")
    parser.add_argument("--fresh", action="store_true", help="do not go on from an interrupted run")
    parser.add_argument("--output", metavar="PATH", help="folder, or .h5 file (default: results/NAME.h5)")
    parser.add_argument(
        "--starts",
        type=int,
        metavar="N",
        help="starts to find the best gait of, at least (default: 32, of relaxed gaits 8); 1: the guess alone",
    )
    parser.add_argument("--seconds", type=float, default=math.inf, metavar="S", help="begin no other start after so long")
    parser.add_argument(
        "--search",
        choices=SEARCHES,
        default=SEARCHES[0],
        help="reduced: SQP on the gait's parameters, answered by IPOPT on the full program (default); full: IPOPT on the full "
        "program at every level of delta, from the guess alone",
    )
    add_bound(parser)
    parser.add_argument("--no-figure", action="store_true", help="do not draw NAME.png")
    parser.add_argument("--pdf", action="store_true", help="draw NAME.pdf too")
    add_printing(parser)
    add_verbose(parser)
    return parser


def level_line(level: Level) -> str:
    """One line about a level of the continuation."""
    flag = "" if level.optimal else f"   ({level.status})"
    return (
        f"{level.delta:9.1e} {level.edges.size - 1:6d} {level.value:11.6f} {level.distance:9.5f} {level.work:9.5f} "
        f"{level.iterations:6d} {level.seconds:8.2f}{flag}"
    )


LEVEL_HEADER = "    delta   mesh   objective         d         W   iter  seconds"


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line; returns the exit code."""
    return run(_parser(), _solve, arguments)


def _solve(options: argparse.Namespace) -> int:
    if options.starts is not None and options.starts < 1:
        raise ProblemError(f"--starts must be at least 1, not {options.starts}.")
    if not options.seconds > 0:
        raise ProblemError(f"--seconds must be positive, not {options.seconds:g}.")
    stated = read_problem_file(options.problem)
    problem = changed(stated.problem, options)
    path = output_path(options.output, Path("results") / f"{problem.name}.h5")
    # heavy imports only now: a bad problem is refused at once
    from colloc.bounds.optimality_gap import gap_line, upper_bound
    from colloc.results.kept import save_result

    quiet = options.quiet or options.json
    if not quiet and problem.intervals > _MANY_INTERVALS:
        seconds = duration(_SECONDS_AN_INTERVAL * problem.intervals)
        hint = "mesh_tolerance refines a small mesh where it has to be fine"
        print(f"colloc: {problem.intervals} intervals will take about {seconds} or more; {hint}.", file=sys.stderr)
    solution = _solved(problem, stated, path, options, quiet)
    bound, complaints, saved, kept = None, [], [], []
    if solution.finite is not None:
        solution.finite.source = solution.source
    try:
        kept = save_result(solution, path)
        _partial(path).unlink(missing_ok=True)
        path = kept[0].path
        saved = [str(path), *(f"{one.path} (the gait of finite size)" for one in kept[1:])]
    except StoreError as error:  # what was found is told all the same
        complaints.append(f"the result is not saved: {error}")
    with said_if_interrupted(saved):
        with StatusLine(enabled=not quiet) as line:
            if options.bound:
                line.say("computing an upper bound on every gait")
            try:
                bound = upper_bound(problem, path.parent, compute=options.bound)
            except CollocError as error:  # what is solved is not lost for it
                complaints.append(f"no bound: {error}")
        facts = {**summary_dict(solution, path if saved else None, stated.reference, bound), "kept": kept_facts(kept)}
        said = summary_lines(solution, stated.reference, verbose=options.verbose)
        tell(options, facts, [*said, gap_line(problem, solution.measured.efficiency, bound, asked=options.bound)])
        if saved and not options.no_figure:
            with StatusLine(enabled=not quiet) as line:
                line.say("drawing")
                try:
                    saved += _drawn(solution, path, pdf=options.pdf)
                except CollocError as error:
                    complaints.append(f"no figure: {error}")
    if saved and not options.json:
        print("\n".join([f"  saved {', '.join(saved)}", *kept_lines(kept)]))
    for complaint in complaints:
        print(f"colloc: {complaint}", file=sys.stderr)
    return BAD_PROBLEM if complaints else EXIT[solution.status]


def _drawn(solution: Solution, path: Path, *, pdf: bool) -> list[str]:
    """Draw the figure beside a result; the files."""
    from colloc.pictures.solution_figure import solution_figure
    from colloc.pictures.style import save as save_figure

    return [str(file) for file in save_figure(solution_figure(solution), path.with_suffix(""), ("png", "pdf")[: 1 + pdf])]


def _partial(path: Path) -> Path:
    """Where the levels of a run are kept while it is under way."""
    return beside(path, PARTIAL)


def _solved(problem: Problem, stated: ProblemFile, path: Path, options: argparse.Namespace, quiet: bool) -> Solution:
    """The solution, from the levels that an interrupted run left if there are any; each level is kept as it ends."""
    from colloc.results.store import load, save
    from colloc.search.optimise import best_gait, maximise_efficiency

    # a gait that is given on the command line is to be improved, not left for another
    starts = options.starts or (1 if options.start else stated.starts)
    source = stated.source
    partial = _partial(path)
    levels: list[Level] = []
    if partial.exists() and not options.fresh:
        try:
            before = load(partial)
        except StoreError as error:
            raise StoreError(f"{error} It was left by an interrupted run; --fresh begins again.") from None
        if before.problem.hash == problem.hash:
            levels = list(before.levels)
    table = not quiet and sys.stdout.isatty()
    if levels and not quiet:
        print(f"going on from {partial}: {len(levels)} levels, the last at delta = {levels[-1].delta:.1e}", flush=True)
    if table:
        print(LEVEL_HEADER, flush=True)
    begin = time.monotonic()
    before_levels = tuple(levels)
    try:
        with StatusLine(enabled=not quiet) as line:
            line.say(f"{problem.name}: " + ("building" if starts == 1 else "trying starts"))

            def ended(level: Level) -> None:
                levels.append(level)
                save(Solution(problem, levels, source=source, message="interrupted."), partial)
                if table:
                    line.clear()
                    print(level_line(level), flush=True)
                left = levels_left(problem, level) * (time.monotonic() - begin) / (len(levels) - len(before_levels))
                what = "solving" if level.delta > problem.delta else "refining the mesh and checking"
                line.say(f"{problem.name}: {what}, delta {level.delta:.0e} done", left)

            def tried(step: SearchStep | str) -> None:
                line.say(f"{problem.name}: {step}")

            if options.search == SEARCHES[0]:
                solution = best_gait(problem, starts, ended, options.seconds, before_levels, tried)
            else:
                solution = maximise_efficiency(problem, ended, literal=True)
    except KeyboardInterrupt:
        if not levels:
            raise
        raise KeyboardInterrupt(f"{len(levels)} levels are kept in {partial}; the same command goes on from there.") from None
    solution.source = source
    return solution


def levels_left(problem: Problem, level: Level) -> int:
    """Levels a solve will probably still take after this one: one a decade of delta, and one on a refined mesh."""
    if level.delta <= problem.delta:
        return 1
    return math.ceil(math.log10(level.delta / problem.delta) - 1e-9) + (problem.mesh_tolerance > 0)
