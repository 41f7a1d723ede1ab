"""HDF5 files of results: written whole and sealed, opened only with an unbroken seal, read within limits of size.

The HDF5 library is no safe parser of hostile bytes. So nothing reaches it that does not carry the checksum colloc wrote
(`colloc.sealed_file`). Whoever forges a checksum still meets limits before any allocation, and no external files, virtual
data or links out of the file are followed.
"""

from __future__ import annotations

import contextlib
import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from colloc.errors import CollocError, StoreError
from colloc.replaced_file import replaced_file
from colloc.sealed_file import check_seal, write_sealed

LARGEST_FILE = 2**28
LARGEST_ARRAY = 2**27
LONGEST_TEXT = 2**20
"""Bytes of a file, of one array when it is in memory, and of one text, such as the description of a problem."""


@contextlib.contextmanager
def new_file(path: str | os.PathLike[str]) -> Iterator[h5py.File]:
    """An HDF5 file to write; it takes its place, sealed, only if the block ends well.

    It is made in memory: where the disk is full, HDF5 closing a file on it can end the process (a segmentation fault).

    Raises
    ------
    StoreError
        If the folder or the file cannot be written.
    """
    with replaced_file(Path(path)) as temporary:
        with h5py.File("in memory", "w", driver="core", backing_store=False, block_size=2**20) as file:
            yield file
            file.flush()
            image = file.id.get_file_image()
        write_sealed(temporary, image)


@contextlib.contextmanager
def sealed_file(path: str | os.PathLike[str], kind: str, version: int, *, largest: int = LARGEST_FILE) -> Iterator[h5py.File]:
    """An HDF5 file of a kind ("colloc solution") to read.

    Raises
    ------
    StoreError
        If it is missing, too large, damaged, of another kind or of a later version, or if reading in the block fails.
    """
    path = Path(path)
    check_seal(path, largest, kind)
    try:
        with h5py.File(path, "r") as file:
            if file.attrs.get("format") != kind:
                raise StoreError(f"{path} is an HDF5 file, but not a {kind}.")
            if int(file.attrs["format_version"]) > version:
                raise StoreError(f"{path} was written by a newer colloc; update colloc to read it.")
            yield file
    except StoreError:
        raise
    except CollocError as error:
        raise StoreError(f"{path} is damaged: {error}") from None
    except Exception as error:
        # h5py raises many kinds for a damaged file
        raise StoreError(f"{path} is not a readable {kind} ({type(error).__name__}: {error}).") from None


def mark(file: h5py.File, kind: str, version: int) -> None:
    """Say what a new file is."""
    file.attrs["format"], file.attrs["format_version"] = kind, version


def array(group: h5py.Group, name: str, *, largest: int = LARGEST_ARRAY) -> Any:
    """The data of a dataset: numbers as a NumPy array, texts decoded.

    Raises
    ------
    StoreError
        If it is no plain dataset of this file, or too large.
    """
    where = f"{group.name.rstrip('/')}/{name}"
    if not isinstance(group.get(name, getlink=True), h5py.HardLink):
        raise StoreError(f"{where} is missing, or a link.")
    dataset = group[name]
    if not isinstance(dataset, h5py.Dataset) or dataset.external or dataset.is_virtual:
        raise StoreError(f"{where} is not a plain dataset.")
    is_text = h5py.check_string_dtype(dataset.dtype) is not None
    if not is_text and dataset.dtype.kind not in "biuf":
        raise StoreError(f"{where} holds neither numbers nor texts.")
    if dataset.size is None or dataset.size * max(dataset.dtype.itemsize, 16 if is_text else 1) > largest:
        raise StoreError(f"{where} is too large.")
    return dataset.asstr()[()] if is_text else dataset[()]


def text(group: h5py.Group, name: str) -> str:
    """A scalar text."""
    found = array(group, name)
    if not isinstance(found, str):
        raise StoreError(f"{name} is not a text.")
    if len(found) > LONGEST_TEXT:
        raise StoreError(f"{name} is too long: {len(found)} characters, where {LONGEST_TEXT} are allowed.")
    return found


def child(group: h5py.Group, name: str) -> h5py.Group:
    """A group in this file, not a link out of it."""
    if not isinstance(group.get(name, getlink=True), h5py.HardLink) or not isinstance(group[name], h5py.Group):
        raise StoreError(f"{name} is missing, or not a group.")
    return group[name]


def plain(value: Any) -> Any:
    """NumPy scalars as Python's."""
    return value.item() if isinstance(value, np.generic) else value
