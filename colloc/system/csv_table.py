"""Tables of numbers in text files, as spreadsheets, loggers and colloc itself write them."""

import csv
import math
import re
from collections import Counter
from pathlib import Path
from typing import NamedTuple

import numpy as np

from colloc.system.errors import ProblemError

_DELIMITERS = {",": "commas", ";": "semicolons", "\t": "tabs", " ": "spaces", "|": "bars"}
_BLANK = re.compile(r"(nan|#?n/?a|null|none|nil|--?|\?|[+-]?inf)?", re.I)
_COMMENT = re.compile(r"^\s*(#|%|//)[\s#%/]*")
_THOUSANDS = re.compile(r"[+-]?(?!0,)\d{1,3}(,\d{3})*")
_MANY = 500  # lines from which delimiter and width are determined


class Table(NamedTuple):
    names: list[str]  # of the columns; empty if the file has none
    units: list[str]  # from a row below the names, else empty texts
    values: np.ndarray  # (n_row, n_column); NaN where there is no number
    cells: list[list[str]]  # the rows as text
    lines: list[int]  # line numbers of the rows, from 1
    preamble: str  # what precedes the names, and comments
    notes: list[str]  # remarks on the format for people


class _Row(NamedTuple):
    line: int
    cells: list[str]
    comment: bool


