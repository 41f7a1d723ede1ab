"""Files that are replaced whole: a reader sees the old one or the new one, never a part."""

from __future__ import annotations

import contextlib
import os
import re
import secrets
import socket
import time
import zlib
from collections.abc import Iterator
from pathlib import Path

from colloc.system.errors import StoreError

_FORGOTTEN = 3600.0
"""Seconds after which a temporary file whose writer cannot be asked is taken for one that a killed process left."""
_UNFINISHED = re.compile(r"\..+\.(?P<place>[0-9a-f]{8})-(?P<writer>\d+)-[0-9a-f]{6}\.part")
"""Names of temporary files: where their writer runs, its process, and a word by which it tells its own apart."""


@contextlib.contextmanager
def replaced_file(path: Path) -> Iterator[str]:
    """Name of a temporary file beside `path`, which takes its place if the block ends well and vanishes if it does not.

    What killed processes left in the folder is removed. `StoreError` if the folder cannot be made, or the file not written.
    """
    word = secrets.token_hex(3)
    temporary = str(path.with_name(f".{path.name}.{_place()}-{os.getpid()}-{word}.part"))
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        _sweep(path.parent)
        # 0o666 less the user's umask, as of any new file
        os.close(os.open(temporary, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o666))
        yield temporary
        with open(temporary, "rb") as written:
            os.fsync(written.fileno())
        os.replace(temporary, path)
        _flush(path.parent)
    except StoreError:
        raise
    except OSError as error:
        raise StoreError(f"cannot write {path}: {error.strerror or error}.") from None
    finally:
        with contextlib.suppress(OSError):
            os.unlink(temporary)


def _place() -> str:
    """Where numbers of processes mean the same: this machine, or this container on it."""
    try:
        namespace = os.stat("/proc/self/ns/pid").st_ino
    except OSError:
        namespace = 0
    return f"{zlib.crc32(f'{socket.gethostname()} {namespace}'.encode()):08x}"


def _sweep(folder: Path) -> None:
    """Remove what killed processes left of files they were writing."""
    for left in folder.glob(".*.part"):
        name = _UNFINISHED.fullmatch(left.name)
        if name is None:
            continue
        with contextlib.suppress(OSError):
            here = name["place"] == _place() and os.name == "posix"
            if (here and not _is_alive(int(name["writer"]))) or time.time() - left.stat().st_mtime > _FORGOTTEN:
                left.unlink()


def _is_alive(process: int) -> bool:
    try:
        os.kill(process, 0)  # sends nothing
    except (ProcessLookupError, OverflowError):
        return False
    except PermissionError:
        pass  # another user's
    return True


def _flush(folder: Path) -> None:
    """The new name, too, survives a power cut, where the system lets folders be flushed."""
    with contextlib.suppress(OSError):
        handle = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(handle)
        finally:
            os.close(handle)
