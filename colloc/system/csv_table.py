"""Tables of numbers in CSV files."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np

from colloc.system.errors import ProblemError


def csv_table(path: Path, fewest: int) -> tuple[list[str], np.ndarray]:
    """Names of the columns, in lower case, or none, and the numbers ``(n_row, n_column)`` of a file.

    Blank lines and those that begin with ``#`` are left out. `ProblemError` if it cannot be read, a line does not hold as many
    finite numbers as the first, or there are fewer than `fewest` of two columns or more.
    """
    try:
        text = path.read_text(encoding="utf-8-sig")
    except OSError as error:
        raise ProblemError(f"cannot read {path}: {error.strerror or error}.") from None
    except UnicodeDecodeError:
        raise ProblemError(
            f"{path} is no text in UTF-8: a CSV file is read here, lines of numbers with commas between, such as a spreadsheet "
            "or colloc export writes."
        ) from None
    rows = list(csv.reader(line for line in text.splitlines() if line.strip() and not line.startswith("#")))
    names = [name.strip().lower() for name in rows[0]] if rows and not _are_numbers(rows[0]) else []
    rows = rows[bool(names) :]
    if len(rows) < fewest:
        raise ProblemError(f"{path} holds {len(rows)} samples: at least {fewest} are needed, a line each.")
    width = len(names or rows[0])
    if width < 2:
        raise ProblemError(f"{path} has one column: at least two are needed, with commas between.")
    for k, row in enumerate(rows, 1):
        if len(row) != width or not _are_numbers(row):
            raise ProblemError(f"{path}, sample {k}: {','.join(row)[:60]!r} is not {width} finite numbers below 1e150.")
    return names, np.array(rows, dtype=float)


def _are_numbers(row: list[str]) -> bool:
    try:
        return all(abs(float(value)) < 1e150 for value in row)  # so that sums of squares are finite
    except ValueError:
        return False
