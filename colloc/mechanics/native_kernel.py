"""The compiled kernel of chains, or none, and its calls.

The C sources (folder `native`) mirror the NumPy solvers step by step (docs/developers/kernel.md).
Without them, and for laws that are not in closed form, NumPy does everything. Calls release the
interpreter's lock, so that threads share large batches; results do not depend on batches or
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
from colloc.mechanics.bodies import BalanceSolution
from colloc.mechanics.damped_newton import METHODS
from colloc.mechanics.friction import Friction
from colloc.mechanics.law import Law
from colloc.mechanics.links import Links
from colloc.system.environment import available_threads
from colloc.system.errors import SlowWarning

SOURCES = resources.files("colloc.mechanics") / "native"
_PIECE = 4000
"""Time points a call: about 10 ms, after which an interrupt is heard and threads switch."""

_REAL, _COUNT, _ARRAY = ctypes.c_double, ctypes.c_ssize_t, ctypes.c_void_p
BODY = (ctypes.c_int, _ARRAY, _ARRAY, _ARRAY, _ARRAY, _COUNT, _COUNT, _COUNT)
_SHAPES = (*BODY, _ARRAY, _ARRAY, _REAL)
_METHOD = _REAL, ctypes.c_longlong, ctypes.c_int
_SCHEME = _ARRAY, _REAL, _COUNT, ctypes.c_int
_SIGNATURES = {
    "colloc_balance": (*_SHAPES, _ARRAY, _ARRAY, *_METHOD, *[_ARRAY] * 5),
    "colloc_motion": (*_SHAPES, *[_ARRAY] * 5),
    "colloc_repeating": (*_SHAPES, *_SCHEME, *[_ARRAY] * 6, ctypes.POINTER(ctypes.c_int)),
    "colloc_momenta": (*_SHAPES, _ARRAY, _REAL, _ARRAY, ctypes.c_int, _ARRAY, _ARRAY),
}
_SLOW = (
    "the balance is solved by NumPy, 10 to 60 times more slowly: the compiled kernel was not "
    "built, or its sources changed "
    "since; install colloc again with a C compiler on the PATH."
)

_LINKS, _COULOMB = Links(), Friction()
_switched_off = False


def native_kernel(body: Links = _LINKS, friction: Law = _COULOMB) -> ctypes.CDLL | None:
    """The compiled kernel, or None where NumPy has to do."""
    usable = not _switched_off and body.in_series and _parameters(body, friction)[0]
    return library() if usable else None


@contextlib.contextmanager
def numpy_instead() -> Iterator[None]:
    """A context in which NumPy does everything, on all threads: for comparison."""
    global _switched_off
    before, _switched_off = _switched_off, True
    try:
        yield
    finally:
        _switched_off = before


@cache
def library() -> ctypes.CDLL | None:
    """The kernel as it was built; None, with a `SlowWarning`, if there is none of these sources."""
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
    """The library that was built of these very sources, if there is one."""
    now = hashlib.sha256(
        b"".join(file.read_bytes() for file in sorted(sources.glob("*.[ch]")))
    ).hexdigest()
    for file in _built_files():
        with contextlib.suppress(OSError, ValueError):  # of another machine, or of something else
            kernel = ctypes.CDLL(file)
            address = ctypes.addressof(ctypes.c_char.in_dll(kernel, "colloc_sources"))
            if ctypes.string_at(address).decode("ascii") == now:
                return kernel
    return None


def _built_files() -> Iterator[str]:
    """Candidates beside this file or, where Python runs a clone's source, of the installation."""
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
    return None if array is None else array.ctypes.data


def call_for_all(
    function: Callable[..., int],
    body: Links,
    friction: Law,
    n_time: int,
    *arguments: object,
    piece: int = _PIECE,
) -> None:
    """Call a function of the kernel with the chain, its law and the time points of each piece, then
    the arguments; on several threads if there are many. `MemoryError` if it fails."""
    chain, _arrays = _parameters(body, friction)  # held through the calls, which read them

    def call(first: int) -> int:
        return function(*chain, n_time, first, min(first + piece, n_time), *arguments)

    starts = range(0, n_time, piece)
    if len(starts) > 1 and (workers := min(available_threads(), len(starts))) > 1:
        with ThreadPoolExecutor(workers) as pool:
            failed = any(list(pool.map(call, starts)))
    else:
        failed = any(map(call, starts))
    if failed:
        raise MemoryError("no memory for the links of a body.")


