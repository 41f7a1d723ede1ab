"""Commands that solve many problems: many starts, a grid, a Pareto front, gaits that steer."""

from __future__ import annotations

import argparse
import json
import math
import time
from collections import Counter
from collections.abc import Sequence
from concurrent.futures import BrokenExecutor
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from colloc.commands import main as cli
from colloc.commands.solve import FamilyResult, bound_facts, find_family, find_front, save_and_tell
from colloc.gaits.gait_fields import fields
from colloc.gaits.objective import objective_from
from colloc.gaits.problem import Problem
from colloc.gaits.starts import LATIN_HYPERCUBE, SAMPLERS, on_speed_floor
from colloc.pictures import render
from colloc.results.archive import STATUSES, Basin, Outcome, basins, counts
from colloc.results.solution import SOLVED
from colloc.system.errors import ProblemError, StoreError
from colloc.system.files import SUFFIX, lock_file

if TYPE_CHECKING:
    from colloc.gaits.problem_file import ProblemFile
    from colloc.studies.study import Study
    from colloc.studies.sweep import StudyTable

_STARTS = cli.option(int, "--starts N", "starts 0 to N-1 (default: 20)", 20, least=1)
_TIME_LIMIT = cli.option(
    float, "--time-limit S", "seconds for one start (default: 300)", 300.0, least=0
)
_MOST_SHOWN = 12
_SAVE_EVERY = 60.0  # seconds


def starts_summary(
    problem: Problem, outcomes: Sequence[Outcome], path: Path | None
) -> tuple[list[Basin], dict[str, Any], list[str]]:
    """Distinct optima of starts, facts about all of them, and lines for people."""
    optima, tally = basins(problem, outcomes), counts(outcomes)
    failures = [o for o in outcomes if o.status != SOLVED]
    rows: list[dict[str, Any]] = [
        {
            "value": basin.best.value,
            "efficiency": basin.best.efficiency,
            "frequency": basin.frequency,
            "starts": list(basin.starts),
            "on_speed_floor": on_speed_floor(problem, basin.best.gait),
            "gait": fields(basin.best.gait),
        }
        for basin in optima
    ]
    facts = {
        "name": problem.name,
        "problem_hash": problem.hash,
        "file": str(path),
        "starts": len(outcomes),
        "counts": {status: tally.get(status, 0) for status in STATUSES},
        "optima": rows,
        "failures": [
            {name: getattr(o, name) for name in ("start", "status", "message")} for o in failures
        ],
    }
    best = [basin.best.start for basin in optima]
    more = {"f": facts, "best": best, "objective": problem.objective.name, "most": _MOST_SHOWN}
    return optima, facts, render("starts.txt", **more).splitlines()


