"""What a process runs in: processors, versions, and imports made on use."""

import importlib
import multiprocessing
import os
import platform
import sys
from collections.abc import Callable
from contextlib import suppress
from functools import cache
from typing import Any

from colloc.system.errors import CollocError


def higher(place: str) -> Callable[..., Any]:
    """Import what a higher package offers, such as ``"pictures.movie:write_movie"``."""
    module, _, name = place.partition(":")
    # Matplotlib cannot be imported where $MPLBACKEND names a backend that is not installed, as a
    # notebook's terminal does; nothing is drawn here with it
    backend = None if "matplotlib" in sys.modules else os.environ.pop("MPLBACKEND", None)
    try:
        return getattr(importlib.import_module(f"colloc.{module}"), name)
    finally:
        if backend is not None:
            os.environ["MPLBACKEND"] = backend
            if backend and "matplotlib" in sys.modules:
                with suppress(ValueError):
                    sys.modules["matplotlib"].rcParams["backend"] = backend


def optional(library: str) -> Any:
    try:
        return importlib.import_module(library)
    except ImportError:
        raise CollocError(
            f"this needs {library}, which is not installed: pip install {library}."
        ) from None


@cache
def version_of(library: str) -> str:
    from importlib import metadata  # slow to import

    try:
        return metadata.version(library)
    except metadata.PackageNotFoundError:
        return "source tree"


def versions() -> dict[str, str]:
    """Versions of Python and of the libraries that a result depends on."""
    names = ("colloc", "casadi", "numpy", "scipy", "h5py")
    return {"python": platform.python_version(), **{name: version_of(name) for name in names}}


def available_processes() -> int:
    try:
        return len(os.sched_getaffinity(0))
    except AttributeError:  # not on Linux
        return os.cpu_count() or 1


def available_threads() -> int:
    """Threads for a batch: ``$OMP_NUM_THREADS``, else all processors; one in a child process."""
    if multiprocessing.parent_process() is not None:
        return 1
    text = os.environ.get("OMP_NUM_THREADS", "")
    return max(1, int(text)) if text.isdigit() else available_processes()


def one_thread_each() -> None:
    """Have BLAS use one thread unless the environment says otherwise; before NumPy is imported.

    On two busy cores, two threads that wait for each other made SQP with 360 parameters take thirty
    times the processor time.
    """
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
