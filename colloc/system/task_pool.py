"""Run tasks on any `concurrent.futures` executor; a worker that dies costs a repetition, never the
run.

Which task comes next is asked only when a worker is free, so tasks may depend on results of earlier
ones.
"""

from __future__ import annotations

import contextlib
import multiprocessing
import os
import pickle
import sys
import threading
from collections.abc import Callable, Hashable, Iterator
from concurrent.futures import (
    FIRST_COMPLETED,
    BrokenExecutor,
    CancelledError,
    Executor,
    Future,
    ProcessPoolExecutor,
    wait,
)
from dataclasses import dataclass
from multiprocessing.connection import wait as wait_for_handles
from signal import SIG_IGN, SIGINT, signal
from typing import Any

from colloc.system.errors import CollocError
from colloc.system.interruption import interruptible

_MOMENT = 0.1
"""Longest time for which Ctrl-C is held back [s]."""
_THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "VECLIB_MAXIMUM_THREADS")
_ENVIRONMENT = dict.fromkeys((*_THREADS, "PYTHONSAFEPATH"), "1")
_ONE_BEGINS = threading.Lock()


@dataclass(frozen=True)
class Task:
    """One call: a name of its own, and the arguments."""

    key: Hashable
    arguments: tuple[Any, ...]


@dataclass(frozen=True)
class Lost:
    """In place of a result: the executor failed twice to give one (worker killed, out of memory,
    lost connection)."""

    message: str


class EngineGone(CollocError, RuntimeError):
    """The executor is gone as a whole, so no task is to blame."""


@contextlib.contextmanager
def worker_environment() -> Iterator[None]:
    """Processes started inside use one BLAS thread each, and import no file of the folder instead
    of another module; the environment is put back afterwards."""
    before = {name: os.environ.get(name) for name in _ENVIRONMENT}
    os.environ.update(_ENVIRONMENT)
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                os.environ.pop(name, None)  # another thread may have done so
            else:
                os.environ[name] = value


def _begin_worker() -> None:
    """A worker leaves interrupts and standard output to its parent, and does not outlive it."""
    signal(SIGINT, SIG_IGN)
    with contextlib.suppress(OSError):
        os.dup2(2, 1)
    parent = multiprocessing.parent_process()
    assert parent is not None

    def leave() -> None:
        wait_for_handles([parent.sentinel])
        os._exit(1)

    threading.Thread(target=leave, daemon=True).start()


class _Processes(ProcessPoolExecutor):
    """Processes that do not run the script which begins them, unless a task is of something it
    defines: so it needs no ``if __name__ == "__main__"`` for those of colloc alone."""

    def submit(self, function: Callable[..., Any], /, *arguments: Any, **named: Any) -> Future:
        try:
            of_script = b"__main__" in pickle.dumps((function, arguments, named))
        except Exception:
            of_script = True  # the executor says what is wrong
        with contextlib.nullcontext() if of_script else _without_script():
            return super().submit(function, *arguments, **named)


@contextlib.contextmanager
def _without_script() -> Iterator[None]:
    """Processes that are begun inside are not told which file this one was begun with."""
    main: dict[str, Any] = vars(sys.modules["__main__"])
    with _ONE_BEGINS:
        before = {str(name): main.pop(name) for name in ("__file__", "__spec__") if name in main}
        main["__spec__"] = None
        try:
            yield
        finally:
            main.update(before)


def process_pool(workers: int) -> Executor:
    """Fresh processes: they inherit no state, and their number of BLAS threads is settled before
    NumPy is loaded."""
    if getattr(multiprocessing.current_process(), "_inheriting", False):
        # a worker, in a script without that line: the process that began it does its task itself
        sys.exit(1)
    spawn = multiprocessing.get_context("spawn")
    return _Processes(workers, mp_context=spawn, initializer=_begin_worker)


