"""Joint angles over time from a file of a robot, logger or spreadsheet, whose columns are known by
their names. What is ambiguous is refused; what was taken is said in one line."""

from __future__ import annotations

import re
from collections.abc import Collection
from datetime import datetime
from pathlib import Path
from typing import NamedTuple, NoReturn

import numpy as np

from colloc.mechanics.chain import Chain
from colloc.system.csv_table import Table, check_size, is_blank, read_table
from colloc.system.errors import ProblemError

FEWEST = 6
"""Samples of a gait, and of each of its periods."""
LARGEST = 2 * np.pi  # an angle beyond it is one in degrees
_DEGREE = np.pi / 180
_ANGLES = dict.fromkeys(("rad", "rads", "radian", "radians"), 1.0) | {"mrad": 1e-3}
# Grad is German for degrees
_ANGLES |= dict.fromkeys(("deg", "degs", "degree", "degrees", "grad", "°"), _DEGREE)
_WORDS = {
    "time": "t|time|timestamp|stamp|zeit|temps|tiempo|tempo|clock|elapsed|datetime|date|uptime|"
    "n?secs|nanosecs?",
    "other": "vel.*|speeds?|rates?|dot|qd|dq|omega|effort|torques?|tau|load|volt.*|temp.*|power|"
    "acc.*|pwm|force|currents?|err.*|imu|gyro|battery|per|nm|m[va]|rpm|moving|status|cov.*",
    "count": "index|idx|samples?|frame|step|seq|nr|no|count(er)?|id|row|unnamed|attempt",
    "angle": "positions?|pos|angles?",
    "commanded": "cmd|command(ed)?|target|goal|setpoint|des(ired)?|ref(erence)?|sp",
    "link": "links?|segments?|heading|abs(olute)?|orientation",
    "end": "head|tail|front|rear|back|one|two|second|ii|beta|anterior",
    "unit of time": "m?s|[uµn]s|secs?|seconds?|[mu]sec|nsecs?|nanosecs?|(milli|micro|nano)seconds|"
    "millis|micros|min",
    "unit not read": "revs?|revolutions|turns?|gons?|ticks?|counts|pi|norm.*|[cmuµ]deg|[uµ]rad|%",
}
"""Words in names of columns, as regular expressions; "other" are columns that are no angles."""
HEADINGS = {"theta", "yaw", "heading"}  # of a link, without a number
_SECOND = {"": 1, "m": 1e3, "milli": 1e3, "n": 1e9, "nano": 1e9, "u": 1e6, "µ": 1e6, "micro": 1e6}
_MOST = 5_000  # samples
_ASTRAY = 0.03  # distance of markers from what is a link, in body lengths, that is refused


class Record(NamedTuple):
    time: np.ndarray  # (n_time,), from 0, in the file's unit; it does not fall
    angles: np.ndarray  # (n_joint, n_time) [rad], from tail to head
    degrees: bool  # whether all were given in degrees
    period: float | None  # that the file states, in its unit of time
    taken: str  # what was read, in one sentence without its full stop
    centre: int  # right angle about which servos are centred [degrees]; 0 if about none
    path: np.ndarray | None  # centre of mass and tail that markers tell, x and y, (2, 2, n_time)
    others: list[tuple[Column, np.ndarray]]  # columns that are neither, and their numbers
    second: float | None  # in the unit of time, if that is known

    def describe(self, used: Collection[Column] = ()) -> str:
        """What was read, and what was left out, unless it was of use elsewhere."""
        left = [c.name for c, _ in self.others if c not in used]
        more = f" and {len(left) - 3} more" if len(left) > 3 else ""
        return f"{self.taken}{'; ignored: ' * bool(left)}{', '.join(left[:3])}{more}"


