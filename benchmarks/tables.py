"""What all measurements share: processor time, medians of interleaved runs, values kept in files,
Markdown tables."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from colloc.system.row_file import CACHE, put_rows, read_rows


def cpu_seconds(work: Callable[[], object], at_least: float = 0.05) -> float:
    """Processor time of one call: the mean over enough calls to fill `at_least` seconds."""
    calls, begin = 0, time.process_time()
    while True:
        work()
        calls += 1
        spent = time.process_time() - begin
        if spent >= at_least:
            return spent / calls


def interleaved_seconds(
    works: dict[str, Callable[[], object]], rounds: int = 3, at_least: float = 0.05
) -> dict[str, float]:
    """Median processor time of each call over `rounds` rounds in turn, so that disturbances fall on
    all alike."""
    spent: dict[str, list[float]] = {name: [] for name in works}
    for _ in range(rounds):
        for name, work in works.items():
            spent[name].append(cpu_seconds(work, at_least))
    return {name: float(np.median(values)) for name, values in spent.items()}


def cached(path: Path, key: str, compute: Callable[[], Any]) -> Any:
    """The value of a key in a file of rows, computed and put there if it is missing."""
    if key not in read_rows(path, CACHE):
        put_rows(path, CACHE, {key: compute()})
    return read_rows(path, CACHE)[key]


def markdown_table(header: Sequence[str], rows: Iterable[Sequence[object]]) -> str:
    """A Markdown table; floats in three digits."""
    lines = ["| " + " | ".join(header) + " |", "|" + "---|" * len(header)]
    lines += ["| " + " | ".join(_cell(value) for value in row) + " |" for row in rows]
    return "\n".join(lines)


def _cell(value: object) -> str:
    if not isinstance(value, (float, np.floating)):
        return str(value)
    number = float(value)
    plain = number == 0 or not (abs(number) < 1e-2 or abs(number) >= 1e5)
    return f"{number:.3g}" if plain else f"{number:.1e}"
