"""Commands that end in one result: solve, evaluate, and open for a start of an archive."""

from __future__ import annotations

import argparse
import math
import re
from dataclasses import replace
from pathlib import Path

from colloc.commands import options as cli
from colloc.commands.ending import BAD_PROBLEM, NONE_FOUND, OK, naming_saved_files
from colloc.commands.summary import (
    EXIT,
    kept_facts,
    kept_lines,
    save_and_tell,
    summary_dict,
    summary_lines,
)
from colloc.gaits.starts import LATIN_HYPERCUBE, SAMPLERS
from colloc.system.errors import CollocError, ProblemError, StoreError
from colloc.system.progress import duration

_MANY_INTERVALS, _SECONDS_PER_INTERVAL = 1000, 0.02
_SEARCHES = ("reduced", "full")


@cli.command(
    "solve",
    """\
A failed solve is kept as NAME.failed.h5, a former result of another problem called NAME, or a
better one of this problem, as NAME.former-1.h5. After Ctrl-C or a crash the same command goes on
from NAME.run.sqlite; Ctrl-C leaves the best gait so far in NAME.interrupted.h5.

  colloc solve problems/three_link.py --delta 1e-6 --output results/dry.h5
  colloc solve mine.py --start results/three_link.h5      begin with the gait of another result""",
    *cli.PROBLEM,
    cli.text("--start", "FILE.h5", "start from the gait of an earlier result"),
    cli.flag("--fresh", "do not go on from an interrupted run"),
    cli.output("folder, or .h5 file (default: results/NAME.h5)"),
    cli.count(
        "--starts", "N", "minimum number of starting points (default: 32); 1: the guess alone"
    ),
    cli.number("--seconds", "S", "wall time allowed; then the best gait so far counts", math.inf),
    cli.choice(
        "--search",
        _SEARCHES,
        "reduced: SQP on the gait's parameters, confirmed by IPOPT on the full program (default); "
        "full: IPOPT on the full program at every level of delta, from the guess alone",
        _SEARCHES[0],
    ),
    cli.BOUND,
    cli.flag("--dry", "certify it also under dry friction, with no delta (a second)"),
    cli.NO_FIGURE,
    cli.flag("--pdf", "draw NAME.pdf too"),
    cli.VERBOSE,
)
def solve(options: argparse.Namespace) -> int:
    cli.check_least(options, starts=1)
    cli.check_positive(options, "seconds")
    stated, problem = cli.read_problem(options)
    path = cli.output_path(options.output, Path("results") / f"{problem.name}.h5")
    # slow imports only now: a bad problem is refused at once
    from colloc.bounds.optimality_gap import gap_line, upper_bound
    from colloc.studies.saved import resume, save_and_clear

    if not cli.quiet(options) and problem.intervals > _MANY_INTERVALS:
        seconds = duration(_SECONDS_PER_INTERVAL * problem.intervals)
        cli.complain(
            f"{problem.intervals} intervals will take about {seconds} or more; mesh_tolerance "
            f"refines a small mesh where it has to be fine."
        )
    with cli.status_line(options) as line:
        solution = resume(
            replace(stated, problem=problem),
            path,
            # a gait that is given on the command line is to be improved
            starts=options.starts or (1 if options.start else stated.starts),
            progress=lambda news: line.say(f"{problem.name}: {news}"),
            **cli.values(options, "seconds", "search", "fresh"),
        )
    bound, complaints, saved, records = None, [], [], []
    if options.dry and solution.certificate.replayed:
        try:
            solution.certify_dry()
        except CollocError as error:  # what is solved is not lost for it
            complaints.append(f"no bounds under dry friction: {error}")
    try:
        records = save_and_clear(solution, path)
        path = records[0].path
        saved = [str(path), *(f"{one.path} (the gait that shrank)" for one in records[1:])]
    except StoreError as error:  # the result is printed all the same
        complaints.append(f"the result is not saved: {error}")
    with naming_saved_files(saved):
        with cli.status_line(options) as line:
            if options.bound:
                line.say("computing an upper bound on every gait")
            try:
                compute = options.bound and not solution.interrupted
                bound = upper_bound(problem, path.parent, compute=compute)
            except CollocError as error:
                complaints.append(f"no bound: {error}")
        facts = summary_dict(solution, path if saved else None, stated.reference, bound)
        lines = summary_lines(solution, stated.reference, verbose=options.verbose)
        gap = gap_line(problem, solution.measured.efficiency, bound, asked=options.bound)
        cli.tell(options, facts | {"kept": kept_facts(records)}, [*lines, gap])
        if saved and not options.no_figure and not solution.interrupted:
            from colloc.pictures.solution_figure import solution_figure
            from colloc.pictures.style import save as save_figure

            with cli.status_line(options) as line:
                line.say("drawing")
                try:
                    figure, kinds = solution_figure(solution), ("png", "pdf")[: 1 + options.pdf]
                    saved += map(str, save_figure(figure, path.with_suffix(""), kinds))
                except CollocError as error:
                    complaints.append(f"no figure: {error}")
    if saved and not options.json:
        print("\n".join([f"  saved {', '.join(saved)}", *kept_lines(records)]))
    if solution.interrupted:
        complaints.append("interrupted; the same command goes on from there.")
    for complaint in complaints:
        cli.complain(complaint)
    return BAD_PROBLEM if complaints and not solution.interrupted else EXIT[solution.status]


