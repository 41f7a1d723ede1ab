"""Archives of searches over many starts: a row on the disk for each start as it ends, and one HDF5
file of all for users.

An archive is about one problem. Its starts are told apart by sampler, seed and number, so searches
with other seeds join it, also at the same time. The rows (NAME.sqlite beside NAME.h5) are what a
search goes on from: they hold every gait as it is. The HDF5 file is made of them when a search
ends; gaits that are no Fourier series are there by their series::

    start, sampler, seed, status, message, iterations, cpu_seconds and the numbers of an outcome (start)
    guess_mean, gait_mean (start, joint)         guess_cos, guess_sin, gait_cos, gait_sin (start, joint, harmonic)
    basin_{row,count,frequency,value,efficiency,on_speed_floor} (basin)     distinct optima, best first; row: the best start
    problem, versions: JSON texts; attributes problem_hash, command (the last one that added to it)
"""  # noqa: E501

from __future__ import annotations

import json
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from colloc.gaits.problem import Problem
from colloc.gaits.starts import on_speed_floor
from colloc.results.distinct_optima import basins, fourier_series
from colloc.results.outcome import RETRIED, UNITS, Outcome, outcome_fields, outcome_from
from colloc.results.solution import versions
from colloc.system.errors import CollocError, StoreError
from colloc.system.replaced_file import locked
from colloc.system.row_file import put_rows, read_rows
from colloc.system.table import Table, save_table

KIND, VERSION = "colloc archive", 4
ROWS = "colloc starts 2"
_PROBLEM = "problem"
_TEXTS = ("sampler", "status", "message")
_COLUMNS = ("status", "message", *UNITS, "iterations", "cpu_seconds")
_UNITS = {
    **dict.fromkeys(_TEXTS, "text"),
    **UNITS,
    "cpu_seconds": "s",
    **{f"{w}_{p}": "rad" for w in ("guess", "gait") for p in ("mean", "cos", "sin")},
    "basin_frequency": "share of starts",
    "basin_efficiency": "1/weight",
    "basin_value": "of the objective",
}


class StartName(NamedTuple):
    """What decides a start of a problem; in the order in which starts are listed."""

    sampler: str
    seed: int
    number: int


@dataclass(eq=False)
class Archive:
    """The starts of a problem that ended so far, whoever asked for them; without a path they are
    not on the disk."""

    problem: Problem
    path: Path | None = None
    outcomes: dict[StartName, Outcome] = field(default_factory=dict)

    def of_search(self, sampler: str, seed: int, starts: float = np.inf) -> dict[int, Outcome]:
        """Outcomes of one sampler and seed with numbers below `starts`, by number."""
        return {
            name.number: self.outcomes[name]
            for name in sorted(self.outcomes)
            if name[:2] == (sampler, seed) and name.number < starts
        }

    def done(self, sampler: str, seed: int, starts: int, *, retry: bool = False) -> frozenset[int]:
        """Numbers below `starts` that need not be solved; with `retry` not those that ended in an
        error, a crash or the time limit."""
        outcomes = self.of_search(sampler, seed, starts).items()
        return frozenset(k for k, o in outcomes if not (retry and o.status in RETRIED))

    def add(self, outcomes: Mapping[StartName, Outcome]) -> None:
        """Put starts that ended on the disk; StoreError if that is not possible."""
        if self.path is not None:
            rows = {" ".join(map(str, n)): [n, outcome_fields(o)] for n, o in outcomes.items()}
            put_rows(row_path(self.path), ROWS, rows)
        self.outcomes.update(outcomes)


def row_path(path: str | os.PathLike[str]) -> Path:
    """Where the rows of the archive with this HDF5 file are."""
    return Path(path).with_suffix(".sqlite")


def _lock(path: Path) -> Path:
    return path.with_name(f".{path.name}.lock")


def _read(path: Path) -> tuple[Problem, dict[StartName, Outcome]] | None:
    """The problem and the outcomes on the disk; None if nothing is there."""
    rows = read_rows(row_path(path), ROWS)
    stated = rows.pop(_PROBLEM, None)
    if stated is None:
        if rows:
            raise StoreError(
                f"{row_path(path)} is damaged: it does not say what problem it is about; move "
                f"it away."
            )
        return None
    outcomes = {}
    for key, value in rows.items():
        try:
            (sampler, seed, number), entry = value
            outcomes[StartName(str(sampler), int(seed), int(number))] = outcome_from(entry)
        except (KeyError, TypeError, ValueError, OverflowError, CollocError):
            raise StoreError(
                f"{row_path(path)} is damaged: {key} is no start; move it away."
            ) from None
    return Problem.from_dict(stated), outcomes


