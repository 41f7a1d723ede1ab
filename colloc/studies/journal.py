"""Attempts at the cells of a study, and the journal that holds every finished visit to a cell."""

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
    """Hash of a gait."""
    return statement_hash(fields(gait))[:16]


@dataclass(frozen=True, eq=False)
class Attempt:
    """Outcome of one start of a cell; its origin, and a key so that it is not solved again."""

    origin: str
    key: str
    outcome: Outcome

    @cached_property
    def gait_key(self) -> str:
        return start_key(self.outcome.gait)


def best_attempt(attempts: Iterable[Attempt]) -> Attempt | None:
    """The certified attempt of largest value."""
    certified = (a for a in attempts if a.outcome.status == SOLVED)
    return max(certified, key=lambda a: a.outcome.value, default=None)


@dataclass(frozen=True, eq=False)
class Visit:
    """Attempts at the cell of a problem, and values there of gaits of other cells by `start_key`,
    evaluated without optimising (NaN if unknown)."""

    problem_hash: str
    attempts: list[Attempt]
    scores: dict[str, float] = field(default_factory=dict)


def _encode(visit: Visit) -> dict[str, Any]:
    return {
        "problem": visit.problem_hash,
        "attempts": [
            {"origin": a.origin, "key": a.key, "outcome": outcome_fields(a.outcome)}
            for a in visit.attempts
        ],
        "scores": {key: score for key, score in visit.scores.items() if math.isfinite(score)},
    }


def _decode(row: dict[str, Any]) -> Visit:
    attempts = [
        Attempt(str(a["origin"]), str(a["key"]), outcome_from(a["outcome"]))
        for a in row["attempts"]
    ]
    scores = {str(key): float(score) for key, score in row["scores"].items()}
    return Visit(str(row["problem"]), attempts, scores)


def read_journal(folder: Path) -> list[Visit]:
    """All visits in a folder, in order. `StoreError` if the journal cannot be read."""
    return [*read_rows(folder / NAME, KIND, _decode).values()]


def append_visits(folder: Path, visits: Iterable[Visit]) -> None:
    """Put visits on the disk. `StoreError` if that is not possible."""
    rows = map(_encode, visits)
    put_rows(folder / NAME, KIND, {statement_hash(row): row for row in rows})
