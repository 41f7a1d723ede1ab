"""Map a function over tasks on several processes, in order, with a bar on the terminal."""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
from typing import TypeVar

from rich.console import Console
from rich.progress import track

from colloc.system.environment import available_processes

Task = TypeVar("Task")
Result = TypeVar("Result")


def parallel_map(
    function: Callable[[Task], Result],
    tasks: Sequence[Task],
    *,
    processes: int | None = None,
    label: str = "",
) -> list[Result]:
    """``[function(task) for task in tasks]``, on `processes` processes (all available ones by
    default)."""
    count = min(available_processes() if processes is None else processes, len(tasks))

    def watched(results):
        hidden = not label or not sys.stderr.isatty()
        return list(
            track(results, label, total=len(tasks), console=Console(stderr=True), disable=hidden)
        )

    if count <= 1:
        return watched(map(function, tasks))
    with ProcessPoolExecutor(count) as pool:
        return watched(pool.map(function, tasks, chunksize=max(1, len(tasks) // (8 * count))))