def read_table(path: Path) -> Table:
    """Read a text file of numbers, whatever its encoding, delimiter, decimal mark and preamble.

    Blank lines, comments (``#``, ``%``, ``//``) and a truncated last line are left out.
    `ProblemError` if the file cannot be read, or its rows have different widths.
    """
    lines = _text(path).splitlines()
    plain = [line for line in lines[: 4 * _MANY] if line.strip() and not _COMMENT.match(line)]

    def fit(delimiter):
        split = filter(None, (_split(line, delimiter) for line in plain[-_MANY:]))
        counts = sorted((sum(map(_is_number, row)) / len(row), len(row)) for row in split)
        return counts[len(counts) // 2] if counts else (0.0, 0.0)

    delimiter = max(_DELIMITERS, key=fit)
    rows = []
    for k, line in enumerate(lines, 1):
        if cells := _split(_COMMENT.sub("", line), delimiter):
            rows.append(_Row(k, cells, bool(_COMMENT.match(line))))
    usual = [row.cells for row in rows[: 4 * _MANY] if not row.comment][-_MANY:]
    if usual and all(cells[-1] == "" for cells in usual):  # a delimiter at the end of every line
        for row in rows:
            if not row.cells[-1]:
                row.cells.pop()
    width = Counter(map(len, usual)).most_common(1)[0][0] if usual else 0
    first = _first_row(rows, width, [cells for cells in usual if len(cells) == width])
    names, units = _names(path, rows[:first], width)
    notes = [f"{_DELIMITERS[delimiter]} between"] if delimiter != "," else []
    data = [row for row in rows[first:] if not row.comment]
    if len(data) > 1 and len(data[-1].cells) < width:
        notes.append(f"line {data.pop().line}, the last one, cut short, left out")
    for k, cells, _ in data:
        if len(cells) != width:
            raise ProblemError(
                f"{path}, line {k}, has {len(cells)} cell{'s' * (len(cells) != 1)}, and the lines "
                f"about it have {width}: mend it, or leave it out."
            )
        if cells == names:
            raise ProblemError(
                f"{path}, line {k}, names the columns again: the file holds two records; give one "
                f"of them."
            )
    texts, thousands = [row.cells for row in data], "commas of thousands"
    for j, column in enumerate(zip(*texts, strict=True)):
        written = [x for x in column if not is_blank(x)]
        if len({"," in x for x in written}) > 1 and all(map(_THOUSANDS.fullmatch, written)):
            notes += [thousands] * (thousands not in notes)
            for cells in texts:
                cells[j] = cells[j].replace(",", "")
    some = [x for row in data[:_MANY] for x in row.cells]
    if any("," in x for x in some if _is_number(x)):
        points = any("." in x for x in some)
        notes.append("commas in numbers" if points else "decimal commas")
    values = np.array([list(map(_number, row)) for row in texts]).reshape(len(data), width)
    before = "\n".join(lines[: rows[first].line - 1 if first < len(rows) else None])
    return Table(names, units, values, texts, [row.line for row in data], before, notes)


def _first_row(rows: list[_Row], width: int, usual: list[list[str]]) -> int:
    columns = zip(*usual, strict=True)
    numeric = [j for j, x in enumerate(columns) if 2 * sum(map(_is_number, x)) >= len(usual)]

    def is_data(row):
        if row.comment or len(row.cells) != width or not numeric:
            return False
        cells = [row.cells[j] for j in numeric]
        fits = [_is_number(x) or is_blank(x) for x in cells]
        return 2 * sum(fits) >= len(fits) and fits[0] and any(map(_is_number, cells))

    first = next((i for i, row in enumerate(rows) if is_data(row)), len(rows))
    if first + 1 < len(rows) and rows[first].cells == [str(j) for j in range(width)]:
        first += _number(rows[first + 1].cells[0]) <= 0  # columns that are numbered, not named
    return first


def csv_table(path: Path, fewest: int) -> tuple[list[str], np.ndarray]:
    """Read column names, in lower case, and numbers ``(n_row, n_column)``.

    `ProblemError` as `read_table`, for a cell that is no number, or too few rows.
    """
    table = read_table(path)
    check_size(path, table, fewest)
    for k, row in enumerate(table.values, 1):
        if not (np.abs(row) < 1e150).all():  # sums of squares are finite
            text = ",".join(table.cells[k - 1])[:60]
            raise ProblemError(
                f"{path}, sample {k}: {text!r} is not {row.size} finite numbers below 1e150."
            )
    return [name.lower() for name in table.names], table.values


def check_size(path: Path, table: Table, fewest: int) -> None:
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
    usual = "utf-16" if content[:2] in (b"\xff\xfe", b"\xfe\xff") else "utf-8-sig"
    for encoding in (usual, "cp1252"):  # a spreadsheet's degree sign on Windows
        try:
            text = content.decode(encoding)
        except UnicodeDecodeError:
            continue
        if not re.search(r"[\x00-\x08\x0e-\x1f]", text) and text.lstrip()[:1] not in ("{", "<"):
            return text
    raise ProblemError(
        f"{path} is no text of numbers in UTF-8: a CSV file is read here, lines of numbers with "
        f"commas between, such as a spreadsheet (save as CSV) or colloc export writes."
    )


def _split(line: str, delimiter: str) -> list[str]:
    if delimiter == " ":
        return line.split()
    try:
        row = next(csv.reader([line], delimiter=delimiter, skipinitialspace=True), [])
    except csv.Error:  # a cell of more than 100 kB
        return [line]
    cells = [x.strip() for x in row]
    return cells if any(cells) else []


def is_blank(cell: str) -> bool:
    return bool(_BLANK.fullmatch(cell))


def _is_number(cell: str) -> bool:
    return not math.isnan(_number(cell))


def _number(cell: str) -> float:
    try:
        number = float(cell)
    except ValueError:
        cell = cell.replace("\N{MINUS SIGN}", "-")
        if "," in cell:
            decimal = "." if cell.rfind(".") > cell.rfind(",") or cell.count(",") > 1 else ","
            cell = cell.replace("." if decimal == "," else ",", "").replace(",", ".")
        if not re.fullmatch(r"[+-]?(\d+\.?\d*|\.\d+)([eEdD][+-]?\d+)?", cell):
            return np.nan
        number = float(re.sub("[dD]", "e", cell))
    return number if abs(number) < np.inf and "_" not in cell else np.nan


def _names(path: Path, rows: list[_Row], width: int) -> tuple[list[str], list[str]]:
    plain = [row for row in rows if not row.comment]
    fitting = [row.cells for row in plain if len(row.cells) == width]
    if rows and not fitting and len(rows[-1].cells) == width > 1:
        fitting = [rows[-1].cells]  # the names are a comment, as NumPy and ROS write them
    elif plain and (count := len(plain[-1].cells)) != width and (fitting or count > 1):
        raise ProblemError(
            f"{path}, line {plain[-1].line}, has {count} cells, and the lines below have {width}: "
            f"write a name for each column and a number for each name, with decimal points, or "
            f"semicolons between, if numbers have decimal commas."
        )
    units = [""] * width
    unit = re.compile(r"[\[(]?[°µ\w/·%-]{0,12}[\])]?")
    if len(fitting) > 1 and all(not x or unit.fullmatch(x) for x in fitting[-1]):
        units = fitting.pop()
    return (fitting[-1] if fitting else []), units
