"""The system's C compiler, and the folder where what it made is kept. No CasADi."""

from __future__ import annotations

import os
import shutil
import subprocess
from collections.abc import Sequence
from pathlib import Path

from platformdirs import user_cache_path

from colloc.system.errors import StoreError
from colloc.system.replaced_file import replaced_file

FOLDER, OFF = "COLLOC_CODE", "off"
_PATIENCE = 600.0


def cache_folder() -> Path | None:
    """``$COLLOC_CODE``, else ``colloc`` in the user's cache folder.

    None if it is "off", or for a user without a home.
    """
    named = os.environ.get(FOLDER)
    if named == OFF:
        return None
    if named:
        return Path(named).absolute()
    try:
        folder = user_cache_path("colloc", appauthor=False)
    except RuntimeError:  # without a home; older platformdirs leave "~" in the path
        return None
    return folder if folder.is_absolute() else None


def c_compiler() -> str | None:
    """Path of the C compiler, if there is one: ``$CC``, or the first of cc, gcc and clang that is found."""
    names = (os.environ.get("CC"), "cc", "gcc", "clang")
    return next((found for name in names if name and (found := shutil.which(name))), None)


def compile_library(source: str | Path, flags: Sequence[str], library: Path) -> None:
    """Compile a C file into a shared library, which appears whole or not at all.

    Raises
    ------
    StoreError
        If there is no compiler, it fails, or the library cannot be written.
    """
    command = [str(c_compiler()), *flags]
    with replaced_file(library) as unfinished:
        try:
            done = subprocess.run(
                [*command, str(source), "-o", unfinished, "-lm"],
                capture_output=True,
                text=True,
                timeout=_PATIENCE,
                check=False,
            )
            failure = (done.stderr.strip().splitlines() or ["no message"])[-1] if done.returncode != 0 else ""
        except subprocess.TimeoutExpired:
            failure = f"took longer than {_PATIENCE:g} s"
        except OSError as error:
            failure = f"could not be run: {error.strerror or error}"
        if failure:
            raise StoreError(f"the C compiler {command[0]} failed ({failure}); set CC to another, or do without compiled code.")
        os.chmod(unfinished, 0o600)  # whoever else could write it could have it run
