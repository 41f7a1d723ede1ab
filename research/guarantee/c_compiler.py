"""C compiled while a program runs, by the system's compiler, for this process alone."""

from __future__ import annotations

import ctypes
import os
import shutil
import subprocess
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path

from colloc.system.errors import StoreError

_PATIENCE = 600.0


def c_compiler() -> str | None:
    """Path of the C compiler, if there is one: ``$CC``, or the first of cc, gcc and clang that is
    found."""
    names = (os.environ.get("CC"), "cc", "gcc", "clang")
    return next((found for name in names if name and (found := shutil.which(name))), None)


def compiled_library(source: Path, flags: Sequence[str], headers: Mapping[str, str]) -> ctypes.CDLL:
    """A C file, with further headers by name and text, as a library of this process; no file of it
    is left.

    Raises
    ------
    StoreError
        If there is no compiler, or it fails.
    """
    compiler = c_compiler()
    if compiler is None:
        raise StoreError("there is no C compiler (cc, gcc or clang, or $CC).")
    with tempfile.TemporaryDirectory(prefix="colloc-", ignore_cleanup_errors=True) as scratch:
        for header, text in headers.items():
            (Path(scratch) / header).write_text(text, encoding="ascii")
        made = str(Path(scratch) / "made.so")
        command = [
            compiler,
            *flags,
            "-fPIC",
            "-shared",
            f"-I{scratch}",
            f"-I{source.parent}",
            str(source),
            "-o",
            made,
            "-lm",
        ]
        try:
            done = subprocess.run(
                command, capture_output=True, text=True, timeout=_PATIENCE, check=False
            )
            failure = (
                (done.stderr.strip().splitlines() or ["no message"])[-1]
                if done.returncode != 0
                else ""
            )
        except subprocess.TimeoutExpired:
            failure = f"took longer than {_PATIENCE:g} s"
        except OSError as error:
            failure = f"could not be run: {error.strerror or error}"
        if failure:
            raise StoreError(f"the C compiler {compiler} failed ({failure}); set CC to another.")
        return ctypes.CDLL(made)
