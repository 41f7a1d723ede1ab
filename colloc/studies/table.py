"""Results of a study as labelled arrays over its axes, and the netCDF-4 file that holds them.

Numbers are those of the best certified gait of a cell, or NaN, with ``status`` and ``message``.
``delta`` is per period; ``mean``, ``cos`` and ``sin`` are the gait's truncated Fourier series.
``below_neighbour`` is 1 where a neighbour's gait does better, unchanged (``neighbour_value``).
"""

from __future__ import annotations

import json
import os
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from colloc.gaits.gait import delta_per_period
from colloc.gaits.problem import Problem
from colloc.gaits.starts import on_speed_floor
from colloc.mechanics.law import rate_independent
from colloc.results.distinct_optima import fourier_series, series_class
from colloc.results.outcome import UNITS, Outcome
from colloc.results.solution import SOLVED, versions
from colloc.studies.gait_class import gait_class
from colloc.studies.run import StudyRun
from colloc.studies.study import ARRAYS, COLUMNS, KINDS, NUMBERS, Index
from colloc.system.store_file import Table, save_table

KIND, VERSION = "colloc study", 2
NO_PROBLEM, NOT_TRIED = "no problem", "not tried"
_UNITS = {
    **UNITS,
    **dict.fromkeys(("trivial_bound", "upper_bound"), "1/weight"),
    "neighbour_value": "of the objective",
    **dict.fromkeys(ARRAYS, "rad"),
}
_KnownBound = Callable[[Problem], float | None]


@dataclass(frozen=True, eq=False)
class StudyTable(Table):
    """Results of a study as labelled arrays over its axes."""

    def __repr__(self) -> str:
        status = self.variables["status"]
        certified = int((status == SOLVED).sum())
        return f"<StudyTable {self.name}: {certified} of {status.size} cells have a certified gait>"


def study_table(run: StudyRun, known_bound: _KnownBound = lambda _: None) -> StudyTable:
    """Results of all cells; `known_bound` gives an upper bound on d/W that is known for a
    problem."""
    study, cells = run.study, list(run.cells)
    problems = [p for state in run.cells.values() if (p := state.problem) is not None]
    sizes = {
        "joint": max(p.body.n_joint for p in problems),
        "harmonic": max(series_class(p).harmonics for p in problems),
    }
    variables: dict[str, np.ndarray] = {}
    for name, empty in COLUMNS.items():
        kind = object if isinstance(empty, str) else type(empty)
        variables[name] = np.full(study.shape, empty, dtype=kind)
    variables["status"][:] = NOT_TRIED
    for name, extra in ARRAYS.items():
        variables[name] = np.full((*study.shape, *(sizes[e] for e in extra)), np.nan)
    for cell in cells:
        for name, value in _row(run, cell, known_bound).items():
            if name in ARRAYS:
                variables[name][cell][tuple(map(slice, np.shape(value)))] = value
            else:
                variables[name][cell] = value
    axes = tuple(axis.name for axis in study.axes)
    coordinates = {
        axis.name: np.array(axis.values, dtype=object if axis.of_texts else float)
        for axis in study.axes
    }
    return StudyTable(
        study.name,
        coordinates | {name: np.arange(1, size + 1) for name, size in sizes.items()},
        variables,
        {name: (*axes, *ARRAYS.get(name, ())) for name in variables},
        _UNITS | {axis.name: axis.units for axis in study.axes},
        {**{n: n for n in sizes}, **{axis.name: axis.label or axis.name for axis in study.axes}},
    )


def _row(run: StudyRun, cell: Index, known_bound: _KnownBound) -> dict[str, Any]:
    state = run.cells[cell]
    problem, best = state.problem, state.best
    if problem is None:
        return {"status": NO_PROBLEM, "message": state.message}
    outcomes = [a.outcome for a in state.attempts]
    bound = known_bound(problem)
    row: dict[str, Any] = {
        "problem_hash": problem.hash,
        "starts": len(outcomes),
        "starts_certified": sum(o.status == SOLVED for o in outcomes),
        "seconds": sum(o.seconds for o in outcomes),
        "trivial_bound": 1.0 / problem.law.smallest if rate_independent(problem.law) else np.nan,
        "upper_bound": np.nan if bound is None else bound,
        "neighbour_value": run.neighbour_value(cell),
        "below_neighbour": int(run.below_neighbour(cell)),
        "status": NOT_TRIED,
    }
    if best is not None:
        row |= {"status": SOLVED, "origin": best.origin} | _gait_row(problem, best.outcome)
    elif outcomes:
        row |= {"status": outcomes[-1].status, "message": outcomes[-1].message}
    return row


def _gait_row(problem: Problem, outcome: Outcome) -> dict[str, Any]:
    gait = fourier_series(problem, outcome.gait)
    row: dict[str, Any] = {name: getattr(outcome, name) for name in NUMBERS}
    row |= {name: getattr(gait, name) for name in ARRAYS}
    row["delta"] = delta_per_period(problem.gait, outcome.gait, outcome.delta)
    row["at_slowest"] = int(on_speed_floor(problem, outcome.gait))
    if problem.body.n_joint > 1:
        kind = gait_class(gait, problem.body, problem.law)
        row |= {name: getattr(kind, name) for name in KINDS} | {"gait_class": kind.label}
    return row


def save_study(
    table: StudyTable, path: str | os.PathLike[str], *, source: str = "", command: str = ""
) -> Path:
    facts = {"source": source, "command": command, "versions": json.dumps(versions())}
    stated = replace(table, attributes=facts | {"Conventions": "CF-1.8"})
    return save_table(stated, path, KIND, VERSION)
