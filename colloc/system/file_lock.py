"""One writer at a time: a lock on a file beside the results, which the system lets go of when its holder dies."""

from __future__ import annotations

import contextlib
import errno
import os
import socket
from collections.abc import Iterator
from pathlib import Path

from filelock import FileLock, SoftFileLock, Timeout

from colloc.system.errors import StoreError

NO_LOCKS = (errno.ENOLCK, errno.EOPNOTSUPP, errno.ENOSYS, errno.EINVAL)
"""What a file system without locks says: results are still replaced whole, but two runs are not kept apart."""


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
    with contextlib.ExitStack() as held:
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            lock = held.enter_context(FileLock(path, blocking=wait))
            if not isinstance(lock, SoftFileLock):  # whose file has a content of its own
                with contextlib.suppress(OSError):  # a full disk does not matter here
                    path.write_text(f"process {os.getpid()} on {socket.gethostname()}", encoding="utf-8")
        except Timeout:
            holder = path.read_text(encoding="utf-8", errors="replace")[:200].strip() or "another process"
            raise StoreError(f"{path.parent} is in use by {holder}; wait for it, or choose another --output.") from None
        except OSError as error:
            if error.errno not in NO_LOCKS:
                raise StoreError(f"cannot write {path}: {error.strerror or error}; choose another --output.") from None
        yield
