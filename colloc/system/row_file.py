"""Rows of JSON by key in an SQLite file: when `put_rows` returns they are on the disk, and no crash or other writer undoes it.

A file has one table, named for what its rows are ("colloc journal 1"). A row carries the SHA-256 of its key and text, since
SQLite does not see a changed bit in a text: such a row is left out and counted. Nothing in a file is executed.
"""

from __future__ import annotations

import contextlib
import hashlib
import json
import os
import sqlite3
import tempfile
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path
from typing import Any

from colloc.system.errors import StoreError
from colloc.system.file_lock import NO_LOCKS

try:
    import fcntl
except ImportError:  # Windows, whose locks SQLite uses
    fcntl = None  # type: ignore[assignment]

CACHE = "colloc cache 1"
LARGEST_ROW, LARGEST_FILE = 2**24, 2**31
"""Bytes."""
_SMALLEST = 512
_PATIENCE = 60.0
"""Seconds to wait for other writers, each of which takes milliseconds."""


@dataclass(frozen=True)
class Rows:
    """What was read: values by key in the order in which the keys came, and the keys of damaged rows, as far as they can be
    read."""

    values: dict[str, Any] = field(default_factory=dict)
    damaged: tuple[str, ...] = ()


def _sum(key: bytes, text: bytes) -> bytes:
    return hashlib.sha256(key + b"\0" + text).hexdigest().encode()


@lru_cache
def _has_locks(folder: Path) -> bool:
    """Whether the file system locks parts of files, as SQLite wants; some network file systems do not."""
    try:
        with tempfile.TemporaryFile(dir=folder) as probe:
            if fcntl is not None:
                fcntl.lockf(probe, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError as error:
        return error.errno not in NO_LOCKS  # a folder to read from, or a full one, says nothing of locks
    return True


@contextlib.contextmanager
def _opened(path: Path, mode: str) -> Iterator[sqlite3.Connection]:
    if path.exists() and 0 < path.stat().st_size < _SMALLEST and not path.with_name(f"{path.name}-journal").exists():
        raise sqlite3.DatabaseError("file is not a database")  # which SQLite would take for an empty one
    locking = "" if _has_locks(path.parent) else "&vfs=unix-dotfile"
    address = f"{path.absolute().as_uri()}?mode={mode}{locking}"
    with contextlib.closing(sqlite3.connect(address, uri=True, timeout=_PATIENCE, isolation_level=None)) as connection:
        connection.text_factory = bytes
        connection.setlimit(sqlite3.SQLITE_LIMIT_LENGTH, LARGEST_ROW)
        connection.execute("PRAGMA trusted_schema = OFF")
        connection.execute("PRAGMA synchronous = EXTRA")  # the end of a transaction survives a power cut, too
        yield connection


def _is_empty(connection: sqlite3.Connection, path: Path, kind: str) -> bool:
    """Whether there is no table yet; any other than that of `kind` is refused, and so is a file that has lost its own."""
    found = connection.execute("SELECT sql FROM sqlite_master WHERE sql IS NOT NULL LIMIT 2").fetchall()
    if not found and path.stat().st_size > 0:
        raise sqlite3.DatabaseError("its table is missing")
    if found and found != [(_table(kind).encode(),)]:
        raise StoreError(f"{path} is not a {kind}: another version of colloc wrote it, or another program; move it away.")
    return not found


def _table(kind: str) -> str:
    return f'CREATE TABLE "{kind}" (key TEXT PRIMARY KEY, sha256 TEXT, value TEXT)'


def read_rows(path: Path, kind: str) -> Rows:
    """All rows of a file; none if there is no such file. `StoreError` if the file cannot be read, is too large, of another
    kind, or damaged beyond single rows."""
    values: dict[str, Any] = {}
    damaged: list[str] = []
    try:
        if not path.exists():
            return Rows()
        if path.stat().st_size > LARGEST_FILE:
            raise StoreError(f"{path} is too large for a {kind}; move it away.")
        with _opened(path, "rw") as connection:
            connection.execute("BEGIN")
            if _is_empty(connection, path, kind):
                return Rows()
            wrong = connection.execute("PRAGMA quick_check(1)").fetchone()[0]
            if wrong != b"ok":
                raise sqlite3.DatabaseError(wrong.decode("utf-8", "replace").splitlines()[-1])
            for key, digest, text in connection.execute(f'SELECT key, sha256, value FROM "{kind}" ORDER BY rowid'):
                try:
                    if _sum(key, text) != digest:
                        raise ValueError("wrong sum")
                    values[key.decode()] = json.loads(text)
                except (TypeError, ValueError, RecursionError):
                    damaged.append(bytes(key).decode("utf-8", "replace") if isinstance(key, bytes) else "a row without a key")
    except StoreError:
        raise
    except (sqlite3.Error, OSError, UnicodeDecodeError) as error:  # the last one: of a message of SQLite's
        raise StoreError(f"{path} cannot be read as a {kind} ({error}); move it away, or have sqlite3 recover it.") from None
    return Rows(values, tuple(damaged))


def put_rows(path: Path, kind: str, rows: Mapping[str, Any]) -> None:
    """Add rows, or replace those of the same keys: all of them, or none. Writers wait for each other. `StoreError` if the file
    cannot be written, or is of another kind. It then holds what it held."""
    texts = [(key, json.dumps(value)) for key, value in rows.items()]
    filled = [(key, _sum(key.encode(), text.encode()).decode(), text) for key, text in texts]
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        # with 0o666 less the umask, where SQLite would take 0o644: a group may share it
        with contextlib.suppress(FileExistsError):
            os.close(os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o666))
        with _opened(path, "rw") as connection:
            connection.execute("BEGIN IMMEDIATE")
            if _is_empty(connection, path, kind):
                connection.execute(_table(kind))
            update = "ON CONFLICT(key) DO UPDATE SET sha256 = excluded.sha256, value = excluded.value"
            connection.executemany(f'INSERT INTO "{kind}" VALUES (?, ?, ?) {update}', filled)
            connection.execute("COMMIT")
    except StoreError:
        raise
    except (sqlite3.Error, OSError, UnicodeDecodeError) as error:
        why = getattr(error, "strerror", None) or error
        if path.with_name(f"{path.name}.lock").exists():  # only where `_has_locks` is false
            why = f"{why}, and if no run is under way remove {path.name}.lock"
        raise StoreError(
            f"cannot write {path}: {why}. What was finished before is kept; make room or choose another --output, and give the "
            "same command again."
        ) from None


def cached(path: Path, key: str, compute: Callable[[], Any]) -> Any:
    """The value of a key in a cache file, computed and put there if it is missing. Raises as `read_rows` and `put_rows`."""
    known = read_rows(path, CACHE).values
    if key not in known:
        put_rows(path, CACHE, {key: compute()})
        known = read_rows(path, CACHE).values
    return known[key]
