"""The motion of a body over some instants, and the same as labelled columns: for result files, xarray and pandas."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from colloc.system.late_binding import optional

if TYPE_CHECKING:
    import pandas
    import xarray

SAMPLES = 401
"""Instants of one period in a result file, both ends included."""


@dataclass(frozen=True, eq=False)
class SampledMotion:
    """The body at given instants, ``n_time`` columns each.

    Attributes
    ----------
    t : (n_time,)
        Phase.
    angles, rates : (n_joint, n_time)
    z : (3, n_time)
        Tail velocity (u, v, omega) in the body frame, per period.
    theta : (n_time,)
        Lab angle of the tail link.
    centre, tail : (2, n_time)
        Lab positions of the centre of mass and of the tail.
    """

    t: np.ndarray
    angles: np.ndarray
    rates: np.ndarray
    z: np.ndarray
    theta: np.ndarray
    centre: np.ndarray
    tail: np.ndarray

    def __repr__(self) -> str:
        return f"<SampledMotion at {self.t.size} instants, t = {self.t.min():g} to {self.t.max():g}>"


def turned(vectors: np.ndarray, theta: np.ndarray) -> np.ndarray:
    """Vectors ``(2, ..., n_time)`` of the body's axes in those of the lab."""
    (x, y), c, s = vectors, np.cos(theta), np.sin(theta)
    return np.stack([c * x - s * y, s * x + c * y])


class Column(NamedTuple):
    """Values with their units and the names of their dimensions, time last."""

    values: np.ndarray
    units: str
    dims: tuple[str, ...]


def motion_columns(motion: SampledMotion, power: np.ndarray) -> dict[str, Column]:
    """Name to column, with the power against friction ``(n_time,)``."""
    return {
        "t": Column(motion.t, "period", ("t",)),
        "joint_angles": Column(motion.angles, "rad", ("joint", "t")),
        "joint_rates": Column(motion.rates, "rad/period", ("joint", "t")),
        "tail_velocity": Column(motion.z, "length/period, length/period, rad/period", ("velocity", "t")),
        "theta": Column(motion.theta, "rad", ("t",)),
        "centre": Column(motion.centre, "length", ("axis", "t")),
        "tail": Column(motion.tail, "length", ("axis", "t")),
        "power": Column(power, "weight length/period", ("t",)),
    }


def motion_dataset(columns: dict[str, Column], about: dict[str, Any]) -> xarray.Dataset:
    """The columns as an xarray Dataset with the attributes `about`."""
    arrays = optional("xarray")
    found = {name: (c.dims, c.values, {"units": c.units}) for name, c in columns.items()}
    return arrays.Dataset(found, _labels(columns), about)


def motion_frame(columns: dict[str, Column]) -> pandas.DataFrame:
    """The columns as a pandas DataFrame, a number each, with the phase as index."""
    frames = optional("pandas")
    flat: dict[str, np.ndarray] = {}
    for name, column in columns.items():
        if column.dims == ("t",):
            flat[name] = column.values
        else:
            named = zip(_labels(columns)[column.dims[0]], column.values, strict=True)
            flat |= {f"{name}_{label}": row for label, row in named}
    return frames.DataFrame(flat).set_index("t")


def _labels(columns: dict[str, Column]) -> dict[str, list]:
    """Labels along the dimensions other than time."""
    joints = [*range(1, len(columns["joint_angles"].values) + 1)]
    return {"joint": joints, "velocity": ["u", "v", "omega"], "axis": ["x", "y"]}
