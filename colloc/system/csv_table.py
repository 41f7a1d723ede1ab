"""Tables of numbers in text files, as spreadsheets, loggers and colloc itself write them."""

from __future__ import annotations

import csv
import re
from collections import Counter
from pathlib import Path
from typing import NamedTuple

import numpy as np

from colloc.system.errors import ProblemError

_DELIMITERS = {",": "commas", ";": "semicolons", "\t": "tabs", " ": "spaces", "|": "bars"}
"""And what they are called; spaces count as one, however many there are."""
_BLANK = frozenset(
    ("", "nan", "na", "n/a", "#n/a", "null", "none", "nil", "-", "--", "?", "inf", "+inf", "-inf")
)
"""What loggers write where there is no number."""
_COMMENT = re.compile(r"\s*(#|%|//)[\s#%/]*")
_MANY = 500
"""Lines, from which delimiter and width are told."""
_LARGEST = 1e150
"""Sums of squares of smaller numbers are finite."""


class Table(NamedTuple):
    """Numbers of a text file, with what stands about them."""

    names: list[str]
    """Of the columns; none if the file does not say."""
    units: list[str]
    """Of a row below the names; as many empty ones if there is none."""
    values: np.ndarray
    """``(n_row, n_column)``; NaN where there is no number."""
    cells: list[list[str]]
    """The same as text."""
    lines: list[int]
    """Of the rows in the file, from 1."""
    preamble: str
    """What stands before the names, and comments."""
    notes: list[str]
    """What a person should know of the format, in words."""


def read_table(path: Path) -> Table:
    """Everything that a text file of numbers holds, whatever its encoding, delimiters, decimal
    marks and preamble.

    Blank lines and comments (``#``, ``%``, ``//``) are left out, and a last line that was cut
    short. `ProblemError` if the file cannot be read, or its rows are not of one width.
    """
    rows: list[
        tuple[int, list[str], bool]
    ] = []  # number of the line, its cells, whether it is a comment
    lines = _text(path).splitlines()
    plain = [line for line in lines[: 4 * _MANY] if line.strip() and not _COMMENT.match(line)][
        -_MANY:
    ]
    delimiter = max(_DELIMITERS, key=lambda mark: _fit(plain, mark))
    for k, line in enumerate(lines, 1):
        if cells := _split(_COMMENT.sub("", line, count=1), delimiter):
            rows.append((k, cells, _COMMENT.match(line) is not None))
    usual = [cells for _, cells, comment in rows[: 4 * _MANY] if not comment][-_MANY:]
    if usual and all(cells[-1] == "" for cells in usual):  # a delimiter at the end of every line
        rows = [
            (k, cells[:-1] if cells[-1] == "" else cells, comment) for k, cells, comment in rows
        ]
        usual = [cells[:-1] for cells in usual]
    width = Counter(map(len, usual)).most_common(1)[0][0] if usual else 0
    fitting = [row for row in usual if len(row) == width]
    numeric = [
        j
        for j in range(width)
        if 2 * sum(_number(row[j]) is not None for row in fitting) >= len(fitting)
    ]

    def is_data(cells: list[str], comment: bool) -> bool:
        """Whether a row looks like those that most are like; a cell of it may be spoilt."""
        if comment or len(cells) != width:
            return False
        told = [_number(cells[j]) is not None or is_blank(cells[j]) for j in numeric]
        return (
            2 * sum(told) >= len(told)
            and told[:1] == [True]
            and any(_number(cells[j]) is not None for j in numeric)
        )

    first = next(
        (i for i, (_, cells, comment) in enumerate(rows) if is_data(cells, comment)), len(rows)
    )
    if [cells for _, cells, _ in rows[first : first + 1]] == [[str(j) for j in range(width)]]:
        after = _number(rows[first + 1][1][0]) if first + 1 < len(rows) else None
        first += after is not None and after <= 0  # columns that are numbered, not named
    names, units = _names(path, rows[:first], width)
    notes = [f"{_DELIMITERS[delimiter]} between"] if delimiter != "," else []
    data = [(k, cells) for k, cells, comment in rows[first:] if not comment]
    if len(data) > 1 and len(data[-1][1]) < width:
        notes.append(f"line {data.pop()[0]}, the last one, cut short, left out")
    for k, cells in data:
        if len(cells) != width:
            raise ProblemError(
                f"{path}, line {k}, has {len(cells)} cell{'s' * (len(cells) != 1)}, and the lines "
                f"about it have {width}: mend "
                "it, or leave it out."
            )
        if cells == names:
            raise ProblemError(
                f"{path}, line {k}, names the columns again: the file holds two records; give one "
                f"of them."
            )
    if any("," in cell for _, cells in data[:_MANY] for cell in cells if _number(cell) is not None):
        notes.append(
            "commas in numbers"
            if any("." in cell for _, cells in data[:_MANY] for cell in cells)
            else "decimal commas"
        )
    numbers = [
        [np.nan if (x := _number(cell)) is None else x for cell in cells] for _, cells in data
    ]
    values = np.array(numbers).reshape(len(data), width)
    before = "\n".join(lines[: rows[first][0] - 1 if first < len(rows) else None])
    return Table(
        names, units, values, [cells for _, cells in data], [k for k, _ in data], before, notes
    )


