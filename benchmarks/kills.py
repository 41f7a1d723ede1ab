"""Does an interrupt lose anything? Solves are stopped at random moments; the same command again
must leave the same file.

    python -m benchmarks.kills --moments 100 [problems/three_link.py ...]

Each problem is solved once undisturbed. Then `python -m colloc solve` is stopped by SIGINT or
SIGKILL, in turn, at a random moment of that time (seed 0), and called again with the same
arguments, until it has gone to its end. What it leaves is held against the undisturbed file: every
number and every text to the last bit, times aside, and no other file beside it.
"""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import h5py
import numpy as np

from scripts.program import command_line

DEFAULT = (
    "three_link",
    "three_link_feet",
    "three_link_turning",
    "three_link_uphill",
    "wave_sine",
    "four_link",
)
STARTS = 4
ALL = {name: value for name, value in os.environ.items() if name != "OMP_NUM_THREADS"}
"""The environment of a command that uses all processors."""


def contents(path: Path) -> dict[str, bytes]:
    """All numbers and texts of a result, times aside."""
    found: dict[str, bytes] = {}

    def seen(name: str, thing: h5py.Dataset | h5py.Group) -> None:
        if isinstance(thing, h5py.Dataset) and "seconds" not in name:
            found[name] = np.asarray(thing[()]).tobytes()
        for key, value in thing.attrs.items():
            if "seconds" not in key and key not in ("REFERENCE_LIST", "DIMENSION_LIST"):
                found[f"{name} {key}"] = np.asarray(value).tobytes()

    with h5py.File(path) as file:
        file.visititems(seen)
    return found


def command(problem: Path, folder: Path) -> list[str]:
    options = ["--starts", str(STARTS), "--output", f"{folder}/", "--no-figure", "--quiet"]
    return [sys.executable, "-m", "colloc", "solve", str(problem), *options]


def stopped(problem: Path, folder: Path, asked: signal.Signals, seconds: float) -> bool:
    """Whether the command was stopped after so many seconds, before its end."""
    process = subprocess.Popen(
        command(problem, folder), stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, env=ALL
    )
    try:
        process.wait(seconds)
    except subprocess.TimeoutExpired:
        process.send_signal(asked)
    return process.wait(300) != 0


def lost(problem: Path, folder: Path, wanted: dict[str, bytes]) -> str:
    """What a solve that is taken up again in a folder leaves otherwise than an undisturbed one;
    empty if nothing."""
    subprocess.run(
        command(problem, folder),
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        env=ALL,
        check=False,
    )
    left = sorted(path.name for path in folder.iterdir())
    if len(left) != 1:
        return f"the files are {', '.join(left) or 'none'}"
    found = contents(folder / left[0])
    other = sorted(key for key in wanted.keys() | found.keys() if wanted.get(key) != found.get(key))
    return f"other in {', '.join(other[:5])}" if other else ""


def undisturbed(problem: Path) -> tuple[dict[str, bytes], float]:
    """The contents of the file that a solve leaves, and how long it takes [s]."""
    with tempfile.TemporaryDirectory() as name:
        begin = time.monotonic()
        subprocess.run(command(problem, Path(name)), stdout=subprocess.DEVNULL, env=ALL, check=True)
        return contents(next(Path(name).iterdir())), time.monotonic() - begin


def main() -> None:
    arguments = command_line(
        __doc__, ("problems", [Path("problems", f"{name}.py") for name in DEFAULT]), moments=100
    )
    if (
        signal.getsignal(signal.SIGINT) is signal.SIG_IGN
    ):  # in the background of a shell; what is started would ignore it too
        signal.signal(signal.SIGINT, signal.default_int_handler)
    rng, failed = np.random.default_rng(0), 0
    whole = {problem: undisturbed(problem) for problem in arguments.problems}
    for k in range(arguments.moments):
        problem = arguments.problems[k % len(whole)]
        wanted, seconds = whole[problem]
        asked = (signal.SIGINT, signal.SIGKILL)[k // len(whole) % 2]
        after = rng.uniform(0, seconds)
        with tempfile.TemporaryDirectory() as name:
            early = "stopped" if stopped(problem, Path(name), asked, after) else "ended"
            said = lost(problem, Path(name), wanted)
        failed += bool(said)
        print(
            f"{k:3d} {problem.stem:20} {asked.name:7} {early} by {after:5.2f} of {seconds:5.2f} s: "
            f"{said or 'the same file'}",
            flush=True,
        )
    print(
        f"{arguments.moments - failed} of {arguments.moments} left the file of an undisturbed "
        f"solve."
    )


if __name__ == "__main__":
    main()
