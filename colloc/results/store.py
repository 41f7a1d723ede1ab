"""Solutions as HDF5 files: self-describing, readable with plain h5py, replaced atomically, and nothing but data.

Layout of a file (every dataset carries ``units`` and ``dims``)::

    /problem            JSON text of all fields          /source     text of the problem file
    /gait/{mean,cos,sin}                                 /versions   JSON text
         or {edges,shapes,tangents,length} of a free path, or {corners} of a polygon, with attribute symmetry
    /motion/{t,joint_angles,joint_rates,tail_velocity,theta,centre,tail,power}    one period of the result; of a smooth body
        modes and mode_rates
    /levels/000/{edges,x,lam_x,lam_g}, knots of a free path; attributes delta, efficiency, objective (NaN: the efficiency), ...
    /certificate/{name,value,threshold,passed,meaning}, attributes value, value_error, efficiency, efficiency_error, ...
    /relaxed/{durations,directions,start}, attribute symmetry and those of `results.relaxation.Optimality`, with
        /relaxed/certificate and /relaxed/realised/000/{corners,certificate}, attributes repeats, sense, symmetry
"""

from __future__ import annotations

import dataclasses
import json
import os
import warnings
from pathlib import Path

import h5py
import numpy as np

from colloc.gaits.gait_fields import AnyGait, fields, gait_from, statement_hash
from colloc.gaits.polygon import Corners
from colloc.gaits.problem import Problem
from colloc.gaits.relaxed import Mixture
from colloc.results.checks import UNCERTIFIED, Certificate, Check
from colloc.results.former_format import converted, is_former
from colloc.results.relaxation import Optimality, Realised, Relaxation
from colloc.results.solution import Solution
from colloc.results.steps import Alternative, Level
from colloc.system.errors import ChangedFileWarning, StoreError
from colloc.system.store_file import (
    BETWEEN_DIMS,
    array,
    attribute,
    child,
    mark,
    new_file,
    put,
    put_attribute,
    sealed_file,
    text,
    was_changed,
)

FORMAT, FORMAT_VERSION = "colloc solution", 3
_LAYOUT = "see colloc.collocation.layout"
_LEVEL_ARRAYS = {
    "edges": ("period", "edge"),
    "x": (_LAYOUT, "variable"),
    "lam_x": (_LAYOUT, "variable"),
    "lam_g": (_LAYOUT, "constraint"),
}
_KNOTS = "knots"

_GAIT_ARRAYS = {
    "mean": ("rad", "joint"),
    "cos": ("rad", "joint, harmonic"),
    "sin": ("rad", "joint, harmonic"),
    "edges": ("period", "edge"),
    "shapes": ("rad", "joint, edge"),
    "tangents": ("heading in rad, or unit vector", "component, edge"),
    "length": ("rad", ""),
    "corners": ("rad", "joint, vertex"),
    "schedule": ("period", "stage"),
    "durations": ("rad", "piece, direction"),
    "directions": ("", "piece, direction, joint"),
    "start": ("rad", "joint"),
}
_MIXTURE = ("durations", "directions", "start")


def save(solution: Solution, path: str | os.PathLike[str]) -> Path:
    """Write a solution; an existing file is replaced only once the new one is complete.

    Raises
    ------
    StoreError
        If the folder cannot be made or written.

    Examples
    --------
    >>> import colloc, os, tempfile
    >>> problem = colloc.Problem("quick", gait=colloc.Harmonic(1, "bilateral"), delta=1e-2)
    >>> solution = colloc.solve(problem, starts=1)
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = colloc.save(solution, os.path.join(folder, "quick.h5"))
    ...     again = colloc.load(path)
    >>> again.certificate == solution.certificate
    True
    """
    path = Path(path)
    with new_file(path) as file:
        _write(file, solution)
    return path


def load(path: str | os.PathLike[str]) -> Solution:
    """The solution in a file that `save` wrote.

    A file of the former format is converted first (`colloc.results.former_format`).
    A file that another program has opened to write since then is read with a `ChangedFileWarning`, and the solution is marked
    as ``changed``: `colloc verify` decides what it is worth.

    Raises
    ------
    StoreError
        If the file is missing, damaged, or not a colloc solution. Nothing in the file is executed.

    Examples
    --------
    >>> import colloc
    >>> colloc.load("nothing.h5")
    Traceback (most recent call last):
    colloc.system.errors.StoreError: there is no file nothing.h5.
    """
    if is_former(path):
        with converted(path, FORMAT, FORMAT_VERSION) as present:
            return load(present)
    changed = was_changed(Path(path), FORMAT)
    try:
        with sealed_file(path, FORMAT, FORMAT_VERSION, unsealed=changed) as file:
            solution = _read(file)
    except StoreError as error:
        if not changed:
            raise
        raise StoreError(f"{path} was changed after colloc wrote it, and cannot be read any more: {error}") from None
    if changed:
        solution.changed = True
        message = f"{path} was changed after colloc wrote it; colloc verify {path} says what it is worth."
        warnings.warn(message, ChangedFileWarning, stacklevel=2)
    return solution


