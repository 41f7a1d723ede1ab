"""Named arrays with units and provenance in an HDF5 file, replaced as a whole or not at all."""

from __future__ import annotations

import json
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import h5py
import numpy as np

import colloc
from colloc.errors import StoreError
from colloc.replaced_file import replaced_file


def write_arrays(
    path: Path,
    arrays: Mapping[str, Any],
    *,
    units: Mapping[str, str] | None = None,
    attributes: Mapping[str, Any] | None = None,
) -> None:
    """Write arrays (numbers, strings or NumPy arrays by name; "a/b" makes a group) with what describes them.

    Parameters
    ----------
    path : Path
        Replaced atomically.
    arrays : mapping
    units : mapping, optional
        Unit or dimensions of an array, by name.
    attributes : mapping, optional
        Of the file, as JSON where they are not plain numbers or strings. The command line and versions are added.

    Raises
    ------
    StoreError
        If the file cannot be written.
    """
    path = Path(path)
    described = {
        "command": " ".join(sys.orig_argv[1:]),
        "versions": {"python": sys.version.split()[0], "numpy": np.__version__, "h5py": h5py.__version__},
        "conventions": (colloc.__doc__ or "").strip(),
        **(attributes or {}),
    }
    with replaced_file(path) as name, h5py.File(name, "w") as file:
        for key, value in arrays.items():
            value = np.asarray(value)
            plain = value.astype(h5py.string_dtype()) if value.dtype.kind in "US" else value
            dataset = file.create_dataset(key, data=plain, compression="gzip" if plain.size > 1000 else None)
            dataset.attrs["units"] = (units or {}).get(key, "1")
        for key, value in described.items():
            file.attrs[key] = value if isinstance(value, (str, int, float)) else json.dumps(value)


def read_arrays(path: Path) -> dict[str, Any]:
    """All arrays of a file by name; strings decoded, scalars as NumPy scalars.

    Raises
    ------
    StoreError
        If the file is missing, damaged or not HDF5.
    """
    arrays: dict[str, Any] = {}

    def visit(name: str, item: Any) -> None:
        if isinstance(item, h5py.Dataset):
            arrays[name] = item.asstr()[()] if h5py.check_string_dtype(item.dtype) else item[()]

    try:
        with h5py.File(path, "r") as file:
            file.visititems(visit)
    except OSError as error:
        raise StoreError(f"cannot read {path}: {error}; make it again with the command that wrote it.") from None
    return arrays


def read_attribute(path: Path, name: str) -> Any:
    """One attribute of the file, or None if the file or the attribute is missing."""
    try:
        with h5py.File(path, "r") as file:
            return file.attrs.get(name)
    except OSError:
        return None
