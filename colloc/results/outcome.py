"""Outcomes of the starts of a multi-start."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from colloc.gaits.gait_fields import AnyGait, fields, gait_from
from colloc.results.solution import CERTIFICATE_FAILED, NOT_CONVERGED, SOLVED

TRIVIAL, ERROR, TIME_LIMIT, CRASHED = "trivial gait", "error", "time limit", "crashed"
PASSED_OVER = "passed over"
"""Status of a start that was no better than the incumbent and was not certified."""
UNITS = {
    **dict.fromkeys(("efficiency", "efficiency_error"), "1/weight"),
    **dict.fromkeys(("value", "value_error"), "of the objective"),
    "distance": "length",
    "work": "weight length",
    "delta": "length/period",
    "seconds": "s",
}
RETRIED = (ERROR, CRASHED, TIME_LIMIT)
STATUSES = (
    SOLVED,
    TRIVIAL,
    CERTIFICATE_FAILED,
    NOT_CONVERGED,
    PASSED_OVER,
    TIME_LIMIT,
    ERROR,
    CRASHED,
)
_LONGEST_MESSAGE = 1000
_READERS: dict[Any, Any] = {"int": int, "str": str, "float": float, "AnyGait": gait_from}


@dataclass(frozen=True, eq=False)
class Outcome:
    """Outcome of one start."""

    start: int
    status: str
    message: str
    guess: AnyGait
    gait: AnyGait
    efficiency: float = np.nan
    efficiency_error: float = np.nan
    distance: float = np.nan
    work: float = np.nan
    delta: float = np.nan
    iterations: int = 0
    seconds: float = 0.0
    cpu_seconds: float = 0.0
    value: float = np.nan
    value_error: float = np.nan

    def __post_init__(self) -> None:
        for name, usual in (("value", self.efficiency), ("value_error", self.efficiency_error)):
            if np.isnan(getattr(self, name)):
                object.__setattr__(self, name, usual)

    def __repr__(self) -> str:
        return (
            f"<Outcome of start {self.start}: {self.status}, d/W = {self.efficiency:.6g}, "
            f"{self.cpu_seconds:.1f} s>"
        )


def outcome_fields(outcome: Outcome) -> dict[str, Any]:
    """Plain fields (numbers, strings, lists) of an outcome."""
    gaits = {"guess": fields(outcome.guess), "gait": fields(outcome.gait)}
    return {**vars(outcome), "message": outcome.message[:_LONGEST_MESSAGE], **gaits}


def outcome_from(entry: dict[str, Any]) -> Outcome:
    """Outcome from `outcome_fields`."""
    if entry["status"] not in STATUSES:
        raise ValueError(f"no status: {entry['status']}")
    types = {field.name: field.type for field in dataclasses.fields(Outcome)}
    return Outcome(**{name: _READERS[kind](entry[name]) for name, kind in types.items()})


def counts(outcomes: Sequence[Outcome]) -> dict[str, int]:
    """Number of starts of each status that occurs."""
    return {s: n for s in STATUSES if (n := sum(o.status == s for o in outcomes))}
