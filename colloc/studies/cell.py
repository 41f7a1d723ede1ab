"""Cells of a study: what a worker does for one, and the journal of all visits."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from colloc.gaits.gait import delta_per_period
from colloc.gaits.gait_fields import AnyGait, fields, statement_hash
from colloc.gaits.problem import Problem
from colloc.gaits.starts import LATIN_HYPERCUBE, start_gait, to_class
from colloc.results.archive import ERROR, Outcome, outcome_fields, outcome_from
from colloc.results.comparison import SAME_GAIT, distance, fourier_series, phase_distance
from colloc.results.solution import SOLVED
from colloc.search.explore import with_reachable_distance
from colloc.search.iterate import Iterate, space_near
from colloc.search.optimise import project_to_zero_rotation
from colloc.studies.solve import run_guess
from colloc.studies.study import Index
from colloc.system.errors import CollocError
from colloc.system.row_file import put_rows, read_rows
from colloc.verification.replay import replayer

KIND, NAME = "colloc journal 2", "journal.sqlite"
GUESS, WARM, COLD, RESCUE = "guess", "warm", "cold", "rescue"
_COARSE, _FINE = (200, 200), (1600, 25600)  # instants of a replay, and at most; 200 are within 3e-4
_LEVER = 0.5  # body lengths by which the distance depends on the point followed, per net rotation
_SAME_START = 1e-3
BETTER = 1e-3  # relative gain in value that is worth a solve, and that a coarse replay resolves


def start_key(gait: AnyGait) -> str:
    return statement_hash(fields(gait))[:16]


@dataclass(frozen=True, eq=False)
class Attempt:
    """Outcome of one start of a cell; its origin, and a key so that it is not solved again."""

    origin: str
    key: str
    outcome: Outcome

    @cached_property
    def gait_key(self) -> str:
        return start_key(self.outcome.gait)


def best_attempt(attempts: Iterable[Attempt]) -> Attempt | None:
    """The certified attempt of largest value."""
    certified = (a for a in attempts if a.outcome.status == SOLVED)
    return max(certified, key=lambda a: a.outcome.value, default=None)


@dataclass(frozen=True, eq=False)
class Visit:
    """Attempts at the cell of a problem, and values there of gaits of other cells by `start_key`,
    evaluated without optimising (NaN if unknown)."""

    problem_hash: str
    attempts: list[Attempt]
    scores: dict[str, float] = field(default_factory=dict)


def read_journal(folder: Path) -> list[Visit]:
    """All visits in a folder, in order. `StoreError` if the journal cannot be read."""

    def decode(row: dict[str, Any]) -> Visit:
        attempts = [
            Attempt(str(a["origin"]), str(a["key"]), outcome_from(a["outcome"]))
            for a in row["attempts"]
        ]
        scores = {str(key): float(score) for key, score in row["scores"].items()}
        return Visit(str(row["problem"]), attempts, scores)

    return [*read_rows(folder / NAME, KIND, decode).values()]


def append_visits(folder: Path, visits: Iterable[Visit]) -> None:
    """Put visits on the disk. `StoreError` if that is not possible."""
    rows = [
        {
            "problem": visit.problem_hash,
            "attempts": [
                {"origin": a.origin, "key": a.key, "outcome": outcome_fields(a.outcome)}
                for a in visit.attempts
            ],
            "scores": {key: x for key, x in visit.scores.items() if math.isfinite(x)},
        }
        for visit in visits
    ]
    put_rows(folder / NAME, KIND, {statement_hash(row): row for row in rows})


@dataclass(frozen=True, eq=False)
class Work:
    """A cell to solve; the last three as in `colloc.studies.study.Study`."""

    cell: Index
    problem: Problem
    first: bool  # its guess and cold starts are still to be solved
    inside: tuple[Index, ...]  # earlier cells of the task, whose gaits are warm starts
    gaits: tuple[AnyGait, ...]  # warm starts of other tasks
    cold: tuple[int, ...]  # numbers of the seeded starts
    incumbent: float  # best certified value so far, or 0
    tried: frozenset[str]  # keys of starts solved before
    warm_starts: int
    time_limit: float
    seed: int


def member(problem: Problem, gait: AnyGait) -> AnyGait | None:
    """Project a gait of any class into the problem's class; None if that is not admissible."""
    body, gaits = problem.body, problem.gait
    if gait.n_joint != body.n_joint or not gaits.free:
        return None
    try:
        similar = to_class(gaits, gait, body, problem.joint_limit, problem.smallest_shape_speed)
        space, v = space_near(problem, project_to_zero_rotation(problem, similar, problem.delta))
        projection = space.member(v)
        problem.with_(guess=projection)
    except CollocError:
        return None
    return projection


