"""The cells of a study as labelled arrays: best certified gait of each, its class and its
bounds."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from colloc.gaits.gait import delta_per_period
from colloc.gaits.problem import Problem
from colloc.gaits.starts import on_speed_floor
from colloc.mechanics.law import rate_independent
from colloc.results.distinct_optima import fourier_series, series_class
from colloc.results.outcome import UNITS as OF_OUTCOMES
from colloc.results.outcome import Outcome
from colloc.results.solution import SOLVED
from colloc.studies.gait_class import GaitClass, gait_class
from colloc.studies.run import StudyRun
from colloc.studies.study import ARRAYS, COUNTS, NUMBERS, OTHERS, TEXTS, Index, Study
from colloc.system.late_binding import optional

if TYPE_CHECKING:
    import xarray

NO_PROBLEM, NOT_TRIED = "no problem", "not tried"
UNITS = {
    **OF_OUTCOMES,
    "trivial_bound": "1/weight",
    "upper_bound": "1/weight",
    "neighbour_value": "of the objective",
    **dict.fromkeys(("mean", "cos", "sin"), "rad"),
}
KnownBound = Callable[[Problem], float | None]


@dataclass(frozen=True, eq=False)
class StudyTable:
    """Labelled arrays: coordinates and variables by name, with the dimensions of each variable."""

    name: str
    coordinates: Mapping[str, np.ndarray]
    units: Mapping[str, str]
    labels: Mapping[str, str]
    variables: Mapping[str, np.ndarray]
    dimensions: Mapping[str, tuple[str, ...]]

    def __repr__(self) -> str:
        status = self.variables["status"]
        certified = int((status == SOLVED).sum())
        return f"<StudyTable {self.name}: {certified} of {status.size} cells have a certified gait>"

    def to_xarray(self) -> xarray.Dataset:
        """The arrays as an xarray Dataset."""
        arrays = optional("xarray")
        found = {
            k: (self.dimensions[k], v, {"units": UNITS.get(k, "1")})
            for k, v in self.variables.items()
        }
        return arrays.Dataset(found, dict(self.coordinates), {"name": self.name})


def study_table(run: StudyRun, known_bound: KnownBound = lambda _: None) -> StudyTable:
    """All cells of a run; `known_bound` gives an upper bound on the efficiency of every gait of a
    problem's body, if one is known."""
    study = run.study
    axes = tuple(axis.name for axis in study.axes)
    problems = [state.problem for state in run.cells.values() if state.problem is not None]
    joints, harmonics = (
        max(p.body.n_joint for p in problems),
        max(series_class(p).harmonics for p in problems),
    )
    variables: dict[str, np.ndarray] = {}
    dimensions: dict[str, tuple[str, ...]] = {}

    def variable(name: str, kind: type, empty: object, extra: tuple[str, ...] = ()) -> None:
        sizes = {"joint": joints, "harmonic": harmonics}
        variables[name] = np.full((*study.shape, *(sizes[e] for e in extra)), empty, dtype=kind)
        dimensions[name] = (*axes, *extra)

    for name in (*NUMBERS, *OTHERS):
        variable(name, float, np.nan)
    for name in COUNTS:
        variable(name, int, 0)
    for name in TEXTS:
        variable(name, object, "")
    for name, extra in ARRAYS.items():
        variable(name, float, np.nan, extra)
    for cell in run.cells:
        for name, value in _cell(run, cell, known_bound).items():
            here = variables[name][cell]
            if isinstance(here, np.ndarray):
                here[tuple(slice(0, n) for n in np.shape(value))] = value
            else:
                variables[name][cell] = value
    coordinates = {axis.name: _coordinate(axis.values) for axis in study.axes}
    coordinates |= {"joint": np.arange(1, joints + 1), "harmonic": np.arange(1, harmonics + 1)}
    units, labels = (
        {axis.name: axis.units for axis in study.axes},
        {axis.name: axis.label or axis.name for axis in study.axes},
    )
    return StudyTable(study.name, coordinates, units, labels, variables, dimensions)


def _coordinate(values: tuple) -> np.ndarray:
    return np.array(values, dtype=object if isinstance(values[0], str) else float)


def _cell(run: StudyRun, cell: Index, known_bound: KnownBound) -> dict[str, Any]:
    state = run.cells[cell]
    problem = state.problem
    if problem is None:
        return {"status": NO_PROBLEM, "message": state.message}
    outcomes = [a.outcome for a in state.attempts]
    row: dict[str, Any] = {
        "problem_hash": problem.hash,
        "starts": len(outcomes),
        "status": NOT_TRIED,
    }
    row["starts_certified"] = sum(o.status == SOLVED for o in outcomes)
    row["seconds"] = sum(o.seconds for o in outcomes)
    row["trivial_bound"] = 1.0 / problem.law.smallest if rate_independent(problem.law) else np.nan
    bound = known_bound(problem)
    row["upper_bound"] = np.nan if bound is None else bound
    row["neighbour_value"], row["below_neighbour"] = (
        run.neighbour_value(cell),
        int(run.below_neighbour(cell)),
    )
    best = state.best
    if best is not None:
        row |= {"status": SOLVED, "origin": best.origin} | _gait_row(problem, best.outcome)
    elif outcomes:
        row |= {"status": outcomes[-1].status, "message": outcomes[-1].message}
    return row


def _gait_row(problem: Problem, outcome: Outcome) -> dict[str, Any]:
    gait = fourier_series(problem, outcome.gait)
    row: dict[str, Any] = {name: getattr(outcome, name) for name in NUMBERS}
    row["delta"] = delta_per_period(problem.gait, outcome.gait, outcome.delta)
    row |= {"mean": gait.mean, "cos": gait.cos, "sin": gait.sin}
    row["at_slowest"] = int(on_speed_floor(problem, outcome.gait))
    if problem.body.n_joint > 1:
        kind: GaitClass = gait_class(gait, problem.body, problem.law)
        row |= {
            name: getattr(kind, name)
            for name in ("bilateral", "antipodal", "retraced", "winding", "wave", "forward")
        }
        row["gait_class"] = kind.label
    return row


def cell_text(study: Study, cell: Index) -> str:
    """Coordinates of a cell for people."""
    return ", ".join(
        f"{k} {v:.4g}" if isinstance(v, float) else f"{k} {v}"
        for k, v in study.coordinates(cell).items()
    )
