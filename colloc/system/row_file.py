"""Values as JSON and back, exact to the last bit; and rows of JSON by key in one table of an SQLite
file, named for their kind ("colloc journal 2"). When `put_rows` returns they are on the disk.
Nothing in a file is executed.

Arrays become base64 text; dataclasses and named tuples their fields and the name of their class, of
which only listed ones are made again, without calling ``__init__``, which could change a last bit.
"""

import base64
import contextlib
import dataclasses
import json
import os
import sqlite3
from collections.abc import Callable, Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from colloc.system.errors import StoreError

CACHE = "colloc cache 2"
_PATIENCE = 60.0  # seconds to wait for other writers, each of which takes milliseconds


@contextlib.contextmanager
def _transaction(path: Path, kind: str, begin: str) -> Iterator[tuple[sqlite3.Connection, bool]]:
    address = f"{path.absolute().as_uri()}?mode=rw"
    with contextlib.closing(
        sqlite3.connect(address, uri=True, timeout=_PATIENCE, isolation_level=None)
    ) as connection:
        connection.execute("PRAGMA synchronous = EXTRA")  # commits survive a power cut
        connection.execute(begin)
        query = "SELECT sql FROM sqlite_master WHERE sql IS NOT NULL LIMIT 2"
        tables = connection.execute(query).fetchall()
        if not tables and path.stat().st_size > 0:
            raise sqlite3.DatabaseError("it is no database, or its table is missing")
        if tables and tables != [(_table(kind),)]:
            raise StoreError(
                f"{path} is not a {kind}: another version of colloc wrote it, or another program; "
                f"move it away."
            )
        yield connection, bool(tables)


def _table(kind: str) -> str:
    return f'CREATE TABLE "{kind}" (key TEXT PRIMARY KEY, value TEXT)'


def read_rows(
    path: Path, kind: str, decode: Callable[[Any], Any] = lambda value: value
) -> dict[str, Any]:
    """Decoded values by key, in insertion order; none if there is no file.

    `StoreError` if the file cannot be read, is damaged or of another kind.
    """
    if not path.exists():
        return {}
    try:
        with _transaction(path, kind, "BEGIN") as (connection, filled):
            query = f'SELECT key, value FROM "{kind}" ORDER BY rowid'
            rows = connection.execute(query) if filled else ()
            return {key: decode(json.loads(text)) for key, text in rows}
    except StoreError:
        raise
    except Exception as error:
        raise StoreError(
            f"{path} cannot be read as a {kind} ({error}); move it away, or have sqlite3 "
            f"recover it."
        ) from None


def put_rows(path: Path, kind: str, rows: Mapping[str, Any]) -> None:
    """Add rows, or replace those of the same keys: all or none. Writers wait for each other.

    `StoreError` if the file cannot be written, or is of another kind.
    """
    texts = [(key, json.dumps(value)) for key, value in rows.items()]
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        # with 0o666 less the umask, where SQLite would take 0o644: a group may share it
        with contextlib.suppress(FileExistsError):
            os.close(os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o666))
        with _transaction(path, kind, "BEGIN IMMEDIATE") as (connection, filled):
            if not filled:
                connection.execute(_table(kind))
            update = "ON CONFLICT(key) DO UPDATE SET value = excluded.value"
            connection.executemany(f'INSERT INTO "{kind}" VALUES (?, ?) {update}', texts)
            connection.execute("COMMIT")
    except StoreError:
        raise
    except (sqlite3.Error, OSError, UnicodeDecodeError) as error:
        raise StoreError(
            f"cannot write {path}: {getattr(error, 'strerror', None) or error}. What was finished "
            f"before is kept; make room or choose another --output, and give the same command "
            f"again."
        ) from None


class Codec:
    """Encoder and decoder of values of listed classes, or by the pairs of `custom` functions."""

    def __init__(self, kinds: Iterable[type], custom: Mapping[type, Any]) -> None:
        self._kinds = {kind.__name__: kind for kind in kinds}
        self._custom = {kind.__name__: pair for kind, pair in custom.items()}

    def encode(self, value: Any) -> Any:
        """Encode a value as plain JSON. `TypeError` for a class that is not listed."""
        name = type(value).__name__
        if isinstance(value, np.generic):
            return value.item()
        if value is None or isinstance(value, (bool, int, float, str)):
            return value
        if isinstance(value, list):
            return [self.encode(part) for part in value]
        if isinstance(value, np.ndarray):
            text = base64.b64encode(np.ascontiguousarray(value).tobytes()).decode()
            return {"array": text, "type": value.dtype.str, "shape": list(value.shape)}
        if name in self._custom:
            of = self._custom[name][0](value)
        elif name in self._kinds:
            names = getattr(value, "_fields", None) or [x.name for x in dataclasses.fields(value)]
            of = {each: self.encode(getattr(value, each)) for each in names}
        elif name == "tuple":
            of = [self.encode(part) for part in value]
        elif name == "dict":
            of = [[self.encode(k), self.encode(v)] for k, v in value.items()]
        else:
            raise TypeError(f"cannot write a {name}.")
        return {"kind": name, "of": of}

    def decode(self, plain: Any) -> Any:
        """Decode. `KeyError`, `TypeError` or `ValueError` if `encode` did not make it."""
        if isinstance(plain, list):
            return [self.decode(part) for part in plain]
        if not isinstance(plain, dict):
            return plain
        if "array" in plain:
            data = np.frombuffer(base64.b64decode(plain["array"]), dtype=np.dtype(plain["type"]))
            return data.reshape(plain["shape"]).copy()
        name, of = plain["kind"], plain["of"]
        if name == "tuple":
            return tuple(self.decode(part) for part in of)
        if name == "dict":
            return {self.decode(k): self.decode(v) for k, v in of}
        if name in self._custom:
            return self._custom[name][1](of)
        kind, values = self._kinds[name], {key: self.decode(part) for key, part in of.items()}
        if issubclass(kind, tuple):
            return kind(**values)
        made: Any = object.__new__(kind)
        for key, value in values.items():
            object.__setattr__(made, key, value)
        return made
