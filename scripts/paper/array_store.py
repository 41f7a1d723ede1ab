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
from colloc.system.errors import StoreError
from colloc.system.store_file import array, attribute, mark, new_file, open_file, put, put_attribute

KIND, VERSION = "colloc arrays", 2


def write_arrays(
    path: Path,
    arrays: Mapping[str, Any],
    *,
    units: Mapping[str, str] | None = None,
    attributes: Mapping[str, Any] | None = None,
) -> None:
    """Write arrays (numbers, strings or NumPy arrays by name; "a/b" makes a group) with what
    describes them."""
    path = Path(path)
    described = {
        "command": " ".join(sys.orig_argv[1:]),
        "versions": {
            "python": sys.version.split()[0],
            "numpy": np.__version__,
            "h5py": h5py.__version__,
        },
        "conventions": (colloc.__doc__ or "").strip(),
        **(attributes or {}),
    }
    with new_file(path) as file:
        mark(file, KIND, VERSION)
        for key, value in arrays.items():
            put(file, key, value, units=(units or {}).get(key, "1"))
        for key, value in described.items():
            put_attribute(
                file, key, value if isinstance(value, (str, int, float)) else json.dumps(value)
            )


def read_arrays(path: Path) -> dict[str, Any]:
    """All arrays of a file by name; strings decoded, scalars as NumPy scalars."""
    names: list[str] = []

    def visit(name: str, item: Any) -> None:
        if isinstance(item, h5py.Dataset):
            names.append(name)

    with open_file(path, KIND, VERSION) as file:
        file.visititems(visit)
        return {name: array(file, name) for name in names}


def read_attribute(path: Path, name: str) -> Any:
    """One attribute of the file, or None if the file or the attribute is missing, or the file is
    damaged."""
    try:
        with open_file(path, KIND, VERSION) as file:
            return attribute(file, name)
    except StoreError:
        return None
