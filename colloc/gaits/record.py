"""Joint angles over time from a file of a robot, logger or spreadsheet, whose columns are known by
their names. What is ambiguous is refused; what was taken is said in one line."""

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
_LARGEST = 2 * np.pi  # an angle beyond it is one in degrees


_ANGLES = dict.fromkeys(("rad", "rads", "radian", "radians"), 1.0) | {"mrad": 1e-3}
# Grad is German for degrees
_ANGLES |= dict.fromkeys(("deg", "degs", "degree", "degrees", "grad", "°"), np.pi / 180)
_WORDS = {
    "time": "t|time|timestamp|stamp|zeit|temps|tiempo|tempo|clock|elapsed|datetime|date|uptime|n?secs|nanosecs?",  # noqa: E501
    "other": "vel.*|speeds?|rate|dot|qd|dq|omega|effort|torques?|tau|load|volt.*|temp.*|power|acc.*|pwm|force|currents?|err.*|"  # noqa: E501
    "imu|gyro|battery|per|nm|m[va]|rpm|moving|status|cov.*",
    "count": "index|idx|samples?|frame|step|seq|nr|no|count(er)?|id|row|unnamed|attempt",
    "angle": "positions?|pos|angles?",
    "commanded": "cmd|command(ed)?|target|goal|setpoint|des(ired)?|ref(erence)?|sp",
    "link": "links?|segments?|heading|abs(olute)?|orientation",
    "end": "head|tail|front|rear|back",
    "unit of time": "m?s|[uµn]s|secs?|seconds?|[mu]sec|nsecs?|nanosecs?|(milli|micro|nano)seconds|"
    "millis|micros|min",
    "unit not read": "revs?|revolutions|turns?|gons?|ticks?|counts",
}
"""Words in names of columns, as regular expressions; "other" are columns that are no angles."""
_CALLED = "call columns of joints joint_1 (at the tail), joint_2 and so on"
_ROUNDED = 0.15  # share of unequal time steps from which equal steps were rounded
_MOST = 5_000  # samples; of more, every second, third ... is taken
_CENTRED = np.radians(20)
"""All joints are centred within it of a right angle, or a straight one: so are servos that know no
negative angles."""


class Record(NamedTuple):
    time: np.ndarray  # (n_time,), from 0, in the file's unit; it does not fall
    angles: np.ndarray  # (n_joint, n_time) [rad], from tail to head
    degrees: bool  # whether all were given in degrees
    period: float | None  # that the file states, in its unit of time
    taken: str  # what was read, and what was left out, in one sentence without its full stop
    centre: int  # right angle about which servos are centred [degrees]; 0 if about none


class _Column(NamedTuple):
    at: int
    name: str
    words: tuple[str, ...]  # letters and numbers of the name and the unit below it, lower case

    @property
    def numbers(self) -> tuple[int, ...]:
        return tuple(int(word) for word in self.words if word.isdecimal())

    @property
    def skeleton(self) -> tuple[str, ...]:
        """The pattern of the names of one set of columns."""
        words = (word for word in self.words if word not in _ANGLES)
        return tuple("#" if word.isdecimal() else word for word in words)

    def last(self, what: str) -> str:
        """The last of its words that speaks of something; else empty."""
        return next((word for word in reversed(self.words) if re.fullmatch(_WORDS[what], word)), "")

    def speaks_of(self, what: str) -> bool:
        return bool(self.last(what))

    @property
    def kind(self) -> str:
        """One of "time", "count", "other", "place" and, if nothing else, "angle"."""
        words, unit = set(self.words), self.words[-2:]
        all_units = all(re.fullmatch(_WORDS["unit of time"], word) for word in words)
        if self.speaks_of("time") or (words and all_units):
            return "time"
        after_number = len(unit) > 1 and unit[0].isdecimal() and unit[1] in ("w", "a", "v", "c")
        rate = re.search(r"(rad|deg|°|rev)\w*\s*/\s*s|n·m", self.name, re.I)
        force = self.words[:1] == ("v",) or unit == ("n", "m")
        if self.speaks_of("other") or force or after_number or rate:
            current = self.speaks_of("angle") and "current" in words and not rate
            return "angle" if current else "other"
        if not words or (self.speaks_of("count") and not self.speaks_of("angle")):
            return "count"
        return "place" if words & {"x", "y", "z"} and not words & {"joint", "angle"} else "angle"


