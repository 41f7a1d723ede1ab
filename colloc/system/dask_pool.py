"""Workers of a Dask cluster as an executor that does not wait for ever for scheduler or workers."""

from __future__ import annotations

import logging
import time
from collections.abc import Callable
from concurrent.futures import Executor, Future
from contextlib import suppress
from typing import Any

from colloc.system.errors import ProblemError
from colloc.system.task_pool import EngineGone, worker_environment

_PATIENCE = 60.0  # seconds without workers, or without an answer
_CONNECT, _LOOK, _ANSWER = 20.0, 1.0, 10.0  # seconds to connect, between looks, for an answer


def connect(
    address: str, workers: int, say: Callable[[str], None] = print, patience: float = _PATIENCE
) -> tuple[Callable[[int], Executor], int]:
    """Connect to the cluster at an address ("local": processes of this machine).

    Returns a maker of executors for `colloc.system.task_pool.run_tasks`, and the number of workers.
    `ProblemError` if Dask is not installed, there is no scheduler, or no worker within `patience`.
    """
    try:
        from distributed import Client
    except ImportError:
        raise ProblemError(
            "--dask needs the package distributed: pip install 'colloc[dask]'."
        ) from None
    how: dict[str, Any] = {"address": address, "timeout": _CONNECT}
    if address == "local":  # any free port, for this machine alone
        how = {"n_workers": workers, "threads_per_worker": 1, "dashboard_address": "127.0.0.1:0"}
    try:
        with worker_environment():
            client = Client(**how, set_as_default=False)  # xarray must not use it
    except (OSError, TimeoutError, ValueError) as error:
        raise ProblemError(f"no Dask scheduler at {address}: {error}") from None
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
        raise ProblemError(
            f"the Dask scheduler at {address} had no workers for {patience:.0f} s; start some, for "
            f"example: dask worker ADDRESS --nthreads 1."
        ) from None
    count = max(1, sum(client.nthreads().values()))
    return lambda _: _DaskExecutor(client, address, patience), count


class _DaskExecutor(Executor):
    def __init__(self, client: Any, address: str, patience: float) -> None:
        self._client, self._address, self._patience = client, address, patience
        self._pool = client.get_executor(pure=False)
        self._looked = self._well = time.monotonic()

    def submit(self, function: Callable, /, *arguments: Any, **named: Any) -> Future:
        try:
            return self._pool.submit(function, *arguments, **named)
        except Exception:
            self.check()
            raise

    def check(self) -> None:
        """Raise `EngineGone` if the scheduler died, is silent, or has no workers."""
        pause, trouble = time.monotonic() - self._looked, "is gone"
        if self._client.status == "running":
            if pause < _LOOK:
                return
            ask, timeout = self._client.scheduler.ncores, min(_ANSWER, self._patience)
            try:
                workers = len(self._client.sync(ask, callback_timeout=timeout))
                trouble = "had no workers"
            except Exception:  # stopped, cut off, or about to die
                workers, trouble = 0, "gave no answer"
            self._looked = time.monotonic()
            if workers or pause > _ANSWER:  # or nobody was waiting until now
                self._well = self._looked
            if self._looked - self._well <= self._patience:
                return
            trouble += f" for {self._patience:.0f} s"
        raise EngineGone(
            f"the Dask scheduler at {self._address} {trouble}; what is done is kept. Look at it, "
            f"its workers and the network, and give the same command again."
        )

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        with suppress(Exception):  # the client may be closed
            self._pool.shutdown(wait=wait)
