"""Run a study: a wavefront of tasks over an executor, then rounds in which gaits spread.

A task waits for the cells that its warm starts come from, so results do not depend on the workers.
Rounds end when no gait does better in a neighbouring cell, unchanged, than what is known there.
Problems are made when their cells are reached.
"""

from __future__ import annotations

import itertools
import math
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Executor
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from colloc.gaits.problem import Problem
from colloc.mechanics.native_kernel import native_kernel
from colloc.results.outcome import CRASHED, RETRIED
from colloc.studies.cell import BETTER, Work, failed_visit, run_chunk
from colloc.studies.journal import (
    Attempt,
    Visit,
    append_visits,
    best_attempt,
    read_journal,
    start_key,
)
from colloc.studies.study import Index, Study
from colloc.system.errors import ProblemError
from colloc.system.task_pool import Lost, Task, process_pool, run_tasks


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
    def tried(self) -> frozenset[str]:
        return frozenset(a.key for a in self.attempts)

    @property
    def missing(self) -> bool:
        """Whether the problem's own guess was not tried yet."""
        return self.problem is not None and start_key(self.problem.guess) not in self.tried

    def add(self, visit: Visit) -> None:
        self.attempts += visit.attempts
        self.scores |= visit.scores


@dataclass(frozen=True, eq=False)
class Progress:
    """A cell that was just visited; `done` of `total` cells of a round."""

    cell: Index
    state: CellState
    new: list[Attempt]
    round: int
    done: int
    total: int


class _Cells(dict[Index, CellState]):
    """States of the cells that were reached, each made from the journal on first use."""

    def __init__(self, study: Study, visits: list[Visit], retry: bool) -> None:
        self._study, self._retry = study, retry
        self._visits: dict[str, list[Visit]] = {}
        for visit in visits:
            self._visits.setdefault(visit.problem_hash, []).append(visit)

    def __missing__(self, cell: Index) -> CellState:
        try:
            state = CellState(problem := self._study.problem_at(cell))
        except ProblemError as error:
            state = CellState(None, str(error))
        else:
            for visit in self._visits.get(problem.hash, []):
                state.add(visit)
        if self._retry:
            state.attempts = [a for a in state.attempts if a.outcome.status not in RETRIED]
        self[cell] = state
        return state


class StudyRun:
    """A study under way, kept in the journal of a folder; what that holds is not solved again, but
    with `retry` errors, crashes and time limits are.

    `ProblemError` if no cell has a problem, `StoreError` if the journal cannot be read.
    """

    def __init__(self, study: Study, folder: Path, *, retry: bool = False) -> None:
        self.study, self.folder = study, folder
        visits = read_journal(folder)
        self.visited = len({visit.problem_hash for visit in visits})
        self.cells = _Cells(study, visits, retry)
        if all(self.cells[cell].problem is None for cell in study.cells()):
            message = next(iter(self.cells.values())).message
            raise ProblemError(f"the study {study.name} has no problem in any cell; {message}")

    @property
    def missing(self) -> list[Index]:
        """Cells with a problem whose own guess was not tried yet."""
        return [cell for cell in self.study.cells() if self.cells[cell].missing]

    def neighbours(self, cell: Index) -> list[Attempt]:
        """Best attempts of the cells around one."""
        bests = (self.cells[other].best for other in self.study.around(cell))
        return [best for best in bests if best is not None]

    def neighbour_value(self, cell: Index) -> float:
        """Largest value in a cell of a neighbour's best gait, projected but not optimised; or
        NaN."""
        known = self.cells[cell].scores
        scores = (known.get(best.gait_key, math.nan) for best in self.neighbours(cell))
        return max((score for score in scores if not math.isnan(score)), default=math.nan)

    def below_neighbour(self, cell: Index) -> bool:
        """Whether a neighbour's gait does clearly better in the cell than its own best."""
        best = self.cells[cell].best
        return best is not None and self.neighbour_value(cell) > (1 + BETTER) * best.outcome.value

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
        tasks: _Wavefront | _Round = _Wavefront(self)
        for number in itertools.count():
            done = 0
            for task, result in run_tasks(
                run_chunk, tasks.ready, workers=workers, executor=executor, ahead=ahead
            ):
                (works,) = task.arguments
                if isinstance(result, Lost):
                    result = [failed_visit(work, CRASHED, result.message) for work in works]
                append_visits(self.folder, [v for v in result if v.attempts or v.scores])
                for work, visit in zip(works, result, strict=True):
                    self.cells[work.cell].add(visit)
                tasks.finish(task.key)
                for work, visit in zip(works, result, strict=True):
                    done += 1
                    if visit.attempts:
                        state, total = self.cells[work.cell], tasks.total
                        yield Progress(work.cell, state, visit.attempts, number, done, total)
            improvable = [
                cell
                for cell, state in list(self.cells.items())
                if state.problem is not None
                and any(best.gait_key not in state.scores for best in self.neighbours(cell))
            ]
            if not improvable:
                return
            tasks = _Round(self, improvable)

    def work(
        self, cell: Index, best: Callable[[Index], Attempt | None], chunk: tuple[Index, ...] = ()
    ) -> Work:
        """Work on a cell: in the first round within a chunk, later with none."""
        study, state, own = self.study, self.cells[cell], best(cell)
        assert state.problem is not None
        sources = study.before(cell) if chunk else study.around(cell)
        inside = tuple(c for c in sources if c in chunk)
        others = (best(c) for c in sources if c not in inside)
        return Work(
            cell,
            state.problem,
            bool(chunk),
            inside,
            tuple(a.outcome.gait for a in others if a and a.gait_key not in state.scores),
            study.cold_numbers(cell) if chunk else (),
            own.outcome.value if own else 0.0,
            state.tried,
            study.warm_starts,
            study.time_limit,
            study.seed,
        )


