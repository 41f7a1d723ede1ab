"""What every heuristic of the search trades: each a third and three times as large, and problems of
the zoo solved with it.

    python -m benchmarks.numbers
    python -m benchmarks.numbers --names hop patience --problems 4 6 7 12 14 21 22 24

Printed for both: how many problems are still solved, the worst loss of value and the time over what
the stated number (`colloc.search.options.SearchOptions`) gives.
"""

from __future__ import annotations

import argparse
import time
from dataclasses import asdict

import numpy as np

from benchmarks.zoo import zoo_problem
from colloc.results.solution import SOLVED
from colloc.search.options import OPTIONS
from colloc.search.solve import solve
from colloc.system.errors import CollocError

FACTORS = (1 / 3, 3.0)
PROBLEMS = (4, 6, 7, 12, 14, 21, 22, 24)
"""Quick ones of all classes."""


def results(problems: list[int]) -> tuple[np.ndarray, np.ndarray]:
    """Values, nan where unsolved, and seconds of processor time."""
    values, seconds = np.full(len(problems), np.nan), np.empty(len(problems))
    for k, number in enumerate(problems):
        begin = time.process_time()
        try:
            solution = solve(zoo_problem(number))
            values[k] = solution.value if solution.status == SOLVED else np.nan
        except CollocError:
            pass
        seconds[k] = time.process_time() - begin
    return values, seconds


def results_with(name: str, value: float, problems: list[int]) -> tuple[np.ndarray, np.ndarray]:
    """The same with another value of one option, which is frozen for everyone else."""
    stated = getattr(OPTIONS, name)
    object.__setattr__(OPTIONS, name, value)
    try:
        return results(problems)
    finally:
        object.__setattr__(OPTIONS, name, stated)


def main() -> None:
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.numbers", description="What every number of the search trades."
    )
    options = asdict(OPTIONS)
    parser.add_argument("--names", nargs="*", default=list(options), choices=list(options))
    parser.add_argument("--problems", nargs="*", type=int, default=list(PROBLEMS))
    asked = parser.parse_args()
    results(asked.problems[:1])  # what is loaded once
    stated, usual = results(asked.problems)
    solved = f"{len(asked.problems)} problems, {np.isfinite(stated).sum()} solved"
    print(f"{solved}, {usual.sum():.1f} s of processor time\n")
    print(f"{'':26} {'a third: solved, loss, time':>30} {'three times: solved, loss, time':>30}")
    for name in asked.names:
        line, value = f"{name:26}", options[name]
        for factor in FACTORS:
            scaled = max(1, round(factor * value)) if isinstance(value, int) else factor * value
            values, seconds = results_with(name, scaled, asked.problems)
            loss = np.nanmax(1 - values / stated, initial=-np.inf)
            ratio = seconds.sum() / usual.sum()
            line += f"{np.isfinite(values).sum():12d} {loss:9.1e} {ratio:7.2f}"
        print(line, flush=True)


if __name__ == "__main__":
    main()
