"""Run a study: a wavefront of tasks over an executor, then rounds in which gaits spread.

A task waits for the cells that its warm starts come from, so results do not depend on the workers.
Rounds end when no gait does better in a neighbouring cell, unchanged, than what is known there.
Problems are made when their cells are reached.
"""

from __future__ import annotations

import itertools
import math
from collections import deque
from collections.abc import Callable, Iterator
from concurrent.futures import Executor
from dataclasses import dataclass, field
from functools import partial
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
        """True if the problem's own guess was not tried yet."""
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
        """True if a neighbour's gait does clearly better in the cell than its own best."""
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
        first = _Wavefront(self)
        tasks, total = first.ready, lambda: first.total
        for number in itertools.count():
            done = 0
            for task, result in run_tasks(
                run_chunk, tasks, workers=workers, executor=executor, ahead=ahead
            ):
                (works,) = task.arguments
                if isinstance(result, Lost):
                    result = [failed_visit(work, CRASHED, result.message) for work in works]
                append_visits(self.folder, [v for v in result if v.attempts or v.scores])
                visited = [
                    (self.cells[w.cell], w.cell, v) for w, v in zip(works, result, strict=True)
                ]
                for state, _, visit in visited:
                    state.add(visit)
                if number == 0:
                    first.finish(task.key)
                for state, cell, visit in visited:
                    done += 1
                    if visit.attempts:
                        yield Progress(cell, state, visit.attempts, number, done, total())
            improvable = [
                cell
                for cell, state in list(self.cells.items())
                if state.problem is not None
                and any(best.gait_key not in state.scores for best in self.neighbours(cell))
            ]
            if not improvable:
                return
            # all start from what is known now
            known = {cell: state.best for cell, state in self.cells.items()}
            waiting = iter([Task(cell, ((self.work(cell, known.get),),)) for cell in improvable])
            tasks, total = partial(next, waiting, None), partial(len, improvable)

    def work(
        self, cell: Index, best: Callable[[Index], Attempt | None], chunk: tuple[Index, ...] = ()
    ) -> Work:
        """Work on a cell: in the first round within a chunk, later with none."""
        study, state, incumbent = self.study, self.cells[cell], best(cell)
        assert state.problem is not None
        sources = study.before(cell) if chunk else study.around(cell)
        others = (best(c) for c in sources if c not in chunk)
        return Work(
            cell,
            state.problem,
            bool(chunk),
            tuple(c for c in sources if c in chunk),
            tuple(a.outcome.gait for a in others if a and a.gait_key not in state.scores),
            study.cold_numbers(cell) if chunk else (),
            incumbent.outcome.value if incumbent else 0.0,
            state.tried,
            *(study.warm_starts, study.time_limit, study.seed),
        )


class _Wavefront:
    """Tasks of the first round: chunks of missing cells along the last axis, each ready when those
    before it are finished."""

    def __init__(self, run: StudyRun) -> None:
        self._run, self._size = run, run.study.chunk
        self.total = math.prod(run.study.shape)  # less what is not missing, as it is reached
        *sizes, self._last = run.study.shape
        self._counts = (*sizes, -(-self._last // self._size))
        self._travels = [axis.travels for axis in run.study.axes]
        first = (
            (0,) if goes else range(n) for n, goes in zip(self._counts, self._travels, strict=True)
        )
        self._first: Iterator[Index] = itertools.product(*first)
        self._released: deque[Index] = deque()
        self._finished: set[Index] = set()

    def ready(self) -> Task | None:
        states = self._run.cells
        while chunk := self._released.popleft() if self._released else next(self._first, None):
            begin = chunk[-1] * self._size
            every = [(*chunk[:-1], k) for k in range(begin, min(begin + self._size, self._last))]
            cells = tuple(cell for cell in every if states[cell].missing)
            self.total -= len(every) - len(cells)
            if cells:
                works = (self._run.work(cell, lambda c: states[c].best, cells) for cell in cells)
                return Task(chunk, (tuple(works),))
            self.finish(chunk)
        return None

    def finish(self, chunk: Any) -> None:
        """Release the chunks after one of which all others before them are finished, too."""
        self._finished.add(chunk)
        for following in self._shift(chunk, 1):
            if self._finished.issuperset(self._shift(following, -1)):
                self._released.append(following)

    def _shift(self, chunk: Index, by: int) -> Iterator[Index]:
        for a, goes in enumerate(self._travels):
            if goes and 0 <= (i := chunk[a] + by) < self._counts[a]:
                yield (*chunk[:a], i, *chunk[a + 1 :])
