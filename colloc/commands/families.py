"""Commands that solve many problems: many starts, a grid, a Pareto front, gaits that steer."""

from __future__ import annotations

import argparse
import csv
import io
import json
import math
import time
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import BrokenExecutor, Executor
from dataclasses import asdict, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from colloc.commands import options as cli
from colloc.commands.ending import FAILED, INTERRUPTED, NONE_FOUND, OK, naming_saved_files
from colloc.commands.solve import bound_facts, kept_facts, kept_lines, save_and_tell
from colloc.gaits.gait_fields import fields
from colloc.gaits.objective import EFFICIENCY, SPEED, objective_from
from colloc.gaits.problem import Problem
from colloc.gaits.starts import LATIN_HYPERCUBE, SAMPLERS, on_speed_floor
from colloc.results.distinct_optima import Basin, basins
from colloc.results.outcome import STATUSES, Outcome, counts
from colloc.results.solution import SOLVED, Solution
from colloc.system.errors import ProblemError, StoreError
from colloc.system.files import lock_file, write_text

if TYPE_CHECKING:
    from colloc.results.archive import Archive
    from colloc.studies.pareto import ParetoFront
    from colloc.studies.run import StudyRun
    from colloc.studies.steering import Steering

_MOST_SHOWN = 12
_SAVE_EVERY = 60.0  # seconds
_AIMS = SPEED.name, EFFICIENCY.name


def starts_summary(
    problem: Problem, outcomes: Sequence[Outcome], path: Path | None
) -> tuple[list[Basin], dict[str, Any], list[str]]:
    """Distinct optima of starts, facts about all of them, and lines for people."""
    optima, tally = basins(problem, outcomes), counts(outcomes)
    failures = [o for o in outcomes if o.status != SOLVED]
    floors = [on_speed_floor(problem, basin.best.gait) for basin in optima]
    facts = {
        "name": problem.name,
        "problem_hash": problem.hash,
        "file": str(path),
        "starts": len(outcomes),
        "counts": {status: tally.get(status, 0) for status in STATUSES},
        "optima": [
            {
                "value": basin.best.value,
                "efficiency": basin.best.efficiency,
                "frequency": basin.frequency,
                "starts": list(basin.starts),
                "on_speed_floor": floor,
                "gait": fields(basin.best.gait),
            }
            for basin, floor in zip(optima, floors, strict=True)
        ],
        "failures": [
            {name: getattr(o, name) for name in ("start", "status", "message")} for o in failures
        ],
    }
    ends = ", ".join(f"{n} {status}" for status, n in tally.items())
    lines = [f"{problem.name}: {len(outcomes)} starts: {ends}; {len(optima)} distinct optima"]
    for basin, floor in zip(optima[:_MOST_SHOWN], floors, strict=False):
        share = f"{len(basin.starts)} of {len(outcomes)} starts"
        lines.append(
            f"  {problem.objective.name} {basin.best.value:.6f}  {share:<20s} best: start "
            f"{basin.best.start}{'  on the bound smallest_shape_speed' * floor}"
        )
    if len(optima) > _MOST_SHOWN:
        lines.append(f"  ... and {len(optima) - _MOST_SHOWN} more")
    lines += [f"  start {o.start}: {o.status}: {o.message}" for o in failures[:_MOST_SHOWN]]
    return optima, facts, lines


