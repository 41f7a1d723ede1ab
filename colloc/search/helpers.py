"""Other processes that compute ahead what a search is going to ask for: its answer is the same with
any number of them.

A search keeps what its stages find under the values that they found it from (`colloc.search.run`).
A helper calls a function that the search will call later, with the same values, and what was kept
on the way becomes known to the search. So the search itself stays one after the other. What a
helper has not begun when its turn comes, or never ends, the search computes itself.
"""

from __future__ import annotations

import importlib
import json
import os
import pickle
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from queue import SimpleQueue
from signal import SIG_IGN, SIGINT, signal
from typing import Any, BinaryIO

import numpy as np

from colloc.gaits.problem import Problem
from colloc.search.run import Run, this_run
from colloc.system.errors import CollocError
from colloc.system.processors import available_threads

_WORTH = 2.0
"""Seconds of work still to be done for which a process is begun, which takes about one."""
_COMMAND = """
import os, pickle, sys
says = os.fdopen(os.dup(1), "wb")
os.dup2(2, 1)  # for all else that is printed
sys.path[:] = pickle.load(sys.stdin.buffer)
from colloc.search.helpers import serve
serve(says)
"""


class Helpers:
    """Processes that are begun when it is worth it, one for each other processor
    (`available_threads`).

    Parameters
    ----------
    problem : Problem
        Of the run that is under way.
    """

    def __init__(self, problem: Problem) -> None:
        self._problem, self._run = problem, this_run()
        self._processes: list[subprocess.Popen[bytes]] = []
        self._waiting: dict[str, SimpleQueue[bytes]] = {}
        self._asked: dict[str, SimpleQueue[bytes]] = {}
        self._next: SimpleQueue[str] = SimpleQueue()

    def begin(self, seconds: float) -> None:
        """Begin, where there is so much left to do and a run that keeps what they find."""
        count = available_threads() - 1
        if self._processes or count == 0 or seconds < _WORTH or self._run.problem is None:
            return
        try:
            given = pickle.dumps(sys.path) + pickle.dumps(self._problem)
        except (pickle.PicklingError, AttributeError, TypeError):
            return  # a part of the problem is known in this process only
        for _ in range(count):
            # -P: no file of the folder is imported instead of another module
            command = [sys.executable, "-P", "-c", _COMMAND]
            process = subprocess.Popen(
                command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL
            )
            self._processes.append(process)
            threading.Thread(target=self._lead, args=(process, given), daemon=True).start()

    @property
    def count(self) -> int:
        """How many there are."""
        return len(self._processes)

    @property
    def waiting(self) -> int:
        """How many tasks nobody has begun with."""
        return len(self._waiting)

    def has(self, number: int) -> bool:
        """Whether a piece of work of this number is for a helper: the search does its own share of
        them."""
        return number % (self.count + 1) > 0

    def ask(self, function: Callable[..., object], *given: Any) -> None:
        """Have a function of a module called with values that a run can keep."""
        if self._processes and (task := self._task(function, given)) not in self._asked:
            self._asked[task] = self._waiting[task] = SimpleQueue()
            self._next.put(task)

    def await_for(self, function: Callable[..., object], *given: Any) -> None:
        """Wait for what was asked, if a helper has begun with it; what it found is known to the run
        then."""
        if not self._processes:
            return
        task = self._task(function, given)
        answer = self._asked.pop(task, None)
        if answer is not None and self._waiting.pop(task, None) is None:
            self._run.learn(json.loads(answer.get() or b"{}"))

    def end(self) -> None:
        """End them, whatever they do."""
        for process in self._processes:
            process.kill()
            self._next.put("")
        for process in self._processes:
            process.wait()

    def _task(self, function: Callable[..., object], given: tuple) -> str:
        return json.dumps([function.__module__, function.__name__, self._run.written(given)])

    def _lead(self, process: subprocess.Popen[bytes], given: bytes) -> None:
        """Hand over tasks, one at a time; a task whose helper dies has found nothing."""
        assert process.stdin is not None
        assert process.stdout is not None
        with suppress(OSError), process:
            process.stdin.write(given)
            process.stdin.flush()
            # not what Python prints as it starts
            answers = (line for line in process.stdout if line.endswith(b"}\n"))
            alive = next(answers, b"")
            while alive and (task := self._next.get()):
                answer = self._waiting.pop(task, None)
                if answer is None:
                    continue  # the search has come to it first
                alive = b""
                try:
                    process.stdin.write(task.encode() + b"\n")
                    process.stdin.flush()
                    alive = next(answers, b"")
                finally:
                    answer.put(alive)


@contextmanager
def helping(problem: Problem) -> Iterator[Helpers]:
    """Helpers that end with the block."""
    helpers = Helpers(problem)
    try:
        yield helpers
    finally:
        helpers.end()


def serve(says: BinaryIO) -> None:
    """What a helper does until nobody asks it any more: a line of rows for every line that asks."""
    signal(SIGINT, SIG_IGN)
    asks = sys.stdin.buffer
    problem = pickle.load(asks)
    os.environ["OMP_NUM_THREADS"] = "1"  # the others have the other processors
    tasks: SimpleQueue[bytes] = SimpleQueue()
    threading.Thread(target=_listen, args=(asks, tasks), daemon=True).start()
    _say(says, {})
    while True:
        module, name, given = json.loads(tasks.get())
        run = Run(problem=problem, remembers=True)
        with suppress(CollocError), run.under_way(np.inf):
            getattr(importlib.import_module(module), name)(*run.read(given))
        _say(says, run.rows)


def _listen(asks: BinaryIO, tasks: SimpleQueue[bytes]) -> None:
    for line in asks:
        tasks.put(line)
    os._exit(0)  # who asked is gone


def _say(says: BinaryIO, rows: dict[str, Any]) -> None:
    says.write(json.dumps(rows).encode() + b"\n")
    says.flush()
