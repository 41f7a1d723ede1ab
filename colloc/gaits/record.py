"""Joint angles over time, from a file as robots, loggers and spreadsheets write it.

Columns are known by their names: numbers of joints, whatever their order, units, times. What cannot
be told is refused, not guessed; what was taken is said in one line.
"""

from __future__ import annotations

import re
from datetime import datetime
from pathlib import Path
from typing import NamedTuple

import numpy as np

from colloc.system.csv_table import Table, check_size, is_blank, read_table
from colloc.system.errors import ProblemError

FEWEST = 6
"""Samples of a gait, and of each of its periods."""
_LARGEST = 2 * np.pi
"""An angle beyond it is taken for one in degrees."""
_ANGLES = {
    "rad": 1.0, "rads": 1.0, "radian": 1.0, "radians": 1.0, "mrad": 1e-3, "deg": np.pi / 180,
    "degs": np.pi / 180,
    "degree": np.pi / 180, "degrees": np.pi / 180, "grad": np.pi / 180, "°": np.pi / 180,
}  # fmt: skip
"""Units of angles [rad]; Grad is German for degrees."""
_NOT_READ = {
    "rev",
    "revs",
    "revolutions",
    "turn",
    "turns",
    "gon",
    "gons",
    "tick",
    "ticks",
    "counts",
}
"""Words of names that say another unit."""
_TIMES = {
    "s": 1.0, "sec": 1.0, "secs": 1.0, "second": 1.0, "seconds": 1.0, "ms": 1e-3, "msec": 1e-3,
    "millis": 1e-3,
    "milliseconds": 1e-3, "us": 1e-6, "µs": 1e-6, "usec": 1e-6, "micros": 1e-6,
    "microseconds": 1e-6, "ns": 1e-9, "nsec": 1e-9,
    "nsecs": 1e-9, "nanosec": 1e-9, "nanosecs": 1e-9, "nanoseconds": 1e-9, "min": 60.0,
}  # fmt: skip
"""Units of time [s]."""
_WORDS = {
    "time": "t|time|timestamp|stamp|zeit|temps|tiempo|tempo|clock|elapsed|datetime|date|uptime|n?secs|nanosecs?",  # noqa: E501
    "other": "vel.*|speeds?|rate|dot|qd|dq|omega|effort|torques?|tau|load|volt.*|temp.*|power|acc.*|pwm|force|currents?|err.*|"  # noqa: E501
    "imu|gyro|battery|per|nm|m[va]|rpm|moving|status|cov.*",
    "count": "index|idx|samples?|frame|step|seq|nr|no|count(er)?|id|row|unnamed|attempt",
    "angle": "positions?|pos|angles?",
    "commanded": "cmd|command(ed)?|target|goal|setpoint|des(ired)?|ref(erence)?|sp",
    "link": "links?|segments?|heading|abs(olute)?|orientation",
    "end": "head|tail|front|rear|back",
}
"""What words of the names of columns speak of, as regular expressions; "other" are columns that are
no angles."""
_CALLED = "call columns of joints joint_1 (at the tail), joint_2 and so on"
"""What makes an order plain."""
_ROUNDED = 0.15
"""Share of steps of time that differ from the usual one, from which equal steps were rounded."""
_MOST = 5_000
"""Samples; of more, every second, third ... is taken."""
_CENTRED = np.radians(20)
"""All joints are centred within it of a right angle, or a straight one: so are servos that know no
negative angles."""


class Record(NamedTuple):
    """Joint angles over time."""

    time: np.ndarray
    """``(n_time,)``, from 0, in the file's unit; it does not fall."""
    angles: np.ndarray
    """``(n_joint, n_time)`` [rad], from tail to head."""
    degrees: bool
    """Whether all were given in degrees."""
    period: float | None
    """That the file states, in its unit of time."""
    taken: str
    """What was read, and what was left out, in one sentence without its full stop."""
    centre: int
    """About what servos are centred, to the next right angle [degrees]; 0 where that is nothing to
    be asked about."""