class Column(NamedTuple):
    at: int
    name: str

    @property
    def words(self) -> tuple[str, ...]:
        """Letters and numbers of name and unit, in lower case."""
        spaced = re.sub(r"(?<=[a-z])(?=[A-Z])", " ", self.name).lower()
        return tuple(re.findall(r"[^\W\d_]+|\d+|[°%]", spaced))

    @property
    def numbers(self) -> tuple[int, ...]:
        return tuple(int(w) for w in self.words if w.isdecimal())

    @property
    def skeleton(self) -> tuple[str, ...]:
        """The pattern of the names of one set of columns."""
        return tuple("#" if w.isdecimal() else w for w in self.words if w not in _ANGLES)

    def last(self, what: str) -> str:
        """The last of its words that speaks of something; else empty."""
        return next((w for w in reversed(self.words) if re.fullmatch(_WORDS[what], w)), "")

    @property
    def kind(self) -> str:
        """One of "time", "count", "other", "place" and, if nothing else, "angle"."""
        words = self.words
        units = [w for w in words if re.fullmatch(_WORDS["unit of time"], w)]
        if self.last("time") or 0 < len(units) == len(words):
            return "time"
        # a velocity; newton metres; a number and a unit, as 1 v
        other = re.fullmatch(r"v( .*)?|(.* )?(n m|\d+ [wavc])", " ".join(words))
        rate = re.search(r"(rad|deg|°|rev)\w*\s*/\s*s|n·m", self.name, re.I)
        if rate or other or self.last("other"):
            is_current = self.last("angle") and "current" in words and not rate
            return "angle" if is_current else "other"
        if not words or (self.last("count") and not self.last("angle")):
            return "count"
        return "place" if {*words} & {*"xyz"} and not {*words} & {"joint", "angle"} else "angle"


def read_record(
    path: Path, n_joint: int, *, degrees: bool = False, body: Chain | None = None
) -> Record:
    """Read joint angles over time from a text file, a line a sample; `degrees` holds where the file
    does not name a unit. With a `body` markers at its ends and joints tell them, too."""
    table = read_table(path)
    check_size(path, table, FEWEST)
    try:
        return _record(table, n_joint, degrees, body)
    except ProblemError as error:
        raise ProblemError(f"{path}: {error}") from None


