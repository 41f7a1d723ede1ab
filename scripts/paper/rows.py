"""Rows of the table of printed and computed numbers, and their verdicts."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Row:
    """A line of the table."""

    what: str
    printed: str
    computed: str
    error: str
    verdict: str


def number_row(
    what: str, printed: str, computed: float, error: float, source: str, unit: str = ""
) -> Row:
    """A row for a printed number; `error` is absolute, `source` says where it comes from."""
    value = float(printed)
    decimals = len(printed.partition(".")[2])
    half_digit = 0.5 * 10.0**-decimals
    if abs(computed - value) <= half_digit + error:
        verdict = "agrees"
    else:
        verdict = f"printed value {100 * (value / computed - 1):+.1f} %" if computed else "differs"
    digits = 6 if error == 0 else int(np.clip(np.ceil(-np.log10(error)) + 1, 2, 9))
    return Row(
        what, f"{printed}{unit}", f"{computed:.{digits}f}{unit}", f"{error:.1g} ({source})", verdict
    )


def statement_row(what: str, printed: str, computed: str, holds: bool, error: str = "-") -> Row:
    """A row for a range or a statement, which holds or does not."""
    return Row(what, printed, computed, error, "consistent" if holds else "does not hold")
