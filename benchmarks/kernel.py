"""The compiled kernel beside NumPy in the same run: python -m benchmarks.kernel [--quick]

Instants, certified starts, ellipse gaits and bounds, each by the kernel and by NumPy in turn:
processor time, as a ratio, and its distance to a floor that is stated with it.
"""

from __future__ import annotations

import contextlib
import dataclasses
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any
from unittest import mock

import numpy as np

from benchmarks.tables import interleaved_seconds, markdown_table
from colloc import Chain, Friction, solve_balance
from colloc.bounds import cutting_plane, sampling
from colloc.bounds.sampled import QUICK, compute_bound
from colloc.gaits.problem_file import read_problem_file
from colloc.gaits.starts import LATIN_HYPERCUBE, start_gait
from colloc.mechanics.native_kernel import native_kernel, numpy_instead
from colloc.results.solution import SOLVED
from colloc.search.solve import solve
from scripts.models.ellipses import admissible
from scripts.models.sweep import Route, performance
from scripts.program import command_line

BODY, ISOTROPIC = Chain(), Friction()
LAWS = (ISOTROPIC, Friction(mu_t=2.5, mu_f=1, mu_b=1.6))
START_FLOOR = 0.1
"""Processor time of a certified start below which what is not the balance would have to be
rewritten as well [s]."""
WAYS: dict[str, Callable[[], contextlib.AbstractContextManager]] = {
    "kernel": contextlib.nullcontext,
    "NumPy": numpy_instead,
}


def random_instants(count: int, seed: int = 2) -> tuple[np.ndarray, np.ndarray]:
    """Angles over all of shape space and rates with the larger one 1, ``(2, count)`` each."""
    rng = np.random.default_rng(seed)
    angles, rates = rng.uniform(-np.pi, np.pi, (2, count)), rng.uniform(-1, 1, (2, count))
    return angles, rates / np.abs(rates).max(axis=0)


def by_both(work: Callable[[], object], rounds: int = 3) -> dict[str, float]:
    """Median processor time of the work by each way."""

    def done(way: Callable[[], contextlib.AbstractContextManager]) -> Callable[[], None]:
        def run() -> None:
            with way():
                work()

        return run

    return interleaved_seconds(
        {name: done(way) for name, way in WAYS.items()}, rounds, at_least=0.2
    )


def instants(quick: bool) -> str:
    """Instants a second and core, from rest, for three links; the floor is one bare evaluation of
    the forces a step."""
    rows: list[list[object]] = []
    many = random_instants(10_000)
    for law in LAWS[: 1 if quick else 2]:
        for delta in (1e-4,) if quick else (1e-2, 1e-4, 1e-8):
            steps = solve_balance(BODY, law, *many, delta).iterations.mean()
            bare = interleaved_seconds(
                {"": partial(solve_balance, BODY, law, *many, delta, tolerance=1e300)}
            )[""]
            for count in (60, 10_000):
                seconds = by_both(partial(solve_balance, BODY, law, *random_instants(count), delta))
                each = {name: value / count for name, value in seconds.items()}
                row = [
                    dataclasses.astuple(law),
                    f"{delta:.0e}",
                    count,
                    *(f"{1 / each[way]:,.0f}" for way in WAYS),
                ]
                rows.append(
                    [
                        *row,
                        each["NumPy"] / each["kernel"],
                        each["kernel"] / (steps + 1) / bare * 10_000,
                    ]
                )
    head = [
        "friction (t, f, b)",
        "delta",
        "at once",
        *(f"{w}, a second" for w in WAYS),
        "ratio",
        "times the floor",
    ]
    return (
        "Instants of three links, residual 1e-11 (floor: one evaluation of the forces a step).\n\n"
        + markdown_table(head, rows)
    )