class _Column(NamedTuple):
    at: int
    name: str
    words: tuple[str, ...]
    """Letters and numbers of the name and the unit below it, in lower case."""

    @property
    def numbers(self) -> tuple[int, ...]:
        """Of the name, or the one letter that stands for one."""
        return tuple(int(word) for word in self.words if word.isdecimal())

    @property
    def skeleton(self) -> tuple[str, ...]:
        """What names of one set of columns have in common."""
        return tuple(
            "#" if word.isdecimal() else word for word in self.words if word not in _ANGLES
        )

    def speaks_of(self, what: str) -> bool:
        """Whether a word of the name is of a kind."""
        return any(re.fullmatch(_WORDS[what], word) for word in self.words)

    @property
    def kind(self) -> str:
        """What the column holds, by its name: "time", "count", "other", "place", or "angle" if
        nothing else."""
        words, unit = set(self.words), self.words[-2:]
        if self.speaks_of("time") or (words and words <= set(_TIMES)):
            return "time"
        after_number = len(unit) > 1 and unit[0].isdecimal() and unit[1] in ("w", "a", "v", "c")
        rate = re.search(r"(rad|deg|°|rev)\w*\s*/\s*s|n·m", self.name, re.I)
        if (
            self.speaks_of("other")
            or self.words[:1] == ("v",)
            or unit == ("n", "m")
            or after_number
            or rate
        ):
            return (
                "angle" if self.speaks_of("angle") and "current" in words and not rate else "other"
            )
        if not words or (self.speaks_of("count") and not self.speaks_of("angle")):
            return "count"
        return "place" if words & {"x", "y", "z"} and not words & {"joint", "angle"} else "angle"


def _column(at: int, name: str, unit: str) -> _Column:
    text = re.sub(r"(?<=[a-z])(?=[A-Z])", " ", f"{name} {unit}")
    return _Column(
        at, f"{name} {unit}".strip(), tuple(re.findall(r"[^\W\d_]+|\d+|°", text.lower()))
    )


