"""Files that are replaced whole, so that a reader sees the old one or the new one, never a part;
and one writer at a time."""

from __future__ import annotations

import contextlib
import errno
import os
import secrets
import socket
import time
from collections.abc import Iterator
from pathlib import Path

from filelock import FileLock, SoftFileLock, Timeout

from colloc.system.errors import StoreError

NO_LOCKS = (errno.ENOLCK, errno.EOPNOTSUPP, errno.ENOSYS, errno.EINVAL)
"""What a file system without locks says: results are still replaced whole, but two runs are not
kept apart."""
_FORGOTTEN = 3600.0
"""Seconds after which a temporary file is taken for one that a killed process left."""


@contextlib.contextmanager
def replaced_file(path: Path) -> Iterator[str]:
    """Name of a temporary file beside `path`, which takes its place if the block ends well and
    vanishes if it does not.

    Raises
    ------
    StoreError
        If the folder cannot be made, or the file not written; what was there before is kept.
    """
    temporary = path.with_name(f".{path.name}.colloc-{secrets.token_hex(4)}.part")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        for left in path.parent.glob(".*.colloc-*.part"):
            with contextlib.suppress(OSError):  # another writer may have removed it
                if time.time() - left.stat().st_mtime > _FORGOTTEN:
                    left.unlink()
        # 0o666 less the user's umask, as of any new file
        os.close(os.open(temporary, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o666))
        yield str(temporary)
        with open(temporary, "rb") as written:
            os.fsync(written.fileno())
        os.replace(temporary, path)
    except StoreError:
        raise
    except OSError as error:
        raise StoreError(f"cannot write {path}: {error.strerror or error}.") from None
    finally:
        with contextlib.suppress(OSError):
            os.unlink(temporary)


@contextlib.contextmanager
def locked(path: Path, *, wait: bool = False) -> Iterator[None]:
    """Hold the lock file `path` while the block runs; the system lets go of it when its holder
    dies.

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
                    path.write_text(
                        f"process {os.getpid()} on {socket.gethostname()}", encoding="utf-8"
                    )
        except Timeout:
            holder = (
                path.read_text(encoding="utf-8", errors="replace")[:200].strip()
                or "another process"
            )
            raise StoreError(
                f"{path.parent} is in use by {holder}; wait for it, or choose another --output."
            ) from None
        except OSError as error:
            if error.errno not in NO_LOCKS:
                raise StoreError(
                    f"cannot write {path}: {error.strerror or error}; choose another --output."
                ) from None
        yield


@contextlib.contextmanager
def alone_in(folder: Path) -> Iterator[None]:
    """Hold a folder while the block runs; others wait. `StoreError` if the folder cannot be made or
    read."""
    with contextlib.ExitStack() as held:
        try:
            import fcntl

            folder.mkdir(parents=True, exist_ok=True)
            handle = os.open(folder, os.O_RDONLY)
            held.callback(os.close, handle)
            fcntl.flock(handle, fcntl.LOCK_EX)
        except (ImportError, OSError):  # Windows and some network file systems lock files alone
            held.enter_context(locked(folder / ".colloc.lock", wait=True))
        yield