@cli.command(
    "multistart",
    """\
Start k of a seed is the same gait whatever --starts and --workers are. What the archive holds is
not solved again: the same command goes on after Ctrl-C, and more starts and seeds add to it.

  colloc multistart problems/three_link.py --starts 100 --workers 2""",
    *cli.PROBLEM,
    cli.count("--starts", "N", "starts 0 to N-1 (default: 20)", 20),
    cli.SEED,
    cli.WORKERS,
    cli.choice("--sampler", SAMPLERS, "perturbed: near the problem's guess", LATIN_HYPERCUBE),
    cli.number("--time-limit", "S", "seconds for one start (default: 300)", 300.0),
    cli.RETRY,
    cli.BOUND,
    cli.output("folder, or .h5 file (default: results/NAME.starts.h5)"),
)
def multistart(options: argparse.Namespace) -> int:
    cli.check_least(options, starts=1, workers=1, seed=0)
    cli.check_positive(options, "time_limit")
    problem = cli.read_problem(options)[1]
    path = cli.output_path(options.output, Path("results") / f"{problem.name}.starts.h5")
    # slow imports only now: a bad problem is refused at once
    from colloc.bounds.optimality_gap import gap_line, upper_bound
    from colloc.results.archive import open_archive, save_archive

    archive = open_archive(problem, path)  # or refused, before anything is solved
    interrupted = _run_starts(archive, options)
    save_archive(archive, options.command)
    outcomes = list(archive.of_search(options.sampler, options.seed, options.starts).values())
    optima, facts, lines = starts_summary(problem, outcomes, path)
    bound = upper_bound(problem, path.parent, compute=options.bound) if optima else None
    if optima:
        lines.append(gap_line(problem, max(basin.best.efficiency for basin in optima), bound))
        which = f" --seed {options.seed}" if options.seed else ""
        which += f" --sampler {options.sampler}" if options.sampler != LATIN_HYPERCUBE else ""
        start = f"--start {optima[0].best.start}{which}"
        lines.append(f"  colloc open {path} {start}   makes a result of the best")
    if others := len(archive.outcomes) - len(outcomes):
        solved = {name: o.value for name, o in archive.outcomes.items() if o.status == SOLVED}
        line = f"  starts in the file besides: {others}"
        if solved:
            best = max(solved, key=lambda name: solved[name])
            where = f"start {best.number} of seed {best.seed} ({best.sampler})"
            line += f"; the best of all, {solved[best]:.6f}, is {where}"
        lines.append(line)
    lines.append(f"  saved {path}")
    cli.tell(options, facts | {"bound": bound_facts(bound), "interrupted": interrupted}, lines)
    if interrupted:
        cli.complain("interrupted; run the same command again to go on.")
        return INTERRUPTED
    return OK if optima else NONE_FOUND


def _run_starts(archive: Archive, options: argparse.Namespace) -> bool:
    """Solve the missing starts; whether Ctrl-C came."""
    from colloc.studies.multistart import run_archive

    done = archive.done(options.sampler, options.seed, options.starts, retry=options.retry)
    todo = (k for k in range(options.starts) if k not in done)  # may be more than memory holds
    to_go, name, loud = options.starts - len(done), archive.problem.name, not cli.quiet(options)
    settings = cli.values(options, "sampler", "seed", "workers", "time_limit")
    if loud:
        header = " start       value   iter  seconds  status"
        print(f"{len(done)} starts done already, {to_go} to go\n{header}", flush=True)
    begin = time.perf_counter()
    try:
        with cli.status_line(options) as line:
            line.say(f"{name}: 0 of {to_go} starts")
            for k, o in enumerate(run_archive(archive, todo, **settings), 1):
                if loud:
                    line.clear()
                    numbers = f"{o.start:6d} {o.value:11.6f} {o.iterations:6d} {o.seconds:8.2f}"
                    print(f"{numbers}  {o.status}", flush=True)
                left = (time.perf_counter() - begin) / k * (to_go - k)
                line.say(f"{name}: {k} of {to_go} starts", left)
    except KeyboardInterrupt:
        return True
    return False


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