@cli.command(
    *cli.PROBLEM,
    _STARTS,
    cli.option(int, "--seed N", "seed of the sampler (default: 0)", 0, least=0),
    cli.WORKERS,
    cli.option(
        str, "--sampler", "perturbed: near the problem's guess", LATIN_HYPERCUBE, choices=SAMPLERS
    ),
    _TIME_LIMIT,
    cli.RETRY,
    cli.BOUND,
    cli.option(int, "--start N", "with an archive: solve start N again and save it"),
    cli.VERBOSE,
    cli.output("folder, or .h5 file (default: results/NAME.starts.h5; beside an archive)"),
)
def multistart(options: argparse.Namespace) -> int:
    if Path(options.problem).suffix == SUFFIX:
        return _open_archive(options)
    if options.start is not None:
        raise ProblemError("--start opens a start of an archive: colloc multistart ARCHIVE.h5.")
    problem = cli.read_problem(options)[1]
    path = cli.output_path(options, Path("results") / f"{problem.name}.starts.h5")
    from colloc.bounds.optimality_gap import gap_line, upper_bound
    from colloc.results.archive import open_archive, save_archive
    from colloc.search.explore import with_reachable_distance
    from colloc.studies.solve import run_starts

    problem, _ = with_reachable_distance(problem)
    archive = open_archive(problem, path)  # or refused, before anything is solved
    search = options.sampler, options.seed, options.starts
    done = archive.done(*search, retry=options.retry)
    todo = (k for k in range(options.starts) if k not in done)  # may be more than memory holds
    to_go, loud, interrupted = options.starts - len(done), not cli.quiet(options), False
    settings = cli.values(options, "sampler", "seed", "workers", "time_limit")
    if loud:
        header = " start       value   iter  seconds  status"
        print(f"{len(done)} starts done already, {to_go} to go\n{header}", flush=True)
    begin = time.perf_counter()
    try:
        with cli.status_line(options) as line:
            line.say(f"{problem.name}: 0 of {to_go} starts")
            for k, o in enumerate(run_starts(archive, todo, **settings), 1):
                if loud:
                    line.clear()
                    numbers = f"{o.start:6d} {o.value:11.6f} {o.iterations:6d} {o.seconds:8.2f}"
                    print(f"{numbers}  {o.status}", flush=True)
                left = (time.perf_counter() - begin) / k * (to_go - k)
                line.say(f"{problem.name}: {k} of {to_go} starts", left)
    except KeyboardInterrupt:
        interrupted = True
    save_archive(archive, options.command)
    outcomes = list(archive.of_search(*search).values())
    optima, facts, lines = starts_summary(problem, outcomes, path)
    bound = upper_bound(problem, path.parent, compute=options.bound) if optima else None
    if optima:
        lines.append(gap_line(problem, max(basin.best.efficiency for basin in optima), bound))
        which = f" --seed {options.seed}" if options.seed else ""
        which += f" --sampler {options.sampler}" if options.sampler != LATIN_HYPERCUBE else ""
        start = f"--start {optima[0].best.start}{which}"
        lines.append(f"  colloc multistart {path} {start}   makes a result of the best")
    if others := len(archive.outcomes) - len(outcomes):
        line_ = f"  other starts in the file: {others}"
        solved = {name: o.value for name, o in archive.outcomes.items() if o.status == SOLVED}
        if solved:
            best = max(solved, key=lambda name: solved[name])
            where = f"start {best.number} of seed {best.seed} ({best.sampler})"
            line_ += f"; the best of all, {solved[best]:.6f}, is {where}"
        lines.append(line_)
    lines.append(f"  saved {path}")
    cli.tell(options, facts | {"bound": bound_facts(bound), "interrupted": interrupted}, lines)
    if interrupted:
        cli.complain("interrupted; run the same command again to go on.")
        return cli.INTERRUPTED
    return cli.OK if optima else cli.NONE_FOUND


def _open_archive(options: argparse.Namespace) -> int:
    from colloc.results.archive import StartName, archive_at

    unused = *cli.CHANGES, _STARTS, cli.WORKERS, _TIME_LIMIT, cli.RETRY, cli.BOUND
    cli.refuse(options, "an archive holds its problem and its starts", *unused)
    archive = archive_at(options.problem)
    problem, start = archive.problem, StartName(options.sampler, options.seed, options.start)
    if options.start is None:
        optima, facts, lines = starts_summary(problem, [*archive.outcomes.values()], archive.path)
        cli.tell(options, facts, lines)
        return cli.OK if optima else cli.NONE_FOUND
    if start not in archive.outcomes:
        there = sorted({f"{name.sampler} seed {name.seed}" for name in archive.outcomes})
        raise ProblemError(
            f"{options.problem} holds no start {options.start} of {options.sampler} seed "
            f"{options.seed}; it holds {len(archive.outcomes)} starts of "
            f"{', '.join(there) or 'no sampler'}."
        )
    name = f"{problem.name}.start-{options.start}.h5"
    path = cli.output_path(options, Path(options.problem).with_name(name))
    from colloc.studies.solve import reopen

    with cli.status_line(options) as line:
        line.say(f"{problem.name}: start {options.start}")
        solution = reopen(problem, archive.outcomes[start])
    return save_and_tell(options, solution, path)


@cli.command(
    cli.option(
        str, "study", "a Python file that states STUDY, for example studies/friction_plane.py"
    ),
    cli.WORKERS,
    cli.option(int, "--chunk N", "cells to a task, instead of the study's own number", least=1),
    cli.RETRY,
    cli.output("folder, or .nc file; NAME.study/ lies beside it (default: results/NAME.nc)"),
)
def sweep(options: argparse.Namespace) -> int:
    from colloc.studies.study import read_study_file

    study, source = read_study_file(options.study)
    if options.chunk is not None:
        study = replace(study, chunk=options.chunk)
    path = cli.output_path(options, Path("results") / f"{study.name}.nc")
    from colloc.bounds.optimality_gap import upper_bound
    from colloc.studies.sweep import StudyRun, save_study, study_table

    def known_bound(problem):
        known = upper_bound(problem, path.parent, compute=False)
        return None if known is None else known.sampled

    def save():
        table = study_table(run, known_bound)
        save_study(table, path, source=source, command=options.command)
        return table

    folder, interrupted = path.with_suffix(".study"), False
    with lock_file(folder / "lock"):
        run, total = StudyRun(study, folder, retry=options.retry), math.prod(study.shape)
        if not cli.quiet(options):
            print(f"{study.name}: {total} cells, {run.visited} of them in the journal", flush=True)
        due = time.perf_counter() + _SAVE_EVERY
        try:
            for news in run.run(workers=options.workers):
                if not cli.quiet(options):
                    print(news, flush=True)
                if (begin := time.perf_counter()) > due:
                    save()
                    due = (end := time.perf_counter()) + max(_SAVE_EVERY, 20 * (end - begin))
        except KeyboardInterrupt:
            interrupted = True
        except BrokenExecutor as error:
            what = f"no worker could be started ({error}); what is done is kept."
            raise StoreError(what) from None
        finally:
            table = save()
    cli.tell(options, *sweep_summary(study, table, path))
    if interrupted:
        cli.complain("interrupted; what is done is kept, and the same command goes on from there.")
        return cli.INTERRUPTED
    return cli.OK if (table.variables["status"] == SOLVED).all() else cli.NONE_FOUND


