"""HDF5 files of results, for plain h5py, netCDF and xarray. Nothing in a file is executed.

Datasets have ``units`` and ``dims``; texts are UTF-8 of fixed length, without trailing NULs.
"""

from __future__ import annotations

import contextlib
import io
import os
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import h5py
import numpy as np

from colloc.system.environment import optional
from colloc.system.errors import CollocError, StoreError
from colloc.system.files import replaced_file

if TYPE_CHECKING:
    import xarray


@contextlib.contextmanager
def new_file(path: str | os.PathLike[str]) -> Iterator[h5py.File]:
    """An HDF5 file to write, which replaces `path` if the block succeeds. `StoreError` if not."""
    with replaced_file(Path(path)) as temporary:
        # in memory: on a full disk HDF5 can end the process
        image = io.BytesIO()
        with h5py.File(image, "w", libver="v108") as file:
            yield file
        Path(temporary).write_bytes(image.getbuffer())


@contextlib.contextmanager
def open_file(path: str | os.PathLike[str], kind: str, version: int) -> Iterator[h5py.File]:
    """An HDF5 file of a kind ("colloc solution") and version to read.

    `StoreError` if it is missing, damaged or another one, or reading in the block fails.
    """
    path = Path(path)
    if not path.is_file():
        raise StoreError(f"there is no file {path}.")
    try:
        # files are replaced as a whole, and need no lock, which some file systems do not have
        with h5py.File(path, "r", locking=False) as file:
            if (text := attribute(file, "format")) != kind:
                raise StoreError(f"it is a {text}.")
            if (text := attribute(file, "format_version")) != version:
                remedy = "Make it again with the command that wrote it"
                if text > version:
                    remedy = "Update colloc to read it"
                raise StoreError(
                    f"its format is {text}, where this colloc reads {version}. {remedy}."
                )
            yield file
    except Exception as error:  # h5py raises many kinds for a damaged file
        why = error if isinstance(error, CollocError) else f"{type(error).__name__}: {error}."
        if isinstance(error, OSError) and "file signature" in str(error):
            why = "it is no HDF5 file."
        raise StoreError(f"{path} is not a readable {kind}: {why}") from None


def mark(file: h5py.File, kind: str, version: int) -> None:
    put_attribute(file, "format", kind)
    put_attribute(file, "format_version", version)


def put(group: h5py.Group, name: str, value: Any, **described: str) -> h5py.Dataset:
    """Write a dataset of numbers or texts, with texts such as its units as attributes.

    ``dims="joint, time"`` also names its dimensions as netCDF does: the dataset named like its one
    dimension is the coordinate; a dimension without one has a dataset with no data.
    """
    dataset = group.create_dataset(name, data=_encode(value))
    if dataset.dtype.kind == "S":
        put_attribute(dataset, "_Encoding", "utf-8")  # xarray would give bytes
    for key, text in described.items():
        put_attribute(dataset, key, text)
    dims = described["dims"].split(", ") if described.get("dims") else []
    if dims == [name]:
        dataset.make_scale(name)
        return dataset
    for axis, (dim, size) in enumerate(zip(dims, dataset.shape, strict=bool(dims))):
        if dim not in group:
            group.create_dataset(dim, shape=(size,), dtype=">f4").make_scale(
                f"This is a netCDF dimension but not a netCDF variable.{size:10d}"
            )
        dataset.dims[axis].attach_scale(group[dim])
    return dataset


def put_attribute(owner: h5py.Group | h5py.Dataset, name: str, value: Any) -> None:
    owner.attrs[name] = _encode(value)


def _encode(value: Any) -> np.ndarray:
    value = np.asarray(value)
    if value.dtype.kind not in "UO":
        return value
    encoded = [str.encode(each, "utf-8", "replace") for each in value.flat]
    # HDF5 has no length 0, and h5netcdf takes length 1 for a byte
    length = max(2, max(map(len, encoded), default=0))
    return np.array(encoded, dtype=h5py.string_dtype("utf-8", length)).reshape(value.shape)


def _decode(value: Any) -> Any:
    if isinstance(value, np.ndarray) and value.dtype.kind == "S":
        return np.char.decode(value, "utf-8")
    return value.decode("utf-8") if isinstance(value, bytes) else value


def attribute(owner: h5py.Group | h5py.Dataset, name: str) -> Any:
    """A number, a text or an array. `StoreError` if it is missing."""
    if name not in owner.attrs:
        raise StoreError(f"attribute {name} of {owner.name} is missing.")
    value = _decode(owner.attrs[name])
    return value.item() if isinstance(value, np.generic) else value


def array(group: h5py.Group, name: str) -> Any:
    if not isinstance(group.get(name), h5py.Dataset):
        raise StoreError(f"{group.name.rstrip('/')}/{name} is missing, or not a dataset.")
    return _decode(group[name][()])


@dataclass(frozen=True, eq=False)
class Table:
    """Labelled columns over named dimensions, with the units and labels that are known."""

    name: str
    coordinates: Mapping[str, np.ndarray]
    variables: Mapping[str, np.ndarray]
    dimensions: Mapping[str, tuple[str, ...]]
    units: Mapping[str, str] = field(default_factory=dict)
    labels: Mapping[str, str] = field(default_factory=dict)
    attributes: Mapping[str, Any] = field(default_factory=dict)

    def to_xarray(self) -> xarray.Dataset:
        columns = {
            name: (self.dimensions[name], values, {"units": self.units.get(name, "1")})
            for name, values in self.variables.items()
        }
        return optional("xarray").Dataset(columns, dict(self.coordinates), {"name": self.name})


def save_table(table: Table, path: str | os.PathLike[str], kind: str, version: int) -> Path:
    """Write a table as HDF5. `StoreError` if it cannot be written."""
    dimensions = {name: (name,) for name in table.coordinates} | dict(table.dimensions)
    with new_file(path) as file:
        mark(file, kind, version)
        for name, value in {"name": table.name, **table.attributes}.items():
            put_attribute(file, name, value)
        for name, values in {**table.coordinates, **table.variables}.items():
            described = {"long_name": table.labels[name]} if name in table.labels else {}
            if dims := ", ".join(dimensions[name]):
                described = {"dims": dims, "units": table.units.get(name, "1"), **described}
            stored = values.astype("i1") if values.dtype.kind == "b" else values
            dataset = put(file, name, stored, **described)
            if dataset.dtype.kind == "f" and name in table.variables:
                put_attribute(dataset, "_FillValue", [np.nan])
    return Path(path)
