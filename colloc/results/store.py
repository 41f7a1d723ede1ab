"""Solutions as HDF5 files, readable with plain h5py; every dataset has ``units`` and ``dims``. A
former result of another problem, or a better one, is kept beside the new one.

/problem (JSON), /source (problem file), /versions, /settings, /others (JSON)
/gait/{mean,cos,sin} or {corners}, with attribute symmetry, ...
/motion/{t,joint_angles,joint_rates,tail_velocity,theta,centre,tail,power}: one period
/answer/{edges,x,lam_x,lam_g}; attributes delta, value, distance, work, kkt_error, panels, ...
/history/{delta,intervals,value,distance,work,...}: a row a step of the search
/certificate/{name,value,threshold,passed,meaning}; attributes value, value_error, ...
"""

from __future__ import annotations

import dataclasses
import io
import itertools
import json
import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from colloc.dynamics.control_problem import control_problem
from colloc.gaits.gait_fields import fields, gait_from
from colloc.gaits.problem import Problem
from colloc.numerics.mesh import Mesh
from colloc.numerics.schemes import scheme
from colloc.results.answer import Alternative, Answer, SecondOrder, Step
from colloc.results.checks import NUMBERS, UNCERTIFIED, Certificate, Check
from colloc.results.solution import Solution
from colloc.smooth.smooth_body import on_panels, panels_of
from colloc.system.errors import ProblemError, StoreError
from colloc.system.files import FAILED, INTERRUPTED, SHRUNK, alone_in, beside
from colloc.system.interruption import interruptible
from colloc.system.store_file import array, attribute, mark, new_file, open_file, put, put_attribute
from colloc.transcription.layout import layout_of

FORMAT, FORMAT_VERSION = "colloc solution", 6
_LAYOUT = "see colloc.transcription.layout"
_ANSWER_ARRAYS = {
    "edges": ("period", "edge"),
    "x": (_LAYOUT, "variable"),
    "lam_x": (_LAYOUT, "variable"),
    "lam_g": (_LAYOUT, "constraint"),
}
_SEPARATE = ("problem", "gait", "second_order", "history", *_ANSWER_ARRAYS)
_GAIT_ARRAYS = {
    "mean": ("rad", "joint"),
    "cos": ("rad", "joint, harmonic"),
    "sin": ("rad", "joint, harmonic"),
    "table": ("", "joint, function"),
    "corners": ("rad", "joint, vertex"),
    "schedule": ("period", "stage"),
}
_DRY, _OF_SAMPLES = "dry_efficiency", "errors_of_samples"


def save(solution: Solution, path: str | os.PathLike[str]) -> Path:
    """Write a solution; an existing file is replaced once the new one is complete.

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
    if not path.name:
        raise ProblemError(f"a result is saved in a file, which {path} does not name.")
    with new_file(path) as file:
        _write(file, solution)
    return path


def load(path: str | os.PathLike[str]) -> Solution:
    """Read the solution in a file that `save` wrote, unchecked: `colloc verify` checks it.

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
    with open_file(path, FORMAT, FORMAT_VERSION) as file:
        problem = Problem.from_dict(json.loads(array(file, "problem")))
        answer = _read_answer(file, problem)
        certificate = UNCERTIFIED
        if "certificate" in file:
            certificate = _read_certificate(file["certificate"])
        solution = Solution(
            problem,
            answer,
            certificate,
            float(attribute(file, "seconds")),
            array(file, "source"),
            str(attribute(file, "message")),
            json.loads(array(file, "versions")),
        )
        others = json.loads(array(file, "others"))
        solution.others = tuple(Alternative(**x | {"gait": gait_from(x["gait"])}) for x in others)
        solution.starts = int(attribute(file, "starts"))
        solution.interrupted = bool(attribute(file, "interrupted"))
        solution.settings = json.loads(array(file, "settings")) if "settings" in file else {}
        return solution


def holds_more(path: str | os.PathLike[str], solution: Solution) -> bool:
    """True if the file of a solution holds more than `save` writes, such as remarks."""

    def names(file):
        each = {f"/@{name}" for name in file.attrs}
        file.visititems(
            lambda at, item: each.update([at, *(f"{at}@{name}" for name in item.attrs)])
        )
        return each

    with h5py.File(path, "r", locking=False) as file, h5py.File(io.BytesIO(), "w") as written:
        _write(written, solution)
        return not names(file) <= names(written)