def csv_table(path: Path, fewest: int) -> tuple[list[str], np.ndarray]:
    """Names of the columns, in lower case, or none, and the numbers ``(n_row, n_column)`` of a file
    (`read_table`).

    `ProblemError` if it cannot be read, a cell is no finite number, or there are fewer than
    `fewest` rows of two columns or more.
    """
    table = read_table(path)
    check_size(path, table, fewest)
    for k, row in enumerate(table.values, 1):
        if not (np.abs(row) < _LARGEST).all():
            text = ",".join(table.cells[k - 1])[:60]
            raise ProblemError(
                f"{path}, sample {k}: {text!r} is not {row.size} finite numbers below 1e150."
            )
    return [name.lower() for name in table.names], table.values


def check_size(path: Path, table: Table, fewest: int) -> None:
    """A `ProblemError` if a table has fewer than `fewest` rows of two columns or more."""
    rows, width = table.values.shape
    if rows < fewest:
        raise ProblemError(
            f"{path} holds {rows} samples: at least {fewest} are needed, a line each."
        )
    if width < 2:
        raise ProblemError(f"{path} has one column: at least two are needed, with commas between.")


def _text(path: Path) -> str:
    try:
        content = path.read_bytes()
    except OSError as error:
        raise ProblemError(f"cannot read {path}: {error.strerror or error}.") from None
    marks = {b"\xff\xfe": "utf-16", b"\xfe\xff": "utf-16", b"\xef\xbb\xbf": "utf-8-sig"}
    named = next(
        (encoding for mark, encoding in marks.items() if content.startswith(mark)), "utf-8"
    )
    for encoding in (named, "cp1252"):  # the degree sign of a spreadsheet on Windows
        try:
            text = content.decode(encoding)
        except UnicodeDecodeError:
            continue
        if not re.search(r"[\x00-\x08\x0e-\x1f]", text) and text.lstrip()[:1] not in ("{", "<"):
            return text
    raise ProblemError(
        f"{path} is no text of numbers in UTF-8: a CSV file is read here, lines of numbers with "
        f"commas between, such as a "
        "spreadsheet (save as CSV) or colloc export writes."
    )


def _split(line: str, delimiter: str) -> list[str]:
    """Its cells; none of a blank line."""
    if delimiter == " ":
        return line.split()
    try:
        cells = [
            cell.strip()
            for cell in next(csv.reader([line], delimiter=delimiter, skipinitialspace=True), [])
        ]
    except csv.Error:  # a cell of more than 100 kB
        return [line]
    return cells if any(cells) else []


def _fit(lines: list[str], delimiter: str) -> tuple[float, float]:
    """Share of cells that are numbers, and how many are, in the line in the middle of all by
    that."""
    rows = [_split(line, delimiter) for line in lines]
    counts = sorted(
        (sum(_number(cell) is not None for cell in row) / len(row), len(row)) for row in rows if row
    )
    return counts[len(counts) // 2] if counts else (0.0, 0.0)


def is_blank(cell: str) -> bool:
    """Whether a cell says that there is no number."""
    return cell.lower() in _BLANK


def _number(cell: str) -> float | None:
    """What a cell says, with a decimal point or comma; None if it is no finite number."""
    try:
        number = float(cell)
    except ValueError:
        cell = cell.replace("\N{MINUS SIGN}", "-")
        if "," in cell:
            decimal = "." if cell.rfind(".") > cell.rfind(",") or cell.count(",") > 1 else ","
            cell = cell.replace("." if decimal == "," else ",", "").replace(",", ".")
        if not re.fullmatch(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?", cell):
            return None
        number = float(cell)
    return number if abs(number) < np.inf and "_" not in cell else None


def _names(
    path: Path, rows: list[tuple[int, list[str], bool]], width: int
) -> tuple[list[str], list[str]]:
    """Names of the columns and their units, from the lines before the first row of numbers."""
    plain = [(k, cells) for k, cells, comment in rows if not comment]
    fitting = [cells for _, cells in plain if len(cells) == width]
    if rows and not fitting and len(rows[-1][1]) == width > 1:
        fitting = [rows[-1][1]]  # the names are a comment, as NumPy and ROS write them
    elif plain and len(plain[-1][1]) != width and (fitting or len(plain[-1][1]) > 1):
        k, cells = plain[-1]
        raise ProblemError(
            f"{path}, line {k}, has {len(cells)} cells, and the lines below have {width}: write a "
            f"name for each column and a "
            "number for each name, with decimal points, or semicolons between, if numbers have "
            "decimal commas."
        )
    units = [""] * width
    if len(fitting) > 1 and all(
        not cell or re.fullmatch(r"[\[(]?[°µ\w/·%-]{0,12}[\])]?", cell) for cell in fitting[-1]
    ):
        units = fitting.pop()
    return (fitting[-1] if fitting else []), units
