"""A small file of every kind that colloc writes, with its reader and a writer."""

from pathlib import Path

import numpy as np

from colloc import Axis, Fourier, Harmonic, Problem, Study, ellipse, load, save
from colloc.results.archive import Archive, Outcome, StartName, open_archive
from colloc.results.solution import SOLVED
from colloc.studies import sweep as studies
from colloc.system.row_file import CACHE, put_rows, read_rows
from colloc.system.store_file import Table, array, attribute, open_file
from scripts.paper.study import read_arrays, write_arrays

GAIT = Fourier([0.3, -0.5], [[0.9, 0.2], [0.1, -0.1]], [[0.0, 0.1], [0.8, 0.2]])
HDF5_KINDS = ("solution", "arrays", "study")
ROW_KINDS = ("archive", "journal", "cache")
KINDS = (*HDF5_KINDS, *ROW_KINDS)


def problem(x=1.0):
    fields = {"gait": Harmonic(2, "none"), "intervals": 10, "mesh_tolerance": 0.0}
    return Problem("sample", ellipse(0.2, 1.2, 0.8), **fields, smallest_shape_speed=0.1 + 1e-6 * x)


def outcome(start, efficiency=0.2, gait=GAIT, guess=None, status=SOLVED):
    numbers = 1e-7, 0.1, 0.5, 1e-4, 12, 1.5, 1.25, efficiency, 1e-7
    return Outcome(start, status, "", guess or gait, gait, efficiency, *numbers)


def archive(path, starts=range(3)) -> Archive:
    found = open_archive(problem(), path)
    found.add({StartName("latin-hypercube", 0, k): outcome(k) for k in starts})
    return found


def record(k=0):
    return studies.Visit(
        problem(1.0 + 0.01 * k).hash, (studies.Attempt("warm", f"key{k}", outcome(k)),)
    )


def table(folder):
    study = Study(
        "sample", (Axis("x", (1.0, 1.5)), Axis("kind", ("a", "b"))), lambda x, kind: problem(x)
    )
    run = studies.StudyRun(study, folder)
    for k, state in enumerate(map(run.state, study.cells())):
        state.attempts.append(studies.Attempt("warm", "key", outcome(k)))
    return studies.study_table(run)


class Samples:
    """Writes and reads files of one kind under a folder."""

    def __init__(self, folder: Path, solution) -> None:
        self.folder, self.solution, self.table = folder, solution, table(folder / "none")

    def path(self, kind: str) -> Path:
        return self.folder / {
            "journal": studies.NAME,
            "cache": "bounds.sqlite",
            "archive": "archive.sqlite",
        }.get(kind, f"{kind}.h5")

    def write(self, kind: str, version: int = 0) -> Path:
        path = self.path(kind)
        path.parent.mkdir(parents=True, exist_ok=True)
        if kind == "solution":
            self.solution.seconds = float(version)
            save(self.solution, path)
        elif kind == "archive":
            archive(path.with_suffix(".h5"), range(3 + version))
        elif kind == "arrays":
            arrays = {"a/b": np.arange(2000.0) + version, "names": np.array(["d", "W"])}
            write_arrays(path, arrays, units={})
        elif kind == "study":
            studies.save_study(self.table, path, source=str(version) * 10)
        elif kind == "journal":
            studies.append_visits(
                self.folder,
                [record(5 + version)] if path.exists() else [record(k) for k in range(5)],
            )
        else:
            put_rows(path, CACHE, {f"key{version}": {"value": 1.0 + version}})
        return path

    def read(self, kind: str, path: Path | None = None):
        """What a file holds, as something that can be compared."""
        path = path or self.path(kind)
        if kind == "solution":
            found = load(path)
            return found.seconds, found.problem.hash, found.answer.x.tobytes(), found.certificate
        if kind == "archive":
            found = open_archive(problem(), path.with_suffix(".h5"))
            return {name: o.efficiency for name, o in found.outcomes.items()}
        if kind == "arrays":
            return {k: np.asarray(v).tolist() for k, v in read_arrays(path).items()}
        if kind == "study":
            found = load_study(path)
            return found.attributes, {
                name: repr(values.tolist()) for name, values in found.variables.items()
            }
        if kind == "journal":
            return sorted(a.key for r in studies.read_journal(path.parent) for a in r.attempts)
        return read_rows(path, CACHE)


def load_study(path):
    """The table that `save_study` wrote. `StoreError` if it cannot be read."""
    with open_file(path, studies.KIND, studies.VERSION) as file:
        columns = {name: array(file, name) for name in file}
        dims = {name: tuple(attribute(file[name], "dims").split(", ")) for name in file}
        attributes = {name: attribute(file, name) for name in file.attrs}
    coordinates = {name: values for name, values in columns.items() if dims[name] == (name,)}
    variables = {name: values for name, values in columns.items() if name not in coordinates}
    dims = {name: dims[name] for name in variables}
    return Table(attributes["name"], coordinates, variables, dims, attributes=attributes)
