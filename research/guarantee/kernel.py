"""The guarantee's own C (folder `native`), compiled for the process with the library's headers, and its calls."""

from __future__ import annotations

import ctypes
from functools import cache
from pathlib import Path

import numpy as np

from colloc.mechanics import native_kernel
from colloc.mechanics.law import Law
from colloc.mechanics.links import Links
from colloc.mechanics.native_kernel import BODY, address, call_for_all
from colloc.numerics.c_compiler import c_compiler, compiled_library

_SOURCES = Path(__file__).with_name("native")
_REAL, _COUNT, _ARRAY = ctypes.c_double, ctypes.c_ssize_t, ctypes.c_void_p
_SIGNATURES = {
    "colloc_loaded": (*BODY, *[_ARRAY] * 4, _REAL, ctypes.c_int, *[_ARRAY] * 6),
    "colloc_enclosure": (_ARRAY, _ARRAY, _COUNT, _COUNT, *[_ARRAY] * 6, _REAL, _ARRAY),
}


def guarantee_kernel(body: Links) -> ctypes.CDLL | None:
    """The compiled functions, or None without a compiler, or where NumPy has to do. `StoreError` if the compiler fails."""
    return None if c_compiler() is None or native_kernel.native_kernel(body) is None else _library()


@cache
def _library() -> ctypes.CDLL:
    headers = {each.name: each.read_text("ascii") for each in native_kernel.SOURCES.iterdir() if each.name.endswith(".h")}
    found = compiled_library(_SOURCES / "guarantee.c", native_kernel.FLAGS, headers)
    for name, arguments in _SIGNATURES.items():
        getattr(found, name).argtypes = arguments
    return found


def compiled_loaded(
    library: ctypes.CDLL,
    body: Links,
    friction: Law,
    angles: np.ndarray,
    rates: np.ndarray,
    load: np.ndarray,
    start: np.ndarray,
    delta: float,
    steps: int,
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """The fields of `research.guarantee.loaded_balance.Loaded`."""
    n_time = angles.shape[1]
    given = [np.ascontiguousarray(a, dtype=float) for a in (angles, rates, load, start)]
    velocity, potential, power = np.empty((3, n_time)), np.empty(n_time), np.empty(n_time)
    forces, residual, leftover_power = np.empty((body.n_link, 3, n_time)), np.empty((2, n_time)), np.empty(n_time)
    found = velocity, potential, power, forces, residual, leftover_power
    call_for_all(library.colloc_loaded, body, friction, n_time, *map(address, given), delta, steps, *map(address, found))
    return found
