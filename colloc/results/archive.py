"""Archives of searches over many starts, as HDF5: one row a start, replaced atomically, and nothing but data.

Layout (every dataset carries ``units`` and ``dims``)::

    /problem   JSON text      /versions  JSON text     attributes problem_hash, sampler, seed, command
    /outcomes/{start,status,message,efficiency,efficiency_error,distance,work,delta,iterations,seconds,cpu_seconds}
    /outcomes/{guess,gait}/{mean,cos,sin}
    /basins/{best_start,count,frequency,efficiency,on_speed_floor}      the distinct optima, best first
"""

from __future__ import annotations

import json
import os
from dataclasses import dataclass, field
from pathlib import Path

import h5py
import numpy as np

from colloc.gaits.harmonic import Fourier
from colloc.gaits.problem import Problem
from colloc.gaits.sampling import on_speed_floor
from colloc.results.distinct_optima import Outcome, basins
from colloc.results.solution import versions
from colloc.system.errors import StoreError
from colloc.system.file_lock import locked
from colloc.system.store_file import array, attribute, child, mark, new_file, put, put_attribute, sealed_file, text

FORMAT, FORMAT_VERSION = "colloc archive", 2
_NUMBERS = {
    "efficiency": "1/weight",
    "efficiency_error": "1/weight",
    "distance": "length",
    "work": "weight length",
    "delta": "length/period",
    "iterations": "1",
    "seconds": "s",
    "cpu_seconds": "s",
}


@dataclass(eq=False)
class Archive:
    """A search: what was asked, and the outcomes so far by start number."""

    problem: Problem
    sampler: str
    seed: int
    command: str = ""
    outcomes: dict[int, Outcome] = field(default_factory=dict)

    def ordered(self) -> list[Outcome]:
        """Outcomes by start number."""
        return [self.outcomes[start] for start in sorted(self.outcomes)]


def save_archive(archive: Archive, path: str | os.PathLike[str]) -> Path:
    """Write an archive; an existing file is replaced only once the new one is complete.

    Writers wait for each other, and starts that another run of the same search has added to the file are kept and added to
    `archive`.

    Raises
    ------
    StoreError
        If the folder cannot be made or written, or the file there is damaged.
    """
    path = Path(path)
    with locked(path.with_name(f".{path.name}.lock"), wait=True):
        if path.exists():
            there = load_archive(path)
            if (there.problem.hash, there.sampler, there.seed) == (archive.problem.hash, archive.sampler, archive.seed):
                archive.outcomes = there.outcomes | archive.outcomes
        with new_file(path) as file:
            _write(file, archive)
    return path


def load_archive(path: str | os.PathLike[str]) -> Archive:
    """The archive in a file that `save_archive` wrote.

    Raises
    ------
    StoreError
        If the file is missing, damaged, or not a colloc archive.
    """
    with sealed_file(path, FORMAT, FORMAT_VERSION) as file:
        return _read(file)


def _dataset(group: h5py.Group, name: str, value: list, units: str, dims: str = "start") -> None:
    put(group, name, np.array(value, dtype=object if units == "text" else None), units=units, dims=dims)


def _write(file: h5py.File, archive: Archive) -> None:
    mark(file, FORMAT, FORMAT_VERSION)
    put_attribute(file, "name", archive.problem.name)
    put_attribute(file, "problem_hash", archive.problem.hash)
    for name in ("sampler", "seed", "command"):
        put_attribute(file, name, getattr(archive, name))
    put(file, "problem", json.dumps(archive.problem.to_dict()))
    put(file, "versions", json.dumps(versions()))
    outcomes = archive.ordered()
    group = file.create_group("outcomes")
    _dataset(group, "start", [o.start for o in outcomes], "1")
    for name in ("status", "message"):
        _dataset(group, name, [getattr(o, name) for o in outcomes], "text")
    for name, units in _NUMBERS.items():
        _dataset(group, name, [getattr(o, name) for o in outcomes], units)
    for name in ("guess", "gait"):
        own = group.create_group(name)
        for part, dims in (("mean", "start, joint"), ("cos", "start, joint, harmonic"), ("sin", "start, joint, harmonic")):
            _dataset(own, part, [getattr(getattr(o, name), part) for o in outcomes], "rad", dims)
    found = basins(archive.problem, outcomes)
    group = file.create_group("basins")
    _dataset(group, "best_start", [b.best.start for b in found], "1", "basin")
    _dataset(group, "count", [len(b.starts) for b in found], "1", "basin")
    _dataset(group, "frequency", [b.frequency for b in found], "share of starts", "basin")
    _dataset(group, "efficiency", [b.best.efficiency for b in found], "1/weight", "basin")
    _dataset(group, "on_speed_floor", [on_speed_floor(archive.problem, b.best.gait) for b in found], "1", "basin")


def _read(file: h5py.File) -> Archive:
    problem = Problem.from_dict(json.loads(text(file, "problem")))
    if problem.hash != attribute(file, "problem_hash"):
        raise StoreError(f"{file.filename} is damaged: its problem does not match its hash.")
    sampler, seed, command = (attribute(file, name) for name in ("sampler", "seed", "command"))
    archive = Archive(problem, str(sampler), int(seed), str(command))
    group = child(file, "outcomes")
    starts = array(group, "start")
    if not starts.size:
        return archive
    status, message = array(group, "status"), array(group, "message")
    numbers = {name: array(group, name) for name in _NUMBERS}
    gaits = {name: [array(child(group, name), part) for part in ("mean", "cos", "sin")] for name in ("guess", "gait")}
    for row, start in enumerate(starts):
        guess, gait = (Fourier(*(part[row] for part in gaits[name])) for name in ("guess", "gait"))
        values = {name: column[row].item() for name, column in numbers.items()}
        archive.outcomes[int(start)] = Outcome(int(start), str(status[row]), str(message[row]), guess, gait, **values)
    return archive