def _write(file: h5py.File, solution: Solution) -> None:
    problem, answer, certificate = solution.problem, solution.answer, solution.certificate
    mark(file, FORMAT, FORMAT_VERSION)
    put_attribute(file, "name", problem.name)
    put_attribute(file, "problem_hash", problem.hash)
    for name in ("status", "message", "seconds", "starts"):
        put_attribute(file, name, getattr(solution, name))
    put_attribute(file, "interrupted", int(solution.interrupted))
    put(file, "problem", json.dumps(problem.to_dict()))
    put(file, "source", solution.source)
    put(file, "versions", json.dumps(solution.versions))
    put(file, "settings", json.dumps(solution.settings))
    others = [{**dataclasses.asdict(x), "gait": fields(x.gait)} for x in solution.others]
    put(file, "others", json.dumps(others))

    group = file.create_group("answer")
    for name, (units, dims) in _ANSWER_ARRAYS.items():
        put(group, name, getattr(answer, name), units=units, dims=dims)
    for field in dataclasses.fields(answer):
        if field.name not in _SEPARATE:
            put_attribute(group, field.name, getattr(answer, field.name))
    put_attribute(group, "panels", panels_of(answer.problem.body))
    put_attribute(group, "smallest_shape_speed", answer.problem.smallest_shape_speed)
    put(group, "guess", json.dumps(fields(answer.problem.guess)))
    for field in dataclasses.fields(SecondOrder):
        put_attribute(group, f"second_order_{field.name}", getattr(answer.second_order, field.name))
    group = file.create_group("history")
    for field in dataclasses.fields(Step):
        put(group, field.name, [getattr(step, field.name) for step in answer.history], dims="step")

    group, coordinate = file.create_group("gait"), problem.body.defaults.coordinate
    for name, value in fields(solution.gait).items():
        if name in _GAIT_ARRAYS:
            units, dims = _GAIT_ARRAYS[name]
            put(group, name, value, units=units, dims=dims.replace("joint", coordinate))
        elif isinstance(value, dict):  # a class
            put(group, name, json.dumps(value))
        else:
            put_attribute(group, name, value)
    group = file.create_group("motion")
    for name, column in solution.columns().items():
        put(group, name, column.values, units=column.units, dims=", ".join(column.dims))

    if certificate.replayed:
        group = file.create_group("certificate")
        for name, number in certificate.numbers.items():
            if name != "efficiency":  # distance / work
                put_attribute(group, name, number)
        for name, numbers in ((_DRY, certificate.dry), (_OF_SAMPLES, certificate.of_samples)):
            if numbers is not None:
                put_attribute(group, name, list(numbers))
        for name in ("name", "value", "threshold", "passed", "meaning"):
            put(group, name, [getattr(check, name) for check in certificate.checks], dims="check")


def _read_answer(file: h5py.File, problem: Problem) -> Answer:
    group, steps, path = file["answer"], file["history"], file["gait"]
    arrays = {name: array(group, name) for name in _ANSWER_ARRAYS}
    names = [f.name for f in dataclasses.fields(Answer) if f.name not in _SEPARATE]
    plain = {name: attribute(group, name) for name in names}
    if panels := int(attribute(group, "panels")):
        problem = problem.with_(body=on_panels(problem.body, panels))
    if plain["delta"] < problem.delta:  # lowered for a small gait
        problem = problem.with_(delta=plain["delta"])
    if "guess" in group:  # the least speed was raised for a gait that would shrink
        guess = gait_from(json.loads(array(group, "guess")))
        speed = attribute(group, "smallest_shape_speed")
        problem = problem.with_(smallest_shape_speed=speed, guess=guess)
    names = [f.name for f in dataclasses.fields(SecondOrder)]
    second = SecondOrder(**{name: attribute(group, f"second_order_{name}") for name in names})
    columns = {f.name: array(steps, f.name).tolist() for f in dataclasses.fields(Step)}
    rows = zip(*columns.values(), strict=True)
    history = tuple(Step(**dict(zip(columns, row, strict=True))) for row in rows)
    control = control_problem(problem)
    layout = layout_of(control, Mesh(scheme(plain["scheme"]), arrays["edges"]))
    if arrays["x"].shape != (layout.n,) or not np.isfinite(arrays["x"]).all():
        raise StoreError("its variables do not fit its mesh.")
    gait = control.admissible.member(arrays["x"][layout.decisions])
    for name in {"table", "corners"} & set(path):
        if not np.allclose(getattr(gait, name), table := array(path, name), rtol=0, atol=1e-9):
            # of a version whose parameters meant others on other machines
            gait = dataclasses.replace(gait, **{name: table})
            arrays["x"][layout.decisions] = control.admissible.parameters(gait)
    return Answer(problem, gait, **arrays, **plain, second_order=second, history=history)