@cli.command(
    "sweep",
    """\
Starts travel between neighbours. What is done is kept, and not solved again. A study file is Python
code, and is executed. Exit code 3: some cells have no certified gait.""",
    cli.text(
        "study", None, "a Python file that states STUDY, for example studies/friction_plane.py"
    ),
    cli.WORKERS,
    cli.text("--dask", "ADDRESS", "scheduler of a Dask cluster (tcp://host:8786), or 'local'"),
    cli.count("--chunk", "N", "cells to a task, instead of the study's own number"),
    cli.RETRY,
    cli.text(
        "--output", "FOLDER", "for NAME.nc and NAME.study/ (default: results)", default="results"
    ),
)
def sweep(options: argparse.Namespace) -> int:
    from colloc.studies.study import read_study_file

    cli.check_least(options, workers=1, chunk=1)
    study, source = read_study_file(options.study)
    if options.chunk is not None:
        study = replace(study, chunk=options.chunk)
    # slow imports only now: a bad study is refused at once
    from colloc.studies.run import StudyRun

    path = cli.output_path(None, cli.output_folder(options.output) / f"{study.name}.nc")
    folder = path.with_suffix(".study")

    def save() -> None:
        from colloc.bounds.optimality_gap import upper_bound
        from colloc.studies.table import save_study, study_table

        def bound(problem: Problem) -> float | None:
            known = upper_bound(problem, path.parent, compute=False)
            return None if known is None else known.sampled

        save_study(study_table(run, bound), path, source=source, command=options.command)

    with lock_file(folder / "lock"):
        run = StudyRun(study, folder, retry=options.retry)
        if not cli.quiet(options):
            total = math.prod(study.shape)
            print(f"{study.name}: {total} cells, {run.visited} of them in the journal", flush=True)
        try:
            interrupted = _run_cells(run, options, save)
        finally:
            save()
    cli.tell(options, *sweep_summary(run, path))
    if interrupted:
        cli.complain("interrupted; what is done is kept, and the same command goes on from there.")
        return INTERRUPTED
    solved = sum(state.best is not None for state in run.cells.values())
    return OK if solved == math.prod(study.shape) else NONE_FOUND


def _run_cells(run: StudyRun, options: argparse.Namespace, save: Callable[[], None]) -> bool:
    """Work until all is done, saving now and then; whether Ctrl-C came."""
    from colloc.system.task_pool import process_pool

    executor: Callable[[int], Executor] = process_pool
    workers = options.workers
    if options.dask is not None:
        from colloc.system.dask_pool import connect

        executor, workers = connect(options.dask, workers, cli.complain)
    begin = time.perf_counter()
    due, number = begin + _SAVE_EVERY, 0
    try:
        for news in run.run(workers=workers, executor=executor):
            if news.round != number:
                number, begin = news.round, time.perf_counter()
            if not cli.quiet(options):
                best = news.state.best
                value = f"{best.outcome.value:9.6f}" if best else "     none"
                tally = Counter(a.outcome.status for a in news.new)
                tries = ", ".join(f"{n} {status}" for status, n in tally.items())
                left = (time.perf_counter() - begin) / news.done * (news.total - news.done)
                print(
                    f"{run.study.label(news.cell)}: {value}  ({tries}; round {number}: "
                    f"{news.done} of {news.total}, {left:.0f} s left)",
                    flush=True,
                )
            if time.perf_counter() > due:
                saving = time.perf_counter()
                save()
                due = time.perf_counter() + max(_SAVE_EVERY, 20 * (time.perf_counter() - saving))
    except KeyboardInterrupt:
        return True
    except BrokenExecutor as error:
        raise StoreError(f"no worker could be started ({error}); what is done is kept.") from None
    return False


def sweep_summary(run: StudyRun, path: Path) -> tuple[dict[str, Any], list[str]]:
    """Facts about a study at its end, and lines for people."""
    study, cells = run.study, run.cells
    total, reached = math.prod(study.shape), list(cells)
    tally: Counter[str] = Counter()
    for state in cells.values():
        tried = "no certified gait" if state.attempts else "not tried yet"
        tally["solved" if state.best else tried if state.problem else "no problem"] += 1
    if total > len(reached):
        tally["not tried yet"] += total - len(reached)
    below = [cell for cell in reached if run.below_neighbour(cell)]
    facts = {
        "name": study.name,
        "file": str(path),
        "cells": total,
        "counts": dict(tally),
        "below_neighbour": [study.coordinates(cell) for cell in below],
    }
    shares = ", ".join(f"{n} {what}" for what, n in tally.items())
    lines = [f"{study.name}: {total} cells: {shares}; saved {path}"]
    if below:
        lines.append(
            f"  {len(below)} of them below what a neighbour's gait achieves there as it is: more "
            f"starts may find more"
        )
    for cell in below[:_MOST_SHOWN]:
        best, could = cells[cell].best, run.neighbour_value(cell)
        assert best is not None
        value = f"{best.outcome.value:.6f}, where a neighbour's gait achieves {could:.6f}"
        lines.append(f"  {study.label(cell)}: {value}")
    failed = [
        f"  {study.label(cell)}: "
        f"{state.attempts[-1].outcome.message if state.attempts else state.message}"
        for cell, state in cells.items()
        if not state.best and (state.attempts or state.message)
    ]
    if len(failed) > _MOST_SHOWN:
        more = len(failed) - _MOST_SHOWN
        failed[_MOST_SHOWN:] = [f"  ... and {more} more; all are in the file, with their messages"]
    return facts, lines + failed