class _InThisProcess(Executor):
    """Runs every task at once where it is handed over."""

    def submit(self, function: Callable[..., Any], /, *arguments: Any, **named: Any) -> Future:
        future: Future = Future()
        try:
            future.set_result(function(*arguments, **named))
        except Exception as error:
            future.set_exception(error)
        return future


def pool_for(workers: int) -> Executor:
    """Fresh processes, or this one if one worker is enough."""
    return process_pool(workers) if workers > 1 else _InThisProcess()


def _first_done(pool: Executor, pending: dict[Future, Task]) -> set[Future]:
    """Futures that are done, as soon as one is.

    Ctrl-C is held back while an executor's locks are taken, here and where tasks are handed over:
    it could fall between a lock and the block that would open it again, and the executor's own
    thread, which Python joins at its end, would wait for ever.
    """
    while True:
        with interruptible():
            done = wait(pending, timeout=_MOMENT, return_when=FIRST_COMPLETED).done
        if done:
            return done
        _check(pool)


def _check(pool: Executor) -> None:
    if hasattr(pool, "check"):
        pool.check()


def run_tasks(
    function: Callable[..., Any],
    ready: Callable[[], Task | None],
    *,
    workers: int,
    executor: Callable[[int], Executor] = process_pool,
    ahead: int = 0,
) -> Iterator[tuple[Task, Any]]:
    """Tasks with their results, each as soon as it is there.

    Parameters
    ----------
    function : callable
        Called as ``function(*task.arguments)`` on a worker. An exception counts as a lost worker. A
        task that was lost is tried again, alone; if it is lost again its result is `Lost`.
    ready : callable
        The next task, or None if there is none now. Asked again after each result has been taken;
        the run ends when there is none and nothing is under way.
    workers, ahead : int
        So many tasks, together, are handed over at a time; `ahead` of them wait so that no worker
        has to.
    executor : callable
        Makes an executor for a number of workers: processes by default; threads, or the one a Dask
        client gives (``lambda n: client.get_executor()``), will do. If it has a method `check`,
        that is called while nothing ends, and may raise `EngineGone`.

    Raises
    ------
    BrokenExecutor
        If not even a first task can be handed over.
    EngineGone
        If the executor says that of itself: nothing is tried again, and no task recorded as lost.
    """
    suspects: list[Task] = []  # under way when a worker died
    more = True
    with worker_environment():
        while more or suspects:
            alone = bool(suspects)
            most = 1 if alone else workers + ahead
            pool = executor(1 if alone else workers)
            pending: dict[Future, Task] = {}
            any_begun, listened = False, True
            try:
                while True:
                    while len(pending) < most:
                        task = ready() if not alone else suspects.pop() if suspects else None
                        if task is None:
                            break
                        try:
                            with interruptible():
                                pending[pool.submit(function, *task.arguments)] = task
                        except BrokenExecutor:
                            suspects.append(task)
                            raise
                        any_begun = True
                    if not pending:
                        more = alone or bool(suspects)
                        break
                    for future in _first_done(pool, pending):
                        error = CancelledError() if future.cancelled() else future.exception()
                        if isinstance(error, (BrokenExecutor, EngineGone)):
                            raise error
                        if error is not None:
                            _check(pool)
                        task = pending.pop(future)
                        if error is None:
                            yield task, future.result()
                        elif alone:
                            why = f"{type(error).__name__}: {error}"
                            yield task, Lost(f"its worker failed twice ({why}).")
                        else:
                            suspects.append(task)
            except BrokenExecutor:
                if not any_begun:
                    listened = False
                    raise
                if not alone:
                    suspects += pending.values()
                for task in pending.values() if alone else ():
                    yield task, Lost("its worker process died twice (killed, or out of memory).")
            except BaseException as error:
                listened = False
                if isinstance(error, EngineGone):
                    pending.clear()  # nobody answers
                raise
            finally:
                # interrupted, or nobody listens any more: do not wait for what is under way
                for future in pending:
                    future.cancel()
                pool.shutdown(wait=listened)
