"""A study of many cells through a Dask cluster of processes, killed half-way: overhead, memory, and what it goes on from.

    python -m benchmarks.many_cells --cells 10000 --chunk 10

A scheduler and two workers are started on this machine, then ``colloc sweep --dask``; cells are stand-ins that are not solved
(`benchmarks.sweep_scaling.nothing`), everything else is real: problems, tasks, the journal on the disk, the file for xarray.
When half the cells are in the journal the run is killed with -9 and the command given again.
"""

from __future__ import annotations

import argparse
import contextlib
import json
import os
import sqlite3
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

from benchmarks.sweep_scaling import nothing
from colloc.studies.journal import KIND, NAME
from colloc.system.row_file import read_rows

STUDY = "from benchmarks.sweep_scaling import study\nSTUDY = study({cells}, {chunk})\n"
_DASK = (sys.executable, "-m", "dask")


@contextlib.contextmanager
def started(folder: Path, workers: int) -> Iterator[tuple[str, subprocess.Popen]]:
    """A scheduler on the loopback address and workers: its address and its process."""
    file = folder / "scheduler.json"
    quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    here = ("--host", "127.0.0.1", "--no-dashboard")
    scheduler = subprocess.Popen([*_DASK, "scheduler", *here, "--port", "0", "--scheduler-file", str(file)], **quiet)  # type: ignore[call-overload]
    each = [*_DASK, "worker", *here, "--scheduler-file", str(file), "--nthreads", "1", "--no-nanny"]
    processes = [scheduler, *(subprocess.Popen([*each, "--local-directory", str(folder)], **quiet) for _ in range(workers))]  # type: ignore[call-overload]
    try:
        while not file.exists():
            time.sleep(0.1)
        yield json.loads(file.read_text(encoding="utf-8"))["address"], scheduler
    finally:
        for process in processes:
            process.kill()
            process.wait()


def used(process: subprocess.Popen) -> tuple[float, float]:
    """Processor seconds and megabytes of a process."""
    import psutil

    seen = psutil.Process(process.pid)
    times = seen.cpu_times()
    return times.user + times.system, seen.memory_info().rss / 2**20


def rows(journal: Path) -> int:
    """How many are on the disk."""
    if not journal.exists():
        return 0
    with contextlib.closing(sqlite3.connect(f"{journal.absolute().as_uri()}?mode=ro", uri=True, timeout=60)) as file:
        try:
            return int(file.execute(f'SELECT count(*) FROM "{KIND}"').fetchone()[0])
        except sqlite3.OperationalError:  # just made
            return 0


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--cells", type=int, default=10_000)
    parser.add_argument("--chunk", type=int, default=10)
    parser.add_argument("--run", nargs=2, metavar=("STUDY", "ADDRESS"), help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.run:
        _run(*options.run)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        journal = folder / "scaling.study" / NAME
        (folder / "s.py").write_text(STUDY.format(cells=options.cells, chunk=options.chunk), encoding="utf-8")
        with started(folder, 2) as (address, scheduler):
            command = [sys.executable, "-m", "benchmarks.many_cells", "--run", str(folder / "s.py"), address]
            empty = used(scheduler)
            for kill_at in (options.cells // 2, None):
                before, begin, first = rows(journal), time.monotonic(), 0.0
                seen, run = used(scheduler), subprocess.Popen(command, stdout=subprocess.DEVNULL)
                own = (0.0, 0.0)
                while run.poll() is None:
                    with contextlib.suppress(Exception):  # it may have ended a moment ago
                        own = used(run)
                    now = rows(journal)
                    if now > before and not first:
                        first = own[0]
                    if kill_at is not None and now >= kill_at:
                        run.kill()
                        break
                    time.sleep(0.2)
                run.wait()
                new, after = rows(journal) - before, used(scheduler)
                print(f"{'killed' if kill_at else 'ended'} with code {run.returncode} after {time.monotonic() - begin:.0f} s:")
                print(f"  {new} cells, {before} known before; {first:.1f} s of processor time before the first new row")
                print(f"  the run: {own[0] / max(new, 1) * 1e3:.2f} ms a cell, {own[0]:.1f} s, {own[1]:.0f} MB")
                spent = (after[0] - seen[0]) / max(new, 1) * 1e3
                print(f"  the scheduler: {spent:.2f} ms a cell, {after[1]:.0f} MB ({empty[1]:.0f} MB at first)", flush=True)
        found = read_rows(journal, KIND)
        problems = {entry["problem"] for entry in found.values.values()}
        print(f"{len(found.values)} rows, {len(problems)} problems of {options.cells}, {found.damaged} damaged")
        print(f"{journal.name}: {os.path.getsize(journal) / 2**20:.0f} MB")


def _run(study: str, address: str) -> None:
    """``colloc sweep`` with stand-ins for cells."""
    from colloc.commands.sweep import main as sweep
    from colloc.studies import run as study_run

    study_run.run_chunk = nothing
    sys.exit(sweep([study, "--dask", address, "--output", str(Path(study).parent), "--json"]))


if __name__ == "__main__":
    main()