def _save_family(
    options: argparse.Namespace,
    family: ParetoFront | Steering,
    table: Path,
    members: Iterable[tuple[str, Solution]],
    source: str,
    describe: Callable[[list[Path]], tuple[str, dict[str, Any], list[str], str]],
) -> int:
    """Save the members and the table of a family, draw and print it, and return the exit code.

    From the paths of the members, `describe` gives the text of the table, facts, lines for people
    and how members are named among the saved files.
    """
    from colloc.results.kept import save_result

    paths, saved = [], []
    for name, solution in members:
        solution.source = source
        saved += (one := save_result(solution, table.with_suffix("") / f"{name}.h5"))
        paths.append(one[0].path)
    content, facts, lines, points = describe(paths)
    write_text(table, content)
    files = [table]
    if not options.no_figure:
        from colloc.pictures.style import save as save_figure

        with naming_saved_files([f"{table}{points}"]):
            files += save_figure(family.plot(), table.with_suffix(""), ("png",))
    lines = [*lines, f"  saved {', '.join(map(str, files))}{points}", *kept_lines(saved)]
    cli.tell(options, facts | {"kept": kept_facts(saved)}, lines)
    return OK if family.certified else FAILED


@cli.command(
    "pareto",
    """\
An objective is "efficiency", "speed", "turning", or an expression of distance, work, rotation and
length of a period. Every point is a result: NAME.front/00.h5 is the best by the first objective,
the last one the best by the second. Exit code 4: a gap is left where gaits are not certified.

  colloc pareto mine.py --objectives distance "distance / work" --points 15""",
    *cli.PROBLEM,
    cli.text(
        "--objectives", ("FIRST", "SECOND"), f"default: {' '.join(_AIMS)}", nargs=2, default=_AIMS
    ),
    cli.count("--points", "N", "of the front, without duplicates (default: 9)", 9),
    cli.count("--starts", "N", "starting points for both ends (default: 32)"),
    cli.output("folder, or .csv file (default: results/NAME.front.csv)"),
    cli.NO_FIGURE,
)
def pareto(options: argparse.Namespace) -> int:
    cli.check_least(options, starts=1)
    if options.points < 2:
        raise ProblemError(f"a front has at least 2 points, not {options.points}.")
    stated, problem = cli.read_problem(options)
    first, second = aims = [objective_from(text) for text in options.objectives]
    table = cli.output_path(options.output, Path("results") / f"{problem.name}.front.csv")
    from colloc.search.options import OPTIONS
    from colloc.studies.pareto import pareto_front
    from colloc.studies.saved import checkpoints_in

    with checkpoints_in(table.with_suffix("")):
        with cli.status_line(options) as line:
            line.say(f"{problem.name}: the ends of the front")

            def report(k: int, point: Solution) -> None:
                last = options.points - 1
                what = f"point {k} of {last}" if k <= last else "in a gap"
                line.say(f"{problem.name}: {what}: {point}")

            starts = options.starts or stated.starts or OPTIONS.starts
            front = pareto_front(
                problem, first, second, options.points, starts=starts, progress=report
            )

        def describe(paths: list[Path]) -> tuple[str, dict[str, Any], list[str], str]:
            names = ["point", *(x.expression for x in aims), "distance", "work", "status", "file"]
            rows = [
                [k, *both, point.measured.distance, point.measured.work, point.status, str(path)]
                for k, (point, both, path) in enumerate(
                    zip(front.points, front.values.tolist(), paths, strict=True)
                )
            ]
            content = io.StringIO(newline="")
            csv.writer(content).writerows([names, *rows])
            empty = {gap.after: f"\n       nothing found between: {gap.why}" for gap in front.gaps}
            facts = {
                "objectives": [aim.fields() for aim in aims],
                "points": [dict(zip(names, row, strict=True)) for row in rows],
                "gaps": [asdict(gap) for gap in front.gaps],
            }
            lines = [f"{problem.name}: {first.name} against {second.name}, {len(rows)} points"]
            for k, a, b, _, _, status, _ in rows:
                lines.append(f"  {k:3d}  {a:11.7f}  {b:11.7f}  {status}{empty.get(k, '')}")
            return content.getvalue(), facts, lines, f", {paths[0]} ..."

        members = [(f"{k:02d}", point) for k, point in enumerate(front.points)]
        return _save_family(options, front, table, members, stated.source, describe)


