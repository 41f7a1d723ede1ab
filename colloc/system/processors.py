"""How many processors there are for this process, and how many of them a batch of work may use."""

from __future__ import annotations

import multiprocessing
import os

_SAID = "OMP_NUM_THREADS"


def available_processes() -> int:
    """Processes this process may use."""
    try:
        return len(os.sched_getaffinity(0))
    except AttributeError:  # not on Linux
        return os.cpu_count() or 1


def available_threads() -> int:
    """Threads for a batch: ``$OMP_NUM_THREADS`` as for BLAS, else all processors; one in a process
    that shares them."""
    if multiprocessing.parent_process() is not None:
        return 1
    said = os.environ.get(_SAID, "")
    return max(1, int(said)) if said.isdigit() else available_processes()


def one_thread_each() -> None:
    """Have linear algebra use one thread, unless the environment says otherwise; before NumPy is
    loaded.

    The matrices of a search are small. On two busy cores two threads that wait for each other made
    SQP with 360 parameters take thirty times the processor time.
    """
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