def _read_certificate(group: h5py.Group) -> Certificate:
    columns = [array(group, name) for name in ("name", "value", "threshold", "meaning")]
    checks = tuple(
        Check(str(n), float(v), float(t), str(m)) for n, v, t, m in zip(*columns, strict=True)
    )
    known = {*NUMBERS, _DRY, _OF_SAMPLES, "distance_error", "work_error"}
    integrals = [name for name in group.attrs if name not in known]
    names = ("distance", "work", "rotation", *integrals)
    values = {name: float(attribute(group, name)) for name in names}
    errors = {name: float(attribute(group, f"{name}_error")) for name in ("distance", "work")}
    pairs: Any = {
        field: tuple(map(float, attribute(group, name)))
        for field, name in (("dry", _DRY), ("of_samples", _OF_SAMPLES))
        if name in group.attrs
    }
    others = {name: type(getattr(UNCERTIFIED, name))(attribute(group, name)) for name in NUMBERS}
    return Certificate(values, errors, {}, checks, **others, **pairs)


_HOW = {"guess", "intervals", "scheme", "formulation", "mesh_tolerance", "delta_start"}
"""Fields of a problem that do not change the question."""


@dataclass(frozen=True)
class SavedFile:
    """A saved result, and where and why the former one was kept."""

    path: Path
    former: Path | None = None
    why: str = ""


def save_result(solution: Solution, path: Path) -> list[SavedFile]:
    """Save a solution at `path` (NAME.h5), or beside it if it failed (NAME.failed.h5) or was
    interrupted (NAME.interrupted.h5); then the better gait that shrank, if there is one, as
    NAME.shrunk.h5.

    A result that is there already is replaced only by an answer to the same question that is as
    good, and only if nobody added anything to it. Else it is kept, with its figures, under the
    first free name of NAME.former-1.h5, NAME.former-2.h5, ... Ctrl-C waits until all is saved.
    `StoreError` if the folder cannot be written; what was there is left as it was.
    """
    place = path
    if not solution.success:
        place = beside(path, INTERRUPTED if solution.interrupted else FAILED)
    with interruptible(), alone_in(path.parent):
        saved = [_save(solution, place)]
        if solution.shrunk is not None:
            saved.append(_save(solution.shrunk, beside(path, SHRUNK)))
        if solution.success:  # it is the end of what was interrupted
            beside(path, INTERRUPTED).unlink(missing_ok=True)
    return saved


def _save(solution: Solution, path: Path) -> SavedFile:
    there = _solution_at(path)
    why = _worth(there, solution, path)
    if not why:
        return SavedFile(save(solution, path))
    places = (beside(path, f"former-{k}") for k in itertools.count(1))
    # a free one, or one whose result the one that is there could replace
    place = next(
        place
        for place in places
        if not place.exists()
        or (there is not None and not _worth(_solution_at(place), there, place))
    )
    with _set_aside(path, place):
        save(solution, path)
    return SavedFile(path, place, why)


def _solution_at(path: Path) -> Solution | None:
    try:
        return load(path)
    except StoreError:
        return None


def _question(solution: Solution) -> dict:
    return {name: value for name, value in solution.problem.to_dict().items() if name not in _HOW}


def _worth(there: Solution | None, new: Solution, path: Path) -> str:
    if there is None:
        return "what was there and cannot be read" if path.exists() else ""
    if _question(there) != _question(new):
        return f"the former result, of another problem called {there.problem.name},"
    old, now = there.certificate, new.certificate
    # as far as both values are known
    as_good = now.value + now.value_error >= old.value - old.value_error
    if there.success and not (new.success and as_good):
        return (
            f"the former result, which is better ({old.value:.6g}, best of {there.starts} starts),"
        )
    if holds_more(path, there):
        return "the former result, which holds more than colloc wrote,"
    return ""


@contextmanager
def _set_aside(path: Path, place: Path) -> Iterator[None]:
    """Move a result aside with its figures; back again if the block fails."""
    pairs = [(path.with_suffix(kind), place.with_suffix(kind)) for kind in (".png", ".pdf")]
    pairs.append((beside(path, SHRUNK), beside(place, SHRUNK)))
    try:
        place.unlink(missing_ok=True)
        try:
            os.link(path, place)
        except OSError:  # a file system without a second name for a file
            os.replace(path, place)
        for old, new in pairs:
            if old.exists():
                os.replace(old, new)
        yield
    except BaseException as error:
        for old, new in [(path, place), *pairs]:
            with suppress(FileNotFoundError):
                if not old.exists():
                    os.replace(new, old)
                elif old.samefile(new):
                    new.unlink()
        if isinstance(error, OSError) and not isinstance(error, StoreError):
            raise StoreError(f"cannot keep {path} as {place}: {error.strerror or error}.") from None
        raise
