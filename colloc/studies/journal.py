"""The journal of a study: every finished visit to a cell is a row on the disk before it is reported
(`system.row_file`)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from colloc.gaits.gait_fields import statement_hash
from colloc.results.outcome import outcome_fields, outcome_from
from colloc.studies.cell import Attempt
from colloc.system.errors import ProblemError, StoreError
from colloc.system.row_file import put_rows, read_rows

KIND, NAME = "colloc journal 2", "journal.sqlite"


@dataclass(frozen=True, eq=False)
class Record:
    """What one visit to a cell gave, and the hash of its problem; see
    `colloc.studies.cell.Visit`."""

    problem_hash: str
    attempts: tuple[Attempt, ...]
    scores: dict[str, float] = field(default_factory=dict)


def _record_fields(record: Record) -> dict[str, Any]:
    return {
        "problem": record.problem_hash,
        "attempts": [
            {"origin": a.origin, "key": a.key, "outcome": outcome_fields(a.outcome)}
            for a in record.attempts
        ],
        "scores": {key: score for key, score in record.scores.items() if math.isfinite(score)},
    }


def _record_from(entry: dict[str, Any]) -> Record:
    attempts = tuple(
        Attempt(str(a["origin"]), str(a["key"]), outcome_from(a["outcome"]))
        for a in entry["attempts"]
    )
    return Record(
        str(entry["problem"]),
        attempts,
        {str(key): float(score) for key, score in entry["scores"].items()},
    )


def read_journal(folder: Path) -> list[Record]:
    """All records of a folder, in order; none if there is no such folder. `StoreError` if the
    journal cannot be read or is damaged."""
    try:
        return [_record_from(entry) for entry in read_rows(folder / NAME, KIND).values()]
    except (KeyError, TypeError, ValueError, OverflowError, AttributeError, ProblemError):
        raise StoreError(
            f"{folder / NAME} is damaged: it holds something else than records; move it away."
        ) from None


def append_records(folder: Path, records: Sequence[Record]) -> None:
    """Put records on the disk; when this returns they are there. StoreError if that is not
    possible."""
    entries = [_record_fields(record) for record in records]
    put_rows(folder / NAME, KIND, {statement_hash(entry): entry for entry in entries})
