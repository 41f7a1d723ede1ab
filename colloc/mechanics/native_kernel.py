"""The compiled kernel of chains: C sources of this package as a shared library, or none, and its
calls. No CasADi.

The sources (folder `native`, plain C11) mirror the NumPy solvers step by step. They are built with
the package (setup.py). If that could not be, or they were changed since, everything is done by
NumPy, the reference (docs/developers/kernel.md), and so are laws of friction that the kernel does
not have in closed form.
Calls release the interpreter's lock, so that large batches are shared by threads; an instant's
answer depends on nothing but its own data, so it is the same in any batch and on any number of
threads.
"""

from __future__ import annotations

import contextlib
import ctypes
import hashlib
import multiprocessing
import warnings
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from functools import cache, lru_cache
from importlib import resources
from importlib.util import find_spec
from pathlib import Path
from typing import overload

import numpy as np

from colloc.mechanics.balance import Moving
from colloc.mechanics.damped_newton import METHODS
from colloc.mechanics.friction import Friction
from colloc.mechanics.law import Law
from colloc.mechanics.links import Links
from colloc.system.errors import SlowWarning
from colloc.system.processors import available_threads

SOURCES = resources.files("colloc.mechanics") / "native"
_PIECE = 4000
"""Instants a call treats: about 10 ms, after which an interrupt is heard, and a thread may have
another piece."""

_REAL, _COUNT, _ARRAY = ctypes.c_double, ctypes.c_ssize_t, ctypes.c_void_p
BODY = (ctypes.c_int, _ARRAY, _ARRAY, _ARRAY, _ARRAY, _COUNT, _COUNT, _COUNT)
_SIGNATURES = {
    "colloc_balance": (
        *BODY,
        _ARRAY,
        _ARRAY,
        _REAL,
        _ARRAY,
        _ARRAY,
        _REAL,
        ctypes.c_longlong,
        ctypes.c_int,
        *[_ARRAY] * 5,
    ),
    "colloc_motion": (*BODY, _ARRAY, _ARRAY, _REAL, *[_ARRAY] * 5),
    "colloc_repeating": (
        *BODY,
        *(_ARRAY, _ARRAY, _REAL, _ARRAY, _REAL),
        *(_COUNT, ctypes.c_int, *[_ARRAY] * 6, ctypes.POINTER(ctypes.c_int)),
    ),
    "colloc_momenta": (
        *BODY,
        _ARRAY,
        _ARRAY,
        _REAL,
        _ARRAY,
        _REAL,
        _ARRAY,
        ctypes.c_int,
        _ARRAY,
        _ARRAY,
    ),
}
_SLOW = (
    "the balance is solved by NumPy, 10 to 60 times more slowly: the compiled kernel was not "
    "built, or its sources changed "
    "since; install colloc again with a C compiler on the PATH."
)

_ANY, _USUAL = Links(), Friction()
_switched_off = False


def native_kernel(body: Links = _ANY, friction: Law = _USUAL) -> ctypes.CDLL | None:
    """The compiled kernel, or None where NumPy has to do: the one place that decides between
    them."""
    return (
        library()
        if not _switched_off and body.in_series and body.contact.kernel_numbers(friction)
        else None
    )


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
def library() -> ctypes.CDLL | None:
    """The kernel as it was built, or None, with a `SlowWarning`, if there is none of these
    sources."""
    with resources.as_file(SOURCES) as sources:
        built = built_kernel(sources)
    if built is None:
        if multiprocessing.parent_process() is None:  # workers leave it to their parent
            warnings.warn(_SLOW, SlowWarning, stacklevel=2)
        return None
    for name, arguments in _SIGNATURES.items():
        getattr(built, name).argtypes = arguments
    return built


def built_kernel(sources: Path) -> ctypes.CDLL | None:
    """The library that was built of these very sources with the package, if there is one."""
    now = hashlib.sha256(
        b"".join(file.read_bytes() for file in sorted(sources.glob("*.[ch]")))
    ).hexdigest()
    for file in _built_files():
        with contextlib.suppress(OSError, ValueError):  # of another machine, or of something else
            found = ctypes.CDLL(file)
            made_of = ctypes.string_at(
                ctypes.addressof(ctypes.c_char.in_dll(found, "colloc_sources"))
            )
            if made_of.decode("ascii") == now:
                return found
    return None


def _built_files() -> Iterator[str]:
    """Where a built kernel may be: beside this file; or, where Python runs a clone's source, with
    what was installed of it."""
    spec = find_spec("colloc.mechanics._kernel")
    if spec is not None and spec.origin is not None:
        yield spec.origin
        return
    from importlib.metadata import distributions  # takes a while

    for installed in distributions(name="colloc"):
        yield from map(str, Path(str(installed.locate_file("colloc/mechanics"))).glob("_kernel.*"))


@overload
def address(array: np.ndarray) -> int: ...
@overload
def address(array: np.ndarray | None) -> int | None: ...
def address(array: np.ndarray | None) -> int | None:
    """Where an array's data are, for a call."""
    return None if array is None else array.ctypes.data


def call_for_all(
    function: Callable[..., int],
    body: Links,
    friction: Law,
    n_time: int,
    *arguments: object,
    piece: int = _PIECE,
) -> None:
    """Call a function of the kernel for all instants: with the chain, the law and the instants of a
    piece, then arguments."""
    chain, _numbers = _stated(body, friction)  # kept through the calls, which read them
    _each_piece(
        n_time, piece, lambda first, last: function(*chain, n_time, first, last, *arguments)
    )


