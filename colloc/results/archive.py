"""Archives of searches over many starts: a row on the disk for each start as it ends, and one HDF5
file of all for users.

An archive is about one problem. Its starts are told apart by sampler, seed and number, so searches
with other seeds join it, also at the same time. The rows (NAME.sqlite beside NAME.h5) are what a
search goes on from: they hold every gait as it is. The HDF5 file is made of them when a search
ends, with named dimensions; a polygon is there by its Fourier series::

    start, sampler, seed, status, message                        (start)
    value, value_error, efficiency, efficiency_error, distance, work, delta, iterations, seconds, cpu_seconds    (start)
    guess_mean, gait_mean (start, joint)         guess_cos, guess_sin, gait_cos, gait_sin (start, joint, harmonic)
    basin_{row,count,frequency,value,efficiency,on_speed_floor} (basin)     distinct optima, best first; row: the best start
    problem, versions: JSON texts; attributes problem_hash, command (the last one that added to it)
"""  # noqa: E501

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

import h5py
import numpy as np

from colloc.gaits.problem import Problem
from colloc.gaits.starts import on_speed_floor
from colloc.results.distinct_optima import basins, fourier_series
from colloc.results.outcome import UNITS, Outcome, outcome_fields, outcome_from
from colloc.results.solution import versions
from colloc.system.errors import CollocError, StoreError
from colloc.system.replaced_file import locked
from colloc.system.row_file import put_rows, read_rows
from colloc.system.store_file import mark, new_file, put, put_attribute

KIND, VERSION = "colloc archive", 4
ROWS = "colloc starts 2"
_PROBLEM = "problem"
_COLUMNS = {"status": "text", "message": "text", **UNITS, "iterations": "1", "cpu_seconds": "s"}


class StartName(NamedTuple):
    """What decides a start of a problem; in the order in which starts are listed."""

    sampler: str
    seed: int
    number: int


@dataclass(eq=False)
class Archive:
    """The starts of a problem that ended so far, whoever asked for them; see `open_archive`."""

    problem: Problem
    path: Path
    outcomes: dict[StartName, Outcome] = field(default_factory=dict)

    def of_search(self, sampler: str, seed: int) -> dict[int, Outcome]:
        """Outcomes of one sampler and seed, by start number."""
        return {
            name.number: self.outcomes[name]
            for name in sorted(self.outcomes)
            if name[:2] == (sampler, seed)
        }

    def add(self, outcomes: Mapping[StartName, Outcome]) -> None:
        """Put starts that ended on the disk; StoreError if that is not possible."""
        put_rows(
            row_path(self.path),
            ROWS,
            {" ".join(map(str, n)): [n, outcome_fields(o)] for n, o in outcomes.items()},
        )
        self.outcomes.update(outcomes)


def row_path(path: str | os.PathLike[str]) -> Path:
    """Where the rows of the archive with this HDF5 file are."""
    return Path(path).with_suffix(".sqlite")


def _lock(path: Path) -> Path:
    return path.with_name(f".{path.name}.lock")


def _outcomes_at(problem: Problem, path: Path) -> dict[StartName, Outcome] | None:
    """Outcomes on the disk; None if nothing is there."""
    rows = read_rows(row_path(path), ROWS)
    stated = rows.pop(_PROBLEM, None)
    if stated is None:
        if rows:
            raise StoreError(
                f"{row_path(path)} is damaged: it does not say what problem it is about; move "
                f"it away."
            )
        return None
    if problem.hash != Problem.from_dict(stated).hash:
        raise StoreError(
            f"{row_path(path)} holds starts of another problem; choose another --output, or move "
            f"it away."
        )
    outcomes = {}
    for key, value in rows.items():
        try:
            (sampler, seed, number), entry = value
            outcomes[StartName(str(sampler), int(seed), int(number))] = outcome_from(entry)
        except (KeyError, TypeError, ValueError, OverflowError, CollocError):
            raise StoreError(
                f"{row_path(path)} is damaged: {key} is no start; move it away."
            ) from None
    return outcomes