@cli.command(
    "evaluate",
    """\
The file has a line for each time point: its time, then the angle of each joint. Columns are known
by their names (joint_1 at the tail, joint_2, ...; units as _deg, [deg], time_ms); without names
they go from tail to head. Angles are radians unless names or --degrees say otherwise. Errors
include the residual of the samples, with two standard deviations.

  colloc evaluate problems/three_link.py mine.csv                          results/mine-evaluated.h5
  colloc compare results/mine-evaluated.h5 results/three_link.h5""",
    cli.text("problem", None, "a Python file that states PROBLEM, for body, friction and limits"),
    cli.text("gait", "GAIT.csv", "times and joint angles"),
    cli.number("--period", "T", "in the file's unit of time (default: from repetition)"),
    cli.count("--harmonics", "N", "of the fit (default: as many as the samples determine)"),
    cli.flag("--degrees", "angles are degrees where names do not say what they are"),
    cli.output("folder or .h5 file (default: results/GAIT-evaluated.h5)"),
    cli.VERBOSE,
)
def evaluate(options: argparse.Namespace) -> int:
    from colloc.gaits.problem_file import read_problem_file
    from colloc.search.evaluate import evaluate as evaluate_gait

    problem = read_problem_file(options.problem).problem
    # not where the result is that it was exported from
    name = re.sub(r"[^A-Za-z0-9_.-]", "_", Path(options.gait).stem) + "-evaluated"
    settings = cli.values(options, "period", "harmonics", "degrees")
    solution = evaluate_gait(problem.with_(name=name), options.gait, **settings)
    path = cli.output_path(options.output, Path("results") / f"{name}.h5")
    return save_and_tell(options, solution, path)


@cli.command(
    "open",
    """\
Without --start: the distinct optima of the archive. With it: that start, solved again from its gait
(from its guess, if it had failed) and saved as a result like any other.

  colloc open results/three_link.starts.h5 --start 7     results/three_link.start-7.h5""",
    cli.text("archive", "ARCHIVE.h5", "an archive that colloc multistart wrote"),
    cli.count("--start", "N", "the start to make a result of"),
    cli.SEED,
    cli.choice("--sampler", SAMPLERS, "of the start", LATIN_HYPERCUBE),
    cli.output("folder, or .h5 file (default: beside the archive)"),
    cli.VERBOSE,
)
def open_archive(options: argparse.Namespace) -> int:
    from colloc.commands.families import starts_summary
    from colloc.results.archive import StartName, archive_at

    archive = archive_at(options.archive)
    problem = archive.problem
    if options.start is None:
        outcomes = list(archive.outcomes.values())
        optima, facts, lines = starts_summary(problem, outcomes, archive.path)
        cli.tell(options, facts, lines)
        return OK if optima else NONE_FOUND
    start = StartName(options.sampler, options.seed, options.start)
    if start not in archive.outcomes:
        there = sorted({f"{name.sampler} seed {name.seed}" for name in archive.outcomes})
        raise ProblemError(
            f"{options.archive} holds no start {options.start} of {options.sampler} seed "
            f"{options.seed}; it holds {len(archive.outcomes)} starts of "
            f"{', '.join(there) or 'no sampler'}."
        )
    name = f"{problem.name}.start-{options.start}.h5"
    path = cli.output_path(options.output, Path(options.archive).with_name(name))
    # slow imports only now: a bad option is refused at once
    from colloc.studies.calls import reopen

    with cli.status_line(options) as line:
        line.say(f"{problem.name}: start {options.start}")
        solution = reopen(problem, archive.outcomes[start])
    return save_and_tell(options, solution, path)
