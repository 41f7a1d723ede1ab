"""Tasks on any `concurrent.futures` executor; a worker that dies costs a repetition, never the run.

The next task is requested only when a worker is free, so tasks may depend on earlier results.
"""

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

from colloc.system.interruption import interruptible

_MOMENT = 0.1  # longest time for which Ctrl-C is held back [s]
_THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "VECLIB_MAXIMUM_THREADS")
_ENVIRONMENT = dict.fromkeys((*_THREADS, "PYTHONSAFEPATH"), "1")
_STARTING = threading.Lock()


@dataclass(frozen=True)
class Task:
    """A call: a unique key, and the arguments."""

    key: Hashable
    arguments: tuple[Any, ...]


@dataclass(frozen=True)
class LostTask:
    """Stands for a result that the executor failed twice to give."""

    message: str


@contextlib.contextmanager
def worker_environment() -> Iterator[None]:
    """Processes started inside use one BLAS thread each and import nothing from the folder."""
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


def _start_worker() -> None:
    """Leave interrupts and standard output to the parent, and do not outlive it."""
    signal(SIGINT, SIG_IGN)
    with contextlib.suppress(OSError):
        os.dup2(2, 1)
    parent = multiprocessing.parent_process()
    assert parent is not None

    def leave():
        wait_for_handles([parent.sentinel])
        os._exit(1)

    threading.Thread(target=leave, daemon=True).start()


class _Processes(ProcessPoolExecutor):
    """Processes that do not run the script that starts them unless a task refers to it, so that it
    needs no ``if __name__ == "__main__"`` for tasks of colloc alone."""

    def submit(self, function: Callable[..., Any], /, *arguments: Any, **named: Any) -> Future:
        try:
            of_script = b"__main__" in pickle.dumps((function, arguments, named))
        except Exception:
            of_script = True  # the executor says what is wrong
        if of_script:
            return super().submit(function, *arguments, **named)
        main: dict[str, Any] = vars(sys.modules["__main__"])
        with _STARTING:
            before = {str(x): main.pop(x) for x in ("__file__", "__spec__") if x in main}
            main["__spec__"] = None
            try:
                return super().submit(function, *arguments, **named)
            finally:
                main.update(before)


def process_pool(workers: int) -> Executor:
    """Spawned processes, which inherit no state."""
    if getattr(multiprocessing.current_process(), "_inheriting", False):
        sys.exit(1)  # a worker of a script without a main guard: its parent does the task
    spawn = multiprocessing.get_context("spawn")
    return _Processes(workers, mp_context=spawn, initializer=_start_worker)


class _InThisProcess(Executor):
    def submit(self, function: Callable[..., Any], /, *arguments: Any, **named: Any) -> Future:
        future: Future = Future()
        try:
            future.set_result(function(*arguments, **named))
        except Exception as error:
            future.set_exception(error)
        return future


def pool_for(workers: int) -> Executor:
    """Processes, or this one if one worker is enough."""
    return process_pool(workers) if workers > 1 else _InThisProcess()


def run_tasks(
    function: Callable[..., Any],
    ready: Callable[[], Task | None],
    *,
    workers: int,
    executor: Callable[[int], Executor] = process_pool,
    ahead: int = 0,
) -> Iterator[tuple[Task, Any]]:
    """Yield tasks with their results ``function(*task.arguments)``, each as soon as it is there,
    those that are there at once in the order in which they were begun.

    `ready` returns the next task, or None if there is none now; it is called again after each
    result, and the run ends when nothing is under way. `ahead` tasks wait for a worker. A task that
    raises, or loses its worker, is repeated alone; if that fails too its result is `LostTask`.
    BrokenExecutor is raised if not even a first task can be submitted.
    """
    suspects: list[Task] = []  # under way when a worker died
    more = True
    with worker_environment():
        while more or suspects:
            alone = bool(suspects)
            most = 1 if alone else workers + ahead
            pool = executor(1 if alone else workers)
            pending: dict[Future, Task] = {}
            any_submitted, listened = False, True
            try:
                while True:
                    while len(pending) < most:
                        task = ready() if not alone else suspects.pop() if suspects else None
                        if task is None:
                            break
                        # Ctrl-C is held back while locks of the executor are taken, which would
                        # stay closed for its thread that Python joins
                        try:
                            with interruptible():
                                pending[pool.submit(function, *task.arguments)] = task
                        except BrokenExecutor:
                            suspects.append(task)
                            raise
                        any_submitted = True
                    if not pending:
                        more = alone or bool(suspects)
                        break
                    with interruptible():
                        done = wait(pending, timeout=_MOMENT, return_when=FIRST_COMPLETED).done
                    for future in [each for each in pending if each in done]:  # in their order
                        error = CancelledError() if future.cancelled() else future.exception()
                        if isinstance(error, BrokenExecutor):
                            raise error
                        task = pending.pop(future)
                        if error is None:
                            yield task, future.result()
                        elif alone:
                            why = f"{type(error).__name__}: {error}"
                            yield task, LostTask(f"its worker failed twice ({why}).")
                        else:
                            suspects.append(task)
            except BrokenExecutor:
                if not any_submitted:
                    listened = False
                    raise
                if not alone:
                    suspects += pending.values()
                for task in pending.values() if alone else ():
                    lost = LostTask("its worker process died twice (killed, or out of memory).")
                    yield task, lost
            except BaseException:
                listened = False
                raise
            finally:
                # interrupted, or nobody listens any more: do not wait for what is under way
                for future in pending:
                    future.cancel()
                pool.shutdown(wait=listened)
