"""Run a study: a wavefront of tasks over an executor, then rounds in which gaits spread.

A task waits for the cells that its warm starts come from, so results do not depend on the workers.
Rounds end when no gait does better in a neighbouring cell, unchanged, than what is known there.
A journal keeps every visit to a cell. Problems are made when their cells are reached.
"""

from __future__ import annotations

import itertools
import json
import math
import os
import tempfile
import time
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Executor
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from pathlib import Path
from typing import Any

import numpy as np

from colloc.dynamics.collocated import CollocatedPose
from colloc.gaits.gait import delta_per_period
from colloc.gaits.gait_fields import AnyGait, fields, statement_hash
from colloc.gaits.harmonic import Fourier
from colloc.gaits.problem import Problem
from colloc.gaits.starts import LATIN_HYPERCUBE, on_speed_floor, start_gait, to_class
from colloc.mechanics.bodies import Body
from colloc.mechanics.law import Law, rate_independent
from colloc.mechanics.native_kernel import native_kernel
from colloc.numerics.mesh import Mesh
from colloc.numerics.schemes import scheme
from colloc.results.archive import (
    CRASHED,
    ERROR,
    RETRIED,
    UNITS,
    Outcome,
    counts,
    outcome_fields,
    outcome_from,
)
from colloc.results.comparison import (
    SAME_GAIT,
    distance,
    fourier_series,
    phase_distance,
    reversed_in_time,
    series_class,
    swap_ends,
)
from colloc.results.solution import SOLVED, versions
from colloc.search.explore import same_gait, with_reachable_distance
from colloc.search.iterate import Iterate, space_near
from colloc.search.optimise import project_to_zero_rotation
from colloc.smooth.smooth_body import SmoothBody
from colloc.studies.solve import reporter, run_guess
from colloc.studies.study import ARRAYS, COLUMNS, NUMBERS, Index, Study, read_study_file
from colloc.system.arguments import check_count
from colloc.system.errors import CollocError, ProblemError
from colloc.system.row_file import put_rows, read_rows
from colloc.system.store_file import Table, save_table
from colloc.system.task_pool import LostTask, Task, pool_for, process_pool, run_tasks
from colloc.verification.replay import replayer

JOURNAL, NAME = "colloc journal 2", "journal.sqlite"
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

    def decode(row):
        attempts = [
            Attempt(str(a["origin"]), str(a["key"]), outcome_from(a["outcome"]))
            for a in row["attempts"]
        ]
        scores = {str(key): float(score) for key, score in row["scores"].items()}
        return Visit(str(row["problem"]), attempts, scores)

    return [*read_rows(folder / NAME, JOURNAL, decode).values()]


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
    put_rows(folder / NAME, JOURNAL, {statement_hash(row): row for row in rows})


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
    gaits = problem.gait
    if gait.n_joint != problem.body.n_joint or not gaits.free:
        return None
    try:
        similar = to_class(problem, gaits, gait)
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
    excess = 0.0 if problem.rotation is None else abs(period.rotation - rotation)
    sure = {**period.values, "distance": max(0.0, period.distance - _LEVER * excess)}
    value = problem.objective(sure)
    return float(value) if np.isfinite(value) else 0.0


