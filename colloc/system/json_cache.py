"""Results kept in one JSON file by the hash of what they depend on."""

from __future__ import annotations

import hashlib
import json
import os
from pathlib import Path
from typing import Any

from colloc.system.errors import ProblemError
from colloc.system.file_lock import locked
from colloc.system.replaced_file import replaced_file

_LARGEST = 2**28


def hash_of(fields: dict[str, Any]) -> str:
    """SHA-256 of plain numbers, strings, lists and dictionaries."""
    return hashlib.sha256(json.dumps(fields, sort_keys=True).encode()).hexdigest()


def load_entries(cache: str | os.PathLike) -> dict[str, dict[str, Any]]:
    """All entries of a cache file, {} if there is none.

    Raises
    ------
    ProblemError
        If the file is no JSON dictionary, too large, or damaged.
    """
    path = Path(cache)
    if not path.exists():
        return {}
    try:
        if path.stat().st_size > _LARGEST:
            raise ValueError("it is too large")
        found = json.loads(path.read_text(encoding="utf-8"))
        if set(found) != {"sha256", "entries"}:
            return dict(found)  # as written before there were checksums
        if hash_of(found["entries"]) != found["sha256"]:
            raise ValueError("its checksum does not fit")
        return found["entries"]
    except (OSError, ValueError, TypeError, AttributeError, RecursionError) as error:
        raise ProblemError(f"the cache {path} cannot be read ({error}); delete it or name another.") from None


def save_entry(cache: str | os.PathLike, key: str, entry: dict[str, Any]) -> None:
    """Add an entry to a cache file, which is replaced in one step; writers wait for each other, and none loses an entry.

    Raises
    ------
    StoreError
        If the file or its lock cannot be written.
    """
    path = Path(cache)
    with locked(path.with_name(f".{path.name}.lock"), wait=True):
        entries = load_entries(path)
        entries[key] = entry
        with replaced_file(path) as temporary:
            text = json.dumps({"sha256": hash_of(entries), "entries": entries})
            Path(temporary).write_text(text, encoding="utf-8")