@lru_cache(maxsize=64)
def _stated(body: Links, friction: Law) -> tuple[tuple[int, ...], tuple[np.ndarray, ...]]:
    """A chain and its law as calls are told them: how many links, and where the numbers are, which
    come with it."""
    law = np.array(body.contact.kernel_numbers(friction), dtype=float)
    numbers = (
        np.array(body.lengths),
        body.pressure_column().ravel(),
        body.mass_column().ravel(),
        law,
    )
    return (body.n_link, *map(address, numbers)), numbers


def _each_piece(n_time: int, piece: int, treat: Callable[[int, int], int]) -> None:
    """Call ``treat(first, last)`` for all of a batch, in pieces, on several threads if it is large.
    `MemoryError` if a call returns anything but 0."""
    starts = range(0, n_time, piece)
    ends = [min(first + piece, n_time) for first in starts]
    if len(ends) > 1 and (workers := min(available_threads(), len(ends))) > 1:
        with ThreadPoolExecutor(workers) as pool:
            failed = any(list(pool.map(treat, starts, ends)))
    else:
        failed = any(map(treat, starts, ends))
    if failed:
        raise MemoryError("no memory for the links of a body.")


def compiled_balance(
    library: ctypes.CDLL,
    moving: Moving,
    start: np.ndarray | None,
    tolerance: float,
    max_iterations: int,
    method: str,
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Tail velocity ``(3, n_time)``, residual, iterations, anchor ``(n_time,)``, its velocity ``(3,
    n_time)``."""
    n_time = moving.angles.shape[1]
    angles, rates = np.ascontiguousarray(moving.angles), np.ascontiguousarray(moving.rates)
    load, start = (None if a is None else np.ascontiguousarray(a) for a in (moving.load, start))
    numbers, counts = np.empty((7, n_time)), np.empty((2, n_time), dtype=np.int64)
    (first, row), (first_count, count_row) = ((address(a), a.strides[0]) for a in (numbers, counts))
    before, after = map(address, (angles, rates)), map(address, (load, start))
    how = tolerance, max_iterations, METHODS.index(method)
    found = first, first + 6 * row, first_count, first_count + count_row, first + 3 * row
    function, delta = library.colloc_balance, moving.delta
    call_for_all(
        function, moving.body, moving.friction, n_time, *before, delta, *after, *how, *found
    )
    return numbers[:3], numbers[6], counts[0], counts[1], numbers[3:6]


def compiled_motion(
    library: ctypes.CDLL,
    moving: Moving,
    anchor: np.ndarray,
    anchor_velocity: np.ndarray,
    *,
    with_slopes: bool,
) -> tuple[np.ndarray, np.ndarray]:
    """What `colloc.mechanics.chain_motion` speaks of: values ``(7, n_time)``, and derivatives ``(6,
    n, n_time)`` if asked for."""
    body, friction, angles, rates, delta, load = moving
    n_time = angles.shape[1]
    angles, rates, anchor_velocity = (
        np.ascontiguousarray(a, dtype=float) for a in (angles, rates, anchor_velocity)
    )
    load = None if load is None else np.ascontiguousarray(load, dtype=float)
    anchor = np.ascontiguousarray(anchor, dtype=np.int64)
    columns = 2 * body.n_joint + (0 if load is None else 2)
    values, slopes = np.empty((7, n_time)), np.empty((6 if with_slopes else 0, columns, n_time))
    after = map(address, (load, anchor, anchor_velocity, values, slopes if with_slopes else None))
    call_for_all(
        library.colloc_motion, body, friction, n_time, *map(address, (angles, rates)), delta, *after
    )
    return values, slopes


def kernel_momenta(
    library: ctypes.CDLL, moving: Moving, states: np.ndarray, froude: float, *, columns: int
) -> tuple[np.ndarray, np.ndarray]:
    """What `colloc.motion.compiled_momenta` speaks of: values ``(9, n_time)``, and derivatives
    ``(9, columns, n_time)``."""
    body, friction, angles, rates, delta, _ = moving
    n_time = angles.shape[1]
    angles, rates, states = (np.ascontiguousarray(a, dtype=float) for a in (angles, rates, states))
    spin, values, slopes = (
        body.inertia_column().ravel(),
        np.empty((9, n_time)),
        np.empty((9, columns, n_time)),
    )
    how = address(spin), froude, address(states), columns, address(values), address(slopes)
    call_for_all(
        library.colloc_momenta, body, friction, n_time, address(angles), address(rates), delta, *how
    )
    return values, slopes


def kernel_repeating(
    library: ctypes.CDLL,
    moving: Moving,
    near: np.ndarray,
    froude: float,
    scheme: tuple[np.ndarray, np.ndarray, np.ndarray],
) -> tuple[np.ndarray, np.ndarray, bool]:
    """Momenta ``(3, n_time)`` at the points of a collocation `scheme`
    (`colloc.motion.states.CollocatedStates.scheme`) that repeat every period, sought near others,
    of which the last column is the start; their outputs ``(9, n_time)``; and whether there are
    any."""
    body, friction, angles, rates, delta, _ = moving
    n_time, (a, b, image) = (
        angles.shape[1],
        (np.ascontiguousarray(each, dtype=float) for each in scheme),
    )
    angles, rates = (
        np.ascontiguousarray(angles, dtype=float),
        np.ascontiguousarray(rates, dtype=float),
    )
    states, start, spin = near[:, :-1].copy(), near[:, -1].copy(), body.inertia_column().ravel()
    values, held = np.empty((9, n_time)), ctypes.c_int()
    how = (
        address(spin),
        froude,
        *b.shape,
        *map(address, (a, b, image, states, start, values)),
        ctypes.byref(held),
    )
    shapes = address(angles), address(rates), delta
    call_for_all(library.colloc_repeating, body, friction, n_time, *shapes, *how, piece=n_time)
    return states, values, bool(held.value)
