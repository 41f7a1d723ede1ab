"""Map a function over tasks on several processes, in order, with a progress bar on the terminal."""

from __future__ import annotations

import multiprocessing
import os
import sys
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import Any, TextIO, TypeVar

Task = TypeVar("Task")
Result = TypeVar("Result")

_WIDTH = 30


def available_processes() -> int:
    """Processors this process may use."""
    try:
        return len(os.sched_getaffinity(0))
    except AttributeError:  # not on Linux
        return os.cpu_count() or 1


def progress(items: Iterable[Result], total: int, label: str, stream: TextIO | None = None) -> Iterator[Result]:
    """Pass `items` on, drawing a bar with the time left; silent where the stream is not a terminal."""
    stream = sys.stderr if stream is None else stream
    if not stream.isatty():
        yield from items
        return
    start = time.monotonic()
    for done, item in enumerate(items, start=1):
        spent = time.monotonic() - start
        bar = "#" * (_WIDTH * done // total)
        left = spent * (total - done) / done
        stream.write(f"\r{label:<28.28} [{bar:<{_WIDTH}}] {done}/{total}  {spent:5.0f} s, {left:4.0f} s left ")
        stream.flush()
        yield item
    stream.write("\n")


def parallel_map(
    function: Callable[[Task], Result], tasks: Sequence[Task], *, processes: int | None = None, label: str = ""
) -> list[Result]:
    """``[function(task) for task in tasks]``, on `processes` processes (all available ones by default).

    Parameters
    ----------
    function : callable
        Picklable: a module-level function, or a partial of one.
    tasks : sequence
    processes : int, optional
        1 stays in this process.
    label : str
        Heads the progress bar; none is drawn without it.
    """
    count = min(available_processes() if processes is None else processes, len(tasks))

    def shown(results: Iterable[Any]) -> list[Any]:
        return list(progress(results, len(tasks), label) if label else results)

    if count <= 1:
        return shown(map(function, tasks))
    # the function may carry much data (a velocity map): it travels once to each process, not with every task
    with multiprocessing.get_context().Pool(count, _hold, (function,)) as pool:
        return shown(pool.imap(_apply_held, tasks))


_HELD: list[Callable[[Any], Any]] = []


def _hold(function: Callable[[Any], Any]) -> None:
    _HELD[:] = [function]


def _apply_held(task: Any) -> Any:
    return _HELD[0](task)
