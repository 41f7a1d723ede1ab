"""Runs every tool on the same starts, in turns: python -m benchmarks.peers.interleave --peers
peers-venv/bin/python

On a machine that others use, processor seconds depend on the hour. So all tools are started at once
and take turns, start by start (A B C A B C ...): what disturbs one disturbs all, and ratios hold.
One thread each. Writes results/peers/NAME.jsonl, which `benchmarks.peer_table` reads. --only takes
names of tools (default: all), --intervals several meshes, each of which is a process of its own:

    python -m benchmarks.peers.interleave --starts 3 --intervals 6 12 48 96
"""

from __future__ import annotations

import json
import os
import subprocess
import sys

from benchmarks.peer_table import FOLDER, OTHERS, OWN, Tool, mesh_of
from benchmarks.peers.settings import INTERVALS
from scripts.program import add_to_record, command_line, read_record

_ONE_THREAD = {
    "OMP_NUM_THREADS": "1",
    "OPENBLAS_NUM_THREADS": "1",
    "XLA_FLAGS": "--xla_cpu_multi_thread_eigen=false",
}


def started(tool: Tool, python: str, **options: int) -> subprocess.Popen[str]:
    """A tool's process, which waits for a line before every start."""
    command = [python, "-m", *tool.command, "--paced"]
    for name, value in options.items():
        command += [f"--{name}", str(value)]
    pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE}
    return subprocess.Popen(command, text=True, env=os.environ | _ONE_THREAD, **pipes)  # type: ignore[call-overload]


def turn(process: subprocess.Popen[str]) -> dict:
    """The next run of a tool (IPOPT's own words are passed over)."""
    assert process.stdin is not None
    assert process.stdout is not None
    process.stdin.write("\n")
    process.stdin.flush()
    for line in process.stdout:
        if line.startswith("{"):
            return json.loads(line)
    raise SystemExit(f"{' '.join(process.args)} ended early.")  # type: ignore[arg-type]


def main() -> None:
    options = command_line(
        __doc__, peers=sys.executable, starts=20, only=[str], intervals=[INTERVALS]
    )
    tools = {**OWN, **OTHERS}
    running = {
        (name, intervals): started(
            tools[name],
            sys.executable if name in OWN else options.peers,
            starts=options.starts,
            intervals=intervals,
        )
        for name in options.only or tools
        for intervals in options.intervals
    }
    for name in {name for name, _ in running}:
        path = FOLDER / tools[name].file
        earlier = [run for run in read_record(path) if mesh_of(run) not in options.intervals]
        add_to_record(path, earlier, anew=True)
    for k in range(options.starts):
        for (name, intervals), process in running.items():
            run = turn(process)
            add_to_record(FOLDER / tools[name].file, [run])
            print(k, name, intervals, str(run)[:70], flush=True)
    for process in running.values():
        process.communicate()


if __name__ == "__main__":
    main()
