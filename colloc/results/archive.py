"""Outcomes of many starts of one problem, their distinct optima, and archives of them.

Rows (NAME.sqlite) hold every start with its gait, by sampler, seed and number, as it ends; searches
go on from them, also at the same time. NAME.h5 is made of them for users: columns over ``start``,
``guess_`` and ``gait_`` ``mean`` (start, joint), ``cos`` and ``sin`` (start, joint, harmonic), and
columns ``basin_...`` of the distinct optima, best first (``basin_row``: row of the best start).
"""

from __future__ import annotations

import dataclasses
import json
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from colloc.gaits.gait_fields import AnyGait, fields, gait_from
from colloc.gaits.harmonic import Fourier
from colloc.gaits.problem import Problem
from colloc.gaits.starts import on_speed_floor
from colloc.results.comparison import are_one, fourier_series
from colloc.results.solution import CERTIFICATE_FAILED, NOT_CONVERGED, SOLVED, versions
from colloc.system.errors import StoreError
from colloc.system.files import alone_in
from colloc.system.row_file import put_rows, read_rows
from colloc.system.store_file import Table, save_table

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
    *(SOLVED, TRIVIAL, CERTIFICATE_FAILED, NOT_CONVERGED),
    *(PASSED_OVER, TIME_LIMIT, ERROR, CRASHED),
)
_LONGEST_MESSAGE = 1000
_READERS: dict[Any, Any] = {"int": int, "str": str, "float": float, "AnyGait": gait_from}
_KIND, _VERSION = "colloc archive", 4
_ROWS = "colloc starts 2"
_TEXTS = dict.fromkeys(("sampler", "status", "message"), "text")
_COLUMNS = ("status", "message", *UNITS, "iterations", "cpu_seconds")
_SERIES = {"mean": ("joint",), "cos": ("joint", "harmonic"), "sin": ("joint", "harmonic")}
_UNITS = {
    **_TEXTS,
    **UNITS,
    "cpu_seconds": "s",
    **{f"{gait}_{part}": "rad" for gait in ("guess", "gait") for part in _SERIES},
    "basin_frequency": "share of starts",
    "basin_efficiency": "1/weight",
    "basin_value": "of the objective",
}


@dataclass(frozen=True, eq=False)
class Outcome:
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

    def __repr__(self) -> str:
        return (
            f"<Outcome of start {self.start}: {self.status}, d/W = {self.efficiency:.6g}, "
            f"{self.cpu_seconds:.1f} s>"
        )


def outcome_fields(outcome: Outcome) -> dict[str, Any]:
    gaits = {"guess": fields(outcome.guess), "gait": fields(outcome.gait)}
    return {**vars(outcome), "message": outcome.message[:_LONGEST_MESSAGE], **gaits}


def outcome_from(entry: dict[str, Any]) -> Outcome:
    if entry["status"] not in STATUSES:
        raise ValueError(f"no status: {entry['status']}")
    types = {field.name: field.type for field in dataclasses.fields(Outcome)}
    return Outcome(**{name: _READERS[kind](entry[name]) for name, kind in types.items()})


def counts(outcomes: Sequence[Outcome]) -> dict[str, int]:
    return {s: n for s in STATUSES if (n := sum(o.status == s for o in outcomes))}


@dataclass(frozen=True, eq=False)
class Basin:
    """A distinct certified optimum and the starts that ended there.

    Attributes
    ----------
    best : Outcome
        Its member of largest value.
    starts : tuple of int
    frequency : float
        Share of all starts tried.
    """

    best: Outcome
    starts: tuple[int, ...]
    frequency: float

    def __repr__(self) -> str:
        return f"<Basin with d/W = {self.best.efficiency:.6g} of {len(self.starts)} starts>"


def basins(problem: Problem, outcomes: Sequence[Outcome]) -> list[Basin]:
    """The distinct certified optima, best first.

    Outcomes join the first, better, optimum they agree with in value and in gait modulo start phase
    and the symmetries of body and friction (see `images`).
    """
    groups: list[tuple[list[Outcome], Fourier]] = []
    for outcome in sorted((o for o in outcomes if o.status == SOLVED), key=lambda o: -o.value):
        path = fourier_series(problem, outcome.gait)
        for members, at in groups:
            if are_one(problem, (members[0].value, at), (outcome.value, path)):
                members.append(outcome)
                break
        else:
            groups.append(([outcome], path))
    return [
        Basin(m[0], tuple(sorted(o.start for o in m)), len(m) / len(outcomes)) for m, _ in groups
    ]


class StartName(NamedTuple):
    sampler: str
    seed: int
    number: int


