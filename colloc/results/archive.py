"""Archives of searches over many starts, as HDF5: one row a start, replaced atomically, and nothing but data.

An archive is about one problem. Its starts are told apart by sampler, seed and number, so searches with other seeds join it.

Layout (every dataset carries ``units`` and ``dims``)::

    /problem   JSON text      /versions  JSON text     attributes problem_hash, command (the last one that added to it)
    /outcomes/{sampler,seed,start,status,message,efficiency,efficiency_error,distance,work,delta,iterations,seconds,cpu_seconds}
    /outcomes/{guess,gait}/{mean,cos,sin}
    /basins/{best,count,frequency,efficiency,on_speed_floor}      the distinct optima, best first; best: row of outcomes
"""

from __future__ import annotations

import json
import os
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

import h5py
import numpy as np

from colloc.gaits.harmonic import Fourier
from colloc.gaits.problem import Problem, statement_hash
from colloc.gaits.sampling import on_speed_floor
from colloc.results.distinct_optima import Outcome, basins, fourier_series
from colloc.results.solution import versions
from colloc.system.errors import StoreError
from colloc.system.file_lock import locked
from colloc.system.store_file import array, attribute, child, mark, new_file, put, put_attribute, sealed_file, text

FORMAT, FORMAT_VERSION = "colloc archive", 3
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


class StartName(NamedTuple):
    """What decides a start of a problem; in the order in which starts are listed."""

    sampler: str
    seed: int
    number: int


@dataclass(eq=False)
class Archive:
    """The starts of a problem that ended so far, whoever asked for them."""

    problem: Problem
    command: str = ""
    outcomes: dict[StartName, Outcome] = field(default_factory=dict)

    def of_search(self, sampler: str, seed: int) -> dict[int, Outcome]:
        """Outcomes of one sampler and seed, by start number."""
        return {name.number: self.outcomes[name] for name in sorted(self.outcomes) if name[:2] == (sampler, seed)}


def save_archive(archive: Archive, path: str | os.PathLike[str]) -> Path:
    """Write an archive; an existing file is replaced only once the new one is complete.

    Writers wait for each other. Starts that another run has added to the file are kept, and added to `archive`.

    Raises
    ------
    StoreError
        If the folder cannot be made or written, or the file there is damaged or belongs to another problem: it is left alone.
    """
    path = Path(path)
    with locked(path.with_name(f".{path.name}.lock"), wait=True):
        if path.exists():
            there = load_archive(path)
            if there.problem.hash != archive.problem.hash:
                raise StoreError(f"{path} holds starts of another problem; choose another --output, or move it away.")
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
    put_attribute(file, "command", archive.command)
    put(file, "problem", json.dumps(archive.problem.to_dict()))
    put(file, "versions", json.dumps(versions()))
    names = sorted(archive.outcomes)
    outcomes = [archive.outcomes[name] for name in names]
    group = file.create_group("outcomes")
    _dataset(group, "sampler", [name.sampler for name in names], "text")
    _dataset(group, "seed", [name.seed for name in names], "1")
    _dataset(group, "start", [name.number for name in names], "1")
    for name in ("status", "message"):
        _dataset(group, name, [getattr(o, name) for o in outcomes], "text")
    for name, units in _NUMBERS.items():
        _dataset(group, name, [getattr(o, name) for o in outcomes], units)
    for name in ("guess", "gait"):
        own = group.create_group(name)
        gaits = [fourier_series(archive.problem, getattr(o, name)) for o in outcomes]
        harmonics = max((gait.n_harmonic for gait in gaits), default=0)
        for part, dims in (("mean", "start, joint"), ("cos", "start, joint, harmonic"), ("sin", "start, joint, harmonic")):
            _dataset(own, part, [getattr(gait.resized(harmonics), part) for gait in gaits], "rad", dims)
    found, rows = basins(archive.problem, outcomes), {id(o): row for row, o in enumerate(outcomes)}
    group = file.create_group("basins")
    _dataset(group, "best", [rows[id(b.best)] for b in found], "row of outcomes", "basin")
    _dataset(group, "count", [len(b.starts) for b in found], "1", "basin")
    _dataset(group, "frequency", [b.frequency for b in found], "share of starts", "basin")
    _dataset(group, "efficiency", [b.best.efficiency for b in found], "1/weight", "basin")
    _dataset(group, "on_speed_floor", [on_speed_floor(archive.problem, b.best.gait) for b in found], "1", "basin")


def _read(file: h5py.File) -> Archive:
    stated = json.loads(text(file, "problem"))
    problem = Problem.from_dict(stated)
    if statement_hash(stated) != attribute(file, "problem_hash"):
        raise StoreError(f"{file.filename} is damaged: its problem does not match its hash.")
    archive = Archive(problem, str(attribute(file, "command")))
    group = child(file, "outcomes")
    starts = array(group, "start")
    if not starts.size:
        return archive
    names = list(zip(array(group, "sampler"), array(group, "seed"), starts, strict=True))
    status, message = array(group, "status"), array(group, "message")
    numbers = {name: array(group, name) for name in _NUMBERS}
    gaits = {name: [array(child(group, name), part) for part in ("mean", "cos", "sin")] for name in ("guess", "gait")}
    for row, start in enumerate(starts):
        guess, gait = (Fourier(*(part[row] for part in gaits[name])) for name in ("guess", "gait"))
        values = {name: column[row].item() for name, column in numbers.items()}
        name = StartName(str(names[row][0]), int(names[row][1]), int(start))
        archive.outcomes[name] = Outcome(int(start), str(status[row]), str(message[row]), guess, gait, **values)
    return archive
