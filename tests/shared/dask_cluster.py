"""A Dask scheduler and workers as processes of their own on this machine, to be killed, stopped and
starved."""

import contextlib
import os
import subprocess
import sys

PROGRAM = """
import asyncio, sys, distributed
async def main():
    kind, address = sys.argv[1:]
    if kind == "scheduler":
        node = distributed.Scheduler(host="127.0.0.1", port=0, dashboard_address="127.0.0.1:0")
    else:
        node = distributed.Worker(address, host="127.0.0.1", nthreads=1)
    async with node:
        print(node.address, flush=True)
        await node.finished()
asyncio.run(main())
"""


class DaskProcesses(contextlib.ExitStack):
    """A scheduler, and workers when they are asked for; all are killed at the end.

    Parameters
    ----------
    **settings : str
        Of Dask, such as SCHEDULER__WORKER_TTL="3s".
    """

    def __init__(self, **settings):
        super().__init__()
        self.environment = {
            **os.environ,
            **{f"DASK_DISTRIBUTED__{key}": value for key, value in settings.items()},
        }
        self.scheduler, self.address = self._started("scheduler", "")

    def worker(self, **environment):
        """A new worker process."""
        return self._started("worker", self.address, environment)[0]

    def _started(self, kind, address, environment=()):
        process = subprocess.Popen(
            [sys.executable, "-c", PROGRAM, kind, address],
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            text=True,
            env={**self.environment, **dict(environment)},
        )
        self.callback(process.communicate)
        self.callback(process.kill)
        return process, process.stdout.readline().strip()