def starts(count: int) -> str:
    """Whole certified starts of `problems/three_link.py`, without and with direction in the law."""
    rows = []
    stated = read_problem_file(Path("problems/three_link.py")).problem
    for law in LAWS:
        problem = dataclasses.replace(stated, friction=law)
        solve(problem, 1)
        spent, certified, furthest = dict.fromkeys(WAYS, 0.0), dict.fromkeys(WAYS, 0), 0.0
        for k in range(count):
            found = {}
            guessed = dataclasses.replace(problem, guess=start_gait(problem, LATIN_HYPERCUBE, 0, k))
            for name, way in WAYS.items():
                begin = time.process_time()
                with way():
                    found[name] = solve(guessed, 1)
                spent[name] += time.process_time() - begin
                certified[name] += found[name].status == SOLVED
            furthest = max(furthest, abs(found["kernel"].efficiency - found["NumPy"].efficiency))
        each = {name: spent[name] / max(certified[name], 1) for name in WAYS}
        shares = ", ".join(f"{certified[name]}" for name in WAYS)
        rows.append(
            [dataclasses.astuple(law), f"{shares} of {count}", each["kernel"], each["NumPy"]]
        )
        rows[-1] += [
            each["NumPy"] / each["kernel"],
            each["kernel"] / START_FLOOR,
            f"{furthest:.0e}",
        ]
    head = [
        "friction (t, f, b)",
        "certified",
        *(f"{w}, s a start" for w in WAYS),
        "ratio",
        "times the floor",
        "efficiencies differ by",
    ]
    return f"Certified starts (floor: {START_FLOOR} s).\n\n" + markdown_table(head, rows)


def sweep(quick: bool) -> str:
    """Ellipse gaits at 100 instants, solved directly; the floor is the balance alone."""
    gaits = np.random.default_rng(0).uniform(0, np.pi, (3, 20_000))
    gaits = gaits[:, admissible(BODY, gaits)][:, : 200 if quick else 1000]
    route = Route(BODY, ISOTROPIC, 1e-4)
    seconds = by_both(partial(performance, route, gaits, instants=100), 1 if quick else 3)
    angles, rates = random_instants(10_000)
    alone = interleaved_seconds(
        {"": partial(solve_balance, BODY, ISOTROPIC, angles, rates, 1e-4, tolerance=1e-8)}
    )[""]
    floor = 50 * alone / 10_000
    each = {name: value / gaits.shape[1] for name, value in seconds.items()}
    row = [
        *(f"{1 / each[w]:,.0f}" for w in WAYS),
        each["NumPy"] / each["kernel"],
        each["kernel"] / floor,
        1e5 * each["kernel"],
    ]
    head = [
        *(f"{w}, gaits a second" for w in WAYS),
        "ratio",
        "times the floor",
        "100,000 gaits, s of one core",
    ]
    return "Ellipse gaits at 100 instants (floor: the balance alone).\n\n" + markdown_table(
        head, [row]
    )


class _Timed:
    """A function and the processor time spent in it."""

    def __init__(self, function: Callable) -> None:
        self.function, self.seconds = function, 0.0

    def __call__(self, *arguments, **named):
        begin = time.process_time()
        try:
            return self.function(*arguments, **named)
        finally:
            self.seconds += time.process_time() - begin


def bounds(quick: bool) -> str:
    """The sampled bound; floors are the balances and the programs. A guarantee has no NumPy to be
    compared with."""
    domain = sampling.Domain(BODY, ISOTROPIC, float(np.pi))
    budget = dataclasses.replace(QUICK, intervals=5, shapes=10, rounds=3) if quick else QUICK
    seconds, values, floor = {}, {}, 0.0
    for way, within in WAYS.items():
        balances, programs = _Timed(sampling.all_motions), _Timed(cutting_plane.smallest_maximum)
        with (
            within(),
            mock.patch.object(sampling, "all_motions", balances),
            mock.patch.object(cutting_plane, "smallest_maximum", programs),
        ):
            begin = time.process_time()
            values[way] = compute_bound(domain, budget).sampled
            seconds[way] = time.process_time() - begin
        if way == "kernel":
            floor = balances.seconds + programs.seconds
    row: list[Any] = [
        f"sampled, {budget.intervals} x {budget.intervals}",
        f"{values['kernel']:.4f}, {values['NumPy']:.4f}",
    ]
    row += [
        seconds["kernel"],
        seconds["NumPy"],
        seconds["NumPy"] / seconds["kernel"],
        floor,
        seconds["kernel"] / floor,
    ]
    head = ["bound", "values", *(f"{w}, s" for w in WAYS), "ratio", "floor, s", "times the floor"]
    return (
        "Bounds (floor: the kernel's balances and the programs of the exchange alone).\n\n"
        + markdown_table(head, [row])
    )


def main() -> None:
    quick = command_line(__doc__, quick=False).quick
    if native_kernel() is None:
        raise SystemExit("no C compiler on this machine, so there is nothing to compare.")
    for table in (instants(quick), starts(2 if quick else 10), sweep(quick), bounds(quick)):
        print(table, end="\n\n", flush=True)


if __name__ == "__main__":
    main()
