"""One line of JSON a start, with its processor seconds; paced by whoever wants several tools to
take turns."""

from __future__ import annotations

import argparse
import json
import os
import sys
import time
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from benchmarks.peers.settings import INTERVALS
from benchmarks.peers.starts import starts


def arguments(page: str, **flags: str) -> argparse.Namespace:
    """The options of a tool's script: --starts, --intervals, --paced, and its own switches with
    their help."""
    parser = argparse.ArgumentParser(
        description=page, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--starts", type=int, default=20)
    parser.add_argument("--intervals", type=int, default=INTERVALS, help="on half a period")
    parser.add_argument(
        "--paced", action="store_true", help="wait for a line on standard input before every start"
    )
    for name, words in flags.items():
        parser.add_argument(f"--{name}", action="store_true", help=words)
    return parser.parse_args()


def run(
    options: argparse.Namespace, build: Callable[[], Any], solve: Callable[[Any, np.ndarray], dict]
) -> None:
    """Prints what `solve` makes of every start; seconds of `build` stand apart. What solves several
    starts `at_once` counts a share for each."""
    program, built = None, 0.0
    for start in starts(options.starts):
        if options.paced:
            sys.stdin.readline()
        begin = _processor_seconds()
        if program is None:
            program = build()
            begin, built = _processor_seconds(), _processor_seconds() - begin
        result = solve(program, start)
        spent = (_processor_seconds() - begin) / result.get("at_once", 1)
        result |= {"cpu": spent, "build": built, "intervals": options.intervals}
        print(json.dumps(result | {"start": start.tolist()}), flush=True)


def _processor_seconds() -> float:
    """Of this process and of its children that have ended (a compiler)."""
    return time.process_time() + sum(os.times()[2:4])


def words_of(error: Exception) -> str:
    """The end of a message, where IPOPT's verdict stands."""
    return " ".join(str(error).split())[-80:]


def failed(level: float, message: str) -> dict:
    """A start that ended at a level of delta."""
    return {"failed_at": level, "message": message[:80]}


def found(efficiency: float, parameters: Sequence[float] | np.ndarray) -> dict:
    """A start that ended in a gait (A0, A1, B1)."""
    return {"efficiency": float(efficiency), "gait": [float(value) for value in parameters]}
