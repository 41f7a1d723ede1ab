"""C sources as shared libraries, made by the system's compiler and kept in the user's cache folder. No CasADi.

A library is kept under a name made of the content of its sources and its own: whoever edits, updates or shares an installation
never meets an old one, nor a part of one, which would kill the process that loads it. Nobody but the user, and the superuser,
may have put anything into the folder.
"""

from __future__ import annotations

import hashlib
import os
import platform
import shutil
import stat
import subprocess
import sys
import tempfile
from collections.abc import Mapping, Sequence
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


def lack() -> str:
    """What is missing to compile and keep code, in words; "" if nothing is, or nobody wants it (COLLOC_CODE is "off")."""
    folder = cache_folder()
    if os.environ.get(FOLDER) == OFF:
        return ""
    if folder is None:
        return f"there is no folder to keep compiled code in (set {FOLDER} to one)"
    if c_compiler() is None:
        return "there is no C compiler (cc, gcc or clang, or $CC)"
    return "" if os.access(folder, os.W_OK) else f"compiled code cannot be kept in {folder} (set {FOLDER} to another folder)"


def kept_library(kind: str, sources: Path, main: str, flags: Sequence[str], headers: Mapping[str, str]) -> Path | None:
    """A shared library in the cache folder, compiled if it is not there; None without a compiler, or where nothing can be kept.

    Parameters
    ----------
    kind : str
        What its name begins with.
    sources : Path
        The folder of C files and headers that it is made of.
    main : str
        The file in it that includes the others.
    flags : sequence of str
    headers : mapping of str to str
        Names and texts of further headers.

    Raises
    ------
    StoreError
        If the compiler fails, or the library cannot be written.
    """
    folder = cache_folder()
    if folder is None:
        return None
    name = f"{kind}-{_fingerprint(sources, flags, headers)}"
    for found in folder.glob(f"{name}-*.so"):
        if is_private(found) and found.stem.endswith(_digest(found)):
            return found
    make_private(folder)
    if c_compiler() is None or not os.access(folder, os.W_OK):
        return None
    with tempfile.TemporaryDirectory(prefix="colloc-") as scratch:
        for header, text in headers.items():
            (Path(scratch) / header).write_text(text, encoding="ascii")
        made = Path(scratch) / f"{kind}.so"
        _compile(sources / main, [*flags, f"-I{scratch}", f"-I{sources}"], made)
        file = folder / f"{name}-{_digest(made)}.so"
        make_private(folder)
        with replaced_file(file) as unfinished:
            shutil.copy(made, unfinished)  # with its permissions
    return file


def _fingerprint(sources: Path, flags: Sequence[str], headers: Mapping[str, str]) -> str:
    """Of everything that a library is made of."""
    content = hashlib.sha256(" ".join((*flags, sys.platform, platform.machine(), *headers.values())).encode())
    for source in sorted(sources.glob("*.[ch]")):
        content.update(source.read_bytes())
    return content.hexdigest()[:32]


def _digest(file: Path) -> str:
    """Of a library; it ends the name."""
    return hashlib.sha256(file.read_bytes()).hexdigest()[:16]


def _compile(source: Path, flags: Sequence[str], library: Path) -> None:
    """Compile a C file into a shared library, which appears whole or not at all."""
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


def trespass(path: Path) -> str:
    """Who else could have written a file or folder: "belongs to another user", "can be written by others", or ""."""
    if not hasattr(os, "geteuid"):  # Windows: folders of a user are closed to others
        return ""
    found = os.stat(path)
    if not {found.st_uid, os.lstat(path).st_uid} <= {os.geteuid(), 0}:  # what a link leads to, and the link
        return "belongs to another user"
    return "can be written by others" if found.st_mode & (stat.S_IWGRP | stat.S_IWOTH) else ""


def is_private(file: Path) -> bool:
    """Whether neither the file nor its folder could have been written by anybody else."""
    try:
        return not (trespass(file.parent) or trespass(file))
    except OSError:
        return False


def make_private(folder: Path) -> None:
    """Make the folder for its user alone (0700), if it is not there. `StoreError` if it cannot be made, or is there and others
    could write to it."""
    try:
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        wrong = trespass(folder)
    except OSError as error:
        raise StoreError(f"cannot write {folder}: {error.strerror or error}.") from None
    if wrong:
        raise StoreError(f"no code is kept in {folder}, since it {wrong}: chmod go-w it, or set COLLOC_CODE to another.")