def value_of(problem: Problem, gait: AnyGait, instants: tuple[int, int] = _COARSE) -> float:
    """Objective of a gait by replay, or 0; reduced by what an unwanted net rotation may add."""
    rotation = problem.rotation or 0.0
    try:
        delta = delta_per_period(problem.gait, gait, problem.delta)
        period = replayer(problem.regime)(
            problem.body, problem.law, gait, delta, instants=instants[0], most_instants=instants[1],
            breaks=gait.corner_phases, objective=problem.objective, turn=rotation,
        )  # fmt: skip
    except CollocError:
        return 0.0
    turned = 0.0 if problem.rotation is None else abs(period.rotation - rotation)
    sure = {**period.values, "distance": max(0.0, period.distance - _LEVER * turned)}
    value = problem.objective(sure)
    return float(value) if np.isfinite(value) else 0.0


def visit(work: Work) -> Visit:
    """Solve a cell from its starts, the most promising gaits of others first.

    These are starts while they do better, unchanged, than all results so far. Optima that are no
    better than, or the same as, the certified one are passed over. If the best one promises more
    than the search from it keeps, it is tried once more from the problem's own delta_start.
    """
    problem, attempts = with_reachable_distance(work.problem), list[Attempt]()
    gaits = {start_key(gait): gait for gait in work.gaits}
    nearest = {key: member(problem, gait) for key, gait in gaits.items()}
    members = {key: gait for key, gait in nearest.items() if gait is not None}
    scores = {key: value_of(problem, members[key]) if key in members else 0.0 for key in gaits}
    paths = {key: fourier_series(problem, gait) for key, gait in members.items()}
    warm = list[str]()  # keys of distinct gaits that were not solved before, best first
    for key in sorted(members, key=lambda key: -scores[key]):
        if start_key(members[key]) not in work.tried and all(
            phase_distance(paths[key], paths[other]) > _SAME_START for other in warm
        ):
            warm.append(key)

    def enough() -> float:
        best = best_attempt(attempts)
        return (1 + BETTER) * max(work.incumbent, best.outcome.value if best else 0.0)

    def worth(end: Iterate) -> bool:
        best = best_attempt(attempts)
        if not end.value > enough():
            return best is None and not work.incumbent
        if best is None:
            return True
        before, now = (fourier_series(problem, gait) for gait in (best.outcome.gait, end.gait))
        return distance(before, now, problem.body, problem.law) > SAME_GAIT

    def solve(origin: str, gait: AnyGait, delta_start: float) -> None:
        key = start_key(gait) + ("r" if origin == RESCUE else "")
        if key in work.tried or key in {a.key for a in attempts}:
            return
        stated, number = problem.with_(delta_start=delta_start), len(attempts)
        outcome = run_guess(stated, lambda: gait, number, work.time_limit, worth=worth)
        attempts.append(Attempt(origin, key, outcome))

    if work.first:
        for key in warm[: work.warm_starts]:
            solve(WARM, members[key], problem.delta)
        solve(GUESS, problem.guess, problem.delta_start)
        for number in work.cold if problem.gait.free else ():
            cold = start_gait(problem, LATIN_HYPERCUBE, work.seed, number)
            solve(COLD, cold, problem.delta_start)
    for key in warm:
        if scores[key] > enough():
            solve(WARM, members[key], problem.delta)
    nothing = not (work.incumbent or best_attempt(attempts))
    if warm and (scores[warm[0]] > enough() or nothing):
        solve(RESCUE, members[warm[0]], problem.delta_start)
    for key, gait in members.items():
        if scores[key] > enough():  # what remains is measured as finely as a certificate
            scores[key] = value_of(problem, gait, _FINE)
    return Visit(work.problem.hash, attempts, scores)


def failed_visit(work: Work, status: str, message: str) -> Visit:
    """A visit without result; gaits of others may be tried again if own starts may be to blame."""
    guess = work.problem.guess
    attempt = Attempt(GUESS, start_key(guess), Outcome(0, status, message, guess, guess))
    scores = {} if work.first else {start_key(gait): np.nan for gait in work.gaits}
    return Visit(work.problem.hash, [attempt], scores)


def run_chunk(chunk: tuple[Work, ...]) -> list[Visit]:
    """Solve the cells of a task in order, on a worker; nothing is raised."""
    earlier: dict[Index, AnyGait] = {}
    visits = []
    for work in chunk:
        inside = (earlier[cell] for cell in work.inside if cell in earlier)
        work = replace(work, gaits=(*work.gaits, *inside))
        try:
            visits.append(visit(work))
        except Exception as error:
            visits.append(failed_visit(work, ERROR, f"{type(error).__name__}: {error}"))
        if best := best_attempt(visits[-1].attempts):
            earlier[work.cell] = best.outcome.gait
    return visits