def _write(file: h5py.File, solution: Solution) -> None:
    mark(file, FORMAT, FORMAT_VERSION)
    put_attribute(file, "name", solution.problem.name)
    put_attribute(file, "problem_hash", solution.problem.hash)
    for name in ("status", "message", "seconds"):
        put_attribute(file, name, getattr(solution, name))
    put(file, "problem", json.dumps(solution.problem.to_dict()))
    put(file, "source", solution.source)
    put(file, "versions", json.dumps(solution.versions))
    put_attribute(file, "starts", solution.starts)
    others = [{**dataclasses.asdict(other), "gait": fields(other.gait)} for other in solution.others]
    put(file, "others", json.dumps(others))
    for index, level in enumerate(solution.levels):
        group = file.create_group(f"levels/{index:03d}")
        for name, (units, dims) in _LEVEL_ARRAYS.items():
            put(group, name, getattr(level, name), units=units, dims=dims)
        if level.knots is not None:
            put(group, _KNOTS, level.knots, units="period", dims="knot")
        for field in dataclasses.fields(level):
            if field.name not in (*_LEVEL_ARRAYS, _KNOTS):
                put_attribute(group, field.name, getattr(level, field.name))
    if solution.levels:
        _write_motion(file, solution)
    if solution.certificate.replayed:
        _write_certificate(file.create_group("certificate"), solution.certificate)
    if solution.relaxed is not None:
        _write_relaxation(file.create_group("relaxed"), solution.relaxed, solution.problem.body.coordinate)


def _write_gait(group: h5py.Group, gait: AnyGait, coordinate: str) -> None:
    for name, value in fields(gait).items():
        if name in _GAIT_ARRAYS:
            units, dims = _GAIT_ARRAYS[name]
            put(group, name, value, units=units, dims=dims.replace("joint", coordinate))
        else:
            put_attribute(group, name, value)


def _write_motion(file: h5py.File, solution: Solution) -> None:
    _write_gait(file.create_group("gait"), solution.gait, solution.problem.body.coordinate)
    group = file.create_group("motion")
    for name, column in solution.columns().items():
        put(group, name, column.values, units=column.units, dims=BETWEEN_DIMS.join(column.dims))


def _write_relaxation(group: h5py.Group, relaxed: Relaxation, coordinate: str) -> None:
    _write_gait(group, relaxed.gait, coordinate)
    for field in dataclasses.fields(Optimality):
        put_attribute(group, field.name, getattr(relaxed.optimality, field.name))
    _write_certificate(group.create_group("certificate"), relaxed.certificate)
    for index, realised in enumerate(relaxed.realised):
        one = group.create_group(f"realised/{index:03d}")
        _write_gait(one, realised.gait, coordinate)
        for name in ("repeats", "sense"):
            put_attribute(one, name, getattr(realised, name))
        _write_certificate(one.create_group("certificate"), realised.certificate)


def _read_relaxation(group: h5py.Group) -> Relaxation:
    mixture = Mixture(**{name: array(group, name) for name in _MIXTURE}, symmetry=str(attribute(group, "symmetry")))
    optimality = Optimality(**{field.name: attribute(group, field.name) for field in dataclasses.fields(Optimality)})
    realised = []
    for name in sorted(child(group, "realised")):
        one = child(child(group, "realised"), name)
        gait = Corners(array(one, "corners"), str(attribute(one, "symmetry")))
        repeats, sense = (int(attribute(one, name)) for name in ("repeats", "sense"))
        realised.append(Realised(repeats, sense, gait, _read_certificate(child(one, "certificate"))))
    return Relaxation(mixture, optimality, _read_certificate(child(group, "certificate")), tuple(realised))


def _write_certificate(group: h5py.Group, certificate: Certificate) -> None:
    """Write a certificate into a group of its own."""
    for field in dataclasses.fields(certificate):
        if field.name != "checks":
            put_attribute(group, field.name, getattr(certificate, field.name))
    for name in ("name", "value", "threshold", "passed", "meaning"):
        put(group, name, [getattr(check, name) for check in certificate.checks], dims="check")


def _read_certificate(group: h5py.Group) -> Certificate:
    """The certificate that `_write_certificate` wrote."""
    columns = [array(group, name) for name in ("name", "value", "threshold", "meaning")]
    checks = tuple(Check(str(n), float(v), float(t), str(m)) for n, v, t, m in zip(*columns, strict=True))
    stated = [f.name for f in dataclasses.fields(Certificate) if f.default is dataclasses.MISSING or f.name in group.attrs]
    return Certificate(checks, **{name: attribute(group, name) for name in stated if name != "checks"})


def _read(file: h5py.File) -> Solution:
    stated = json.loads(text(file, "problem"))
    problem = Problem.from_dict(stated)
    if statement_hash(stated) != attribute(file, "problem_hash"):
        raise StoreError(f"{file.filename} is damaged: its problem does not match its hash.")
    levels = []
    found = child(file, "levels") if "levels" in file else ()
    for name in sorted(found):
        group = child(found, name)
        arrays = {key: array(group, key) for key in _LEVEL_ARRAYS}
        there = [f.name for f in dataclasses.fields(Level) if f.default is dataclasses.MISSING or f.name in group.attrs]
        rest = {name: attribute(group, name) for name in there if name not in _LEVEL_ARRAYS}
        knots = array(group, _KNOTS) if _KNOTS in group else None
        levels.append(Level(**arrays, **rest, knots=knots))
    certificate = UNCERTIFIED
    if "certificate" in file:
        certificate = _read_certificate(child(file, "certificate"))
    solution = Solution(
        problem,
        levels,
        certificate,
        float(attribute(file, "seconds")),
        text(file, "source"),
        str(attribute(file, "message")),
        json.loads(text(file, "versions")),
    )
    if "others" in file:
        others = [{**other, "gait": gait_from(other["gait"])} for other in json.loads(text(file, "others"))]
        for other in others:  # earlier files know of the efficiency only
            other.setdefault("value", other.pop("efficiency", np.nan))
        solution.starts, solution.others = int(attribute(file, "starts")), tuple(Alternative(**other) for other in others)
    if "relaxed" in file:
        solution.relaxed = _read_relaxation(child(file, "relaxed"))
    if levels and (solution.last.x.shape != (solution.layout.n,) or not np.isfinite(solution.last.x).all()):
        raise StoreError(f"{file.filename} is damaged: its variables do not fit its mesh.")
    return solution