def sweep_summary(study: Study, table: StudyTable, path: Path) -> tuple[dict[str, Any], list[str]]:
    """Facts about a study at its end, and lines for people."""
    columns, total = table.variables, math.prod(study.shape)
    words = {SOLVED: SOLVED, "not tried": "not tried yet", "no problem": "no problem"}
    status = columns["status"]
    tally = Counter(words.get(each, "no verified gait") for each in status.flat)
    below = [*map(tuple, np.argwhere(columns["below_neighbour"]).tolist())]
    facts = {
        "name": study.name,
        "file": str(path),
        "cells": total,
        "counts": dict(tally),
        "below_neighbour": [study.coordinates(cell) for cell in below],
    }
    failed = [cell for cell in study.cells() if status[cell] not in (SOLVED, "not tried")]
    shown = {"below": below, "failed": failed, "columns": columns, "most": _MOST_SHOWN}
    return facts, render("sweep.txt", f=facts, study=study, **shown).splitlines()


def _begin(options: argparse.Namespace, ending: str) -> tuple[ProblemFile, Path, int | None]:
    file, problem = cli.read_problem(options)
    table = cli.output_path(options, Path("results") / f"{problem.name}.{ending}")
    return replace(file, problem=problem), table, options.starts or file.starts


def _end(options: argparse.Namespace, result: FamilyResult) -> int:
    family, facts, lines, saved = result
    cli.tell(options, facts, lines, saved)
    return cli.OK if family.certified else cli.FAILED


@cli.command(
    *cli.PROBLEM,
    cli.option(
        str,
        "--objectives",
        "default: distance, and what the problem maximises",
        (None, None),
        nargs=2,
        metavar=("FIRST", "SECOND"),
    ),
    cli.option(int, "--points N", "approximate number of gaits (default: 5)", 5, least=2),
    cli.option(int, "--starts N", "starting points for both ends (default: as solve)", least=1),
    cli.output("folder, or .csv file (default: results/NAME.front.csv)"),
    cli.NO_FIGURE,
)
def pareto(options: argparse.Namespace) -> int:
    first, second = (text and objective_from(text) for text in options.objectives)
    file, table, starts = _begin(options, "front.csv")
    how = {"first": first, "second": second, "points": options.points, "starts": starts}
    return _end(options, find_front(options, file, table, **how))


@cli.command(
    *cli.PROBLEM,
    cli.option(float,
        "--turn DEG", "per cycle (default: -30 -15 0 15 30)", [-30.0, -15.0, 0.0, 15.0, 30.0],
        nargs="+"),
    cli.option(float, "--spot DEG", "turns on the spot, with the least work", [], nargs="+"),
    cli.option(int, "--starts N", "starts for the straight gait (default: 32)", least=1),
    cli.output("folder, or .json file (default: results/NAME.steer.json)"),
    cli.NO_FIGURE,
)  # fmt: skip
def steer(options: argparse.Namespace) -> int:
    file, table, starts = _begin(options, "steer.json")

    def find(say):
        from colloc.studies.families import steer as find_gaits

        def report(turn, point):
            say(f"{math.degrees(turn):+.4g} degrees per cycle", point)

        say("the straight gait")
        turns, spot = ([*map(math.radians, each)] for each in (options.turn, options.spot))
        how = {} if starts is None else {"starts": starts}
        return find_gaits(file.problem, turns, spot=spot, progress=report, **how)

    def describe(family, members):
        facts = family.table() | {"efficiency": family.efficiency.tolist()}
        how: Any = {"degrees": math.degrees, "isfinite": math.isfinite}
        lines = render("steer.txt", members=members, **how).splitlines()
        return json.dumps(facts) + "\n", facts, lines

    return _end(options, find_family(options, file, table, find, describe))
