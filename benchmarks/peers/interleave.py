"""Runs every tool on the same starts, in turns: python -m benchmarks.peers.interleave --peers
peers-venv/bin/python

On a machine that others use, processor seconds depend on the hour. So all tools are started at once
and take turns, start by start (A B C A B C ...): what disturbs one disturbs all, and ratios hold.
One thread each. Writes results/peers/NAME.jsonl, which `benchmarks.peer_table` reads. --only takes
names of tools (default: those with their best options).
"""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

from benchmarks.peer_table import FOLDER, OTHERS, OWN, RECORDED_ONCE, Tool
from scripts.program import command_line

_ONE_THREAD = {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}


def started(tool: Tool, python: str, starts: int, first: int) -> subprocess.Popen[str]:
    """A tool's process, which waits for a line before every start."""
    command = [
        python,
        "-m",
        *tool.command,
        "--starts",
        str(starts),
        "--first",
        str(first),
        "--paced",
    ]
    pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE}
    return subprocess.Popen(command, text=True, env=os.environ | _ONE_THREAD, **pipes)  # type: ignore[call-overload]


def turn(process: subprocess.Popen[str]) -> str:
    """The next line of JSON of a tool (IPOPT's own words are passed over)."""
    assert process.stdin is not None
    assert process.stdout is not None
    process.stdin.write("\n")
    process.stdin.flush()
    for line in process.stdout:
        if line.startswith("{"):
            return line
    raise SystemExit(f"{' '.join(process.args)} ended early.")  # type: ignore[arg-type]


def main() -> None:
    options = command_line(__doc__, peers=sys.executable, starts=20, first=0, only=[str])
    tools = {**OWN, **OTHERS}
    names = options.only or [name for name in tools if name not in RECORDED_ONCE]
    FOLDER.mkdir(parents=True, exist_ok=True)
    running = {
        name: started(
            tools[name],
            sys.executable if name in OWN else options.peers,
            options.starts,
            options.first,
        )
        for name in names
    }
    files = {name: FOLDER / tools[name].file for name in names}
    for path in files.values():  # what an earlier run has beyond the first starts is made again
        kept = (
            path.read_text(encoding="utf-8").splitlines(keepends=True)[: options.first]
            if options.first
            else []
        )
        path.write_text("".join(kept), encoding="utf-8")
    for k in range(options.first, options.starts):
        for name, process in running.items():
            line = turn(process)
            with Path(files[name]).open("a", encoding="utf-8") as file:
                file.write(line)
            print(k, name, line[:70], flush=True)
    for process in running.values():
        process.communicate()


if __name__ == "__main__":
    main()
