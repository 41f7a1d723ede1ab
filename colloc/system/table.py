"""Labelled columns over named dimensions: written as HDF5 that netCDF tools and xarray open, and
read back."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from colloc.system.errors import StoreError
from colloc.system.late_binding import optional
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

if TYPE_CHECKING:
    import xarray


@dataclass(frozen=True, eq=False)
class Table:
    """Columns over named dimensions: coordinates along dimensions, variables with the dimensions of
    each, units and labels of both as far as they have some, attributes of the whole."""

    name: str
    coordinates: Mapping[str, np.ndarray]
    variables: Mapping[str, np.ndarray]
    dimensions: Mapping[str, tuple[str, ...]]
    units: Mapping[str, str] = field(default_factory=dict)
    labels: Mapping[str, str] = field(default_factory=dict)
    attributes: Mapping[str, Any] = field(default_factory=dict)

    def to_xarray(self) -> xarray.Dataset:
        """The columns as an xarray Dataset."""
        columns = {
            name: (self.dimensions[name], values, {"units": self.units.get(name, "1")})
            for name, values in self.variables.items()
        }
        return optional("xarray").Dataset(columns, dict(self.coordinates), {"name": self.name})


def save_table(table: Table, path: str | os.PathLike[str], kind: str, version: int) -> Path:
    """Write a table as HDF5, replacing a file only once the new one is complete. `StoreError` if
    the folder cannot be made or written."""
    path = Path(path)
    dimensions = {name: (name,) for name in table.coordinates} | dict(table.dimensions)
    with new_file(path) as file:
        mark(file, kind, version)
        for name, value in {"name": table.name, **table.attributes}.items():
            put_attribute(file, name, value)
        for name, values in {**table.coordinates, **table.variables}.items():
            described = {}
            if dimensions[name]:
                described["dims"] = BETWEEN_DIMS.join(dimensions[name])
                described["units"] = table.units.get(name, "1")
            if name in table.labels:
                described["long_name"] = table.labels[name]
            # netCDF has no truth values
            stored = values.astype("i1") if values.dtype.kind == "b" else values
            dataset = put(file, name, stored, **described)
            if dataset.dtype.kind == "f" and name in table.variables:
                put_attribute(dataset, "_FillValue", [np.nan])
    return path


def load_table(path: str | os.PathLike[str], kind: str, version: int) -> Table:
    """The table in a file that `save_table` wrote. `StoreError` if the file is missing, damaged, or
    of another kind."""
    with open_file(path, kind, version) as file:
        columns = {name: array(file, name) for name in file}
        dimensions = {
            name: tuple(attribute(file[name], "dims").split(BETWEEN_DIMS)) for name in file
        }
        attributes = {name: attribute(file, name) for name in file.attrs}
    coordinates = {name: values for name, values in columns.items() if dimensions[name] == (name,)}
    for name, values in columns.items():
        sizes = (coordinates[d].size if d in coordinates else None for d in dimensions[name])
        if np.shape(values) != tuple(sizes):
            raise StoreError(f"{path} is damaged: {name} does not fit its coordinates.")
    variables = {name: values for name, values in columns.items() if name not in coordinates}
    return Table(
        attributes["name"],
        coordinates,
        variables,
        {name: dimensions[name] for name in variables},
        attributes=attributes,
    )