def visit(work: Work) -> Visit:
    """Solve a cell from its starts, the most promising gaits of others first.

    These are starts while they do better, unchanged, than all results so far. Optima that are no
    better than, or the same as, the certified one are passed over. If the best one promises more
    than the search from it keeps, it is tried once more from the problem's own delta_start.
    """
    (problem, _), attempts = with_reachable_distance(work.problem), list[Attempt]()
    met = list[Iterate]()  # at a larger delta
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

    def enough():
        best = best_attempt(attempts)
        return (1 + BETTER) * max(work.incumbent, best.outcome.value if best else 0.0)

    def worth(end):
        if end.delta > problem.delta:  # it would go on as an earlier start did from there
            is_known = any(same_gait(problem, end, other) for other in met)
            met.append(end)
            return not is_known
        best = best_attempt(attempts)
        if not end.value > enough():
            return best is None and not work.incumbent
        if best is None:
            return True
        before, now = (fourier_series(problem, gait) for gait in (best.outcome.gait, end.gait))
        return distance(before, now, problem.body, problem.law) > SAME_GAIT

    def solve(origin, gait, problem):
        key = start_key(gait) + ("r" if origin == RESCUE else "")
        if key in work.tried or key in {a.key for a in attempts}:
            return
        outcome = run_guess(problem, lambda: gait, len(attempts), work.time_limit, worth=worth)
        attempts.append(Attempt(origin, key, outcome))

    at_delta = problem.with_(delta_start=problem.delta)
    if work.first:
        for key in warm[: work.warm_starts]:
            solve(WARM, members[key], at_delta)
        solve(GUESS, problem.guess, problem)
        for number in work.cold if problem.gait.free else ():
            cold = start_gait(problem, LATIN_HYPERCUBE, work.seed, number)
            solve(COLD, cold, problem)
    for key in warm:
        if scores[key] > enough():
            solve(WARM, members[key], at_delta)
    nothing = not (work.incumbent or best_attempt(attempts))
    if warm and (scores[warm[0]] > enough() or nothing):
        solve(RESCUE, members[warm[0]], problem)
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


KIND, VERSION = "colloc study", 2
NO_PROBLEM, NOT_TRIED = "no problem", "not tried"


@dataclass(eq=False)
class CellState:
    """Problem of a cell (or why there is none), attempts, and values of gaits of other cells."""

    problem: Problem | None
    message: str = ""
    attempts: list[Attempt] = field(default_factory=list)
    scores: dict[str, float] = field(default_factory=dict)

    @property
    def best(self) -> Attempt | None:
        return best_attempt(self.attempts)

    @property
    def keys(self) -> frozenset[str]:
        return frozenset(a.key for a in self.attempts)

    @property
    def missing(self) -> bool:
        """True if the problem's own guess was not tried yet."""
        return self.problem is not None and start_key(self.problem.guess) not in self.keys

    def add(self, visit: Visit) -> None:
        self.attempts += visit.attempts
        self.scores |= visit.scores


@dataclass(frozen=True, eq=False)
class Progress:
    """A cell that was just visited; `done` of `total` cells of a round, in so many `seconds`."""

    label: str
    cell: Index
    state: CellState
    new: list[Attempt]
    round: int
    done: int
    total: int
    seconds: float

    def __str__(self) -> str:
        value = f"{self.state.best.outcome.value:9.6f}" if self.state.best else "     none"
        tries = ", ".join(f"{n} {x}" for x, n in counts([a.outcome for a in self.new]).items())
        left = self.seconds / self.done * (self.total - self.done)
        where = f"round {self.round}: {self.done} of {self.total}, {left:.0f} s left"
        return f"{self.label}: {value}  ({tries}; {where})"