def _record(table: Table, n_joint: int, degrees: bool, body: Chain | None) -> Record:
    columns, clock, joints, how = _columns(table, n_joint, body)
    time, unit = _times(table, clock)
    rows, notes = _rows(table, time, clock, joints)
    if re.search(r"^#\s*ramp_s:", table.preamble, re.M):
        rows = rows[time[rows] >= 0]
        notes.append("lead-in before time 0 ignored")
    time = time[rows]
    if (falls := np.flatnonzero(np.diff(time) < 0)).size:
        raise ProblemError(
            f"the times{' in the first column' * (not columns)} fall after line "
            f"{table.lines[rows[falls[0]]]}: give one record, its lines in the order of time."
        )
    if time[-1] == time[0]:
        raise ProblemError(
            f"all times are {time[0]:g}: give a column of times that rise, or none for equal steps."
        )
    raw, places = table.values[rows][:, [c.at for c in joints]].T, None
    time, even = _even_steps(time, raw)
    every = -(-rows.size // _MOST)
    # long steps would hide a period
    while every > 1 and np.abs(np.diff(raw[:, ::every])).mean() > 0.15 * raw.std(axis=1).mean():
        every //= 2
    if rows.size > _MOST:
        first = slice(0, every * _MOST, every)
        time, rows, raw = time[first], rows[first], raw[:, first]
        notes.append(f"of {len(table.lines)} rows, the first {rows.size} in steps of {every} taken")
    if body is not None and joints[0].kind == "place":
        units = np.ones(n_joint)
        raw, places, length = _from_markers(raw.reshape(-1, 2, rows.size), body)
        how = f"{how}, {length:.4g} of them a body length,"
    else:
        units = _units(table, joints, degrees)
        _check_size_of_angles(joints, raw, units)
    angles = np.unwrap(raw * units[:, None], discont=1.5 * np.pi, axis=1)
    angles -= 2 * np.pi * np.round(angles.mean(axis=1, keepdims=True) / (2 * np.pi))
    if turned := _names(joints, np.abs(angles - raw * units[:, None]).max(axis=1) > 1.0):
        notes.append(f"whole turns taken out of {turned}")
    in_degrees = np.isclose(units, _DEGREE)
    mixed = f" (but {_names(joints, in_degrees)} degrees)" if in_degrees.any() else ""
    angle_unit = "degrees" if in_degrees.all() else f"radians{mixed}"
    plural = "s" * (n_joint > 1)
    facts = [f"read {n_joint} joint{plural} {how} from {_ends(joints)}"]
    facts[0] += f", {angle_unit}" if places is None else ""
    facts += [f"time {unit}{even}", *table.notes, *notes]
    comment = re.search(r"^#\s*period_s:\s*([\d.eE+-]+)\s*$", table.preamble, re.M)
    period = float(comment[1]) if comment and unit == "in s" else None
    of_time = re.search(r"in (\w*?)(s|secs?|seconds?)$", unit)
    second = _SECOND.get(of_time[1]) if of_time else None
    centres = (angles.max(axis=1) + angles.min(axis=1)) / np.pi
    right = round(np.median(centres))
    centre = 90 * right * (n_joint > 1 and bool(np.abs(centres - right).max() < 20 / 90))
    left = (c for c in columns if c.name and c not in clock + joints)
    others = [(c, table.values[rows, c.at]) for c in left]
    read = time - time[0], angles, bool(in_degrees.all()), period, "; ".join(facts), centre
    return Record(*read, places, others, second)


def _names(columns: list[Column], which: np.ndarray) -> str:
    return ", ".join(columns[j].name for j in np.flatnonzero(which))


def _ends(columns: list[Column]) -> str:
    return " ... ".join(dict.fromkeys((columns[0].name, columns[-1].name)))


def _columns(
    table: Table, n_joint: int, body: Chain | None
) -> tuple[list[Column], list[Column], list[Column], str]:
    """All named columns; those of times, if any; those of the joints, and how they are known."""
    if not table.names:
        width = table.values.shape[1]
        unnamed = [Column(j, f"column {j + 1}") for j in range(width)]
        if width not in (n_joint, n_joint + 1):
            _refuse_count(width - 1, n_joint)
        clock, joints = unnamed[: width - n_joint], unnamed[width - n_joint :]
        return [], clock, joints, "in the file's order, as it has no names"
    both = zip(table.names, table.units, strict=True)
    columns = [Column(j, " ".join(each).strip()) for j, each in enumerate(both)]
    varies = [c for c in columns if len({row[c.at] for row in table.cells}) > 1]
    cells = {row[c.at]: 0 for c in columns if "name" in c.words for row in table.cells}
    names = re.findall(r"[^][()\s,'\"]+", " ".join(cells))  # of joints, as ROS has them
    positions = sorted((c.numbers, c.at) for c in columns if "position" in c.words)
    if len(names) == len(positions):
        for (_, j), name in zip(positions, names, strict=True):
            columns[j] = Column(j, name)
    times = [c for c in varies if c.kind == "time"]
    times.sort(key=lambda c: "date" in c.words)
    whole = [c for c in times if {"sec", "secs"} & {*c.words}][:1]
    part = [c for c in times if {"nanosec", "nanosecs", "nsec", "nsecs"} & {*c.words}][:1]
    rising = [c for c in varies if (np.diff(table.values[:, c.at]) > 0).all()]
    counts = [c for c in rising if c.kind == "count"]
    # times in another language
    others = [c for c in rising if c.at == 0 and not c.numbers]
    clock = whole + part if whole and part else (times or counts or others)[:1]
    numeric = np.isfinite(table.values).any(axis=0)
    left = [c for c in columns if c not in clock]
    may_be = [c for c in left if numeric[c.at]] or left
    return columns, clock, *_joints(may_be, n_joint, body)


def _joints(columns: list[Column], n_joint: int, body: Chain | None) -> tuple[list[Column], str]:
    angles = [c for c in columns if c.kind == "angle"]
    places = [c for c in columns if c.kind == "place"]
    if not angles and places and body is not None:
        return _markers(places, n_joint + 2), "from positions of points"
    if not angles and places:
        _refuse(
            f"its columns {_ends(places)} look like positions of points of the body; write joint "
            f"angles, each the direction of a link less that of the link behind it",
        )
    for other in (lambda c: c.last("commanded"), lambda c: {*c.words} & HEADINGS and not c.numbers):
        joints = [c for c in angles if not other(c)]
        if len(angles) > n_joint <= len(joints):
            angles = joints
    sets: dict[tuple[str, ...], list[Column]] = {}
    for column in angles:
        sets.setdefault(column.skeleton, []).append(column)
    same = len({c.skeleton[:-1] for c in angles}) == 1
    if same and all(len(c.skeleton[-1]) == 1 for c in angles):
        sets = {(): angles}  # known by a letter
    numbered = []
    for key, each in sets.items():
        if "#" in key or (not key and n_joint > 1):
            numbered.append(sorted(each, key=lambda c: (c.numbers, c.words)))
            if len({c.words for c in each}) < len(each):
                _refuse(f"two columns are called {each[0].name}")
    full = [each for each in numbered if len(each) == n_joint]
    if len(full) > 1:
        sides = f"{_ends(full[0])}, and {_ends(full[1])}"
        _refuse(f"two sets of columns may be the {n_joint} joints, {sides}; leave one of them out")
    of_links = full and full[0][0].last("link") and "joint" not in full[0][0].words
    if full and not of_links:
        return full[0], "by name"
    if links := full or [each for each in numbered if len(each) == n_joint + 1]:
        _refuse(
            f"{_ends(links[0])} are {len(links[0])} columns of angles, and the body has {n_joint} "
            "joints; if they are directions of links, write what each has beyond the one behind it",
        )
    if len(angles) != n_joint:
        _refuse_count(len(angles), n_joint)
    in_order = all(each == [c for c in angles if c in each] for each in numbered)
    if not in_order or any(c.last("end") for c in angles):
        _refuse(f"the order of the columns {', '.join(c.name for c in angles)} is not clear")
    return angles, "in the file's order, tail to head,"


def _markers(columns: list[Column], n_point: int) -> list[Column]:
    sides = [
        sorted((c for c in columns if axis in c.words), key=lambda c: c.numbers) for axis in "xy"
    ]
    x, y = ([c.numbers for c in side] for side in sides)
    if x != y or len({*x}) < len(x) or len(x) != n_point:
        raise ProblemError(
            f"its columns {_ends(columns)} are x of {len(x)} points and y of {len(y)}; a "
            f"body of {n_point - 1} links has {n_point} points, its ends and joints: call them "
            f"x_1, y_1 (the tail), x_2, ..."
        )
    return [c for pair in zip(*sides, strict=True) for c in pair]


def _from_markers(places: np.ndarray, body: Chain) -> tuple[np.ndarray, np.ndarray, float]:
    """Joint angles that points ``(n_link + 1, 2, n_time)`` tell, the path of the centre of mass and
    the tail in body lengths, and the body length in the unit of the points."""
    points = places[:, 0] + 1j * places[:, 1]
    links = np.diff(points, axis=0)
    lengths = np.abs(links).mean(axis=1)
    length = float(lengths.sum())
    off = np.abs(lengths / length - body.lengths)
    if not off.max() <= _ASTRAY:
        k = int(off.argmax())
        raise ProblemError(
            f"points {k + 1} and {k + 2} are {lengths[k] / length:.3g} of the body apart, "
            f"and that link is {body.lengths[k]:.3g} long: points must be at the ends and joints, "
            f"from tail to head."
        )
    middles = 0.5 * (points[:-1] + points[1:])
    path_of = np.stack([body.mass_column()[:, 0] @ middles, points[0]]) / length
    angles = np.angle(links[1:] * links[:-1].conj())
    return angles, np.stack([path_of.real, path_of.imag], axis=1), length


def _refuse_count(count: int, n_joint: int) -> NoReturn:
    _refuse(
        f"it has {count} column{'s' * (count != 1)} of angles, and the body has {n_joint} "
        f"joint{'s' * (n_joint != 1)}; write a column of times, then one for each joint",
    )


def _refuse(what: str) -> NoReturn:
    raise ProblemError(f"{what}: call columns of joints joint_1 (at the tail), joint_2 ...")


def _times(table: Table, clock: list[Column]) -> tuple[np.ndarray, str]:
    if not clock:
        samples = np.arange(len(table.lines), dtype=float)
        return samples, "in equal steps, a sample each, as no column holds it"
    column, time = clock[0], table.values[:, clock[0].at]
    if len(clock) > 1:
        return time - time[0] + 1e-9 * table.values[:, clock[1].at], "in s"
    if not np.isfinite(time).any():
        stamps = []
        for row in table.cells:
            text = row[column.at].replace(",", ".")
            try:
                if re.match(r"\d+:\d+[:.]", text):  # of a clock, or minutes and seconds
                    stamps.append(float(np.polyval([*map(float, text.split(":"))], 60)))
                else:
                    stamps.append(datetime.fromisoformat(text).timestamp())
            except ValueError:
                stamps.append(np.nan)
        if np.isnan(stamps[0]):
            raise ProblemError(
                f"line {table.lines[0]}: the time {table.cells[0][column.at]!r} is no "
                f"number, and no date and time as 2026-01-31T12:00:00.05: write seconds."
            )
        time = np.array(stamps) - stamps[0]
        time[time < -43_200] += 86_400 * (stamps[0] < 86_400)  # past midnight, without a date
        return time, "of day, in s"
    if not table.names:
        return time, "in the first column"
    if column.kind == "count":
        return time, f"in samples ({column.name or 'the first column'})"
    unit = column.last("unit of time")
    return time, f"in {unit}" if unit else f"from {column.name}"


def _rows(
    table: Table, time: np.ndarray, clock: list[Column], joints: list[Column]
) -> tuple[np.ndarray, list[str]]:
    needed = [c.at for c in (*clock[:1], *joints)]
    together = np.vstack([time, table.values[:, needed[-len(joints) :]].T])
    whole = np.isfinite(together).all(axis=0)
    for k, i in np.argwhere(~np.isfinite(together[-len(needed) :].T)):
        if not is_blank(cell := table.cells[k][j := needed[i]]):
            name = table.names[j] if table.names else j + 1
            raise ProblemError(
                f"line {table.lines[k]}, column {name}: {cell[:40]!r} is no number: mend "
                f"it, or leave the line out."
            )
    rows, blank = np.flatnonzero(whole), int((~whole).sum())
    if 2 * rows.size < whole.size or rows.size < FEWEST:
        raise ProblemError(
            f"only {rows.size} of {whole.size} lines have a number in each column needed "
            f"(line {table.lines[int(np.argmin(whole))]} has not), and {FEWEST} must: write all "
            f"joints in every line."
        )
    again = np.append(False, (np.diff(together[:, rows], axis=1) == 0).all(axis=0))
    counts = {"with blank cells": blank, "like the one before": int(again.sum())}
    notes = [f"{n} row{'s' * (n > 1)} {what} left out" for what, n in counts.items() if n]
    return rows[~again], notes


def _even_steps(time: np.ndarray, raw: np.ndarray) -> tuple[np.ndarray, str]:
    steps = np.diff(time)
    unit = steps[steps > 0].min()
    whole = np.round(steps / unit)
    uneven = np.mean(whole != np.median(whole))  # a few are samples that were dropped
    rounded = np.abs(steps / unit - whole).max() <= 1e-3 and (not whole.min() or uneven > 0.15)
    count = np.arange(time.size)
    step, begin = np.polyfit(count, time - time[0], 1)
    line = begin + step * count
    # exact stamps of which some are missing make smoother angles
    kinks = (np.median(np.abs(np.diff(np.diff(raw) / np.diff(t)))) for t in (time, line))
    exact = whole.min() and np.less(*kinks)
    if exact or not rounded or np.ptp(time - time[0] - line) > 1.2 * unit:
        return time, ""
    return line, f", stamps rounded to {unit:.3g} taken as equal steps of {step:.4g}"


def _units(table: Table, joints: list[Column], degrees: bool) -> np.ndarray:
    """Radians per unit of each joint's column ``(n_joint,)``."""
    units = []
    for column in joints:
        if unread := column.last("unit not read"):
            raise ProblemError(
                f"the column {column.name} holds {unread}: write degrees or radians, and "
                f"say so in its name."
            )
        units.append(next((_ANGLES[w] for w in reversed(column.words) if w in _ANGLES), 0.0))
    if degrees and 1.0 in units:
        raise ProblemError(
            f"the column {joints[units.index(1.0)].name} holds radians: leave out "
            f"--degrees (degrees=True)."
        )
    degrees |= bool(re.search(r"in_?degrees\s*=\s*yes|angles are in degrees", table.preamble, re.I))
    if not degrees and 0.0 in units and max(units) > 0.0:
        silent, other = joints[units.index(0.0)].name, joints[units.index(max(units))].name
        raise ProblemError(
            f"the column {other} says its unit, and {silent} does not: call it "
            f"{silent}_deg or {silent}_rad."
        )
    return np.array([unit or (_DEGREE if degrees else 1.0) for unit in units])


def _check_size_of_angles(joints: list[Column], raw: np.ndarray, units: np.ndarray) -> None:
    largest = np.abs(raw).max(axis=1)
    worst = int((largest * units).argmax())
    name, most = joints[worst].name, largest[worst]
    if most > 360 and raw.min() >= 0:
        raise ProblemError(
            f"{name} goes up to {most:.4g}, like ticks or pulses of a servo: write "
            f"degrees, such as (ticks - 512) * 300 / 1023 or (ticks - 2048) * 360 / 4096 for "
            f"Dynamixel, and (microseconds - 1500) * 0.09 for pulses."
        )
    if most * units[worst] <= LARGEST:
        return
    if not np.isclose(units[worst], _DEGREE):
        raise ProblemError(
            f"it has an angle of {most:.4g} rad ({name}): if angles are degrees, say so "
            f"(degrees=True, --degrees)."
        )
    if most > 720:
        raise ProblemError(f"{name} has an angle of {most:.4g} degrees: is it the right column?")
