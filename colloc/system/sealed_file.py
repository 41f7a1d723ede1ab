"""Files that carry a seal: a trailer with the SHA-256 of all that stands before it, checked before anything is parsed.

HDF5 readers ignore what follows the end of their data, so a sealed HDF5 file opens everywhere. A file that was cut, whose
bits changed, or that somebody else wrote has no seal that fits. A seal is no signature: it tells damage, not intent. Programs
that open a file to write cut off what follows their data, and the seal with it, even if they write nothing.
"""

from __future__ import annotations

import hashlib
import os
from pathlib import Path
from typing import BinaryIO

from colloc.system.errors import StoreError

MAGIC = b"colloc-sha256\n"
SEAL_SIZE = len(MAGIC) + 32
_BLOCK = 2**20
LONGEST_TEXT = 2**20
"""Bytes of one text in a results file, such as the description of a problem, or the file that states it."""


def _digest(file: BinaryIO, size: int) -> bytes:
    """SHA-256 of the next `size` bytes, in blocks."""
    found = hashlib.sha256()
    while size > 0:
        block = file.read(min(_BLOCK, size))
        if not block:
            break
        found.update(block)
        size -= len(block)
    return found.digest()


def write_sealed(path: str | os.PathLike[str], content: bytes) -> None:
    """Write a whole file with its seal."""
    with open(path, "wb") as file:
        file.write(content)
        file.write(MAGIC + hashlib.sha256(content).digest())


def is_sealed(path: Path, largest: int, kind: str) -> bool:
    """Whether a file is as colloc left it; False if it carries no seal at all. `kind` is for the message, "colloc solution".
    `StoreError` if the file is missing or too large, or if its seal does not fit."""
    try:
        if not path.is_file():
            raise StoreError(f"there is no file {path}.")
        with open(path, "rb") as file:
            size = os.fstat(file.fileno()).st_size
            if size > largest:
                raise StoreError(f"{path} is too large for a {kind}: {size} bytes, where {largest} are allowed.")
            if size < SEAL_SIZE:
                raise StoreError(f"{path} is not a readable {kind}: it is damaged, or something else.")
            file.seek(size - SEAL_SIZE)
            trailer = file.read(SEAL_SIZE)
            if not trailer.startswith(MAGIC):
                return False
            file.seek(0)
            if _digest(file, size - SEAL_SIZE) != trailer[len(MAGIC) :]:
                raise StoreError(f"{path} is damaged: its checksum does not fit. Make it again with the command that wrote it.")
            return True
    except StoreError:
        raise
    except OSError as error:
        raise StoreError(f"cannot read {path}: {error.strerror or error}.") from None


def check_seal(path: Path, largest: int, kind: str) -> None:
    """Refuse a file that is missing, too large, or not as colloc left it, by a `StoreError`."""
    if not is_sealed(path, largest, kind):
        raise StoreError(
            f"{path} is not a readable {kind}: it carries no checksum, so it is damaged, was changed after colloc "
            "wrote it, or is something else. Make it again with the command that wrote it."
        )