class StudyRun:
    """A study under way, kept in the journal of a folder; what that holds is not solved again, but
    with `retry` errors, crashes and time limits are.

    `ProblemError` if no cell has a problem, `StoreError` if the journal cannot be read.
    """

    def __init__(self, study: Study, folder: Path, *, retry: bool = False) -> None:
        self.study, self.folder, self._retry = study, folder, retry
        self.cells: dict[Index, CellState] = {}
        """Those that were reached."""
        self._visits: dict[str, list[Visit]] = {}
        for each in read_journal(folder):
            self._visits.setdefault(each.problem_hash, []).append(each)
        self.visited = len(self._visits)
        if all(self.state(cell).problem is None for cell in study.cells()):
            message = next(iter(self.cells.values())).message
            raise ProblemError(f"the study {study.name} has no problem in any cell; {message}")

    def state(self, cell: Index) -> CellState:
        """The state of a cell, which is made from the journal when the cell is reached."""
        if cell not in self.cells:
            try:
                state = CellState(problem := self.study.problem_at(cell))
            except ProblemError as error:
                state = CellState(None, str(error))
            else:
                for each in self._visits.get(problem.hash, []):
                    state.add(each)
            if self._retry:
                state.attempts = [a for a in state.attempts if a.outcome.status not in RETRIED]
            self.cells[cell] = state
        return self.cells[cell]

    def neighbours(self, cell: Index) -> list[Attempt]:
        """Best attempts of the cells around one."""
        bests = (self.state(other).best for other in self.study.around(cell))
        return [best for best in bests if best is not None]

    def run(
        self,
        *,
        workers: int = 1,
        executor: Callable[[int], Executor] = process_pool,
        ahead: int | None = None,
    ) -> Iterator[Progress]:
        """Visit what is missing, yielding each cell that was tried when it is on the disk;
        arguments as for `colloc.system.task_pool.run_tasks`."""
        native_kernel()  # its absence is reported once for all workers
        ahead = 1 + workers // 4 if ahead is None else ahead
        first = _Wavefront(self)
        tasks, total = first.ready, lambda: first.total
        for number in itertools.count():
            done, begin = 0, time.perf_counter()
            for task, result in run_tasks(
                run_chunk, tasks, workers=workers, executor=executor, ahead=ahead
            ):
                (works,) = task.arguments
                if isinstance(result, LostTask):
                    result = [failed_visit(work, CRASHED, result.message) for work in works]
                append_visits(self.folder, [v for v in result if v.attempts or v.scores])
                for work, visited in zip(works, result, strict=True):
                    self.state(work.cell).add(visited)
                if number == 0:
                    first.finish(task.key)
                for work, visited in zip(works, result, strict=True):
                    done += 1
                    if new := visited.attempts:
                        cell, seconds = work.cell, time.perf_counter() - begin
                        at = self.study.label(cell), cell, self.state(cell)
                        yield Progress(*at, new, number, done, total(), seconds)
            improvable = [
                cell
                for cell, state in list(self.cells.items())
                if state.problem is not None
                and any(best.gait_key not in state.scores for best in self.neighbours(cell))
            ]
            if not improvable:
                return
            # all start from what is known now
            bests = {cell: state.best for cell, state in self.cells.items()}
            waiting = iter([Task(cell, ((self.work(cell, bests.get),),)) for cell in improvable])
            tasks, total = partial(next, waiting, None), partial(len, improvable)

    def work(
        self, cell: Index, best: Callable[[Index], Attempt | None], chunk: tuple[Index, ...] = ()
    ) -> Work:
        """Work on a cell: in the first round within a chunk, later with none."""
        study, state, incumbent = self.study, self.state(cell), best(cell)
        assert state.problem is not None
        sources = study.around(cell, before=bool(chunk))
        others = (best(c) for c in sources if c not in chunk)
        begin = study.cold_starts * int(np.ravel_multi_index(cell, study.shape))
        return Work(
            cell,
            state.problem,
            bool(chunk),
            tuple(c for c in sources if c in chunk),
            tuple(a.outcome.gait for a in others if a and a.gait_key not in state.scores),
            tuple(range(begin, begin + study.cold_starts)) if chunk else (),
            incumbent.outcome.value if incumbent else 0.0,
            state.keys,
            *(study.warm_starts, study.time_limit, study.seed),
        )


