"""Velocity maps in HDF5 files."""

from __future__ import annotations

from pathlib import Path

from colloc.mechanics.body import Chain
from colloc.mechanics.friction import Friction
from colloc.system.errors import StoreError
from scripts.models.velocity_map import VelocityMap
from scripts.paper.array_store import read_arrays, write_arrays

_UNITS = {
    "values": "(u, v, omega) at unit larger rate; face, angle 1, angle 2, ratio with a node more at either end, component",
    "lengths": "body lengths",
    "coefficients": "mu_t, mu_f, mu_b",
    "delta": "speed over larger joint rate",
}


def write_map(path: Path, velocity_map: VelocityMap) -> None:
    """Write a velocity map, with the body and the friction it was made for."""
    friction = velocity_map.friction
    arrays = {
        "values": velocity_map.values,
        "lengths": velocity_map.body.lengths,
        "coefficients": (friction.mu_t, friction.mu_f, friction.mu_b),
        "delta": velocity_map.delta,
    }
    write_arrays(path, arrays, units=_UNITS)


def read_map(path: Path) -> VelocityMap:
    """The velocity map that `write_map` wrote.

    Raises
    ------
    StoreError
        If the file cannot be read or holds something else.
    """
    arrays = read_arrays(path)
    missing = _UNITS.keys() - arrays.keys()
    if missing:
        raise StoreError(f"{path} is not a velocity map: it has no {', '.join(sorted(missing))}.")
    body, friction = Chain(tuple(arrays["lengths"])), Friction(*(float(mu) for mu in arrays["coefficients"]))
    return VelocityMap(body, friction, float(arrays["delta"]), arrays["values"])