@cli.command(
    "steer",
    """\
Positive angles turn left, counter-clockwise. The problem states the gait that goes straight. Every
gait is a result: NAME.steer/00.h5 turns right the most, NAME.steer/spot_00.h5 with --spot. A
controller interpolates the joint angles in NAME.steer.json. Chord and radius are those of the arc
of a period.

  colloc steer mine.py --turn -40 -20 -10 0 10 20 40 --spot -30 30""",
    *cli.PROBLEM,
    cli.number(
        "--turn", "DEG", "per period (default: -30 -15 0 15 30)", [-30.0, -15.0, 0.0, 15.0, 30.0],
        nargs="+",
    ),
    cli.number("--spot", "DEG", "turns on the spot, with the least work", [], nargs="+"),
    cli.count("--starts", "N", "starting points for the straight gait (default: 32)"),
    cli.output("folder, or .json file (default: results/NAME.steer.json)"),
    cli.NO_FIGURE,
)  # fmt: skip
def steer(options: argparse.Namespace) -> int:
    cli.check_least(options, starts=1)
    if not all(abs(turn) < 180 for turn in (*options.turn, *options.spot)) or 0 in options.spot:
        raise ProblemError(
            "--turn and --spot take degrees between -180 and 180, --spot not 0: by more a body "
            "could turn the other way."
        )
    stated, problem = cli.read_problem(options)
    table = cli.output_path(options.output, Path("results") / f"{problem.name}.steer.json")
    from colloc.search.options import OPTIONS
    from colloc.studies.saved import checkpoints_in
    from colloc.studies.steering import steer as steer_problem

    with checkpoints_in(table.with_suffix("")):
        with cli.status_line(options) as line:
            line.say(f"{problem.name}: the straight gait")

            def report(turn: float, point: Solution) -> None:
                line.say(f"{problem.name}: {math.degrees(turn):+.4g} degrees a period: {point}")

            turns, spot = ([*map(math.radians, each)] for each in (options.turn, options.spot))
            starts = options.starts or stated.starts or OPTIONS.starts
            family = steer_problem(problem, turns, spot=spot, starts=starts, progress=report)
        spots = () if family.on_the_spot is None else family.on_the_spot.points
        members = [(f"{k:02d}", point) for k, point in enumerate(family.points)]
        members += [(f"spot_{k:02d}", point) for k, point in enumerate(spots)]

        def describe(paths: list[Path]) -> tuple[str, dict[str, Any], list[str], str]:
            lines = [f"{problem.name}: {len(members)} gaits that steer"]
            for (_, point), path in zip(members, paths, strict=True):
                arc = point.arc
                radius = f"{arc.radius:8.4f}" if math.isfinite(arc.radius) else "       -"
                lines.append(
                    f"  {math.degrees(arc.angle):+7.2f}°  radius {radius}  chord {arc.chord:.6f}  "
                    f"work {point.work:.6f}  efficiency {arc.chord / point.work:.6f}  "
                    f"{point.status}  {path}"
                )
            facts = family.table() | {"efficiency": family.efficiency.tolist()}
            return json.dumps(facts) + "\n", facts | {"file": str(table)}, lines, ""

        return _save_family(options, family, table, members, stated.source, describe)
