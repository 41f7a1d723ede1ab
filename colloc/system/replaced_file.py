"""Files that are replaced whole: a reader sees the old one or the new one, never a part."""

from __future__ import annotations

import contextlib
import glob
import os
import secrets
import time
from collections.abc import Iterator
from pathlib import Path

from colloc.system.errors import StoreError

_FORGOTTEN = 3600.0
"""Seconds after which a temporary file is taken for one that a killed process left."""


@contextlib.contextmanager
def replaced_file(path: Path) -> Iterator[str]:
    """Name of a temporary file beside `path`, which takes its place if the block ends well and vanishes if it does not.
    `StoreError` if the folder cannot be made, or the file not written."""
    temporary = ""
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        _sweep(path)
        unfinished = path.with_name(f".{path.name}.{secrets.token_hex(4)}.part")
        # 0o666 less the user's umask, as of any new file
        os.close(os.open(unfinished, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o666))
        temporary = str(unfinished)
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
        if temporary:
            with contextlib.suppress(OSError):
                os.unlink(temporary)


def _sweep(path: Path) -> None:
    """Remove what killed processes left of earlier attempts."""
    for left in path.parent.glob(f".{glob.escape(path.name)}.*.part"):
        with contextlib.suppress(OSError):
            if time.time() - left.stat().st_mtime > _FORGOTTEN:
                left.unlink()


def _flush(folder: Path) -> None:
    """The new name, too, survives a power cut, where the system lets folders be flushed."""
    with contextlib.suppress(OSError):
        handle = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(handle)
        finally:
            os.close(handle)