def read_record(path: Path, n_joint: int, *, degrees: bool = False) -> Record:
    """Joint angles over time of a file, with what was taken in words.

    Parameters
    ----------
    path : Path
        Of a text file with a line for each instant.
    n_joint : int
        That the body has.
    degrees : bool
        Whether angles are degrees of which the file does not say what they are.

    Raises
    ------
    ProblemError
        If the file is no such record, or one that could be read in several ways; it names line,
        column and cure.
    """
    table = read_table(path)
    check_size(path, table, FEWEST)
    numeric = np.isfinite(table.values).any(axis=0)
    columns = (
        [_column(j, *both) for j, both in enumerate(zip(table.names, table.units, strict=True))]
        if table.names
        else []
    )
    if columns:
        clock = _clock(table, columns)
        joints, how = _joints(
            path,
            [column for column in columns if numeric[column.at] and column.at not in clock],
            n_joint,
        )
        left = [
            c.name
            for c in columns
            if c.at not in clock and c.at not in {j.at for j in joints} and c.name
        ]
    else:
        width = table.values.shape[1]
        clock, how, left = [0] * (width != n_joint), "in the file's order, as it has no names", []
        if width not in (n_joint, n_joint + 1):
            raise ProblemError(_count(path, width - 1, n_joint))
        joints = [_Column(j, f"column {j + 1}", ()) for j in range(width - n_joint, width)]
    time, unit = _times(path, table, columns, clock)
    rows, said = _rows(
        path,
        table,
        [time, *(table.values[:, c.at] for c in joints)],
        [*clock[:1], *(c.at for c in joints)],
    )
    if re.search(r"^#\s*ramp_s:", table.preamble, re.M):
        rows = rows[time[rows] >= 0]
        said.append("the way into the gait, before time 0, left out")
    time = time[rows]
    falls = np.flatnonzero(np.diff(time) < 0)
    if falls.size:
        where = (
            f"the times{' in the first column' * (not columns)} fall after line "
            f"{table.lines[rows[falls[0]]]}"
        )
        raise ProblemError(f"{path}: {where}: give one record, its lines in the order of time.")
    if time[-1] == time[0]:
        raise ProblemError(
            f"{path}: all times are {time[0]:g}: give a column of times that rise, or none for "
            f"equal steps."
        )
    time, even = _even_steps(time)
    if (every := -(-rows.size // _MOST)) > 1:
        time, rows = time[::every], rows[::every]
        said.append(f"of {len(table.lines)} rows, one in {every} taken")
    angles, in_degrees = _radians(path, table, joints, rows, degrees)
    unwrapped = np.unwrap(angles, discont=1.5 * np.pi, axis=1)
    unwrapped -= 2 * np.pi * np.round(unwrapped.mean(axis=1, keepdims=True) / (2 * np.pi))
    turned = [joints[j].name for j in np.flatnonzero(np.abs(unwrapped - angles).max(axis=1) > 1.0)]
    mixed = (
        ", ".join(joints[j].name for j in np.flatnonzero(in_degrees))
        if not in_degrees.all()
        else ""
    )
    in_words = (
        "degrees" if in_degrees.all() else f"radians (but {mixed} degrees)" if mixed else "radians"
    )
    facts = [
        f"read {n_joint} joint{'s' * (n_joint > 1)} {how} from {_listed(joints)}, {in_words}",
        f"time {unit}{even}",
        *table.notes,
        *said,
        *([f"whole turns taken out of {', '.join(turned)}"] if turned else []),
        *(
            [
                f"left out: {', '.join(left[:3])}"
                + (f" and {len(left) - 3} more" if len(left) > 3 else "")
            ]
            if left
            else []
        ),
    ]
    stated = re.search(r"^#\s*period_s:\s*([\d.eE+-]+)\s*$", table.preamble, re.M)
    period = float(stated[1]) if stated and unit == "in s" else None
    return Record(
        time - time[0],
        unwrapped,
        bool(in_degrees.all()),
        period,
        "; ".join(facts),
        _centre(unwrapped),
    )


def _count(path: Path, found: int, n_joint: int) -> str:
    many = (
        f"{found} column{'s' * (found != 1)} of angles, and the body has {n_joint} "
        f"joint{'s' * (n_joint != 1)}"
    )
    return f"{path} has {many}: write a column of times, then one for each joint; {_CALLED}."


def _listed(columns: list[_Column]) -> str:
    return " ... ".join(dict.fromkeys((columns[0].name, columns[-1].name)))


def _clock(table: Table, columns: list[_Column]) -> list[int]:
    """The column of times, or of seconds and what they lack; none for equal steps."""
    varies = [column for column in columns if len({row[column.at] for row in table.cells}) > 1]
    times = [column for column in varies if column.kind == "time"]
    whole = next((c for c in times if {"sec", "secs"} & set(c.words)), None)
    part = next((c for c in times if {"nanosec", "nanosecs", "nsec", "nsecs"} & set(c.words)), None)
    if whole and part:
        return [whole.at, part.at]
    rising = [column for column in varies if (np.diff(table.values[:, column.at]) > 0).all()]
    counts = [column for column in rising if column.kind == "count"]
    # called in another language
    others = [column for column in rising if column.at == 0 and not column.numbers]
    return [column.at for column in (times or counts or others)[:1]]


def _joints(path: Path, columns: list[_Column], n_joint: int) -> tuple[list[_Column], str]:
    """The columns of the joints from tail to head, and by what they are known."""
    angles = [column for column in columns if column.kind == "angle"]
    places = [column for column in columns if column.kind == "place"]
    if not angles and places:
        raise ProblemError(
            f"{path}: its columns {_listed(places)} look like positions of points of the body: "
            f"turn them into joint angles "
            "first, each the direction of a link less that of the link behind it."
        )
    if len(angles) > n_joint:
        measured = [column for column in angles if not column.speaks_of("commanded")]
        angles = measured if len(measured) >= n_joint else angles
    sets: dict[tuple[str, ...], list[_Column]] = {}
    for column in angles:
        sets.setdefault(column.skeleton, []).append(column)
    if len({column.skeleton[:-1] for column in angles}) == 1 and all(
        len(column.skeleton[-1]) == 1 for column in angles
    ):
        sets = {(): angles}  # known by a letter
    numbered = [each for key, each in sets.items() if "#" in key or (not key and n_joint > 1)]
    for each in numbered:
        if len({c.words for c in each}) < len(each):
            raise ProblemError(f"{path}: two columns are called {each[0].name}: {_CALLED}.")
        each.sort(key=lambda column: (column.numbers, column.words))
    full = [each for each in numbered if len(each) == n_joint]
    if len(full) > 1:
        both = f"{_listed(full[0])}, and {_listed(full[1])}"
        raise ProblemError(
            f"{path}: two sets of columns may be the {n_joint} joints, {both}: leave one of "
            f"them out."
        )
    beyond = next((each for each in numbered if len(each) == n_joint + 1), None)
    links = (
        full[0]
        if full and full[0][0].speaks_of("link") and "joint" not in full[0][0].words
        else None
    )
    links = links or (None if full else beyond)
    if links:
        raise ProblemError(
            f"{path}: {_listed(links)} are {len(links)} columns of angles, and the body has "
            f"{n_joint} joints: if they are "
            f"directions of links, write what each has beyond the one behind it; {_CALLED}."
        )
    if full:
        return full[0], "by name"
    if len(angles) != n_joint:
        raise ProblemError(_count(path, len(angles), n_joint))
    turned = any(
        [column.numbers for column in each] != [c.numbers for c in angles if c in each]
        for each in numbered
    )
    if turned or any(column.speaks_of("end") for column in angles):
        names = ", ".join(column.name for column in angles)
        raise ProblemError(f"{path}: the order of the columns {names} is not clear: {_CALLED}.")
    return angles, "in the file's order, tail to head,"


def _times(
    path: Path, table: Table, columns: list[_Column], clock: list[int]
) -> tuple[np.ndarray, str]:
    """Times of all rows, from a first one, and their unit in words."""
    if not clock:
        return np.arange(
            len(table.lines), dtype=float
        ), "in equal steps, a sample each, as no column holds it"
    if len(clock) > 1:
        whole, part = table.values[:, clock].T
        return whole - whole[0] + 1e-9 * part, "in s"
    time = table.values[:, clock[0]]
    if not np.isfinite(time).any():
        stamps = [_stamp(row[clock[0]]) for row in table.cells]
        if stamps[0] is None:
            raise ProblemError(
                f"{path}, line {table.lines[0]}: the time {table.cells[0][clock[0]]!r} is no "
                f"number, and no date and time as "
                "2026-01-31T12:00:00.05: write seconds."
            )
        return np.array(
            [np.nan if stamp is None else stamp - stamps[0] for stamp in stamps]
        ), "of day, in s"
    if not columns:
        return time, "in the first column"
    column = columns[clock[0]]
    if column.kind == "count":
        return time, f"in samples ({column.name or 'the first column'})"
    unit = next((word for word in reversed(column.words) if word in _TIMES), "")
    return time, f"in {unit}" if unit else f"from {column.name}"


def _stamp(text: str) -> float | None:
    """Seconds that a date and time, or a time of day, stands for."""
    text = text.replace(",", ".")
    if re.match(r"\d{1,2}:", text):
        text = f"2000-01-01 {text:0>8}"
    try:
        return datetime.fromisoformat(text).timestamp()
    except ValueError:
        return None


def _rows(
    path: Path, table: Table, values: list[np.ndarray], at: list[int]
) -> tuple[np.ndarray, list[str]]:
    """Which rows are samples, and what is said of the others; `at` are the columns of the last
    values."""
    together = np.array(values)
    whole = np.isfinite(together).all(axis=0)
    for k in np.flatnonzero(~whole):
        for j, value in zip(reversed(at), reversed(together[:, k]), strict=False):
            if not np.isfinite(value) and not is_blank(cell := table.cells[k][j]):
                name = table.names[j] if table.names else j + 1
                raise ProblemError(
                    f"{path}, line {table.lines[k]}, column {name}: {cell[:40]!r} is no number: "
                    f"mend it, or leave the line out."
                )
    rows = np.flatnonzero(whole)
    if 2 * rows.size < whole.size or rows.size < FEWEST:
        first = table.lines[int(np.flatnonzero(~whole)[0])]
        raise ProblemError(
            f"{path}: only {rows.size} of {whole.size} lines have a number in each of the columns "
            f"that are needed (line "
            f"{first} has not), and at least {FEWEST} are: write all joints in every line."
        )
    blank = int((~whole).sum())
    said = [f"{blank} row{'s' * (blank > 1)} with blank cells left out"] if blank else []
    again = np.concatenate([[False], (np.diff(together[:, rows], axis=1) == 0).all(axis=0)])
    if again.any():
        equal = int(again.sum())
        said.append(f"{equal} row{'s' * (equal > 1)} like the one before left out")
    return rows[~again], said


def _even_steps(time: np.ndarray) -> tuple[np.ndarray, str]:
    """Times without what rounding did to equal steps, and that in words."""
    steps = np.diff(time)
    unit = steps[steps > 0].min()
    whole = np.round(steps / unit)
    uneven = np.mean(whole != np.median(whole))  # a few are samples that were dropped
    if np.abs(steps / unit - whole).max() > 1e-3 or not (whole.min() == 0 or uneven > _ROUNDED):
        return time, ""
    count = np.arange(time.size)
    step, begin = np.polyfit(count, time - time[0], 1)
    line = begin + step * count
    if np.ptp(time - time[0] - line) > 1.2 * unit:
        return time, ""
    return line, f", stamps rounded to {unit:.3g} taken as equal steps of {step:.4g}"


def _radians(
    path: Path, table: Table, joints: list[_Column], rows: np.ndarray, degrees: bool
) -> tuple[np.ndarray, np.ndarray]:
    """Angles in radians ``(n_joint, n_time)``, and which were degrees. `ProblemError` if they are
    something else."""
    for name, word in (
        (column.name, word) for column in joints for word in column.words if word in _NOT_READ
    ):
        raise ProblemError(
            f"{path}: the column {name} holds {word}: write degrees or radians, and say so in "
            f"its name."
        )
    stated = [
        next((_ANGLES[word] for word in reversed(c.words) if word in _ANGLES), 0.0) for c in joints
    ]
    if degrees and 1.0 in stated:
        raise ProblemError(
            f"{path}: the column {joints[stated.index(1.0)].name} holds radians: leave out "
            f"--degrees (degrees=True)."
        )
    if re.search(r"in_?degrees\s*=\s*yes|angles are in degrees", table.preamble, re.I):
        degrees = True
    if not degrees and 0.0 in stated and max(stated) > 0.0:
        silent, told = joints[stated.index(0.0)].name, joints[stated.index(max(stated))].name
        raise ProblemError(
            f"{path}: the column {told} says its unit, and {silent} does not: call it {silent}_deg "
            f"or {silent}_rad."
        )
    units = np.array([unit or (np.pi / 180 if degrees else 1.0) for unit in stated])
    raw = table.values[rows][:, [column.at for column in joints]].T
    largest, of = np.abs(raw).max(axis=1), np.isclose(units, np.pi / 180)
    worst = int((largest * units).argmax())
    if largest[worst] > 360 and raw.min() >= 0:
        raise ProblemError(
            f"{path}: {joints[worst].name} goes up to {largest[worst]:.4g}, like ticks or pulses "
            f"of a servo: write "
            "degrees, such as (ticks - 512) * 300 / 1023 or (ticks - 2048) * 360 / 4096 for "
            "Dynamixel, and "
            "(microseconds - 1500) * 0.09 for pulses."
        )
    if largest[worst] * units[worst] > _LARGEST:
        if of[worst]:
            if largest[worst] <= 720:
                return raw * units[:, None], of
            raise ProblemError(
                f"{path}: {joints[worst].name} has an angle of {largest[worst]:.4g} degrees: is it "
                f"the right column?"
            )
        raise ProblemError(
            f"{path} has an angle of {largest[worst]:.4g} rad ({joints[worst].name}): if angles "
            f"are degrees, say so "
            "(degrees=True, --degrees)."
        )
    return raw * units[:, None], of


def _centre(angles: np.ndarray) -> int:
    """The angle about which all joints are centred as servos are, to the next right angle
    [degrees]."""
    centres = 0.5 * (angles.max(axis=1) + angles.min(axis=1))
    near = np.round(np.median(centres) / (np.pi / 2)) * (np.pi / 2)
    return (
        int(np.degrees(near).round())
        if centres.size > 1 and np.abs(centres - near).max() < _CENTRED
        else 0
    )
