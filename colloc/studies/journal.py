"""Attempts at the cells of a study, and their journal: every finished visit to a cell is a row on
the disk before it is reported."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

from colloc.gaits.gait_fields import AnyGait, fields, statement_hash
from colloc.results.outcome import Outcome, outcome_fields, outcome_from
from colloc.results.solution import SOLVED
from colloc.system.row_file import put_rows, read_rows

KIND, NAME = "colloc journal 2", "journal.sqlite"


def start_key(gait: AnyGait) -> str:
    """A name for a gait, the same wherever it comes from."""
    return statement_hash(fields(gait))[:16]


@dataclass(frozen=True, eq=False)
class Attempt:
    """One start of a cell: where it came from, a key so that none is solved twice, its outcome."""

    origin: str
    key: str
    outcome: Outcome

    @cached_property
    def gait_key(self) -> str:
        return start_key(self.outcome.gait)


def best_attempt(attempts: Iterable[Attempt]) -> Attempt | None:
    """The certified one of largest value, or None."""
    certified = (a for a in attempts if a.outcome.status == SOLVED)
    return max(certified, key=lambda a: a.outcome.value, default=None)


@dataclass(frozen=True, eq=False)
class Visit:
    """Attempts at a cell, named by the hash of its problem; and `scores`: the value there of every
    gait that came from elsewhere, as it is, by its `start_key` (NaN if nobody knows)."""

    problem_hash: str
    attempts: list[Attempt]
    scores: dict[str, float] = field(default_factory=dict)


def _visit_fields(visit: Visit) -> dict[str, Any]:
    return {
        "problem": visit.problem_hash,
        "attempts": [
            {"origin": a.origin, "key": a.key, "outcome": outcome_fields(a.outcome)}
            for a in visit.attempts
        ],
        "scores": {key: score for key, score in visit.scores.items() if math.isfinite(score)},
    }


def _visit_from(row: dict[str, Any]) -> Visit:
    attempts = [
        Attempt(str(a["origin"]), str(a["key"]), outcome_from(a["outcome"]))
        for a in row["attempts"]
    ]
    scores = {str(key): float(score) for key, score in row["scores"].items()}
    return Visit(str(row["problem"]), attempts, scores)


def read_journal(folder: Path) -> list[Visit]:
    """All visits of a folder, in order; none if there is no such folder. `StoreError` if the
    journal cannot be read or is damaged."""
    return [*read_rows(folder / NAME, KIND, _visit_from).values()]


def append_visits(folder: Path, visits: Iterable[Visit]) -> None:
    """Put visits on the disk; `StoreError` if that is not possible."""
    rows = map(_visit_fields, visits)
    put_rows(folder / NAME, KIND, {statement_hash(row): row for row in rows})
