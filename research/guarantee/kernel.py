"""The guarantee's own C and C++ (folder `native`), compiled for the process, and calls.

The C finds motions, in floating point, with the library's headers. The C++ says what they prove, in
interval arithmetic.
"""

from __future__ import annotations

import ctypes
from functools import cache
from pathlib import Path

import numpy as np

from colloc.mechanics import native_kernel
from colloc.mechanics.balance import Moving
from colloc.mechanics.chain import Chain
from colloc.mechanics.law import Law
from colloc.mechanics.native_kernel import call_for_all, with_signatures
from research.guarantee.c_compiler import c_compiler, compiled_library

SOURCES = Path(__file__).with_name("native")
FLAGS = tuple((native_kernel.SOURCES / "flags.txt").read_text("ascii").split())
"""Those of the library's C: nothing that reorders arithmetic."""
_REAL, _COUNT, _ARRAY = ctypes.c_double, ctypes.c_ssize_t, ctypes.c_void_p
_PROOFS = {
    "colloc_states": (_COUNT, *[_ARRAY] * 5, _REAL, _ARRAY),
    "colloc_by_convexity": (_COUNT, *[_ARRAY] * 7, _REAL, _ARRAY),
    "colloc_by_loads": (_COUNT, _COUNT, *[_ARRAY] * 10, _REAL, _REAL, _ARRAY),
    "colloc_harmonic": (_COUNT, ctypes.c_int, _ARRAY, _ARRAY, ctypes.c_int, *[_ARRAY] * 5),
}


def guarantee_kernel(body: Chain) -> ctypes.CDLL | None:
    """The compiled functions, or None without a compiler, or where NumPy has to do. `StoreError` if
    the compiler fails."""
    return None if c_compiler() is None or native_kernel.native_kernel(body) is None else _library()


@cache
def proofs() -> ctypes.CDLL:
    """What is proved in interval arithmetic. `StoreError` without a C++ compiler."""
    library = compiled_library(SOURCES / "proofs.cpp", proof_flags(), {})
    for name, arguments in _PROOFS.items():
        getattr(library, name).argtypes = arguments
    return library


def proof_flags() -> list[str]:
    """The same for C++."""
    return [
        "-std=c++17",
        "-fno-exceptions",
        "-fno-rtti",
        *(flag for flag in FLAGS if "-std" not in flag),
    ]


def call(name: str, *arguments: np.ndarray | float) -> None:
    """A function of `proofs`; arrays by their addresses, copied if they are not contiguous."""
    given = [
        np.ascontiguousarray(each) if isinstance(each, np.ndarray) else each for each in arguments
    ]
    getattr(proofs(), name)(
        *(each.ctypes.data if isinstance(each, np.ndarray) else each for each in given)
    )


@cache
def _library() -> ctypes.CDLL:
    headers = {
        each.name: each.read_text("ascii")
        for each in native_kernel.SOURCES.iterdir()
        if each.name.endswith(".h")
    }
    return with_signatures(
        compiled_library(SOURCES / "guarantee.c", FLAGS, headers), {"colloc_loaded": "ppipppppp"}
    )


def compiled_loaded(
    library: ctypes.CDLL,
    body: Chain,
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
    velocity, potential, power = np.empty((3, n_time)), np.empty(n_time), np.empty(n_time)
    forces, residual, leftover_power = (
        np.empty((body.n_link, 3, n_time)),
        np.empty((2, n_time)),
        np.empty(n_time),
    )
    found = velocity, potential, power, forces, residual, leftover_power
    moving = Moving(body, friction, angles, rates, delta)
    call_for_all(library.colloc_loaded, moving, load, start, steps, *found)
    return found
