"""Throughput of a study on 1 and 2 workers, overhead of scheduling a task, and where more workers stop helping.

    python -m benchmarks.sweep_scaling [--cells 24] [--dask]

*Throughput*: one study of identical small problems is run with one worker and with two. Workers start before the clock
does. Three figures tell scaling from the load of the machine: wall time; the share of the wall time that workers were busy
(what scheduling leaves idle is ours, whatever else the machine does); processor time a cell (what cores cost each other).

*Overhead*: tasks that do nothing pass through the whole path of a study, the journal on the disk included. One scheduling
process hands out at most 1/overhead tasks a second, so workers beyond (seconds a task)/overhead wait for it.
"""

from __future__ import annotations

import argparse
import os
import tempfile
import time
from collections.abc import Callable
from concurrent.futures import Executor
from pathlib import Path
from typing import NamedTuple

from colloc import Friction, Harmonic, Problem, ellipse
from colloc.results.outcome import Outcome
from colloc.studies import run as study_run
from colloc.studies.cell import Attempt, Visit, Work, run_chunk, start_key
from colloc.studies.run import StudyRun
from colloc.studies.study import Axis, Study
from colloc.system.task_pool import one_thread_each, process_pool


def problem(x: float) -> Problem:
    """A small solve whose time hardly depends on x."""
    return Problem(
        "scaling",
        ellipse(0.0, 2.85, 1.3),
        friction=Friction(1 + 1e-3 * x, 1, 1),
        gait=Harmonic(1, "bilateral"),
        delta=1e-3,
        delta_start=1e-3,
        intervals=14,
        mesh_tolerance=1e-4,
    )


def study(cells: int, chunk: int = 1) -> Study:
    """Cells that do not wait for each other."""
    axis = Axis("x", tuple(range(cells)), travels=False)
    return Study("scaling", (axis,), problem, cold_starts=0, chunk=chunk)


def nothing(chunk: tuple[Work, ...]) -> list:
    """Answers a task without solving anything."""
    results = []
    for work in chunk:
        guess = work.problem.guess
        attempt = Attempt("none", start_key(guess), Outcome(0, "solved", "", guess, guess, 0.2))
        results.append(Visit(work.cell, [attempt]))
    return results


def warmed(workers: int, executor: Callable[[int], Executor]) -> Executor:
    """An executor whose workers have imported and solved once."""
    with one_thread_each():
        pool = executor(workers)
        own = [StudyRun(study(1), Path(tempfile.mkdtemp()))._work((0,), ((0,),), None) for _ in range(workers)]
        for future in [pool.submit(run_chunk, (work,)) for work in own]:
            future.result()
    return pool


class Timing(NamedTuple):
    """Of a run: its wall seconds, processor seconds of the scheduling process, and both summed over cells on the workers."""

    wall: float
    own: float
    busy: float
    cpu: float


def timed(cells: int, workers: int, pool: Executor, ahead: int | None = None, chunk: int = 1) -> Timing:
    """Run a study of so many cells."""
    with tempfile.TemporaryDirectory() as folder:
        run = StudyRun(study(cells, chunk), Path(folder))
        begin, own = time.perf_counter(), time.process_time()
        for _ in run.run(workers=workers, executor=lambda n: pool, ahead=ahead):
            pass
        wall, own = time.perf_counter() - begin, time.process_time() - own
    outcomes = [a.outcome for state in run.cells.values() for a in state.attempts]
    return Timing(wall, own, sum(o.seconds for o in outcomes), sum(o.cpu_seconds for o in outcomes))


def overhead(tasks: int, workers: int, pool: Executor, chunk: int) -> float:
    """Processor seconds a task of the scheduling process, for tasks that do nothing."""
    before = study_run.run_chunk
    study_run.run_chunk = nothing
    try:
        return timed(tasks * chunk, workers, pool, 4 * workers, chunk).own / tasks
    finally:
        study_run.run_chunk = before


def main() -> None:
    parser = argparse.ArgumentParser(description="Scaling of studies; see the top of this file.")
    parser.add_argument("--cells", type=int, default=24)
    parser.add_argument("--tasks", type=int, default=1000)
    parser.add_argument("--dask", action="store_true", help="measure the overhead with a local Dask cluster, too")
    options = parser.parse_args()
    print(f"load of the machine at the start: {os.getloadavg()[0]:.1f} on {os.cpu_count()} processors")
    rates, busy, cpus = [], [], []
    for workers in (1, 2):
        run = timed(options.cells, workers, warmed(workers, process_pool))
        rates.append(options.cells / run.wall)
        busy.append(run.busy / workers / run.wall)
        cpus.append(run.cpu / options.cells)
        print(
            f"{workers} workers: {options.cells} cells in {run.wall:.1f} s, {rates[-1]:.3f} a second; workers busy "
            f"{busy[-1]:.1%}; {cpus[-1]:.2f} s of processor time a cell"
        )
    print(f"efficiency of scaling by wall time: {rates[1] / rates[0] / 2:.1%}")
    print(f"without the load of others (busy share over processor time a cell): {busy[1] / busy[0] * cpus[0] / cpus[1]:.1%}")
    makers: list[tuple[str, Callable[[int], Executor]]] = [("processes", process_pool)]
    if options.dask:
        from distributed import Client

        client = Client(n_workers=2, threads_per_worker=1, dashboard_address=":0")
        makers.append(("Dask", lambda n: client.get_executor(pure=False)))
    for name, maker in makers:
        for chunk in (1, 10):
            own = overhead(options.tasks // chunk, 2, warmed(2, maker), chunk)
            print(
                f"{name}, {chunk} cells a task: {own * 1e3:.2f} ms of the scheduler a task, {own / chunk * 1e3:.2f} ms "
                f"a cell; at {cpus[0]:.2f} s a cell it keeps {cpus[0] * chunk / own:,.0f} workers busy",
                flush=True,
            )


if __name__ == "__main__":
    main()
