"""Workers of a Dask cluster as an executor that says so when nobody works any more.

Dask itself waits without a word: for a scheduler to come back, and for workers to come.
"""

from __future__ import annotations

import logging
import time
from collections.abc import Callable
from concurrent.futures import Executor, Future
from contextlib import suppress
from typing import Any

from colloc.system.errors import ProblemError
from colloc.system.task_pool import EngineGone, worker_environment

PATIENCE = 60.0
"""Seconds for which a scheduler may be without workers, or give no answer."""
_CONNECT = 20.0
_LOOK, _ANSWER = 1.0, 10.0
_HOW = "dask worker ADDRESS --nthreads 1"


def connect(
    address: str, workers: int, say: Callable[[str], None] = print, patience: float = PATIENCE
) -> tuple[Callable[[int], Executor], int]:
    """A maker of executors for `colloc.system.task_pool.run_tasks`, and the number of workers, of
    the cluster at an address (``tcp://host:8786``; "local": so many processes on this machine).

    Seconds of `patience` are waited for a first worker, which `say` is told, and whenever there is
    none later. `ProblemError` if Dask is not installed, there is no scheduler, or no worker in
    time.
    """
    try:
        from distributed import Client
    except ImportError:
        raise ProblemError(
            "--dask needs the package distributed: pip install 'colloc[dask]'."
        ) from None
    # for the study alone: what else the process does with Dask, xarray for one, is not sent there
    how: dict[str, Any] = {"address": address, "timeout": _CONNECT}
    if address == "local":  # any port that is free, for this machine alone
        how = {"n_workers": workers, "threads_per_worker": 1, "dashboard_address": "127.0.0.1:0"}
    try:
        with worker_environment():
            client = Client(**how, set_as_default=False)
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
    return lambda _: _DaskExecutor(client, address, patience), max(
        1, sum(client.nthreads().values())
    )


def _without_workers(address: str, patience: float) -> str:
    return f"the Dask scheduler at {address} had no workers for {patience:.0f} s; start some"


class _DaskExecutor(Executor):
    """The executor of a Dask client, whose `check` raises `EngineGone` when its scheduler dies or
    has no workers."""

    def __init__(self, client: Any, address: str, patience: float) -> None:
        self._client, self._address, self._patience = client, address, patience
        self._pool = client.get_executor(pure=False)
        self._looked = self._heard = self._worked = time.monotonic()

    def submit(self, function: Callable, /, *arguments: Any, **named: Any) -> Future:
        try:
            return self._pool.submit(function, *arguments, **named)
        except Exception:
            self.check()
            raise

    def check(self) -> None:
        """Look, at most every second, whether somebody works."""
        if self._client.status != "running":
            raise EngineGone(
                f"the Dask scheduler at {self._address} is gone; what is done is kept. Start it "
                f"and give the command again."
            )
        pause = time.monotonic() - self._looked
        if pause < _LOOK:
            return
        workers = self._workers()
        now = self._looked = time.monotonic()
        if workers is not None or pause > _ANSWER:  # or nobody was waiting until now
            self._heard = now
        if workers != 0 or pause > _ANSWER:
            self._worked = now
        if now - self._heard > self._patience:
            raise EngineGone(
                f"the Dask scheduler at {self._address} gave no answer for {self._patience:.0f} s. "
                "What is done is kept; look at the scheduler and the network, and give the same "
                "command again."
            )
        if now - self._worked > self._patience:
            raise EngineGone(
                f"{_without_workers(self._address, self._patience)}. What is done is kept."
            )

    def _workers(self) -> int | None:
        """Number of workers; None if the scheduler does not say so in time."""
        ask, timeout = self._client.scheduler.ncores, min(_ANSWER, self._patience)
        try:
            return len(self._client.sync(ask, callback_timeout=timeout))
        except Exception:  # stopped, cut off, or about to die
            return None

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        with suppress(Exception):  # of a client that is closed already
            self._pool.shutdown(wait=wait)