class _Round:
    """Tasks of a later round: cells that start from what is known when it begins."""

    def __init__(self, run: StudyRun, cells: list[Index]) -> None:
        known = {cell: state.best for cell, state in run.cells.items()}
        self.total = len(cells)
        self._tasks = (Task(cell, ((run.work(cell, known.get),),)) for cell in cells)

    def ready(self) -> Task | None:
        return next(self._tasks, None)

    def finish(self, chunk: Any) -> None:
        pass


class _Wavefront:
    """Tasks of the first round: chunks of missing cells along the last axis, each ready when those
    before it are finished."""

    def __init__(self, run: StudyRun) -> None:
        self._run, self._study = run, run.study
        self.total = math.prod(run.study.shape)  # less what is not missing, as it is reached
        *sizes, last = run.study.shape
        counts = (*sizes, -(-last // run.study.chunk))
        self._counts, self._travels = counts, [axis.travels for axis in run.study.axes]
        first = ((0,) if goes else range(n) for n, goes in zip(counts, self._travels, strict=True))
        self._first: Iterator[Index] = itertools.product(*first)
        self._released: deque[Index] = deque()
        self._finished: set[Index] = set()

    def ready(self) -> Task | None:
        while True:
            chunk = self._released.popleft() if self._released else next(self._first, None)
            if chunk is None:
                return None
            first = chunk[-1] * self._study.chunk
            every = range(first, min(first + self._study.chunk, self._study.shape[-1]))
            cells = tuple(c for k in every if self._run.cells[c := (*chunk[:-1], k)].missing)
            self.total -= len(every) - len(cells)
            if cells:
                works = (self._run.work(c, lambda x: self._run.cells[x].best, cells) for c in cells)
                return Task(chunk, (tuple(works),))
            self.finish(chunk)

    def finish(self, chunk: Any) -> None:
        """Release the chunks after one of which all others before them are finished, too."""
        self._finished.add(chunk)
        for following in self._shifted(chunk, 1):
            if self._finished.issuperset(self._shifted(following, -1)):
                self._released.append(following)

    def _shifted(self, chunk: Index, by: int) -> Iterable[Index]:
        for a, goes in enumerate(self._travels):
            if goes and 0 <= (i := chunk[a] + by) < self._counts[a]:
                yield (*chunk[:a], i, *chunk[a + 1 :])
