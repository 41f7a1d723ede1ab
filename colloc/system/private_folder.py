"""Folders of code that is run: nobody but their user, and the superuser, may have put anything there."""

from __future__ import annotations

import os
import stat
from pathlib import Path

from colloc.system.errors import StoreError


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
