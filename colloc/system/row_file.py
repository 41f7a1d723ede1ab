"""Rows of JSON by key in an SQLite file: when `put_rows` returns they are on the disk, and no crash
or other writer undoes it.

A file has one table, named for what its rows are ("colloc journal 2"). Nothing in a file is
executed.
"""

from __future__ import annotations

import contextlib
import json
import os
import sqlite3
import tempfile
from collections.abc import Callable, Iterator, Mapping
from functools import lru_cache
from pathlib import Path
from typing import Any

from colloc.system.errors import CollocError, StoreError
from colloc.system.replaced_file import NO_LOCKS

CACHE = "colloc cache 2"
_UNREADABLE = (
    *(sqlite3.Error, OSError, TypeError, ValueError, RecursionError),
    *(KeyError, AttributeError, OverflowError, CollocError),
)
_PATIENCE = 60.0
"""Seconds to wait for other writers, each of which takes milliseconds."""


@lru_cache
def _has_locks(folder: Path) -> bool:
    """Whether the file system locks parts of files, as SQLite wants; some network file systems do
    not."""
    try:
        import fcntl

        with tempfile.TemporaryFile(dir=folder) as probe:
            fcntl.lockf(probe, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except ImportError:  # Windows, whose locks SQLite uses
        return True
    except OSError as error:
        # a folder to read from, or a full one, says nothing of locks
        return error.errno not in NO_LOCKS
    return True


@contextlib.contextmanager
def _opened(path: Path, kind: str, begin: str) -> Iterator[tuple[sqlite3.Connection, bool]]:
    """A connection within a transaction, and whether there is a table; what is not committed is
    undone."""
    locking = "" if _has_locks(path.parent) else "&vfs=unix-dotfile"
    address = f"{path.absolute().as_uri()}?mode=rw{locking}"
    with contextlib.closing(
        sqlite3.connect(address, uri=True, timeout=_PATIENCE, isolation_level=None)
    ) as connection:
        # the end of a transaction survives a power cut, too
        connection.execute("PRAGMA synchronous = EXTRA")
        connection.execute(begin)
        found = connection.execute(
            "SELECT sql FROM sqlite_master WHERE sql IS NOT NULL LIMIT 2"
        ).fetchall()
        if not found and path.stat().st_size > 0:
            raise sqlite3.DatabaseError("it is no database, or its table is missing")
        if found and found != [(_table(kind),)]:
            raise StoreError(
                f"{path} is not a {kind}: another version of colloc wrote it, or another program; "
                f"move it away."
            )
        yield connection, bool(found)


def _table(kind: str) -> str:
    return f'CREATE TABLE "{kind}" (key TEXT PRIMARY KEY, value TEXT)'


def read_rows(
    path: Path, kind: str, decode: Callable[[Any], Any] = lambda value: value
) -> dict[str, Any]:
    """Decoded values by key, in the order in which the keys came; none if there is no such file.
    `StoreError` if the file cannot be read, is damaged or of another kind."""
    if not path.exists():
        return {}
    try:
        with _opened(path, kind, "BEGIN") as (connection, filled):
            rows = (
                connection.execute(f'SELECT key, value FROM "{kind}" ORDER BY rowid')
                if filled
                else ()
            )
            return {key: decode(json.loads(text)) for key, text in rows}
    except StoreError:
        raise
    except _UNREADABLE as error:
        raise StoreError(
            f"{path} cannot be read as a {kind} ({error}); move it away, or have sqlite3 "
            f"recover it."
        ) from None


def put_rows(path: Path, kind: str, rows: Mapping[str, Any]) -> None:
    """Add rows, or replace those of the same keys: all of them, or none. Writers wait for each
    other. `StoreError` if the file cannot be written, or is of another kind. It then holds what it
    held."""
    texts = [(key, json.dumps(value)) for key, value in rows.items()]
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        # with 0o666 less the umask, where SQLite would take 0o644: a group may share it
        with contextlib.suppress(FileExistsError):
            os.close(os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o666))
        with _opened(path, kind, "BEGIN IMMEDIATE") as (connection, filled):
            if not filled:
                connection.execute(_table(kind))
            update = "ON CONFLICT(key) DO UPDATE SET value = excluded.value"
            connection.executemany(f'INSERT INTO "{kind}" VALUES (?, ?) {update}', texts)
            connection.execute("COMMIT")
    except StoreError:
        raise
    except (sqlite3.Error, OSError, UnicodeDecodeError) as error:
        why = getattr(error, "strerror", None) or error
        if path.with_name(f"{path.name}.lock").exists():  # only where `_has_locks` is false
            why = f"{why}, and if no run is under way remove {path.name}.lock"
        raise StoreError(
            f"cannot write {path}: {why}. What was finished before is kept; make room or choose "
            f"another --output, and give the "
            "same command again."
        ) from None
