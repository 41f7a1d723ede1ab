"""Numbers of processes and threads to use."""

from __future__ import annotations

import multiprocessing
import os


def available_processes() -> int:
    """Processors that this process may use."""
    try:
        return len(os.sched_getaffinity(0))
    except AttributeError:  # not on Linux
        return os.cpu_count() or 1


def available_threads() -> int:
    """Threads for a batch: ``$OMP_NUM_THREADS``, else all processors; one in a child process."""
    if multiprocessing.parent_process() is not None:
        return 1
    stated = os.environ.get("OMP_NUM_THREADS", "")
    return max(1, int(stated)) if stated.isdigit() else available_processes()


def one_thread_each() -> None:
    """Have BLAS use one thread unless the environment says otherwise; before NumPy is imported.

    On two busy cores, two threads that wait for each other made SQP with 360 parameters take thirty
    times the processor time.
    """
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