def _column(at: int, name: str, unit: str) -> _Column:
    name = f"{name} {unit}"
    words = re.findall(r"[^\W\d_]+|\d+|°", re.sub(r"(?<=[a-z])(?=[A-Z])", " ", name).lower())
    return _Column(at, name.strip(), tuple(words))


def read_record(path: Path, n_joint: int, *, degrees: bool = False) -> Record:
    """Read joint angles over time from a text file, a line a sample; `degrees` holds where the file
    does not name a unit.

    `ProblemError`, with line, column and cure, if the file is no such record, or an ambiguous one.
    """
    table = read_table(path)
    check_size(path, table, FEWEST)
    numeric, width = np.isfinite(table.values).any(axis=0), table.values.shape[1]
    pairs = zip(table.names, table.units, strict=True) if table.names else ()
    columns = [_column(j, *pair) for j, pair in enumerate(pairs)]
    if columns:
        clock = _clock(table, columns)
        others = [column for column in columns if column.at not in clock]
        joints, how = _joints(path, [column for column in others if numeric[column.at]], n_joint)
        left = [column.name for column in others if column not in joints and column.name]
    else:
        clock, how, left = [0] * (width != n_joint), "in the file's order, as it has no names", []
        if width not in (n_joint, n_joint + 1):
            raise ProblemError(_count(path, width - 1, n_joint))
        joints = [_Column(j, f"column {j + 1}", ()) for j in range(width - n_joint, width)]
    time, unit = _times(path, table, columns, clock)
    at = [column.at for column in joints]
    rows, notes = _rows(path, table, [time, *table.values[:, at].T], [*clock[:1], *at])
    if re.search(r"^#\s*ramp_s:", table.preamble, re.M):
        rows = rows[time[rows] >= 0]
        notes.append("the way into the gait, before time 0, left out")
    time = time[rows]
    if (falls := np.flatnonzero(np.diff(time) < 0)).size:
        raise ProblemError(
            f"{path}: the times{' in the first column' * (not columns)} fall after line "
            f"{table.lines[rows[falls[0]]]}: give one record, its lines in the order of time."
        )
    if time[-1] == time[0]:
        raise ProblemError(
            f"{path}: all times are {time[0]:g}: give a column of times that rise, or none for "
            f"equal steps."
        )
    time, even = _even_steps(time)
    if (every := -(-rows.size // _MOST)) > 1:
        time, rows = time[::every], rows[::every]
        notes.append(f"of {len(table.lines)} rows, one in {every} taken")
    angles, in_degrees = _radians(path, table, joints, rows, degrees)
    unwrapped = np.unwrap(angles, discont=1.5 * np.pi, axis=1)
    unwrapped -= 2 * np.pi * np.round(unwrapped.mean(axis=1, keepdims=True) / (2 * np.pi))
    if turned := _names(joints, np.abs(unwrapped - angles).max(axis=1) > 1.0):
        notes.append(f"whole turns taken out of {turned}")
    if left:
        more = f" and {len(left) - 3} more" if len(left) > 3 else ""
        notes.append(f"left out: {', '.join(left[:3])}{more}")
    angle_unit = "degrees"
    if not in_degrees.all():
        mixed = _names(joints, in_degrees)
        angle_unit = f"radians (but {mixed} degrees)" if mixed else "radians"
    plural = "s" * (n_joint > 1)
    facts = [f"read {n_joint} joint{plural} {how} from {_list_names(joints)}, {angle_unit}"]
    facts += [f"time {unit}{even}", *table.notes, *notes]
    stated = re.search(r"^#\s*period_s:\s*([\d.eE+-]+)\s*$", table.preamble, re.M)
    return Record(
        time - time[0],
        unwrapped,
        bool(in_degrees.all()),
        float(stated[1]) if stated and unit == "in s" else None,
        "; ".join(facts),
        _centre(unwrapped),
    )


def _names(columns: list[_Column], which: np.ndarray) -> str:
    return ", ".join(columns[j].name for j in np.flatnonzero(which))


def _list_names(columns: list[_Column]) -> str:
    return " ... ".join(dict.fromkeys((columns[0].name, columns[-1].name)))


def _count(path: Path, count: int, n_joint: int) -> str:
    return (
        f"{path} has {count} column{'s' * (count != 1)} of angles, and the body has {n_joint} "
        f"joint{'s' * (n_joint != 1)}: write a column of times, then one for each joint; {_CALLED}."
    )


def _clock(table: Table, columns: list[_Column]) -> list[int]:
    """The column of times, or those of seconds and nanoseconds; none for equal steps."""
    varies = [column for column in columns if len({row[column.at] for row in table.cells}) > 1]
    times = [column for column in varies if column.kind == "time"]
    whole = next((c for c in times if {"sec", "secs"} & set(c.words)), None)
    part = next((c for c in times if {"nanosec", "nanosecs", "nsec", "nsecs"} & set(c.words)), None)
    if whole and part:
        return [whole.at, part.at]
    rising = [column for column in varies if (np.diff(table.values[:, column.at]) > 0).all()]
    counts = [column for column in rising if column.kind == "count"]
    # times in another language
    others = [column for column in rising if column.at == 0 and not column.numbers]
    return [column.at for column in (times or counts or others)[:1]]


def _joints(path: Path, columns: list[_Column], n_joint: int) -> tuple[list[_Column], str]:
    """The columns of the joints from tail to head, and by what they are known."""
    angles = [column for column in columns if column.kind == "angle"]
    places = [column for column in columns if column.kind == "place"]
    if not angles and places:
        raise ProblemError(
            f"{path}: its columns {_list_names(places)} look like positions of points of the body: "
            f"turn them into joint angles first, each the direction of a link less that of the "
            f"link behind it."
        )
    if len(angles) > n_joint:
        measured = [column for column in angles if not column.speaks_of("commanded")]
        angles = measured if len(measured) >= n_joint else angles
    sets: dict[tuple[str, ...], list[_Column]] = {}
    for column in angles:
        sets.setdefault(column.skeleton, []).append(column)
    same = len({column.skeleton[:-1] for column in angles}) == 1
    if same and all(len(column.skeleton[-1]) == 1 for column in angles):
        sets = {(): angles}  # known by a letter
    numbered = [each for key, each in sets.items() if "#" in key or (not key and n_joint > 1)]
    for each in numbered:
        if len({c.words for c in each}) < len(each):
            raise ProblemError(f"{path}: two columns are called {each[0].name}: {_CALLED}.")
        each.sort(key=lambda column: (column.numbers, column.words))
    full = [each for each in numbered if len(each) == n_joint]
    if len(full) > 1:
        raise ProblemError(
            f"{path}: two sets of columns may be the {n_joint} joints, {_list_names(full[0])}, and "
            f"{_list_names(full[1])}: leave one of them out."
        )
    beyond = next((each for each in numbered if len(each) == n_joint + 1), None)
    if full:
        of_links = full[0][0].speaks_of("link") and "joint" not in full[0][0].words
        beyond = full[0] if of_links else None
    if beyond:
        raise ProblemError(
            f"{path}: {_list_names(beyond)} are {len(beyond)} columns of angles, and the body has "
            f"{n_joint} joints: if they are directions of links, write what each has beyond the "
            f"one behind it; {_CALLED}."
        )
    if full:
        return full[0], "by name"
    if len(angles) != n_joint:
        raise ProblemError(_count(path, len(angles), n_joint))
    in_order = all(each == [column for column in angles if column in each] for each in numbered)
    if not in_order or any(column.speaks_of("end") for column in angles):
        names = ", ".join(column.name for column in angles)
        raise ProblemError(f"{path}: the order of the columns {names} is not clear: {_CALLED}.")
    return angles, "in the file's order, tail to head,"


def _times(
    path: Path, table: Table, columns: list[_Column], clock: list[int]
) -> tuple[np.ndarray, str]:
    """Times of all rows, and their unit in words."""
    if not clock:
        samples = np.arange(len(table.lines), dtype=float)
        return samples, "in equal steps, a sample each, as no column holds it"
    if len(clock) > 1:
        whole, part = table.values[:, clock].T
        return whole - whole[0] + 1e-9 * part, "in s"
    time = table.values[:, clock[0]]
    if not np.isfinite(time).any():
        stamps = [_stamp(row[clock[0]]) for row in table.cells]
        if np.isnan(stamps[0]):
            raise ProblemError(
                f"{path}, line {table.lines[0]}: the time {table.cells[0][clock[0]]!r} is no "
                f"number, and no date and time as 2026-01-31T12:00:00.05: write seconds."
            )
        return np.array(stamps) - stamps[0], "of day, in s"
    if not columns:
        return time, "in the first column"
    column = columns[clock[0]]
    if column.kind == "count":
        return time, f"in samples ({column.name or 'the first column'})"
    unit = column.last("unit of time")
    return time, f"in {unit}" if unit else f"from {column.name}"


def _stamp(text: str) -> float:
    """Seconds of a date and time, or a time of day; NaN if it is none."""
    text = text.replace(",", ".")
    if re.match(r"\d{1,2}:", text):
        text = f"2000-01-01 {text:0>8}"
    try:
        return datetime.fromisoformat(text).timestamp()
    except ValueError:
        return np.nan


def _rows(
    path: Path, table: Table, values: list[np.ndarray], at: list[int]
) -> tuple[np.ndarray, list[str]]:
    """Numbers of the rows that are samples, and notes on the others; `at` are the columns of the
    last values."""
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
    rows, blank = np.flatnonzero(whole), int((~whole).sum())
    if 2 * rows.size < whole.size or rows.size < FEWEST:
        first = table.lines[int(np.flatnonzero(~whole)[0])]
        raise ProblemError(
            f"{path}: only {rows.size} of {whole.size} lines have a number in each of the columns "
            f"that are needed (line {first} has not), and at least {FEWEST} are: write all joints "
            f"in every line."
        )
    again = np.append(False, (np.diff(together[:, rows], axis=1) == 0).all(axis=0))
    counts = {"with blank cells": blank, "like the one before": int(again.sum())}
    notes = [f"{n} row{'s' * (n > 1)} {what} left out" for what, n in counts.items() if n]
    return rows[~again], notes


def _even_steps(time: np.ndarray) -> tuple[np.ndarray, str]:
    """Undo the rounding of equal steps of time, and say so."""
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
    """Angles in radians ``(n_joint, n_time)``, and whether each was in degrees."""
    for column in joints:
        if unread := column.last("unit not read"):
            raise ProblemError(
                f"{path}: the column {column.name} holds {unread}: write degrees or radians, and "
                f"say so in its name."
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
        silent, other = joints[stated.index(0.0)].name, joints[stated.index(max(stated))].name
        raise ProblemError(
            f"{path}: the column {other} says its unit, and {silent} does not: call it "
            f"{silent}_deg or {silent}_rad."
        )
    units = np.array([unit or (np.pi / 180 if degrees else 1.0) for unit in stated])
    raw = table.values[rows][:, [column.at for column in joints]].T
    largest, in_degrees = np.abs(raw).max(axis=1), np.isclose(units, np.pi / 180)
    worst = int((largest * units).argmax())
    name, most = joints[worst].name, largest[worst]
    too_large = most * units[worst] > _LARGEST
    if most > 360 and raw.min() >= 0:
        raise ProblemError(
            f"{path}: {name} goes up to {most:.4g}, like ticks or pulses of a servo: write "
            f"degrees, such as (ticks - 512) * 300 / 1023 or (ticks - 2048) * 360 / 4096 for "
            f"Dynamixel, and (microseconds - 1500) * 0.09 for pulses."
        )
    if too_large and not in_degrees[worst]:
        raise ProblemError(
            f"{path} has an angle of {most:.4g} rad ({name}): if angles are degrees, say so "
            f"(degrees=True, --degrees)."
        )
    if too_large and most > 720:
        raise ProblemError(
            f"{path}: {name} has an angle of {most:.4g} degrees: is it the right column?"
        )
    return raw * units[:, None], in_degrees


def _centre(angles: np.ndarray) -> int:
    """The right angle about which all joints are centred, as servos are [degrees], or 0."""
    centres = 0.5 * (angles.max(axis=1) + angles.min(axis=1))
    right = np.round(np.median(centres) / (np.pi / 2)) * (np.pi / 2)
    centred = centres.size > 1 and np.abs(centres - right).max() < _CENTRED
    return int(np.degrees(right).round()) if centred else 0
