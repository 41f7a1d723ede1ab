"""HDF5 files of results: written whole and sealed, opened only with an unbroken seal, read within limits of size and kind.

The HDF5 library is no safe parser of hostile bytes. So nothing reaches it that does not carry the checksum colloc wrote
(`system.sealed_file`), save a result that another program opened to write: that one is whole, but has lost it (`was_changed`).
Whoever forges that checksum meets a second one: files are in the format of HDF5 1.8, whose blocks of metadata carry checksums
that the library verifies. What is left to read is simple by construction, and anything else is refused by its type before its
data are touched:

- numbers in one contiguous piece: no chunks, no filters, no external or virtual data, no links out of the file, and no array
  larger than its file;
- texts as UTF-8 of fixed length, padded with NUL: no text has a variable length, so the global heap is never read (the library
  can loop there for ever). **Trailing NULs of a text are not kept**; everything else is, also the empty text. What UTF-8 cannot
  hold (undecodable bytes of a command line) becomes "?".

`put` and `put_attribute` write, `array`, `text` and `attribute` read; nothing else in colloc touches data in HDF5 files.
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
from h5py import h5d, h5s, h5t

from colloc.system.errors import CollocError, StoreError
from colloc.system.file_lock import NO_LOCKS
from colloc.system.replaced_file import replaced_file
from colloc.system.sealed_file import LONGEST_TEXT, check_seal, is_sealed, write_sealed

LARGEST_FILE = 2**28
LARGEST_ARRAY = 2**27
"""Bytes of a file, and of one array when it is in memory."""
LONGEST_IN_ARRAY = 2000
"""Characters of a text in an array, where each takes the room of the longest. The rest is left out, and an ellipsis says so."""

BETWEEN_DIMS = ", "
_NO_VARIABLE = "This is a netCDF dimension but not a netCDF variable."
_SIGNATURE, _CHECKED_SUPERBLOCKS, _END_OF_FILE = b"\x89HDF\r\n\x1a\n", (2, 3), slice(28, 36)
"""First bytes; versions of the first block whose metadata carry checksums; where that block keeps the length of the file."""
_REMEDY = "Move it away, and make it again with the command that wrote it"
_NUMBERS = (h5t.INTEGER, h5t.FLOAT, h5t.ENUM)  # h5py keeps truth values as enumerations


@contextlib.contextmanager
def new_file(path: str | os.PathLike[str]) -> Iterator[h5py.File]:
    """An HDF5 file to write; it takes its place, sealed, only if the block ends well.

    It is made in memory: where the disk is full, HDF5 closing a file on it can end the process (a segmentation fault).
    `StoreError` if the folder or the file cannot be written.
    """
    with replaced_file(Path(path)) as temporary:
        # no image of an open file: that of HDF5 1.14.2 has a wrong checksum in its first block
        image = io.BytesIO()
        with h5py.File(image, "w", libver="v108") as file:
            yield file
        write_sealed(temporary, image.getvalue())


@contextlib.contextmanager
def sealed_file(
    path: str | os.PathLike[str], kind: str, version: int, *, largest: int = LARGEST_FILE, unsealed: bool = False
) -> Iterator[h5py.File]:
    """An HDF5 file of a kind ("colloc solution") and version to read, of so many bytes at most; `unsealed` ones, since they
    `was_changed`, without a look at their seal.

    `StoreError` if it is missing, too large, damaged, of another kind or version, or if reading in the block fails.
    """
    path = Path(path)
    if not unsealed:
        check_seal(path, largest, kind)
    try:
        _check_head(path, kind, version)
        with _opened(path) as file:
            if attribute(file, "format") != kind:
                raise StoreError(f"{path} is an HDF5 file, but not a {kind}.")
            found = attribute(file, "format_version")
            if found != version:
                age, remedy = ("a newer", "Update colloc to read it") if found > version else ("an older", _REMEDY)
                raise StoreError(
                    f"{path} was written by {age} colloc: its format is {found}, where this one reads {version}. {remedy}."
                )
            yield file
    except StoreError:
        raise
    except CollocError as error:
        raise StoreError(f"{path} is damaged: {error}") from None
    except Exception as error:
        # h5py raises many kinds for a damaged file
        raise StoreError(f"{path} is not a readable {kind} ({type(error).__name__}: {error}).") from None


def _opened(path: Path) -> h5py.File:
    """A file to read: locked, if its file system can do that. Those of colloc are replaced whole, and need no lock."""
    try:
        return h5py.File(path, "r")
    except OSError as error:
        if error.errno not in NO_LOCKS:
            raise
        return h5py.File(path, "r", locking=False)


def was_changed(path: Path, kind: str) -> bool:
    """Whether another program opened a file to write: it has no seal, but is as long as its own first block says. `StoreError`
    if the file is missing or too large, or has a seal that does not fit."""
    if is_sealed(path, LARGEST_FILE, kind):
        return False
    with open(path, "rb") as file:
        block, size = file.read(_END_OF_FILE.stop), os.fstat(file.fileno()).st_size
    whole = block.startswith(_SIGNATURE) and int.from_bytes(block[_END_OF_FILE], "little") == size
    return whole and block[len(_SIGNATURE)] in _CHECKED_SUPERBLOCKS  # HDF5 checks the checksum of the block itself


def _check_head(path: Path, kind: str, version: int) -> None:
    """Refuse what is not HDF5, and HDF5 whose metadata carry no checksums, as earlier files of colloc."""
    with open(path, "rb") as file:
        head = file.read(len(_SIGNATURE) + 1)
    if not head.startswith(_SIGNATURE):
        raise StoreError(f"{path} is not a {kind}: it is no HDF5 file.")
    if head[-1] not in _CHECKED_SUPERBLOCKS:
        raise StoreError(
            f"{path} is not a {kind} of format {version}: an older colloc wrote it, or another program. {_REMEDY}."
        )


def mark(file: h5py.File, kind: str, version: int) -> None:
    """Say what a new file is."""
    put_attribute(file, "format", kind)
    put_attribute(file, "format_version", version)


def put(group: h5py.Group, name: str, value: Any, **described: str) -> h5py.Dataset:
    """A new dataset of numbers or texts, with texts such as its units as attributes.

    ``dims="joint, time"`` names its dimensions also in the way of netCDF (`_name_dimensions`). `TypeError` if the
    value is neither; `StoreError` if a text is too long to be read again.
    """
    dataset = group.create_dataset(name, data=_stored(value, name))
    if dataset.dtype.kind == "S":
        put_attribute(dataset, "_Encoding", "utf-8")  # for xarray, which gives bytes without it
    for key, text in described.items():
        put_attribute(dataset, key, text)
    if described.get("dims"):
        _name_dimensions(group, dataset, name, described["dims"].split(BETWEEN_DIMS))
    return dataset


def _name_dimensions(group: h5py.Group, dataset: h5py.Dataset, name: str, dims: list[str]) -> None:
    """Dimension scales of HDF5, by which netCDF and xarray know dimensions; colloc never reads them (they are references).

    The dataset named like its one dimension is the coordinate; a dimension without one has a dataset with no data.
    """
    if dims == [name]:
        dataset.make_scale(name)
        return
    for axis, (dim, size) in enumerate(zip(dims, dataset.shape, strict=True)):
        if dim not in group:
            group.create_dataset(dim, shape=(size,), dtype=">f4").make_scale(f"{_NO_VARIABLE}{size:10d}")
        dataset.dims[axis].attach_scale(group[dim])


def put_attribute(owner: h5py.Group | h5py.Dataset, name: str, value: Any) -> None:
    """An attribute: a number, a text, or an array of them. Raises as `put`."""
    owner.attrs[name] = _stored(value, name)


def _stored(value: Any, name: str) -> np.ndarray:
    """Numbers as an array, texts as an array of UTF-8 of fixed length."""
    value = np.asarray(value)
    if value.dtype.kind in "biuf":
        return value
    if value.dtype.kind not in "UO" or not all(isinstance(each, str) for each in value.flat):
        raise TypeError(f"{name} holds neither numbers nor texts, so it cannot be written.")
    if value.ndim:
        texts = [t if len(t) <= LONGEST_IN_ARRAY else t[: LONGEST_IN_ARRAY - 1] + "…" for t in value.flat]
    else:
        texts = [str(value[()])]
    encoded = [t.encode("utf-8", "replace") for t in texts]
    # HDF5 knows no length 0, and h5netcdf takes length 1 for a single byte, no text
    length = max((len(t) for t in encoded), default=0)
    if length > LONGEST_TEXT:
        raise StoreError(f"{name} is too long: {length} bytes, where {LONGEST_TEXT} are allowed.")
    return np.array(encoded, dtype=h5py.string_dtype("utf-8", max(2, length))).reshape(value.shape)


def _is_text(stored: h5d.DatasetID | h5py.h5a.AttrID, where: str, largest: int) -> bool:
    """Whether texts are stored, and not numbers; anything else is refused by its type, before any data are read."""
    kind, space = stored.get_type(), stored.get_space()
    is_text = kind.get_class() == h5t.STRING
    if not (is_text and not kind.is_variable_str()) and kind.get_class() not in _NUMBERS:
        raise StoreError(f"{where} holds neither numbers nor texts of fixed length.")
    if space.get_simple_extent_type() == h5s.NULL:
        raise StoreError(f"{where} is empty.")
    times = 4 if is_text and space.get_simple_extent_ndims() else 1  # decoded, NumPy takes four bytes a character
    if space.get_simple_extent_npoints() * kind.get_size() * times > largest:
        raise StoreError(f"{where} is too large.")
    return is_text


def _decoded(value: Any) -> Any:
    """Texts of stored ones: one as a string, an array as an array of strings."""
    return np.char.decode(value, "utf-8") if isinstance(value, np.ndarray) else bytes(value).decode("utf-8")


def attribute(owner: h5py.Group | h5py.Dataset, name: str) -> Any:
    """An attribute: a number or text of Python, or an array of them. `StoreError` if it is missing, too large, or neither
    number nor text."""
    where = f"attribute {name} of {owner.name}"
    if name not in owner.attrs:
        raise StoreError(f"{where} is missing.")
    is_text = _is_text(owner.attrs.get_id(name), where, LONGEST_TEXT)
    value = owner.attrs[name]
    if is_text:
        return _decoded(value)
    return value.item() if isinstance(value, np.generic) else value


def array(group: h5py.Group, name: str, *, largest: int = LARGEST_ARRAY) -> Any:
    """The data of a dataset: numbers as a NumPy array, texts decoded. `StoreError` if it is no plain dataset of this file, or
    too large."""
    where = f"{group.name.rstrip('/')}/{name}"
    if not isinstance(group.get(name, getlink=True), h5py.HardLink):
        raise StoreError(f"{where} is missing, or a link.")
    dataset = group[name]
    if not isinstance(dataset, h5py.Dataset):
        raise StoreError(f"{where} is not a dataset.")
    is_text = _is_text(dataset.id, where, largest)
    layout = dataset.id.get_create_plist()
    if layout.get_layout() != h5d.CONTIGUOUS or layout.get_external_count():
        raise StoreError(f"{where} is not stored in one piece in this file.")
    if dataset.id.get_storage_size() != dataset.size * dataset.id.get_type().get_size():
        raise StoreError(f"{where} is not whole.")
    return _decoded(dataset[()]) if is_text else dataset[()]


def text(group: h5py.Group, name: str) -> str:
    """A scalar text."""
    found = array(group, name, largest=LONGEST_TEXT)
    if not isinstance(found, str):
        raise StoreError(f"{name} is not a text.")
    return found


def child(group: h5py.Group, name: str) -> h5py.Group:
    """A group in this file, not a link out of it."""
    if not isinstance(group.get(name, getlink=True), h5py.HardLink) or not isinstance(group[name], h5py.Group):
        raise StoreError(f"{name} is missing, or not a group.")
    return group[name]
