"""HDF5 files of results: written whole, for plain h5py, netCDF and xarray to read. Nothing in a
file is executed.

Datasets carry ``units`` and ``dims``; texts are UTF-8 of fixed length, padded with NUL, so that
**trailing NULs are not kept**. What UTF-8 cannot hold (undecodable bytes of a command line) becomes
"?".
"""

from __future__ import annotations

import contextlib
import io
import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from colloc.system.errors import CollocError, StoreError
from colloc.system.replaced_file import replaced_file

BETWEEN_DIMS = ", "
_NO_VARIABLE = "This is a netCDF dimension but not a netCDF variable."


@contextlib.contextmanager
def new_file(path: str | os.PathLike[str]) -> Iterator[h5py.File]:
    """An HDF5 file to write, which takes its place if the block ends well. `StoreError` if it
    cannot be written."""
    with replaced_file(Path(path)) as temporary:
        # in memory: where the disk is full, HDF5 closing a file on it can end the process
        image = io.BytesIO()
        with h5py.File(image, "w", libver="v108") as file:
            yield file
        Path(temporary).write_bytes(image.getbuffer())


@contextlib.contextmanager
def open_file(path: str | os.PathLike[str], kind: str, version: int) -> Iterator[h5py.File]:
    """An HDF5 file of a kind ("colloc solution") and version to read.

    Raises
    ------
    StoreError
        If it is missing, damaged, of another kind or version, or if reading in the block fails.
    """
    path = Path(path)
    if not path.is_file():
        raise StoreError(f"there is no file {path}.")
    try:
        # files of colloc are replaced whole, and need no lock, which some file systems do not have
        with h5py.File(path, "r", locking=False) as file:
            if (found := attribute(file, "format")) != kind:
                raise StoreError(f"it is a {found}.")
            if (found := attribute(file, "format_version")) != version:
                remedy = (
                    "Update colloc to read it"
                    if found > version
                    else "Make it again with the command that wrote it"
                )
                raise StoreError(
                    f"its format is {found}, where this colloc reads {version}. {remedy}."
                )
            yield file
    except Exception as error:  # h5py raises many kinds for a damaged file
        why = error if isinstance(error, CollocError) else f"{type(error).__name__}: {error}."
        raise StoreError(f"{path} is not a readable {kind}: {why}") from None


def mark(file: h5py.File, kind: str, version: int) -> None:
    """Say what a new file is."""
    put_attribute(file, "format", kind)
    put_attribute(file, "format_version", version)


def put(group: h5py.Group, name: str, value: Any, **described: str) -> h5py.Dataset:
    """A new dataset of numbers or texts, with texts such as its units as attributes.

    ``dims="joint, time"`` names its dimensions also in the way of netCDF: the dataset named like
    its one dimension is the coordinate, and a dimension without one has a dataset with no data.
    """
    dataset = group.create_dataset(name, data=_stored(value))
    if dataset.dtype.kind == "S":
        put_attribute(dataset, "_Encoding", "utf-8")  # for xarray, which gives bytes without it
    for key, text in described.items():
        put_attribute(dataset, key, text)
    dims = described["dims"].split(BETWEEN_DIMS) if described.get("dims") else []
    if dims == [name]:
        dataset.make_scale(name)
        return dataset
    for axis, (dim, size) in enumerate(zip(dims, dataset.shape, strict=bool(dims))):
        if dim not in group:
            group.create_dataset(dim, shape=(size,), dtype=">f4").make_scale(
                f"{_NO_VARIABLE}{size:10d}"
            )
        dataset.dims[axis].attach_scale(group[dim])
    return dataset


def put_attribute(owner: h5py.Group | h5py.Dataset, name: str, value: Any) -> None:
    """An attribute: a number, a text, or an array of them."""
    owner.attrs[name] = _stored(value)


def _stored(value: Any) -> np.ndarray:
    value = np.asarray(value)
    if value.dtype.kind not in "UO":
        return value
    encoded = [str.encode(each, "utf-8", "replace") for each in value.flat]
    # HDF5 knows no length 0, and h5netcdf takes length 1 for a single byte, no text
    length = max(2, max(map(len, encoded), default=0))
    return np.array(encoded, dtype=h5py.string_dtype("utf-8", length)).reshape(value.shape)


def _decoded(value: Any) -> Any:
    """Texts of stored ones; numbers as they are."""
    if isinstance(value, np.ndarray):
        return np.char.decode(value, "utf-8") if value.dtype.kind == "S" else value
    return value.decode("utf-8") if isinstance(value, bytes) else value


def attribute(owner: h5py.Group | h5py.Dataset, name: str) -> Any:
    """An attribute: a number or text of Python, or an array of them. `StoreError` if it is
    missing."""
    if name not in owner.attrs:
        raise StoreError(f"attribute {name} of {owner.name} is missing.")
    value = _decoded(owner.attrs[name])
    return value.item() if isinstance(value, np.generic) else value


def array(group: h5py.Group, name: str) -> Any:
    """The data of a dataset: numbers as a NumPy array, texts decoded. `StoreError` if there is
    none."""
    if not isinstance(group.get(name), h5py.Dataset):
        raise StoreError(f"{group.name.rstrip('/')}/{name} is missing, or not a dataset.")
    return _decoded(group[name][()])


def child(group: h5py.Group, name: str) -> h5py.Group:
    """A group of a group. `StoreError` if there is none."""
    if not isinstance(group.get(name), h5py.Group):
        raise StoreError(f"{name} is missing, or not a group.")
    return group[name]
