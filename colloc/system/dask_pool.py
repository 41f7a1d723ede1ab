"""Workers of a Dask cluster as an executor that says so when nobody works any more.

Dask itself waits without a word: for a scheduler to come back, and for workers to come.
"""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Callable
from concurrent.futures import CancelledError, Executor, Future
from contextlib import suppress
from typing import Any

from colloc.system.errors import ProblemError
from colloc.system.task_pool import EngineGone, environment_of_workers

PATIENCE = 60.0
"""Seconds for which a scheduler may be without workers, or give no answer."""
_CONNECT = 20.0
_LOOK, _ANSWER = 1.0, 10.0
_HOW = "dask worker ADDRESS --nthreads 1"


def connected(
    address: str, workers: int, say: Callable[[str], None] = print, patience: float = PATIENCE
) -> tuple[Callable[[int], Executor], int]:
    """What makes executors for `colloc.system.task_pool.completed` of a cluster, and how many
    workers it has.

    Parameters
    ----------
    address : str
        Of the scheduler, ``tcp://host:8786``; or "local" for a cluster of processes on this
        machine.
    workers : int
        Of a local cluster.
    say : callable
        Told that workers are waited for.
    patience : float
        Seconds to wait for a first worker, here and whenever there is none later.

    Raises
    ------
    ProblemError
        If Dask is not installed, there is no scheduler, or it has no workers in time.
    """
    try:
        from distributed import Client
    except ImportError:
        raise ProblemError(
            "--dask needs the package distributed: pip install 'colloc[dask]'."
        ) from None
    # for the study alone: what else the process does with Dask, xarray for one, is not sent there
    try:
        if address == "local":  # any port that is free, for this machine alone
            with environment_of_workers():
                client = Client(
                    n_workers=workers,
                    threads_per_worker=1,
                    dashboard_address="127.0.0.1:0",
                    set_as_default=False,
                )
        else:
            client = Client(address, timeout=_CONNECT, set_as_default=False)
    except (OSError, TimeoutError, ValueError) as error:
        raise ProblemError(f"no Dask scheduler at {address}: {error}") from None
    # what it has to say is said in a sentence
    logging.getLogger("distributed.client").setLevel(logging.CRITICAL + 1)
    if not client.nthreads():
        say(
            f"the Dask scheduler at {address} has no workers yet; waiting for one, {patience:.0f} "
            f"s at most"
        )
    try:
        client.wait_for_workers(1, timeout=patience)
    except TimeoutError:
        client.close()
        raise ProblemError(f"{_without_workers(address, patience)}, for example: {_HOW}.") from None
    return lambda _: DaskExecutor(client, address, patience), max(
        1, sum(client.nthreads().values())
    )


def _without_workers(address: str, patience: float) -> str:
    return f"the Dask scheduler at {address} had no workers for {patience:.0f} s; start some"


class DaskExecutor(Executor):
    """The executor of a Dask client, whose futures end with `EngineGone` when its scheduler dies or
    has no workers."""

    def __init__(self, client: Any, address: str, patience: float) -> None:
        self._client, self._address, self._patience = client, address, patience
        self._pool = client.get_executor(pure=False)
        self._waiting: set[Future] = set()
        self._over = threading.Event()
        threading.Thread(target=self._watch, daemon=True).start()

    def submit(self, function: Callable, /, *arguments: Any, **named: Any) -> Future:
        told: Future = Future()
        self._waiting.add(told)
        try:
            self._pool.submit(function, *arguments, **named).add_done_callback(
                lambda done: self._tell(told, done)
            )
        except Exception as error:
            if self._scheduler_alive():
                raise
            raise self._gone() from error
        return told

    def _tell(self, told: Future, done: Future) -> None:
        try:
            error = done.exception()
        except CancelledError as cancelled:
            error = cancelled
        if error is not None and not self._scheduler_alive():
            error = self._gone()
        self._end(told, error, None if error else done.result())

    def _end(self, told: Future, error: BaseException | None, result: Any = None) -> None:
        self._waiting.discard(told)
        with suppress(Exception):  # cancelled, or ended by the watch a moment ago
            told.set_result(result) if error is None else told.set_exception(error)

    def _scheduler_alive(self) -> bool:
        return self._client.status == "running"

    def _gone(self) -> EngineGone:
        return EngineGone(
            f"the Dask scheduler at {self._address} is gone; what is done is kept. Start it and "
            f"give the command again."
        )

    def _watch(self) -> None:
        """Look every second whether somebody works."""
        heard = worked = time.monotonic()
        while not self._over.wait(_LOOK):
            workers, now = self._workers(), time.monotonic()
            if workers is not None or not self._waiting:
                heard = now
            if workers != 0 or not self._waiting:
                worked = now
            if not self._scheduler_alive():
                lost = self._gone()
            elif now - heard > self._patience:
                lost = EngineGone(
                    f"the Dask scheduler at {self._address} gave no answer for "
                    f"{self._patience:.0f} s. What is done is kept; "
                    "look at the scheduler and the network, and give the same command again."
                )
            elif now - worked > self._patience:
                lost = EngineGone(
                    f"{_without_workers(self._address, self._patience)}. What is done is kept."
                )
            else:
                continue
            for told in list(self._waiting):
                self._end(told, lost)

    def _workers(self) -> int | None:
        """How many there are; None if the scheduler does not say so in time."""
        try:
            return len(
                self._client.sync(
                    self._client.scheduler.ncores, callback_timeout=min(_ANSWER, self._patience)
                )
            )
        except Exception:  # stopped, cut off, or about to die
            return None

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        self._over.set()
        with suppress(Exception):  # of a client that is closed already
            self._pool.shutdown(wait=wait and not self._waiting)