class _Wavefront:
    """Tasks of the first round: chunks of missing cells along the last axis, each ready when those
    before it are finished."""

    def __init__(self, run: StudyRun) -> None:
        self._run, self._travels = run, [axis.travels for axis in run.study.axes]
        self.total = math.prod(run.study.shape)  # less what is not missing, as it is reached
        *sizes, last = run.study.shape
        self._counts = (*sizes, -(-last // run.study.chunk))
        every = zip(self._counts, self._travels, strict=True)
        self._first = itertools.product(*(range(1 if goes else n) for n, goes in every))
        self._released: deque[Index] = deque()
        self._finished: set[Index] = set()

    def ready(self) -> Task | None:
        run, size = self._run, self._run.study.chunk
        while chunk := self._released.popleft() if self._released else next(self._first, None):
            places = range(run.study.shape[-1])[chunk[-1] * size :][:size]
            cells = tuple(c for k in places if run.state(c := (*chunk[:-1], k)).missing)
            self.total -= len(places) - len(cells)
            if cells:
                works = (run.work(cell, lambda c: run.state(c).best, cells) for cell in cells)
                return Task(chunk, (tuple(works),))
            self.finish(chunk)
        return None

    def finish(self, chunk: Any) -> None:
        self._finished.add(chunk)
        for following in self._shift(chunk, 1):
            if self._finished.issuperset(self._shift(following, -1)):
                self._released.append(following)

    def _shift(self, chunk: Index, by: int) -> Iterator[Index]:
        for a, goes in enumerate(self._travels):
            if goes and 0 <= (i := chunk[a] + by) < self._counts[a]:
                yield (*chunk[:a], i, *chunk[a + 1 :])


@dataclass(frozen=True, eq=False)
class StudyTable(Table):
    """Results of a study as labelled arrays over its axes.

    Numbers are those of the best certified gait of a cell, or NaN, with ``status`` and ``message``.
    ``delta`` is per period; ``mean``, ``cos`` and ``sin`` are the gait's truncated Fourier series.
    ``below_neighbour`` is 1 where a neighbour's gait does better, unchanged (``neighbour_value``).
    """

    def __repr__(self) -> str:
        status = self.variables["status"]
        certified = int((status == SOLVED).sum())
        return f"<StudyTable {self.name}: {certified} of {status.size} cells have a verified gait>"


def study_table(
    run: StudyRun, known_bound: Callable[[Problem], float | None] = lambda _: None
) -> StudyTable:
    """Results of all cells; `known_bound` gives an upper bound on d/W that is known for a
    problem."""
    study, reached = run.study, list(run.cells.items())
    problems = [p for _, state in reached if (p := state.problem) is not None]
    sizes = {
        "joint": max(p.body.n_joint for p in problems),
        "harmonic": max(series_class(p).harmonics for p in problems),
    }
    variables = {
        name: np.full(study.shape, x, dtype=object if isinstance(x, str) else type(x))
        for name, x in COLUMNS.items()
    }
    variables["status"][:] = NOT_TRIED
    for name, extra in ARRAYS.items():
        variables[name] = np.full((*study.shape, *(sizes[e] for e in extra)), np.nan)
    for cell, state in reached:
        for name, value in _row(run, cell, state, known_bound).items():
            if name in ARRAYS:
                variables[name][cell][tuple(map(slice, np.shape(value)))] = value
            else:
                variables[name][cell] = value
    axes = {axis.name: axis for axis in study.axes}
    return StudyTable(
        study.name,
        {x: np.array(a.values, dtype=object if a.of_texts else float) for x, a in axes.items()}
        | {name: np.arange(1, size + 1) for name, size in sizes.items()},
        variables,
        {name: (*axes, *ARRAYS.get(name, ())) for name in variables},
        {
            **UNITS,
            **dict.fromkeys(("trivial_bound", "upper_bound"), "1/weight"),
            "neighbour_value": "of the objective",
            **dict.fromkeys(ARRAYS, "rad"),
            **{name: axis.units for name, axis in axes.items()},
        },
        {**{n: n for n in sizes}, **{name: axis.label or name for name, axis in axes.items()}},
    )


def _row(
    run: StudyRun, cell: Index, state: CellState, known_bound: Callable[[Problem], float | None]
) -> dict[str, Any]:
    problem, best = state.problem, state.best
    if problem is None:
        return {"status": NO_PROBLEM, "message": state.message}
    outcomes, bound = [a.outcome for a in state.attempts], known_bound(problem)
    scores = [state.scores.get(each.gait_key, math.nan) for each in run.neighbours(cell)]
    row: dict[str, Any] = {
        "problem_hash": problem.hash,
        "starts": len(outcomes),
        "starts_certified": sum(o.status == SOLVED for o in outcomes),
        "seconds": sum(o.seconds for o in outcomes),
        "trivial_bound": 1.0 / problem.law.smallest if rate_independent(problem.law) else np.nan,
        "upper_bound": np.nan if bound is None else bound,
        # largest value here of a neighbour's best gait, projected but not optimised
        "neighbour_value": max((x for x in scores if not math.isnan(x)), default=math.nan),
    }
    if best is None:
        last = {name: getattr(o, name) for o in outcomes[-1:] for name in ("status", "message")}
        return row | last
    outcome = best.outcome
    gait = fourier_series(problem, outcome.gait)
    row |= {"status": SOLVED, "origin": best.origin}
    row["below_neighbour"] = int(row["neighbour_value"] > (1 + BETTER) * outcome.value)
    row |= {name: getattr(outcome, name) for name in NUMBERS}
    row |= {name: getattr(gait, name) for name in ARRAYS}
    row["delta"] = delta_per_period(problem.gait, outcome.gait, outcome.delta)
    row["at_slowest"] = int(on_speed_floor(problem, outcome.gait))
    several = problem.body.n_joint > 1
    return row | (gait_class(gait, problem.body, problem.law) if several else {})


def save_study(
    table: StudyTable, path: str | os.PathLike[str], *, source: str = "", command: str = ""
) -> Path:
    """Write a table as netCDF-4."""
    facts = {"source": source, "command": command, "versions": json.dumps(versions())}
    facts["Conventions"] = "CF-1.8"
    return save_table(replace(table, attributes=facts), path, KIND, VERSION)


def sweep(
    study: Study | str | os.PathLike[str],
    folder: str | os.PathLike[str] | None = None,
    *,
    workers: int = 1,
    executor: Callable[[int], Executor] = pool_for,
    verbose: bool = False,
    progress: Callable[[Progress], object] | None = None,
) -> StudyTable:
    """Solve every problem of a study, as ``colloc sweep`` does.

    Parameters
    ----------
    study : Study or path-like
        A study, or a study file.
    folder : path-like, optional
        Folder of the journal, in which results are kept and not solved again.
    workers : int
        Processes, as for `multistart`.
    executor : callable, optional
        From a number of workers to a `concurrent.futures.Executor` to use in place of processes, as
        of a cluster (docs/howto/cluster.md).
    verbose : bool
        Print every cell that is solved.
    progress : callable, optional
        Called with every `colloc.studies.sweep.Progress`.

    Returns
    -------
    StudyTable
        Labelled arrays; ``.to_xarray()`` makes a Dataset.

    Examples
    --------
    >>> import colloc
    >>> def problem(mu_t):
    ...     return colloc.Problem(
    ...         "grid",
    ...         friction=colloc.Friction(mu_t=mu_t),
    ...         gait=colloc.Harmonic(1, "bilateral"),
    ...         delta=1e-2,
    ...     )
    >>> study = colloc.Study("grid", (colloc.Axis("mu_t", (1, 2)),), problem, cold_starts=0)
    >>> colloc.sweep(study).variables["status"].tolist()
    ['solved', 'solved']
    """
    check_count(workers=workers)
    report = reporter(verbose, progress)
    study = study if isinstance(study, Study) else read_study_file(study)[0]
    with tempfile.TemporaryDirectory() as scratch:
        run = StudyRun(study, Path(folder or scratch))
        for news in run.run(workers=workers, executor=executor):
            report(news)
        return study_table(run)


_SAME, _STANDING = 0.02, 0.05  # relative distance of a symmetric gait to its image; standing |wave|
_INSTANTS, _AROUND, _DELTA = 200, 2000, 1e-3


def winding(gait: Fourier) -> int:
    """Turns of the path (angle 1, angle 2) about its mean, counter-clockwise."""
    angles = gait.angles(np.linspace(0.0, 1.0, _AROUND + 1)) - gait.mean[:, None]
    turns = np.unwrap(np.arctan2(angles[1], angles[0]))
    return round((turns[-1] - turns[0]) / (2 * np.pi))


def wave_direction(gait: Fourier) -> float:
    """``2 sum_jk k Im(conj(a_jk) a_(j+1)k) / sum_jk k (|a_jk|^2 + |a_(j+1)k|^2)`` of the complex
    amplitudes of joints j and harmonics k: 1 for a wave to the head, -1 to the tail."""
    a = gait.cos + 1j * gait.sin
    k = np.arange(1, gait.n_harmonic + 1)
    travel = 2 * np.sum(k * (np.conj(a[:-1]) * a[1:]).imag)
    size = np.sum(k * (np.abs(a[:-1]) ** 2 + np.abs(a[1:]) ** 2))
    return float(travel / size) if size > 0 else 0.0


def forward_share(gait: Fourier, body: Body, friction: Law) -> float:
    """Cosine between mean velocity and mean body axis: 1 is head first."""
    mesh = Mesh(scheme("gauss-1"), np.linspace(0.0, 1.0, _INSTANTS + 1))
    angles, rates = gait(mesh.times)
    z = body.solve(friction, angles, rates, _DELTA, tolerance=1e-8).z
    centre = body.sliding(friction, angles, rates, z, np.full((1, _INSTANTS), _DELTA)).centre
    pose = CollocatedPose.on_mesh(mesh, z[2], centre)
    head_x, head_y = (points[-1] for points in body.outline(angles))
    displacement = pose.place[-1]
    axis = np.mean(np.exp(1j * pose.stage_theta[:, 0]) * (head_x + 1j * head_y))
    size = abs(displacement) * abs(axis)
    return float((displacement * np.conj(axis)).real / size) if size > 0 else 0.0


def class_name(
    bilateral: bool, antipodal: bool, retraced: bool, wave: float, forward: float
) -> str:
    """The kind of wave of bending, as in the paper's figure 1, and the symmetries in words, as
    "retrograde, both": *retrograde* against the motion, *direct* along it, *standing* where
    joints bend in phase."""
    moving = not retraced and abs(wave * forward) >= _STANDING
    kind = ("direct" if wave * forward > 0 else "retrograde") if moving else "standing"
    symmetries = ["bilateral"] * bilateral + ["antipodal"] * antipodal
    symmetry = "both" if len(symmetries) > 1 else "".join(symmetries) or "none"
    return f"{kind}{' (retraced)' * retraced}, {symmetry}"


def gait_class(gait: Fourier, body: Body, friction: Law) -> dict[str, Any]:
    """Columns of a study about a gait of a body with at least two joints or modes: symmetries
    (`colloc.gaits.gait`), whether it goes back the way it came, `winding`, `wave_direction`,
    `forward_share` and `class_name`."""
    amplitude = math.sqrt(0.5 * np.sum(gait.cos**2 + gait.sin**2))
    close = _SAME * max(amplitude, 1e-12)
    image = reversed_in_time(swap_ends(gait, body)) if body.reversal is not None else None
    even = np.concatenate([gait.mean, gait.cos[:, 1::2].ravel(), gait.sin[:, 1::2].ravel()])
    # how far the body bends at places from tail to head, (n_place, n_joint)
    smooth = isinstance(body, SmoothBody)
    bending = np.diff(body.bounded_angles.rows, axis=0) if smooth else np.eye(body.n_joint)
    kind: dict[str, Any] = {
        "bilateral": image is not None and phase_distance(gait, image) < close,
        "antipodal": bool(np.linalg.norm(even) < close),
        "retraced": phase_distance(gait, reversed_in_time(gait)) < close,
        "wave": wave_direction(gait.transform(bending)),
        "forward": forward_share(gait, body, friction),
    }
    turns = 0 if kind["retraced"] else winding(gait)
    return kind | {"winding": turns, "gait_class": class_name(**kind)}
