"""The result of a study in one file: netCDF-4 compatible HDF5 that xarray, ncdump and plain h5py
open.

Dimensions are the axes of the study, and ``joint`` and ``harmonic``; every dimension has its
coordinate. Numbers of cells without a certified gait are NaN, and ``status`` and ``message`` say
why. ``delta`` is per period for every class; ``mean``, ``cos`` and ``sin`` of a
polygon are its Fourier series in arc length, cut (the journal has the gait itself).
``below_neighbour`` is 1 where a neighbour's gait, as it is, does better (``neighbour_value``) than
the cell's own. Layout::

    value, value_error, efficiency, efficiency_error, distance, work, delta, trivial_bound,
    upper_bound, neighbour_value,
    seconds                                                                                                        (axes)
    wave, forward (axes)   winding, bilateral, antipodal, retraced, at_slowest, below_neighbour (axes)
    starts, starts_certified (axes)
    status, message, origin, gait_class, problem_hash   (axes), texts
    mean (axes, joint)     cos, sin (axes, joint, harmonic)
    attributes: format, format_version, name, source, command, versions (JSON); dims and units of
    every variable
"""  # noqa: E501

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from colloc.results.solution import versions
from colloc.studies.table import UNITS, StudyTable
from colloc.system.errors import StoreError
from colloc.system.store_file import (
    BETWEEN_DIMS,
    array,
    attribute,
    mark,
    new_file,
    open_file,
    put,
    put_attribute,
)

KIND, VERSION = "colloc study", 2


@dataclass(frozen=True, eq=False)
class StudyFile:
    """What a study file holds: coordinates and variables by name, dimensions of each variable,
    attributes."""

    coordinates: Mapping[str, np.ndarray]
    variables: Mapping[str, np.ndarray]
    dimensions: Mapping[str, tuple[str, ...]]
    attributes: Mapping[str, Any]


def save_study(
    table: StudyTable, path: str | os.PathLike[str], *, source: str = "", command: str = ""
) -> Path:
    """Write the consolidated result; an existing file is replaced only once the new one is
    complete. `StoreError` if the folder cannot be made or written."""
    path = Path(path)
    with new_file(path) as file:
        mark(file, KIND, VERSION)
        described = {
            "name": table.name,
            "source": source,
            "command": command,
            "versions": json.dumps(versions()),
        }
        for name, text in (described | {"Conventions": "CF-1.8"}).items():
            put_attribute(file, name, text)
        for name, values in table.coordinates.items():
            labels = {
                "units": table.units.get(name, "1"),
                "long_name": table.labels.get(name, name),
            }
            put(file, name, _no_truth_values(values), dims=name, **labels)
        for name, values in table.variables.items():
            dims = BETWEEN_DIMS.join(table.dimensions[name])
            dataset = put(
                file, name, _no_truth_values(values), dims=dims, units=UNITS.get(name, "1")
            )
            if dataset.dtype.kind == "f":
                put_attribute(dataset, "_FillValue", [np.nan])
    return path


def _no_truth_values(values: np.ndarray) -> np.ndarray:
    """As netCDF knows none."""
    return values.astype("i1") if values.dtype.kind == "b" else values


def load_study(path: str | os.PathLike[str]) -> StudyFile:
    """The result in a file that `save_study` wrote. `StoreError` if it is missing, damaged, or not
    the result of a study."""
    with open_file(path, KIND, VERSION) as file:
        found = {name: array(file, name) for name in file}
        dimensions = {
            name: tuple(attribute(file[name], "dims").split(BETWEEN_DIMS)) for name in file
        }
        attributes = {name: attribute(file, name) for name in file.attrs}
    coordinates = {name: value for name, value in found.items() if dimensions[name] == (name,)}
    variables = {name: value for name, value in found.items() if name not in coordinates}
    for name, value in found.items():
        if np.shape(value) != tuple(
            coordinates[d].size if d in coordinates else None for d in dimensions[name]
        ):
            raise StoreError(f"{path} is damaged: {name} does not fit its coordinates.")
    return StudyFile(
        coordinates, variables, {name: dimensions[name] for name in variables}, attributes
    )
