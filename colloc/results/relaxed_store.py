"""Relaxed solutions as HDF5 files, in the manner of `colloc.results.store`.

Layout of a file::

    /problem /source /versions                           as of other solutions
    /relaxed/{durations,directions,start}, attribute symmetry, and those of `results.relaxed_solution.Optimality`
    /certificate                                         of the relaxed gait
    /realised/000/{corners,certificate}, attributes repeats, sense, symmetry
    /others                                              (efficiency, extent) of other relaxed gaits
"""

from __future__ import annotations

import dataclasses
import json
import os
from pathlib import Path

import h5py
import numpy as np

from colloc.gaits.mixture import Mixture
from colloc.gaits.paths import Corners
from colloc.gaits.problem import Problem, statement_hash
from colloc.results.relaxed_solution import Optimality, Realised, RelaxedSolution
from colloc.results.store import read_certificate, write_certificate
from colloc.system.errors import StoreError
from colloc.system.store_file import array, attribute, child, mark, new_file, put, put_attribute, sealed_file, text

FORMAT, FORMAT_VERSION = "colloc relaxed solution", 1
_RELAXED = {
    "durations": ("rad", "piece, direction"),
    "directions": ("", "piece, direction, joint"),
    "start": ("rad", "joint"),
}


def save_relaxed(solution: RelaxedSolution, path: str | os.PathLike[str]) -> Path:
    """Write a solution; an existing file is replaced only once the new one is complete.

    Raises
    ------
    StoreError
        If the folder cannot be made or written.
    """
    path = Path(path)
    with new_file(path) as file:
        mark(file, FORMAT, FORMAT_VERSION)
        put_attribute(file, "problem_hash", solution.problem.hash)
        for name in ("status", "message", "seconds", "starts"):
            put_attribute(file, name, getattr(solution, name))
        put(file, "problem", json.dumps(solution.problem.to_dict()))
        put(file, "source", solution.source)
        put(file, "versions", json.dumps(solution.versions))
        put(file, "others", json.dumps(solution.others))
        group = file.create_group("relaxed")
        for name, (units, dims) in _RELAXED.items():
            put(group, name, getattr(solution.relaxed, name), units=units, dims=dims)
        put_attribute(group, "symmetry", solution.relaxed.symmetry)
        for field in dataclasses.fields(Optimality):
            put_attribute(group, field.name, getattr(solution.optimality, field.name))
        write_certificate(file.create_group("certificate"), solution.certificate)
        for index, realised in enumerate(solution.realised):
            group = file.create_group(f"realised/{index:03d}")
            put(group, "corners", realised.gait.corners, units="rad", dims="joint, vertex")
            put_attribute(group, "symmetry", realised.gait.symmetry)
            put_attribute(group, "repeats", realised.repeats)
            put_attribute(group, "sense", realised.sense)
            write_certificate(group.create_group("certificate"), realised.certificate)
    return path


def is_relaxed(path: str | os.PathLike[str]) -> bool:
    """Whether a file holds a relaxed solution that nobody has changed."""
    try:
        with sealed_file(path, FORMAT, FORMAT_VERSION):
            return True
    except StoreError:
        return False


def load_relaxed(path: str | os.PathLike[str]) -> RelaxedSolution:
    """The solution in a file that `save_relaxed` wrote.

    Raises
    ------
    StoreError
        If the file is missing, damaged, or holds something else. Nothing in the file is executed.
    """
    with sealed_file(path, FORMAT, FORMAT_VERSION) as file:
        return _read(file)


def _read(file: h5py.File) -> RelaxedSolution:
    stated = json.loads(text(file, "problem"))
    if statement_hash(stated) != attribute(file, "problem_hash"):
        raise StoreError(f"{file.filename} is damaged: its problem does not match its hash.")
    group = child(file, "relaxed")
    durations, directions, start = (np.asarray(array(group, name)) for name in _RELAXED)
    relaxed = Mixture(durations, directions, start, str(attribute(group, "symmetry")))
    optimality = Optimality(**{field.name: attribute(group, field.name) for field in dataclasses.fields(Optimality)})
    realised = []
    for name in sorted(child(file, "realised")):
        group = child(child(file, "realised"), name)
        gait = Corners(array(group, "corners"), str(attribute(group, "symmetry")))
        certificate = read_certificate(child(group, "certificate"))
        realised.append(Realised(int(attribute(group, "repeats")), int(attribute(group, "sense")), gait, certificate))
    return RelaxedSolution(
        Problem.from_dict(stated), relaxed, optimality, read_certificate(child(file, "certificate")), tuple(realised),
        float(attribute(file, "seconds")), text(file, "source"),
        int(attribute(file, "starts")), tuple((float(a), float(b)) for a, b in json.loads(text(file, "others"))),
        json.loads(text(file, "versions")),
    )  # fmt: skip
