"""The compiled kernel of chains, or none, and its calls.

The C sources (folder `native`) mirror the NumPy solvers step by step (docs/developers/kernel.md).
Without them, and for laws that are not in closed form, NumPy does everything. Calls release the
interpreter's lock, so that threads share large batches; results do not depend on batches or
threads.
"""

import contextlib
import ctypes
import hashlib
import multiprocessing
import warnings
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from functools import cache, lru_cache
from importlib import resources
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

from colloc.mechanics.balance import Moving
from colloc.mechanics.friction import Friction
from colloc.mechanics.law import Law
from colloc.system.environment import available_threads
from colloc.system.errors import SlowWarning

SOURCES = resources.files("colloc.mechanics") / "native"
_PIECE = 4000
"""Time points a call: about 10 ms, after which an interrupt is heard and threads switch."""


class _Array:
    """A contiguous array by its address, or that address; None is a null pointer."""

    @classmethod
    def from_param(cls, array: Any) -> Any:
        return address(array) if isinstance(array, np.ndarray) else array


def address(array: Any) -> Any:
    try:
        return ctypes.byref(ctypes.c_char.from_buffer(array))  # four times as fast
    except (TypeError, ValueError):  # it is read-only, or empty
        assert array.flags.c_contiguous
        return ctypes.c_void_p(array.ctypes.data)


def addresses(arguments: Iterable[Any]) -> tuple[Any, ...]:
    """Arguments with addresses for arrays, which have to live on."""
    return tuple(address(x) if isinstance(x, np.ndarray) else x for x in arguments)


_TYPES = {
    "p": _Array,
    "d": ctypes.c_double,
    "i": ctypes.c_int,
    "l": ctypes.c_longlong,
    "n": ctypes.c_ssize_t,
}
_CHAIN = "ipppnnnppd"
"""Number of links, lengths, masses, law; time points in all, first and last; angles,
rates and delta."""
_SIGNATURES = {
    "colloc_balance": "ppdlippppp",
    "colloc_motion": "ppppp",
    "colloc_momenta": "pdpipp",
    "colloc_torques": "pdpppp",
    "colloc_balances": "pdpp",
    "colloc_repeating": "pdnippppppp",
    "colloc_period": "nippppdp" + "ppdpdpppp",
    "colloc_period_vjp": "nippppdp" + "ppippp",
}
_SLOW = (
    "the balance is solved by NumPy, 10 to 60 times more slowly: the compiled kernel was not "
    "built, or its sources changed "
    "since; install colloc again with a C compiler on the PATH."
)

_COULOMB = Friction()


def native_kernel(body: Any = None, friction: Law = _COULOMB) -> ctypes.CDLL | None:
    """The compiled kernel, or None where NumPy has to do."""
    usable = body is None or (body.in_series and chain_parameters(body, friction))
    return library() if usable else None


@cache
def library() -> ctypes.CDLL | None:
    """The kernel as it was built; None, with a `SlowWarning`, if there is none of these sources."""
    with resources.as_file(SOURCES) as sources:
        built = built_kernel(sources)
    if built is None:
        if multiprocessing.parent_process() is None:  # workers leave it to their parent
            warnings.warn(_SLOW, SlowWarning, stacklevel=2)
        return None
    # with as many instants side by side as suit the processor
    for name in ("colloc_period", "colloc_period_vjp", "colloc_balances"):
        setattr(built, name, built[f"{name}_{built.colloc_lanes()}"])
    built.colloc_shape_functions.argtypes = [_TYPES[each] for each in "inppppnpppp"]
    built.colloc_minimize.argtypes = [_TYPES[each] for each in "ppppdppipp"]
    built.colloc_minimize.restype = ctypes.c_longlong
    return with_signatures(built, _SIGNATURES)


def with_signatures(library: ctypes.CDLL, signatures: dict[str, str]) -> ctypes.CDLL:
    for name, types in signatures.items():
        getattr(library, name).argtypes = [_TYPES[each] for each in _CHAIN + types]
    return library


def built_kernel(sources: Path) -> ctypes.CDLL | None:
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


def call_for_all(
    function: Callable[..., int], moving: Moving, *arguments: object, piece: int = _PIECE
) -> None:
    """Call a function of the kernel with a chain at the time points of each piece, then the
    arguments, of which arrays that are written to are contiguous; on several threads if there are
    many pieces. `MemoryError` if it fails."""
    angles, rates = (np.ascontiguousarray(a, dtype=float) for a in (moving.angles, moving.rates))
    n_time, chain = angles.shape[1], chain_parameters(moving.body, moving.friction)
    converted = [np.ascontiguousarray(a) if isinstance(a, np.ndarray) else a for a in arguments]

    def call(first):
        last = min(first + piece, n_time)
        return function(*chain, n_time, first, last, angles, rates, moving.delta, *converted)

    starts = range(0, n_time, piece)
    if len(starts) > 1 and (workers := min(available_threads(), len(starts))) > 1:
        with ThreadPoolExecutor(workers) as pool:
            failed = any(list(pool.map(call, starts)))
    else:
        failed = any(map(call, starts))
    if failed:
        raise MemoryError("no memory for the links of a body.")


@lru_cache(maxsize=64)
def chain_parameters(body: Any, friction: Law) -> tuple[Any, ...]:
    """Number of links, lengths, masses, and contacts with their laws; empty where the
    kernel lacks a law."""
    law = np.array(body.contact.kernel_numbers(friction), dtype=float)
    return (body.n_link, body.length_column(), body.mass_column(), law) if law.size else ()


def kernel_repeating(
    library: ctypes.CDLL,
    moving: Moving,
    guess: np.ndarray,
    froude: float,
    scheme: tuple[np.ndarray, np.ndarray, np.ndarray],
) -> tuple[np.ndarray, np.ndarray, bool]:
    """Periodic momenta ``(3, n_time)`` at the points of a collocation `scheme`
    (`colloc.dynamics.states.CollocatedStates.scheme`), their outputs ``(9, n_time)``, and whether
    there are any; from an initial guess whose last column is the start."""
    n_time, spin = moving.angles.shape[1], moving.body.inertia_column()
    states, start = guess[:, :-1].copy(), guess[:, -1].copy()
    values, converged = np.empty((9, n_time)), np.zeros(1, dtype=np.intc)
    settings = spin, froude, *scheme[1].shape, *scheme
    outputs = states, start, values, converged
    call_for_all(library.colloc_repeating, moving, *settings, *outputs, piece=n_time)
    return states, values, bool(converged[0])


def kernel_balances(
    library: ctypes.CDLL, moving: Moving, start: np.ndarray, tolerance: float
) -> tuple[np.ndarray, np.ndarray]:
    """Balanced velocities ``(3, n_time)`` by Newton's method from `start`, several time points side
    by side, and where there are any ``(n_time,)``; digits are lost at links that rest."""
    z, failures = np.empty(start.shape), np.empty(start.shape[1], dtype=np.int64)
    call_for_all(library.colloc_balances, moving, start, tolerance, z, failures)
    return z, failures == 0
