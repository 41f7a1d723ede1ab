"""CasADi functions as machine code: their generated C, compiled once by the system's compiler and kept in a folder.

CasADi interprets its expressions; compiled, a Hessian of some ten thousand operations runs about ten times faster, with the
same operations in the same order, so the same results to the last bit. Compiling takes seconds, so callers ask
for it where it pays: functions whose code is in the folder are loaded, all others are interpreted, except within `compiling`.

Loading a library runs it. So the folder is made for its user alone, and code is neither loaded from nor put into a place that
anybody else could have written to (`colloc.system.private_folder`).
"""

from __future__ import annotations

import contextlib
import hashlib
import os
import platform
import tempfile
from collections.abc import Iterator, Sequence
from contextvars import ContextVar
from pathlib import Path

import casadi as ca
import numpy as np

from colloc.numerics.c_compiler import BALANCE_ONLY, FOLDER, OFF, c_compiler, cache_folder, compile_library
from colloc.system.errors import ProblemError, StoreError
from colloc.system.private_folder import is_private, make_private

_FLAGS = ("-O1", "-ffp-contract=off", "-fPIC", "-shared")
"""-O2 takes half as long again to compile and gains a few per cent; contracted operations would round differently."""
_WORTH_COMPILING = 1000
"""Operations below which a function gains nothing that matters."""
_asked: ContextVar[bool] = ContextVar("compiling", default=False)


def code_folder() -> Path | None:
    """Where compiled functions are kept, see `cache_folder`; None: nowhere."""
    return None if os.environ.get(FOLDER) == BALANCE_ONLY else cache_folder()


def compiler() -> str | None:
    """Path of the C compiler, if there is one and it may be used."""
    return None if code_folder() is None else c_compiler()


@contextlib.contextmanager
def compiling() -> Iterator[None]:
    """Within it, `machine_code` compiles what it does not find.

    Raises
    ------
    ProblemError
        If there is no C compiler.
    """
    if code_folder() is None:
        raise ProblemError(f"compiled code is switched off by {FOLDER}={OFF}.")
    if compiler() is None:
        raise ProblemError("no C compiler was found ($CC, cc, gcc or clang): install one, or do without compiled code.")
    token = _asked.set(True)
    try:
        yield
    finally:
        _asked.reset(token)


def machine_code(functions: Sequence[ca.Function]) -> list[ca.Function]:
    """The functions, compiled if their code is in the folder or may be put there (see `compiling`), else as they are.

    Parameters
    ----------
    functions : sequence of casadi.Function
        With names of their own; they share one library.

    Raises
    ------
    ProblemError, StoreError
        Within `compiling`: if the compiler fails, or the folder cannot be written.
    """
    folder = code_folder()
    if folder is None or max(f.n_instructions() for f in functions) < _WORTH_COMPILING:
        return list(functions)
    content = "\n".join([ca.__version__, platform.machine(), *_FLAGS, *(f.serialize() for f in functions)])
    library = folder / f"{hashlib.sha256(content.encode()).hexdigest()[:32]}.so"
    # os.path.exists is False where one may not look
    loaded = _loaded(functions, library) if os.path.exists(library) and is_private(library) else None
    if loaded is None and _asked.get():
        make_private(folder)
        _compile(functions, library)
        loaded = _loaded(functions, library)
    return list(functions) if loaded is None else loaded


def _compile(functions: Sequence[ca.Function], library: Path) -> None:
    with _scratch_folder() as folder:
        generator = ca.CodeGenerator("functions.c")
        for function in functions:
            generator.add(function)
        compile_library(generator.generate(f"{folder}{os.sep}"), _FLAGS, library)


@contextlib.contextmanager
def _scratch_folder() -> Iterator[str]:
    try:
        folder = tempfile.TemporaryDirectory(prefix="colloc-")
    except OSError as error:
        raise StoreError(f"cannot make a temporary folder to compile in: {error.strerror or error}.") from None
    with folder as name:
        yield name


def _loaded(functions: Sequence[ca.Function], library: Path) -> list[ca.Function] | None:
    """The functions of a library, None if it is damaged or computes anything else than the originals do."""
    try:
        loaded = [ca.external(f.name(), str(library)) for f in functions]
    except RuntimeError:
        return None
    for ours, theirs in zip(functions, loaded, strict=True):
        if (theirs.n_in(), theirs.n_out()) != (ours.n_in(), ours.n_out()):
            return None
        point = [0.3 + 0.1 * np.arange(ours.numel_in(k)).reshape(ours.size_in(k), order="F") % 1.7 for k in range(ours.n_in())]
        pairs = zip(ours.call(point), theirs.call(point), strict=True)
        if not all(np.array_equal(a.full(), b.full(), equal_nan=True) for a, b in pairs):
            return None
    return loaded
