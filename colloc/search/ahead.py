"""Stages computed ahead in other processes: their results become known to the run, so the search
stays sequential, and its answer does not depend on how many processes there are."""

from __future__ import annotations

import importlib
import json
import pickle
from collections.abc import Callable, Iterator
from concurrent.futures import BrokenExecutor, CancelledError, Executor, Future, wait
from contextlib import contextmanager, suppress
from typing import Any

import numpy as np

from colloc.gaits.problem import Problem
from colloc.search.checkpoint import Run, active_run
from colloc.search.options import OPTIONS
from colloc.system.environment import available_threads
from colloc.system.errors import CollocError
from colloc.system.interruption import interruptible
from colloc.system.task_pool import process_pool, worker_environment

_MOMENT = 0.1  # longest time for which Ctrl-C is held back [s]


class Ahead:
    """Processes, one for each other processor, begun when there is enough left to do."""

    def __init__(self, problem: Problem) -> None:
        self._problem, self._run = problem, active_run()
        self._pool: Executor | None = None
        self._futures: dict[str, Future[dict[str, Any]]] = {}
        self.count = 0

    def begin(self, seconds_left: float) -> None:
        count = available_threads() - 1
        if self._pool or count == 0 or self._run.problem is None:
            return
        if seconds_left < OPTIONS.worth_a_process:
            return
        try:
            pickle.dumps(self._problem)
        except (pickle.PicklingError, AttributeError, TypeError):
            return  # a part of the problem is known in this process only
        self._pool, self.count = process_pool(count), count

    def takes(self, number: int) -> bool:
        """True for pieces of work of other processes: the search does its own share."""
        return number % (self.count + 1) > 0

    def submit(self, function: Callable[..., object], *arguments: Any) -> None:
        """Call a function of a module, with arguments that a run can store, in another process."""
        if self._pool is None or (task := self._task(function, arguments)) in self._futures:
            return
        with suppress(BrokenExecutor), worker_environment(), interruptible():
            self._futures[task] = self._pool.submit(_rows_of, self._problem, task)

    def wait_for(self, function: Callable[..., object], *arguments: Any) -> None:
        """Wait for a call that was submitted and has begun; its results are known to the run
        then."""
        future = self._futures.pop(self._task(function, arguments), None) if self._pool else None
        if future is None or future.cancel():
            return
        while not future.done():
            with interruptible():
                wait([future], timeout=_MOMENT)
        with suppress(BrokenExecutor, CancelledError):
            self._run.update(future.result())

    def end(self) -> None:
        """End the processes, whatever they do."""
        if self._pool is None:
            return
        processes = list((getattr(self._pool, "_processes", None) or {}).values())
        self._pool.shutdown(wait=False, cancel_futures=True)
        for process in processes:  # what they compute is of no use any more
            process.kill()

    def _task(self, function: Callable[..., object], arguments: tuple) -> str:
        return json.dumps([function.__module__, function.__name__, self._run.encode(arguments)])


@contextmanager
def computing_ahead(problem: Problem) -> Iterator[Ahead]:
    ahead = Ahead(problem)
    try:
        yield ahead
    finally:
        ahead.end()


def _rows_of(problem: Problem, task: str) -> dict[str, Any]:
    module, name, arguments = json.loads(task)
    run = Run(problem=problem, stores=True)
    with suppress(CollocError), run.active(np.inf):
        getattr(importlib.import_module(module), name)(*run.decode(arguments))
    return run.rows