@lru_cache(maxsize=64)
def _parameters(body: Links, friction: Law) -> tuple[tuple[int, ...], tuple[np.ndarray, ...]]:
    """Number of links and addresses of lengths, pressures, masses and contacts with their laws, and
    these arrays; none where the kernel lacks a law."""
    law = np.array(body.contact.kernel_numbers(friction), dtype=float)
    if not law.size:
        return (), ()
    columns = body.pressure_column().ravel(), body.mass_column().ravel()
    arrays = np.array(body.lengths), *columns, law
    return (body.n_link, *map(address, arrays)), arrays


def _shapes(moving: Moving) -> tuple[tuple[np.ndarray, np.ndarray], tuple[int, int, float]]:
    """Contiguous angles and rates, to be held through a call, and the arguments they make."""
    angles, rates = (np.ascontiguousarray(a, dtype=float) for a in (moving.angles, moving.rates))
    return (angles, rates), (address(angles), address(rates), moving.delta)


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
    n_time, (_held, shapes) = moving.angles.shape[1], _shapes(moving)
    load, start = (None if a is None else np.ascontiguousarray(a) for a in (moving.load, start))
    z, velocity, residual = np.empty((3, n_time)), np.empty((3, n_time)), np.empty(n_time)
    iterations, anchor = np.empty((2, n_time), dtype=np.int64)
    call_for_all(
        library.colloc_balance, moving.body, moving.friction, n_time, *shapes,
        address(load), address(start), tolerance, max_iterations, METHODS.index(method),
        *map(address, (z, residual, iterations, anchor, velocity)),
    )  # fmt: skip
    return z, residual, iterations, anchor, velocity


def compiled_motion(
    library: ctypes.CDLL, moving: Moving, solved: BalanceSolution, *, derivatives: bool
) -> tuple[np.ndarray, np.ndarray]:
    """Tail velocity, velocity of the centre, power and actuators' power ``(7, n_time)``; and
    derivatives ``(6, n, n_time)`` along angles, rates and load if asked for."""
    n_time, (_held, shapes) = moving.angles.shape[1], _shapes(moving)
    velocity = np.ascontiguousarray(solved.anchor_velocity, dtype=float)
    load = None if moving.load is None else np.ascontiguousarray(moving.load, dtype=float)
    anchor = np.ascontiguousarray(solved.anchor, dtype=np.int64)
    columns = 2 * moving.body.n_joint + (0 if load is None else 2)
    values, slopes = np.empty((7, n_time)), np.empty((6 * derivatives, columns, n_time))
    call_for_all(
        library.colloc_motion, moving.body, moving.friction, n_time, *shapes,
        *map(address, (load, anchor, velocity, values, slopes if derivatives else None)),
    )  # fmt: skip
    return values, slopes


def kernel_momenta(
    library: ctypes.CDLL, moving: Moving, states: np.ndarray, froude: float, *, columns: int
) -> tuple[np.ndarray, np.ndarray]:
    """Outputs of `colloc.dynamics.chain` ``(9, n_time)``, and derivatives ``(9, columns,
    n_time)``."""
    n_time, (_held, shapes) = moving.angles.shape[1], _shapes(moving)
    states = np.ascontiguousarray(states, dtype=float)
    spin = moving.body.inertia_column().ravel()
    values, slopes = np.empty((9, n_time)), np.empty((9, columns, n_time))
    call_for_all(
        library.colloc_momenta, moving.body, moving.friction, n_time, *shapes,
        address(spin), froude, address(states), columns, address(values), address(slopes),
    )  # fmt: skip
    return values, slopes


def kernel_repeating(
    library: ctypes.CDLL,
    moving: Moving,
    near: np.ndarray,
    froude: float,
    scheme: tuple[np.ndarray, np.ndarray, np.ndarray],
) -> tuple[np.ndarray, np.ndarray, bool]:
    """Periodic momenta ``(3, n_time)`` at the points of a collocation `scheme`
    (`colloc.dynamics.states.CollocatedStates.scheme`), their outputs ``(9, n_time)``, and whether
    there are any; from an initial guess whose last column is the start."""
    n_time, (_held, shapes) = moving.angles.shape[1], _shapes(moving)
    a, b, image = (np.ascontiguousarray(each, dtype=float) for each in scheme)
    states, start = near[:, :-1].copy(), near[:, -1].copy()
    spin = moving.body.inertia_column().ravel()
    values, converged = np.empty((9, n_time)), ctypes.c_int()
    call_for_all(
        library.colloc_repeating, moving.body, moving.friction, n_time, *shapes,
        address(spin), froude, *b.shape, *map(address, (a, b, image, states, start, values)),
        ctypes.byref(converged), piece=n_time,
    )  # fmt: skip
    return states, values, bool(converged.value)