@dataclass(eq=False)
class Archive:
    """Finished starts of a problem; not on the disk without a path."""

    problem: Problem
    path: Path | None = None
    outcomes: dict[StartName, Outcome] = field(default_factory=dict)

    def of_search(self, sampler: str, seed: int, starts: float = np.inf) -> dict[int, Outcome]:
        """Outcomes of a sampler and seed by number, below `starts`."""
        return {
            name.number: self.outcomes[name]
            for name in sorted(self.outcomes)
            if name[:2] == (sampler, seed) and name.number < starts
        }

    def done(self, sampler: str, seed: int, starts: int, *, retry: bool = False) -> frozenset[int]:
        """Numbers that need not be solved; with `retry` without errors, crashes and time limits."""
        outcomes = self.of_search(sampler, seed, starts).items()
        return frozenset(k for k, o in outcomes if not (retry and o.status in RETRIED))

    def add(self, outcomes: Mapping[StartName, Outcome]) -> None:
        """Put finished starts on the disk. `StoreError` if that is not possible."""
        if self.path is not None:
            rows = {" ".join(map(str, n)): [n, outcome_fields(o)] for n, o in outcomes.items()}
            put_rows(row_path(self.path), _ROWS, rows)
        self.outcomes.update(outcomes)


def row_path(path: str | os.PathLike[str]) -> Path:
    return Path(path).with_suffix(".sqlite")


def _read(path: Path, problem: Problem | None = None) -> Archive | None:
    def decode(row):
        if isinstance(row, dict):
            return Problem.from_dict(row)
        (sampler, seed, number), outcome = row
        return StartName(str(sampler), int(seed), int(number)), outcome_from(outcome)

    if not (rows := read_rows(row_path(path), _ROWS, decode)):
        return None
    subject = rows.pop("problem", None)
    if subject is None:
        why = "is damaged: it does not say what problem it is about; move it away"
    elif problem is not None and problem.hash != subject.hash:
        why = "holds starts of another problem; choose another --output, or move it away"
    else:
        return Archive(subject, path, dict(rows.values()))
    raise StoreError(f"{row_path(path)} {why}.")


def open_archive(problem: Problem, path: str | os.PathLike[str]) -> Archive:
    """The archive of a problem with this HDF5 file, created if there is none.

    `StoreError` if it is damaged, of another problem or version, or cannot be written.
    """
    path = Path(path)
    with alone_in(path.parent):
        archive = _read(path, problem)
        if archive is None:
            if path.exists():
                raise StoreError(
                    f"{path} is there, but not {row_path(path).name}, which a search goes on "
                    f"from; choose another --output, or move it away."
                )
            put_rows(row_path(path), _ROWS, {"problem": problem.to_dict()})
    return archive or Archive(problem, path)


def archive_at(path: str | os.PathLike[str]) -> Archive:
    """Read the archive with this HDF5 file. `StoreError` if there is none, or it is damaged."""
    path = Path(path)
    if archive := _read(path.with_suffix(".h5")):
        return archive
    what = f"there is no archive of starts at {path}"
    if path.is_file():
        what = (
            f"{path} is no archive of starts, or {row_path(path).name}, which holds its rows, is "
            f"not beside it"
        )
    raise StoreError(f"{what}; colloc multistart makes one.")


def save_archive(archive: Archive, command: str = "") -> Path:
    """Write the HDF5 file of all starts on the disk, which `archive` then holds as well."""
    path, problem = archive.path, archive.problem
    assert path is not None
    with alone_in(path.parent):
        if stored := _read(path, problem):
            archive.outcomes |= stored.outcomes
        names = sorted(archive.outcomes)
        outcomes = [archive.outcomes[name] for name in names]
        rows = {id(o): row for row, o in enumerate(outcomes)}
        of_starts = {name: [getattr(o, name) for o in outcomes] for name in _COLUMNS}
        of_starts |= {"seed": [n.seed for n in names], "sampler": [n.sampler for n in names]}
        optima = basins(problem, outcomes)
        of_basins: dict[str, list] = {
            "row": [rows[id(b.best)] for b in optima],
            "count": [len(b.starts) for b in optima],
            "frequency": [b.frequency for b in optima],
            "efficiency": [b.best.efficiency for b in optima],
            "value": [b.best.value for b in optima],
            "on_speed_floor": [int(on_speed_floor(problem, b.best.gait)) for b in optima],
        }
        columns: dict[str, tuple[Any, tuple[str, ...]]] = {
            "problem": (json.dumps(problem.to_dict()), ()),
            "versions": (json.dumps(versions()), ()),
            **{name: (column, ("start",)) for name, column in of_starts.items()},
            **{f"basin_{name}": (column, ("basin",)) for name, column in of_basins.items()},
        }
        for which in ("guess", "gait") if outcomes else ():
            series = [fourier_series(problem, getattr(o, which)) for o in outcomes]
            longest = max(each.n_harmonic for each in series)
            for part, dims in _SERIES.items():
                values = [getattr(each.resize(longest), part) for each in series]
                columns[f"{which}_{part}"] = values, ("start", *dims)
        table = Table(
            problem.name,
            {"start": np.array([name.number for name in names])},
            {
                name: np.array(column, dtype=object if name in _TEXTS or not dims else None)
                for name, (column, dims) in columns.items()
            },
            {name: dims for name, (_, dims) in columns.items()},
            _UNITS,
            attributes={"problem_hash": problem.hash, "command": command},
        )
        return save_table(table, path, _KIND, _VERSION)
