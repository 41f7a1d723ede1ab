"""The result of a study in one file: netCDF-4 compatible HDF5 that xarray, ncdump and plain h5py open.

Dimensions are the axes of the study, and ``joint`` and ``harmonic``; every dimension has its coordinate. Numbers of cells
without a certified gait are NaN, and ``status`` and ``message`` say why. Layout::

    efficiency, efficiency_error, distance, work, delta, trivial_bound, upper_bound, seconds   (axes)
    wave, forward (axes)   winding, bilateral, antipodal, retraced, at_slowest, starts, starts_certified   (axes)
    status, message, origin, gait_class, problem_hash   (axes), texts
    mean (axes, joint)     cos, sin (axes, joint, harmonic)
    attributes: format, format_version, name, source, command, versions (JSON), created_from
"""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from colloc.errors import StoreError
from colloc.solution import versions
from colloc.store_file import array, mark, new_file, plain, sealed_file
from colloc.study_table import UNITS, StudyTable

KIND, VERSION = "colloc study", 1
_MOST_VARIABLES = 200


@dataclass(frozen=True, eq=False)
class StudyFile:
    """What a study file holds: coordinates and variables by name, dimensions of each variable, attributes."""

    coordinates: Mapping[str, np.ndarray]
    variables: Mapping[str, np.ndarray]
    dimensions: Mapping[str, tuple[str, ...]]
    attributes: Mapping[str, Any]


def save_study(table: StudyTable, path: str | os.PathLike[str], *, source: str = "", command: str = "") -> Path:
    """Write the consolidated result; an existing file is replaced only once the new one is complete.

    Raises
    ------
    StoreError
        If the folder cannot be made or written.
    """
    path = Path(path)
    with new_file(path) as file:
        mark(file, KIND, VERSION)
        file.attrs["name"], file.attrs["source"], file.attrs["command"] = table.name, source, command
        file.attrs["versions"] = json.dumps(versions())
        file.attrs["Conventions"] = "CF-1.8"
        for name, values in table.coordinates.items():
            dataset = _dataset(file, name, values)
            dataset.make_scale(name)
            dataset.attrs["units"] = table.units.get(name, "1")
            dataset.attrs["long_name"] = table.labels.get(name, name)
        for name, values in table.variables.items():
            dataset = _dataset(file, name, values)
            if dataset.dtype.kind == "f":
                dataset.attrs["_FillValue"] = np.array([np.nan])
            for k, dimension in enumerate(table.dimensions[name]):
                dataset.dims[k].attach_scale(file[dimension])
            dataset.attrs["units"] = UNITS.get(name, "1")
    return path


def _dataset(file: h5py.File, name: str, values: np.ndarray) -> h5py.Dataset:
    if values.dtype.kind in "UO":
        return file.create_dataset(name, data=values.astype(object), dtype=h5py.string_dtype())
    return file.create_dataset(name, data=values.astype("i1") if values.dtype.kind == "b" else values)


def load_study(path: str | os.PathLike[str]) -> StudyFile:
    """The result in a file that `save_study` wrote.

    Raises
    ------
    StoreError
        If the file is missing, damaged, or not the result of a study. Nothing in it is executed.
    """
    with sealed_file(path, KIND, VERSION) as file:
        if len(file) > _MOST_VARIABLES:
            raise StoreError(f"{path} holds {len(file)} variables, where {_MOST_VARIABLES} are allowed.")
        found = {name: array(file, name) for name in file}
        scales = {name for name in file if file[name].is_scale}
        dimensions = {}
        for name in set(found) - scales:
            owners = [list(dim.values()) for dim in file[name].dims]
            if not all(owners):
                raise StoreError(f"{path} is damaged: {name} has a dimension without a coordinate.")
            dimensions[name] = tuple(owner[0].name.strip("/") for owner in owners)
            if found[name].shape != tuple(found[d].size for d in dimensions[name] if d in scales):
                raise StoreError(f"{path} is damaged: {name} does not fit its coordinates.")
        attributes = {key: plain(value) for key, value in file.attrs.items()}
    coordinates = {name: value for name, value in found.items() if name in scales}
    variables = {name: value for name, value in found.items() if name not in scales}
    return StudyFile(coordinates, variables, dimensions, attributes)
