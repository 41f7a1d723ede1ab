"""The journal of a study: every finished cell, on disk before it is reported, one line each.

A journal is a folder of text files, one a run, so that two runs cannot harm each other. A line is the SHA-256 of a JSON
text, a blank, and the text. Lines are only ever appended, each by one write, and flushed to the disk. What a kill leaves
of the last line is not a record, and is ignored; so is, with a warning, a line whose sum is wrong. Nothing is executed.
"""

from __future__ import annotations

import contextlib
import hashlib
import json
import math
import os
import uuid
from collections.abc import Iterator
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Any

from colloc.gaits.gait_fields import fields as gait_fields
from colloc.gaits.gait_fields import gait_from
from colloc.results.distinct_optima import STATUSES, Outcome
from colloc.studies.cell import Attempt
from colloc.system.errors import CollocError, StoreError

FORMAT = "colloc study journal 1"
LONGEST_LINE, LARGEST_FILE = 2**22, 2**31
_NUMBERS = [f.name for f in fields(Outcome) if f.name not in ("guess", "gait", "status", "message")]


@dataclass(frozen=True, eq=False)
class Record:
    """What one visit to a cell gave, and the hash of its problem; see `colloc.studies.cell.Visit`."""

    problem_hash: str
    attempts: tuple[Attempt, ...]
    scores: dict[str, float] = field(default_factory=dict)


@dataclass(eq=False)
class JournalText:
    """What was read: records in order, and how many lines were damaged."""

    records: list[Record] = field(default_factory=list)
    damaged: int = 0


def _attempt_fields(attempt: Attempt) -> dict[str, Any]:
    outcome = attempt.outcome
    entry = {"origin": attempt.origin, "key": attempt.key, "status": outcome.status, "message": outcome.message[:1000]}
    numbers = {name: value if math.isfinite(value := getattr(outcome, name)) else None for name in _NUMBERS}
    return entry | numbers | {"guess": gait_fields(outcome.guess), "gait": gait_fields(outcome.gait)}


def _attempt_in(entry: dict[str, Any]) -> Attempt:
    numbers: dict[str, Any] = {name: math.nan if entry[name] is None else entry[name] for name in _NUMBERS}
    if not all(isinstance(value, (int, float)) and not isinstance(value, bool) for value in numbers.values()):
        raise ValueError("not numbers")
    origin, key, status, message = texts = [entry[name] for name in ("origin", "key", "status", "message")]
    if not all(isinstance(text, str) for text in texts) or status not in STATUSES:
        raise ValueError("not texts")
    guess, gait = (gait_from(entry[name]) for name in ("guess", "gait"))
    return Attempt(origin, key, Outcome(status=status, message=message, guess=guess, gait=gait, **numbers))


def line_of(record: Record) -> bytes:
    """A record as a line."""
    entry = {
        "problem": record.problem_hash,
        "attempts": [_attempt_fields(attempt) for attempt in record.attempts],
        "scores": {key: score for key, score in record.scores.items() if math.isfinite(score)},
    }
    text = json.dumps(entry, allow_nan=False).encode()
    return hashlib.sha256(text).hexdigest().encode() + b" " + text + b"\n"


def record_in(line: bytes) -> Record:
    """The record of a line.

    Raises
    ------
    ValueError
        If the sum is wrong or the text is no record.
    """
    digest, _, text = line.rstrip(b"\n").partition(b" ")
    if hashlib.sha256(text).hexdigest().encode() != digest:
        raise ValueError("wrong sum")
    try:
        entry = json.loads(text)
        scores = {str(key): float(score) for key, score in entry.get("scores", {}).items()}  # none in earlier journals
        return Record(str(entry["problem"]), tuple(_attempt_in(fields) for fields in entry["attempts"]), scores)
    except (KeyError, TypeError, AttributeError, CollocError, RecursionError) as error:
        raise ValueError(f"not a record: {error}") from None


def _lines(path: Path) -> Iterator[bytes]:
    """Whole lines of bounded length; one that is longer comes back empty, one without an end not at all."""
    with open(path, "rb") as file:
        while line := file.readline(LONGEST_LINE):
            if line.endswith(b"\n"):
                yield line
                continue
            rest = line
            while rest and not rest.endswith(b"\n"):
                rest = file.readline(LONGEST_LINE)
            if rest:
                yield b""


def read_journal(folder: Path) -> JournalText:
    """All records of a folder; none if there is no such folder.

    Raises
    ------
    StoreError
        If a file cannot be read, is too large, or is no journal.
    """
    found = JournalText()
    for path in sorted(folder.glob("journal-*.jsonl")):
        try:
            if path.stat().st_size > LARGEST_FILE:
                raise StoreError(f"{path} is too large for a journal; move it away.")
            lines = _lines(path)
            head = next(lines, FORMAT.encode())
            if head.strip() != FORMAT.encode():
                raise StoreError(f"{path} is damaged, or not a journal of colloc; move it away.")
            for line in lines:
                try:
                    found.records.append(record_in(line))
                except ValueError:
                    found.damaged += 1
        except StoreError:
            raise
        except OSError as error:
            raise StoreError(f"cannot read {path}: {error.strerror or error}.") from None
    return found


class Journal:
    """A journal file of one run, in a folder that may hold those of others. Use as a context."""

    def __init__(self, folder: Path) -> None:
        self.path = folder / f"journal-{uuid.uuid4().hex[:12]}.jsonl"
        self._handle: int | None = None

    def __enter__(self) -> Journal:
        return self

    def __exit__(self, *_: object) -> None:
        if self._handle is not None:
            os.close(self._handle)
            self._handle = None

    def append(self, records: list[Record]) -> None:
        """Write records to the disk; when this returns, they are there.

        Raises
        ------
        StoreError
            If that is not possible. The file then ends with the last whole line.
        """
        text = b"".join(map(line_of, records))
        try:
            if self._handle is None:
                self._handle = os.open(self.path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_APPEND, 0o666)
                text = FORMAT.encode() + b"\n" + text
            before = os.fstat(self._handle).st_size
            try:
                if os.write(self._handle, text) != len(text):
                    raise OSError(28, "no space left on the disk, or a limit on the size of files")
                os.fsync(self._handle)
            except OSError:
                with contextlib.suppress(OSError):
                    os.ftruncate(self._handle, before)
                raise
        except OSError as error:
            raise StoreError(
                f"cannot write {self.path}: {error.strerror or error}. What was finished before is kept; make room and "
                "give the same command again."
            ) from None
