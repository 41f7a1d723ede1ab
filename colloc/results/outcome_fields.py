"""Outcomes of starts as plain dictionaries (JSON), and back: every number to the bit, and every gait as it is."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from typing import Any

from colloc.gaits.gait_fields import fields as gait_fields
from colloc.gaits.gait_fields import gait_from
from colloc.results.distinct_optima import STATUSES, Outcome

_LONGEST_MESSAGE = 1000
_GAITS, _TEXTS, _COUNTS = ("guess", "gait"), ("status", "message"), ("start", "iterations")
_NUMBERS = tuple(f.name for f in dataclasses.fields(Outcome) if f.name not in (*_GAITS, *_TEXTS, *_COUNTS))
_EARLIER = {"value": float("nan"), "value_error": float("nan")}
"""What earlier rows do not state: they know of the efficiency only."""


def outcome_fields(outcome: Outcome) -> dict[str, Any]:
    """The fields of an outcome as numbers (also NaN), strings and lists."""
    plain = {name: getattr(outcome, name) for name in (*_COUNTS, *_TEXTS, *_NUMBERS)}
    return plain | {"message": outcome.message[:_LONGEST_MESSAGE]} | {g: gait_fields(getattr(outcome, g)) for g in _GAITS}


def outcome_from(entry: dict[str, Any]) -> Outcome:
    """The outcome that `outcome_fields` described. KeyError, TypeError, ValueError or ProblemError if it did not."""
    entry = _EARLIER | entry
    if entry["status"] not in STATUSES:
        raise ValueError(f"no status: {entry['status']}")
    kinds: list[tuple[Callable, tuple[str, ...]]] = [(int, _COUNTS), (str, _TEXTS), (float, _NUMBERS), (gait_from, _GAITS)]
    return Outcome(**{name: kind(entry[name]) for kind, names in kinds for name in names})
