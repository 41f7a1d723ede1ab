"""What every number of the search trades: each divided by three and multiplied, and the zoo solved
with it.

    python -m benchmarks.numbers
    python -m benchmarks.numbers --stages explore refine --problems 4 6 7 12 14 21 22 24

A number is what a module of `colloc/search` states by name in capitals, each entry of a tuple or of
an `Effort` for itself, unless it stands in another module already.
Printed for both: how many problems are still solved, the worst loss of value and of time over what
the stated number gives. One that changes nothing either way, on problems that use its stage, is no
number that anyone needs to set.
"""

from __future__ import annotations

import argparse
import ast
import dataclasses
import importlib
import pkgutil
import sys
import time
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np

import colloc.search
from benchmarks.zoo import zoo_problem
from colloc.results.solution import SOLVED
from colloc.search.solve import solve
from colloc.system.errors import CollocError

FACTORS = (1 / 3, 3.0)
PROBLEMS = (4, 6, 7, 12, 14, 21, 22, 24)
"""Quick ones of all classes."""


def modules(stages: list[str]) -> list[ModuleType]:
    """Those of `colloc.search` by name; all without names."""
    names = stages or [found.name for found in pkgutil.iter_modules(colloc.search.__path__)]
    return [importlib.import_module(f"colloc.search.{name}") for name in names]


def numbers(module: ModuleType) -> Iterator[tuple[str, str, Callable[[float], Any]]]:
    """Every number of a module: what it is called, the name it stands in, and what that holds with
    the number so many times."""
    names = _stated(module)
    others = [value for name, value in vars(module).items() if name.isupper() and name not in names]
    for name in names:
        value = vars(module).get(name)
        if isinstance(value, tuple):
            parts: Any = enumerate(value)
        elif isinstance(value, dict):
            parts = value.items()
        else:
            parts = vars(value).items() if dataclasses.is_dataclass(value) else [("", value)]
        for key, entry in parts:
            elsewhere = isinstance(entry, float) and any(entry is other for other in others)
            if _is_number(entry) and not elsewhere and str(key)[:1] != "_":
                yield (
                    f"{name}[{key}]" if key != "" else name,
                    name,
                    partial(_with_part, value, key, entry),
                )


def _with_part(value: Any, key: Any, entry: float, factor: float) -> Any:
    """A number, tuple, dictionary or `Effort` with one entry so many times what it is."""
    scaled = max(1, round(factor * entry)) if isinstance(entry, int) else factor * entry
    if isinstance(value, tuple):
        return (*value[:key], scaled, *value[key + 1 :])
    if isinstance(value, dict):
        return {**value, key: scaled}
    return (
        dataclasses.replace(value, **{key: scaled}) if dataclasses.is_dataclass(value) else scaled  # type: ignore[type-var]
    )


def _is_number(entry: Any) -> bool:
    return isinstance(entry, (int, float)) and not isinstance(entry, bool) and entry != 0


def _holders(name: str, value: Any) -> list[ModuleType]:
    return [
        m
        for key, m in sys.modules.items()
        if key.startswith("colloc.") and vars(m).get(name) is value
    ]


def _stated(module: ModuleType) -> list[str]:
    """Names in capitals that the module itself gives a value."""
    found = []
    for node in ast.parse(Path(module.__file__ or "").read_text(encoding="utf-8")).body:
        if isinstance(node, ast.Assign):
            names = [
                name.id
                for target in node.targets
                for name in ast.walk(target)
                if isinstance(name, ast.Name)
            ]
            found += [name for name in names if name.isupper()]
        elif (
            isinstance(node, ast.AnnAssign)
            and isinstance(node.target, ast.Name)
            and node.target.id.isupper()
        ):
            found.append(node.target.id)
    return sorted(found)


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


def main() -> None:
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.numbers", description="What every number of the search trades."
    )
    parser.add_argument("--stages", nargs="*", default=[])
    parser.add_argument("--problems", nargs="*", type=int, default=list(PROBLEMS))
    asked = parser.parse_args()
    results(asked.problems[:1])  # what is loaded once
    stated, usual = results(asked.problems)
    print(
        f"{len(asked.problems)} problems, {np.isfinite(stated).sum()} solved, {usual.sum():.1f} s "
        f"of processor time\n"
    )
    print(
        f"{'number':44} {'a third: solved, loss, time':>30} {'three times: solved, loss, time':>30}"
    )
    for module in modules(asked.stages):
        for label, name, scaled in numbers(module):
            line = f"{module.__name__.removeprefix('colloc.search.') + '.' + label:44}"
            value = vars(module)[name]
            for factor in FACTORS:
                for holder in (held := _holders(name, value)):
                    setattr(holder, name, scaled(factor))
                found, seconds = results(asked.problems)
                for holder in held:
                    setattr(holder, name, value)
                loss = np.nanmax(1 - found / stated, initial=-np.inf)
                line += (
                    f"{np.isfinite(found).sum():12d} {loss:9.1e} {seconds.sum() / usual.sum():7.2f}"
                )
            print(line, flush=True)


if __name__ == "__main__":
    main()
