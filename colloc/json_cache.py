"""Results kept in one JSON file by the hash of what they depend on."""

from __future__ import annotations

import hashlib
import json
import os
from pathlib import Path
from typing import Any

from colloc.errors import ProblemError


def hash_of(fields: dict[str, Any]) -> str:
    """SHA-256 of plain numbers, strings, lists and dictionaries."""
    return hashlib.sha256(json.dumps(fields, sort_keys=True).encode()).hexdigest()


def load_entries(cache: str | os.PathLike) -> dict[str, dict[str, Any]]:
    """All entries of a cache file, {} if there is none.

    Raises
    ------
    ProblemError
        If the file is no JSON dictionary.
    """
    path = Path(cache)
    if not path.exists():
        return {}
    try:
        return dict(json.loads(path.read_text()))
    except (OSError, ValueError, TypeError) as error:
        raise ProblemError(f"the cache {path} cannot be read ({error}); delete it or name another.") from None


def save_entry(cache: str | os.PathLike, key: str, entry: dict[str, Any]) -> None:
    """Add an entry to a cache file, which is replaced in one step."""
    path = Path(cache)
    entries = load_entries(path)
    entries[key] = entry
    path.parent.mkdir(parents=True, exist_ok=True)
    temporary = path.with_name(f".{path.name}.{os.getpid()}")
    temporary.write_text(json.dumps(entries))
    temporary.replace(path)
