"""One writer at a time: a lock on a file beside the results, which the system lets go of when its holder dies."""

from __future__ import annotations

import contextlib
import os
import socket
from collections.abc import Iterator
from pathlib import Path

from colloc.system.errors import StoreError

try:
    import fcntl
except ImportError:  # not on Windows: there, results are still replaced whole, but two runs are not kept apart
    fcntl = None  # type: ignore[assignment]


@contextlib.contextmanager
def locked(path: Path, *, wait: bool = False) -> Iterator[None]:
    """Hold the lock file `path` while the block runs.

    Parameters
    ----------
    path : Path
        Made if need be, and left there: removing a lock file is a race of its own.
    wait : bool
        Wait for another holder to finish, instead of refusing.

    Raises
    ------
    StoreError
        If the file cannot be written, or another process holds it; the message says which.
    """
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        handle = os.open(path, os.O_RDWR | os.O_CREAT, 0o666)
    except OSError as error:
        raise StoreError(f"cannot write {path}: {error.strerror or error}; choose another --output.") from None
    try:
        if fcntl is not None:
            _take(handle, path, wait)
        yield
    finally:
        os.close(handle)


def _take(handle: int, path: Path, wait: bool) -> None:
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | (0 if wait else fcntl.LOCK_NB))
    except BlockingIOError:
        holder = os.pread(handle, 200, 0).decode("utf-8", "replace").strip() or "another process"
        raise StoreError(f"{path.parent} is in use by {holder}; wait for it, or choose another --output.") from None
    except OSError:
        return  # a file system without locks: results are still replaced whole
    with contextlib.suppress(OSError):  # a full disk does not matter here
        os.ftruncate(handle, 0)
        os.pwrite(handle, f"process {os.getpid()} on {socket.gethostname()}".encode(), 0)