def _outcomes_of(problem: Problem, path: Path) -> dict[StartName, Outcome] | None:
    content = _read(path)
    if content is None:
        return None
    if problem.hash != content[0].hash:
        raise StoreError(
            f"{row_path(path)} holds starts of another problem; choose another --output, or move "
            f"it away."
        )
    return content[1]


def open_archive(problem: Problem, path: str | os.PathLike[str]) -> Archive:
    """The archive of a problem with all starts that are on the disk, begun if there is none; the
    path is that of its HDF5 file. `StoreError` if what is there is damaged, of an older colloc or
    about another problem, or the folder cannot be written."""
    path = Path(path)
    with locked(_lock(path), wait=True):
        outcomes = _outcomes_of(problem, path)
        if outcomes is None:
            if path.exists():
                raise StoreError(
                    f"{path} is there, but not {row_path(path).name}, which a search goes on from "
                    f"(older ones had none); choose another --output, or move it away."
                )
            put_rows(row_path(path), ROWS, {_PROBLEM: problem.to_dict()})
    return Archive(problem, path, outcomes or {})


def archive_at(path: str | os.PathLike[str]) -> Archive:
    """The archive with this HDF5 file, whatever its problem is, to be read: nothing is written, and
    other runs may go on adding to it. `StoreError` if there is none, or it is damaged."""
    path, rows = Path(path), row_path(path)
    content = _read(path) if rows.exists() else None
    if content is None:
        what = f"there is no archive of starts at {path}"
        if path.is_file():
            what = (
                f"{path} is no archive of starts, or {rows.name}, which holds its rows, is not "
                f"beside it"
            )
        raise StoreError(f"{what}; colloc multistart makes one.")
    return Archive(content[0], path.with_suffix(".h5"), content[1])


def save_archive(archive: Archive, command: str = "") -> Path:
    """Write the HDF5 file of all starts on the disk, those of other runs too, which `archive` then
    holds as well. `StoreError` if the folder cannot be written; the file that was there before is
    left."""
    assert archive.path is not None
    with locked(_lock(archive.path), wait=True):
        archive.outcomes |= _outcomes_of(archive.problem, archive.path) or {}
        return save_table(_table(archive, command), archive.path, KIND, VERSION)


def _table(archive: Archive, command: str) -> Table:
    problem, names = archive.problem, sorted(archive.outcomes)
    outcomes = [archive.outcomes[name] for name in names]
    columns = {name: [getattr(o, name) for o in outcomes] for name in _COLUMNS}
    columns |= {"seed": [n.seed for n in names], "sampler": [n.sampler for n in names]}
    found = basins(problem, outcomes)
    columns |= {
        "basin_row": [next(k for k, o in enumerate(outcomes) if o is b.best) for b in found],
        "basin_count": [len(b.starts) for b in found],
        "basin_frequency": [b.frequency for b in found],
        "basin_efficiency": [b.best.efficiency for b in found],
        "basin_value": [b.best.value for b in found],
        "basin_on_speed_floor": [int(on_speed_floor(problem, b.best.gait)) for b in found],
    }
    dimensions: dict[str, tuple[str, ...]] = {
        name: ("basin",) if name.startswith("basin") else ("start",) for name in columns
    }
    variables = {
        name: np.array(values, dtype=object if name in _TEXTS else None)
        for name, values in columns.items()
    }
    for which in ("guess", "gait") if outcomes else ():
        for part, values in _series(problem, [getattr(o, which) for o in outcomes]).items():
            variables[f"{which}_{part}"] = values
            dimensions[f"{which}_{part}"] = ("start", "joint", "harmonic")[: values.ndim]
    texts = {"problem": json.dumps(problem.to_dict()), "versions": json.dumps(versions())}
    return Table(
        problem.name,
        {"start": np.array([name.number for name in names], dtype=None)},
        {name: np.array(text, dtype=object) for name, text in texts.items()} | variables,
        dict.fromkeys(texts, ()) | dimensions,
        _UNITS,
        attributes={"problem_hash": problem.hash, "command": command},
    )


def _series(problem: Problem, gaits: Sequence[Any]) -> dict[str, np.ndarray]:
    """Means and coefficients of Fourier series that stand for gaits, as long as the longest."""
    series = [fourier_series(problem, gait) for gait in gaits]
    longest = max(each.n_harmonic for each in series)
    series = [each.resized(longest) for each in series]
    return {
        part: np.array([getattr(each, part) for each in series]) for part in ("mean", "cos", "sin")
    }
