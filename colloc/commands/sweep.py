"""Command line: run a study file over processes or a Dask cluster; resumable, and nothing finished
is ever lost."""

from __future__ import annotations

import argparse
import os
import sys
import time
from collections import Counter
from collections.abc import Callable
from concurrent.futures import BrokenExecutor, Executor
from dataclasses import replace
from pathlib import Path

from colloc.commands.ending import INTERRUPTED, NONE_FOUND, OK, command
from colloc.commands.options import add_printing, new_parser, output_folder, tell
from colloc.studies.study import Study, read_study_file
from colloc.system.errors import CollocError, ProblemError, StoreError

_SAVE_EVERY = 60.0
_MOST_FAILURES_SHOWN = 12


def _parser() -> argparse.ArgumentParser:
    parser = new_parser(
        "sweep",
        "Solve every problem of a study file; starts travel between neighbours. What is done is "
        "not solved again.",
        "Exit codes: 0 every cell has a certified gait; 2 bad study, option or folder; 3 some "
        "cells have none;\n"
        "130 interrupted (what is done is kept). A study file is Python code, and is executed.",
    )
    parser.add_argument(
        "study", help="a Python file that states STUDY, for example studies/friction_plane.py"
    )
    parser.add_argument(
        "--workers",
        type=int,
        default=1,
        metavar="N",
        help="processes, one BLAS thread each (default: 1)",
    )
    parser.add_argument(
        "--dask",
        metavar="ADDRESS",
        help="scheduler of a Dask cluster (tcp://host:8786), or 'local'",
    )
    parser.add_argument(
        "--chunk", type=int, metavar="N", help="cells to a task, instead of the study's own number"
    )
    parser.add_argument(
        "--retry",
        action="store_true",
        help="solve again what ended in an error, a crash or the time limit",
    )
    parser.add_argument(
        "--output",
        metavar="FOLDER",
        default="results",
        help="for NAME.nc and NAME.study/ (default: results)",
    )
    add_printing(parser)
    return parser


@command(_parser)
def main(options: argparse.Namespace) -> int:
    for name, value in (("workers", options.workers), ("chunk", options.chunk)):
        if value is not None and value < 1:
            raise ProblemError(f"--{name} must be at least 1, not {value}.")
    study, source = read_study_file(options.study)
    if options.chunk is not None:
        study = replace(study, chunk=options.chunk)
    return _run(study, source, options)


def _executor(options: argparse.Namespace) -> tuple[Callable[[int], Executor] | None, int]:
    """What runs the tasks (None: processes), and how many workers it has."""
    if options.dask is None:
        return None, options.workers
    from colloc.system.dask_pool import connected

    return connected(
        options.dask,
        options.workers,
        lambda text: print(f"colloc: {text}", file=sys.stderr, flush=True),
    )


def _run(study: Study, source: str, options: argparse.Namespace) -> int:
    # heavy imports only now: a bad study is refused at once
    from colloc.studies.run import StudyRun
    from colloc.system.replaced_file import locked

    out = output_folder(options.output)
    folder, quiet = out / f"{study.name}.study", options.quiet or options.json
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise StoreError(f"cannot make the folder {folder}: {error.strerror or error}.") from None
    if not (os.access(folder, os.W_OK) and os.access(out, os.W_OK)):
        raise StoreError(f"cannot write in {out}; choose another --output.")
    with locked(folder / "lock"):
        run = StudyRun(study, folder, retry=options.retry)
        if not quiet:
            _announce(run)
        try:
            interrupted = _work(
                run, options, quiet, lambda: _save(run, out, source, options.command)
            )
        except CollocError:
            _save(run, out, source, options.command)
            raise
        path = _save(run, out, source, options.command)
    tell(options, _summary(run, path), _summary_lines(run, path))
    if interrupted:
        print(
            "colloc: interrupted; what is done is kept, and the same command goes on from there.",
            file=sys.stderr,
        )
        return INTERRUPTED
    return OK if all(state.best for state in run.cells.values()) else NONE_FOUND


def _announce(run) -> None:
    todo, total = len(run.missing), len(run.cells)
    print(
        f"{run.study.name}: {total} cells, {total - todo} done already or without a problem, "
        f"{todo} to go",
        flush=True,
    )


def _work(run, options: argparse.Namespace, quiet: bool, save: Callable[[], Path]) -> bool:
    """Work until all is done, or interrupted."""
    from colloc.system.task_pool import process_pool

    executor, workers = _executor(options)
    begin = time.perf_counter()
    due = begin + _SAVE_EVERY
    number = 0
    try:
        for progress in run.run(workers=workers, executor=executor or process_pool):
            if progress.round != number:
                number, begin = progress.round, time.perf_counter()
            if not quiet:
                best = progress.state.best
                what = f"{best.outcome.value:9.6f}" if best else "     none"
                tries = Counter(a.outcome.status for a in progress.new)
                told = ", ".join(f"{n} {status}" for status, n in tries.items())
                left = (
                    (time.perf_counter() - begin) / progress.done * (progress.total - progress.done)
                )
                print(
                    f"{run.study.label(progress.cell)}: {what}  ({told}; round {number}: "
                    f"{progress.done} of "
                    f"{progress.total}, {left:.0f} s left)",
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


def _save(run, out: Path, source: str, command: str) -> Path:
    from colloc.bounds.optimality_gap import upper_bound
    from colloc.gaits.problem import Problem
    from colloc.studies.table import save_study, study_table

    def bound(problem: Problem) -> float | None:
        known = upper_bound(problem, out, compute=False)
        return None if known is None else known.sampled

    return save_study(
        study_table(run, bound), out / f"{run.study.name}.nc", source=source, command=command
    )


def _summary(run, path: Path) -> dict:
    from colloc.studies.table import NO_PROBLEM, NOT_TRIED

    counts = Counter(
        "solved"
        if s.best
        else NO_PROBLEM
        if s.problem is None
        else "no certified gait"
        if s.attempts
        else f"{NOT_TRIED} yet"
        for s in run.cells.values()
    )
    below = [run.study.coordinates(cell) for cell in run.cells if run.below_neighbour(cell)]
    return {
        "name": run.study.name,
        "file": str(path),
        "cells": len(run.cells),
        "counts": dict(counts),
        "below_neighbour": below,
    }


def _summary_lines(run, path: Path) -> list[str]:
    counts = ", ".join(f"{n} {what}" for what, n in _summary(run, path)["counts"].items())
    lines = [f"{run.study.name}: {len(run.cells)} cells: {counts}; saved {path}"]
    below = [cell for cell in run.cells if run.below_neighbour(cell)]
    if below:
        lines.append(
            f"  {len(below)} of them below what a neighbour's gait achieves there as it is: more "
            f"starts may find more"
        )
    for cell in below[:_MOST_FAILURES_SHOWN]:
        found, could = run.cells[cell].best.outcome.value, run.neighbour_value(cell)
        lines.append(
            f"  {run.study.label(cell)}: {found:.6f}, where a neighbour's gait achieves {could:.6f}"
        )
    failed = [
        (cell, state)
        for cell, state in run.cells.items()
        if not state.best and (state.attempts or state.message)
    ]
    for cell, state in failed[:_MOST_FAILURES_SHOWN]:
        message = state.attempts[-1].outcome.message if state.attempts else state.message
        lines.append(f"  {run.study.label(cell)}: {message}")
    if len(failed) > _MOST_FAILURES_SHOWN:
        lines.append(
            f"  ... and {len(failed) - _MOST_FAILURES_SHOWN} more; all are in the file, with their "
            f"messages"
        )
    return lines
