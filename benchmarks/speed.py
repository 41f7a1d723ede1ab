"""What takes how long, as ratios to a fixed load, and how it grows: python -m benchmarks.speed
[--quick]

The load is Python and small NumPy calls, as a search is, and is measured before and after every
work: a busy or slow machine changes both. Every work runs in a process of its own, forked from this
one, whose memory is the least that is seen. Error over processor time: python -m
benchmarks.work_precision. What it calls is public, so the same file measures an earlier colloc too:
in its tree, python -m benchmarks.speed with this file in place of its own. What that has not yet is
nan.
"""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

import colloc
from benchmarks.tables import markdown_table
from benchmarks.zoo import zoo_problem
from scripts.program import command_line

MAIN = Path(__file__).resolve().parents[1] / "problems/three_link.py"
SHELL = {
    "`import colloc`": ("-c", "import colloc"),
    "`colloc --help`": ("-m", "colloc", "--help"),
    "main job, no figure": ("-m", "colloc.solve", str(MAIN), "--quiet", "--no-figure"),
    "main job": ("-m", "colloc.solve", str(MAIN), "--quiet"),
}
"""Commands of the shell, as a user waits for them."""
_LOAD = 100_000
"""Rounds of the load: an eighth of a second of a quiet processor."""


def load() -> float:
    """Processor time of the fixed load."""
    begin, x = time.process_time(), np.linspace(0.0, 1.0, 72)
    for _ in range(_LOAD):
        x = np.sqrt(x * x + 1e-12)
    return time.process_time() - begin


def in_a_process(work: Callable[[], object]) -> tuple[float, float]:
    """Processor time of a work [s] and the largest memory of its process [MB]. `ChildProcessError`
    if it fails."""
    process = os.fork()
    if process == 0:
        with open(os.devnull, "w") as nowhere:
            os.dup2(nowhere.fileno(), 1)
        try:
            work()
        finally:
            os._exit(0 if sys.exc_info()[0] is None else 1)
    _, status, used = os.wait4(process, 0)
    if status != 0:
        raise ChildProcessError(f"a work ended with {status}")
    return used.ru_utime + used.ru_stime, used.ru_maxrss / 1024


def measured(work: Callable[[], object], rounds: int = 1) -> tuple[float, float, float]:
    """Median over rounds of processor time over that of the load, seconds, and memory; nan where
    the work fails."""
    found = []
    for _ in range(rounds):
        before = load()
        try:
            seconds, memory = in_a_process(work)
        except ChildProcessError:
            seconds = memory = np.nan
        found.append((2 * seconds / (before + load()), seconds, memory))
    return tuple(np.median(found, axis=0))


def works(rounds: int, zoo: int) -> str:
    """The main job as a whole and in parts, a warm start, and random problems."""
    problem = colloc.load_problem(MAIN)
    known = colloc.solve(problem)
    warm = problem.with_(guess=known.gait)
    rows: list[Sequence[object]] = []
    with TemporaryDirectory() as place:
        os.chdir(place)
        # as users have it: modules are compiled once
        ordinary = {**os.environ, "PYTHONDONTWRITEBYTECODE": ""}
        for name, words in SHELL.items():
            command = partial(os.execve, sys.executable, [sys.executable, *words], ordinary)
            in_a_process(command)
            rows.append((name, *measured(command, rounds)))
    rows.append(("solve, loaded before", *measured(partial(colloc.solve, problem), rounds)))
    rows.append(("solve from the answer", *measured(partial(colloc.solve, warm, 1), rounds)))
    rows.append(
        (
            "certificate of its gait alone",
            *measured(lambda: colloc.evaluate(problem, known.gait), rounds),
        )
    )
    each = [measured(partial(colloc.solve, zoo_problem(number))) for number in range(zoo)]
    rows.append((f"median of the zoo's first {zoo}", *np.median(each, axis=0)))
    rows.append(("ten links, one harmonic", *measured(partial(colloc.solve, grown(links=10)))))
    return markdown_table(("work", "times the load", "s", "MB"), rows)


def grown(links: int = 3, harmonics: int = 1, intervals: int = 24, feet: int = 0) -> colloc.Problem:
    """A problem of some size. Two links get nowhere where friction forward and backward is
    alike."""
    body = (
        colloc.Chain((1 / links,) * links, feet=feet)
        if feet
        else colloc.Chain((1 / links,) * links)
    )
    friction, kind = (
        colloc.Friction(mu_t=2, mu_f=1, mu_b=2 if links == 2 else 1),
        colloc.Harmonic(harmonics, "bilateral"),
    )
    return colloc.Problem(
        "grown", body=body, friction=friction, gait=kind, intervals=intervals, delta=1e-3
    )


def swept(cells: int) -> object:
    """A study of so many coefficients of friction."""
    axis = colloc.Axis("mu_t", tuple(np.geomspace(0.5, 8.0, cells)))
    return colloc.sweep(
        colloc.Study(
            "grown",
            (axis,),
            lambda mu_t: grown().with_(friction=colloc.Friction(mu_t=mu_t, mu_f=1, mu_b=1)),
        )
    )


def growth(quick: bool) -> str:
    """One start, or more, or a sweep against sizes: the largest tried, and the exponent between the
    last two."""
    sizes = {
        "links": (2, 3, 5, 10) if quick else (2, 3, 5, 10, 20, 40),
        "harmonics": (1, 4) if quick else (1, 4, 8, 16),
        "intervals": (24, 96) if quick else (24, 96, 384),
        "feet": (1, 2) if quick else (1, 2, 4),
        "starts": (2, 8) if quick else (2, 8, 32, 128),
        "cells": (2, 8) if quick else (2, 8, 32, 128),
    }
    rows = []
    for name, tried in sizes.items():
        found = np.array([measured(_sized(name, size)) for size in tried])
        powers = np.log(found[-1] / found[-2]) / np.log(tried[-1] / tried[-2])
        each = ", ".join(
            f"{size}: {ratio:.3g}" for size, ratio in zip(tried, found[:, 0], strict=True)
        )
        rows.append((name, each, powers[0], found[-1, 2], powers[2]))
    return markdown_table(
        ("of", "size: times the load", "exponent", "MB at the largest", "its exponent"), rows
    )


def _sized(name: str, size: int) -> Callable[[], object]:
    if name == "cells":
        return partial(swept, size)
    return lambda: (
        colloc.solve(grown(), size) if name == "starts" else colloc.solve(grown(**{name: size}), 1)
    )


def main() -> None:
    quick = command_line(__doc__, quick=False).quick
    print(f"The load takes {load():.3f} s of processor time now.", end="\n\n", flush=True)
    print(works(1 if quick else 5, 3 if quick else 25), end="\n\n", flush=True)
    print(growth(quick), flush=True)


if __name__ == "__main__":
    main()
