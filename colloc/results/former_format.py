"""Solutions of the former format, 2, read as those of the present one: the same fields, kept in another way.

Their texts have a variable length and their metadata no checksums. The HDF5 library can loop for ever on such a file if it was
made to (`colloc.system.store_file`), and cannot be interrupted then. So only files with an unbroken seal are looked at, by a
process of their own that writes a file of the present format, and is given a minute.
"""

from __future__ import annotations

import contextlib
import os
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

import h5py

from colloc.system.errors import StoreError
from colloc.system.sealed_file import check_seal
from colloc.system.store_file import LARGEST_FILE, mark, new_file, put, put_attribute

FORMER = 2
_HEAD = b"\x89HDF\r\n\x1a\n\x00"
"""First bytes of HDF5 without checksums of metadata."""
_SECONDS = 60.0


def is_former(path: str | os.PathLike[str]) -> bool:
    """Whether a file may be of the former format, by its first bytes."""
    try:
        with open(path, "rb") as file:
            return file.read(len(_HEAD)) == _HEAD
    except OSError:
        return False


@contextlib.contextmanager
def converted(path: str | os.PathLike[str], kind: str, version: int) -> Iterator[Path]:
    """A file of the present format with what one of the former holds; it is there while the block runs. `StoreError` if the
    file has no unbroken seal, or is not of the former format."""
    check_seal(Path(path), LARGEST_FILE, kind)
    with tempfile.TemporaryDirectory(prefix="colloc-") as folder:
        present = Path(folder) / "present.h5"
        command = [sys.executable, "-P", "-m", __name__, os.fspath(path), str(present), kind, str(version)]
        try:
            ended = subprocess.run(command, capture_output=True, timeout=_SECONDS, check=False)
        except subprocess.TimeoutExpired:
            raise StoreError(f"{path} cannot be read: HDF5 came to no end with it.") from None
        if ended.returncode:
            raise StoreError(f"{path} is not a {kind} of format {FORMER} or {version}; move it away, and make it again.")
        yield present


def _convert(old: h5py.File, new: h5py.File, kind: str, version: int) -> None:
    """Copy every number and text."""
    if (old.attrs["format"], old.attrs["format_version"]) != (kind, FORMER):
        raise StoreError("it is of another kind or format.")

    def copy(name: str, there: h5py.Group | h5py.Dataset) -> None:
        if isinstance(there, h5py.Dataset):
            is_text = h5py.check_string_dtype(there.dtype) is not None
            here: h5py.Group | h5py.Dataset = put(new, name, there.asstr()[()] if is_text else there[()])
        else:
            here = new.require_group(name)
        for key, value in there.attrs.items():
            put_attribute(here, key, value)

    old.visititems(copy)
    for key, value in old.attrs.items():
        put_attribute(new, key, value)
    mark(new, kind, version)


if __name__ == "__main__":
    _, source, target, named, number = sys.argv
    with h5py.File(source, "r") as former, new_file(target) as present_file:
        _convert(former, present_file, named, int(number))