def open_archive(problem: Problem, path: str | os.PathLike[str]) -> Archive:
    """The archive of a problem with all starts that are on the disk, begun if there is none; the
    path is that of its HDF5 file. `StoreError` if what is there is damaged, of an older colloc or
    about another problem, or the folder cannot be written."""
    path = Path(path)
    with locked(_lock(path), wait=True):
        found = _outcomes_at(problem, path)
        if found is None:
            if path.exists():
                raise StoreError(
                    f"{path} is there, but not {row_path(path).name}, which a search goes on from "
                    f"(older ones had none); "
                    "choose another --output, or move it away."
                )
            put_rows(row_path(path), ROWS, {_PROBLEM: problem.to_dict()})
    return Archive(problem, path, found or {})


def archive_at(path: str | os.PathLike[str]) -> Archive:
    """The archive with this HDF5 file, whatever its problem is, to be read: nothing is written, and
    other runs may go on adding to it. `StoreError` if there is none, or it is damaged."""
    rows = row_path(path)
    stated = read_rows(rows, ROWS).get(_PROBLEM) if rows.exists() else None
    if stated is None:
        what = f"there is no archive of starts at {path}"
        if os.path.isfile(path):
            what = (
                f"{path} is no archive of starts, or {rows.name}, which holds its rows, is not "
                f"beside it"
            )
        raise StoreError(f"{what}; colloc multistart makes one.")
    problem, path = Problem.from_dict(stated), Path(path).with_suffix(".h5")
    return Archive(problem, path, _outcomes_at(problem, path) or {})


def save_archive(archive: Archive, command: str = "") -> Path:
    """Write the HDF5 file of all starts on the disk, those of other runs too, which `archive` then
    holds as well. `StoreError` if the folder cannot be written; the file that was there before is
    left."""
    with locked(_lock(archive.path), wait=True):
        found = _outcomes_at(archive.problem, archive.path)
        archive.outcomes |= found or {}
        with new_file(archive.path) as file:
            _write(file, archive, command)
    return archive.path


def _write(file: h5py.File, archive: Archive, command: str) -> None:
    mark(file, KIND, VERSION)
    put_attribute(file, "name", archive.problem.name)
    put_attribute(file, "problem_hash", archive.problem.hash)
    put_attribute(file, "command", command)
    put(file, "problem", json.dumps(archive.problem.to_dict()))
    put(file, "versions", json.dumps(versions()))
    names = sorted(archive.outcomes)
    outcomes = [archive.outcomes[name] for name in names]

    def put_column(name: str, values: list, units: str, dims: str = "start") -> None:
        put(
            file,
            name,
            np.array(values, dtype=object if units == "text" else None),
            units=units,
            dims=dims,
        )

    put_column("start", [name.number for name in names], "1")
    put_column("seed", [name.seed for name in names], "1")
    put_column("sampler", [name.sampler for name in names], "text")
    for name, units in _COLUMNS.items():
        put_column(name, [getattr(o, name) for o in outcomes], units)
    if outcomes:
        for name in ("guess", "gait"):
            gaits = [fourier_series(archive.problem, getattr(o, name)) for o in outcomes]
            gaits = [gait.resized(max(g.n_harmonic for g in gaits)) for gait in gaits]
            put_column(f"{name}_mean", [gait.mean for gait in gaits], "rad", "start, joint")
            for part in ("cos", "sin"):
                put_column(
                    f"{name}_{part}",
                    [getattr(gait, part) for gait in gaits],
                    "rad",
                    "start, joint, harmonic",
                )
    found = basins(archive.problem, outcomes)
    put_column(
        "basin_row",
        [next(row for row, o in enumerate(outcomes) if o is b.best) for b in found],
        "1",
        "basin",
    )
    put_column("basin_count", [len(b.starts) for b in found], "1", "basin")
    put_column("basin_frequency", [b.frequency for b in found], "share of starts", "basin")
    put_column("basin_efficiency", [b.best.efficiency for b in found], "1/weight", "basin")
    put_column("basin_value", [b.best.value for b in found], "of the objective", "basin")
    floor = [int(on_speed_floor(archive.problem, b.best.gait)) for b in found]
    put_column("basin_on_speed_floor", floor, "1", "basin")
