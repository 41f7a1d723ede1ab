"""The compiled kernel of chains: C sources of this package as a shared library, or none. No CasADi.

The sources (folder `native`, plain C11) mirror the NumPy solvers step by step. They are compiled by the system's compiler
when first needed, in about half a second, and kept in the user's cache folder under a name made of their content: whoever
edits, updates or shares an installation never meets an old library. Without a compiler, or a folder to keep the library in,
everything is done by NumPy, the reference (docs/notes/kernel.md says why C, and why then).
Calls release the interpreter's lock, so that large batches are shared by threads; an instant's answer depends on
nothing but its own data, so it is the same in any batch and on any number of threads.
"""

from __future__ import annotations

import contextlib
import ctypes
import hashlib
import os
import platform
import shutil
import sys
import tempfile
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from functools import cache
from importlib import resources
from pathlib import Path

import numpy as np

from colloc.mechanics.friction import Friction
from colloc.mechanics.law import Law
from colloc.mechanics.links import Links
from colloc.numerics.c_compiler import c_compiler, cache_folder, compile_library
from colloc.system.errors import StoreError
from colloc.system.private_folder import is_private, make_private
from colloc.system.processors import available_threads
from colloc.system.replaced_file import replaced_file

_FLAGS = ("-std=c11", "-O2", "-fno-math-errno", "-ffp-contract=off", "-fPIC", "-shared")
"""Nothing that reorders arithmetic. -O3 takes three times as long to compile and gains 5 to 10 %."""
_MAIN = "kernel.c"
_PIECE = 4000
"""Instants a call treats: about 10 ms, after which an interrupt is heard, and a thread may have another piece."""

_REAL, _COUNT, _ARRAY = ctypes.c_double, ctypes.c_ssize_t, ctypes.c_void_p
_BODY = (ctypes.c_int, _ARRAY, _ARRAY, _ARRAY, _COUNT, _COUNT, _COUNT)
_SIGNATURES = {
    "colloc_balance": (*_BODY, _ARRAY, _ARRAY, _REAL, _ARRAY, _ARRAY, _REAL, ctypes.c_longlong, ctypes.c_int, *[_ARRAY] * 5),
    "colloc_loaded": (*_BODY, *[_ARRAY] * 4, _REAL, ctypes.c_int, *[_ARRAY] * 6),
    "colloc_enclosure": (_ARRAY, _COUNT, _COUNT, *[_ARRAY] * 6, _REAL, _ARRAY),
    "colloc_motion": (*_BODY, _ARRAY, _ARRAY, _REAL, *[_ARRAY] * 5),
}


_ANY, _USUAL = Links(), Friction()
_switched_off = False


def native_kernel(body: Links = _ANY, friction: Law = _USUAL) -> ctypes.CDLL | None:
    """The compiled kernel, or None where NumPy has to do: the one place that decides between them."""
    known = body.in_series and friction.kernel_numbers and not _switched_off
    return library(friction.kernel_source) if known else None


@contextlib.contextmanager
def numpy_instead() -> Iterator[None]:
    """Within it everything is done by NumPy, on all threads: for comparison."""
    global _switched_off
    before, _switched_off = _switched_off, True
    try:
        yield
    finally:
        _switched_off = before


@cache
def library(own_law: str = "") -> ctypes.CDLL | None:
    """The kernel, loaded, and compiled before if need be, by itself or with a law's own C; None if that cannot be."""
    folder = cache_folder()
    if folder is None:
        return None
    try:
        with resources.as_file(resources.files("colloc.mechanics").joinpath("native")) as sources:
            name = f"kernel-{_fingerprint(sources, own_law)}"
            own = (found for found in folder.glob(f"{name}-*.so") if is_private(found))
            whole = (found for found in own if found.stem.endswith(_digest(found)))
            file = next(whole, None) or _compiled(sources, own_law, folder, name)
            return None if file is None else _loaded(file)
    except (OSError, StoreError):
        return None


def _fingerprint(sources: Path, own_law: str) -> str:
    """Of everything that the library is made of."""
    content = hashlib.sha256(" ".join((*_FLAGS, sys.platform, platform.machine(), own_law)).encode())
    for source in sorted(sources.glob("*.[ch]")):
        content.update(source.read_bytes())
    return content.hexdigest()[:32]


def _digest(file: Path) -> str:
    """Of a library; it ends the name, as loading a part of a library kills the process."""
    return hashlib.sha256(file.read_bytes()).hexdigest()[:16]


def _compiled(sources: Path, own_law: str, folder: Path, name: str) -> Path | None:
    """The library, put in the folder; None without a compiler, or where nothing can be kept."""
    make_private(folder)
    if c_compiler() is None or not os.access(folder, os.W_OK):
        return None
    with tempfile.TemporaryDirectory(prefix="colloc-") as scratch:
        made = Path(scratch) / "kernel.so"
        flags = [*_FLAGS]
        if own_law:
            (Path(scratch) / "own_law.h").write_text(own_law, encoding="ascii")
            flags += ["-DOWN_LAW", f"-I{scratch}", f"-I{sources}"]
        compile_library(sources / _MAIN, flags, made)
        file = folder / f"{name}-{_digest(made)}.so"
        make_private(folder)
        with replaced_file(file) as unfinished:
            shutil.copy(made, unfinished)  # with its permissions
    return file


def _loaded(file: Path) -> ctypes.CDLL:
    """The library with its functions declared."""
    loaded = ctypes.CDLL(str(file))
    for name, arguments in _SIGNATURES.items():
        getattr(loaded, name).argtypes = arguments
    return loaded


def each_piece(n_time: int, treat: Callable[[int, int], int]) -> None:
    """Call ``treat(first, last)`` for all of a batch, in pieces, on several threads if it is large.

    Raises
    ------
    MemoryError
        If a call returns anything but 0.
    """
    starts = range(0, n_time, _PIECE)
    ends = [min(first + _PIECE, n_time) for first in starts]
    workers = min(available_threads(), len(ends)) if len(ends) > 1 else 1
    if workers > 1:
        with ThreadPoolExecutor(workers) as pool:
            failed = any(list(pool.map(treat, starts, ends)))
    else:
        failed = any(treat(first, last) for first, last in zip(starts, ends, strict=True))
    if failed:
        raise MemoryError("no memory for the links of a body.")


def address(array: np.ndarray | None) -> int | None:
    """Where an array's data are, for a call."""
    return None if array is None else array.ctypes.data
