"""Run a study: a wavefront of tasks over any executor, then rounds in which good gaits spread to
all their neighbours.

A task waits for the cells its warm starts come from, and takes from nowhere else. So the results of
a study do not depend on how many workers there are or which is faster. Rounds end when no gait does
better in a neighbouring cell, as it is, than what is known there; a cell of which that cannot be
said although it was tried is marked (`StudyRun.neighbour_value`).
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Iterator
from concurrent.futures import Executor
from dataclasses import dataclass, field
from graphlib import TopologicalSorter
from pathlib import Path

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

Chunk = tuple[Index, ...]


@dataclass(eq=False)
class CellState:
    """A cell: its problem (or why there is none), all attempts, and what gaits
    of others achieve there."""

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

    def add(self, visit: Visit) -> None:
        self.attempts += visit.attempts
        self.scores |= visit.scores


@dataclass(frozen=True, eq=False)
class Progress:
    """A cell that was just worked on; `done` of `total` cells of a round."""

    cell: Index
    state: CellState
    new: list[Attempt]
    round: int
    done: int
    total: int


class StudyRun:
    """A study under way: the state of every cell, kept in the journal of a folder; what that holds
    already is not solved again, unless `retry` forgets it: errors, crashes and time limits.

    `ProblemError` if the study's function gives no problem for any cell, `StoreError` if the
    journal cannot be read.
    """

    def __init__(self, study: Study, folder: Path, *, retry: bool = False) -> None:
        self.study, self.folder = study, folder
        visits: dict[str, list[Visit]] = {}
        for visit in read_journal(folder):
            visits.setdefault(visit.problem_hash, []).append(visit)
        self.cells: dict[Index, CellState] = {}
        for cell in study.cells():
            try:
                state = CellState(study.problem_at(cell))
            except ProblemError as error:
                state = CellState(None, str(error))
            for visit in visits.get(state.problem.hash, []) if state.problem else ():
                state.add(visit)
            if retry:
                state.attempts = [a for a in state.attempts if a.outcome.status not in RETRIED]
            self.cells[cell] = state
        if all(state.problem is None for state in self.cells.values()):
            raise ProblemError(
                f"the study {study.name} has no problem in any cell; "
                f"{next(iter(self.cells.values())).message}"
            )

    @property
    def missing(self) -> list[Index]:
        """Cells with a problem whose own guess was not tried yet."""
        return [
            cell
            for cell, state in self.cells.items()
            if state.problem is not None and start_key(state.problem.guess) not in state.tried
        ]

    def neighbours(self, cell: Index) -> list[Attempt]:
        """The best attempts of the cells around one, as far as there are any."""
        bests = (self.cells[other].best for other in self.study.around(cell))
        return [best for best in bests if best is not None]

    def neighbour_value(self, cell: Index) -> float:
        """The most that the best gait of a neighbour, moved into the cell's class and otherwise as
        it is, achieves there; NaN if there is none."""
        known = self.cells[cell].scores
        scores = (known.get(best.gait_key, math.nan) for best in self.neighbours(cell))
        return max((score for score in scores if not math.isnan(score)), default=math.nan)

    def below_neighbour(self, cell: Index) -> bool:
        """True if a neighbour's gait does clearly better in the cell than its own best, though it
        was tried there."""
        best = self.cells[cell].best
        return best is not None and self.neighbour_value(cell) > (1 + BETTER) * best.outcome.value

    def run(
        self,
        *,
        workers: int = 1,
        executor: Callable[[int], Executor] = process_pool,
        ahead: int | None = None,
    ) -> Iterator[Progress]:
        """Work on all that is missing (see `colloc.system.task_pool.run_tasks`); each cell is on
        the disk before it is yielded. Cells in which nothing was tried are not."""
        native_kernel()  # missed once for all workers, or there
        ahead = 1 + workers // 4 if ahead is None else ahead
        number, chunks = 0, self._first_chunks()
        while number == 0 or chunks:
            tasks = _Round(self, number, chunks)
            total, done = sum(map(len, chunks)), 0
            for task, result in run_tasks(
                run_chunk, tasks.ready, workers=workers, executor=executor, ahead=ahead
            ):
                (works,) = task.arguments
                if isinstance(result, Lost):
                    result = [failed_visit(work, CRASHED, result.message) for work in works]
                append_visits(self.folder, [v for v in result if v.attempts or v.scores])
                for work, visit in zip(works, result, strict=True):
                    self.cells[work.cell].add(visit)
                tasks.order.done(tuple(work.cell for work in works))
                for work, visit in zip(works, result, strict=True):
                    done += 1
                    if visit.attempts:
                        state = self.cells[work.cell]
                        yield Progress(work.cell, state, visit.attempts, number, done, total)
            number, chunks = number + 1, self._improvable()

    def _first_chunks(self) -> list[Chunk]:
        """Missing cells in runs along the last axis."""
        size = self.study.chunk
        groups: dict[Index, list[Index]] = {}
        for cell in self.missing:
            groups.setdefault((*cell[:-1], cell[-1] // size), []).append(cell)
        return [tuple(cells) for cells in groups.values()]

    def _improvable(self) -> list[Chunk]:
        """Cells with a neighbour whose best gait was not looked at there."""
        return [
            (cell,)
            for cell, state in self.cells.items()
            if state.problem is not None
            and any(best.gait_key not in state.scores for best in self.neighbours(cell))
        ]


class _Round:
    """Tasks of one round, each ready when those that its warm starts come from are done.

    In the first round gaits come from the cells before, as the tasks end. In later ones all cells
    start from what is known when the round begins, whatever order they come in.
    """

    def __init__(self, run: StudyRun, number: int, chunks: list[Chunk]) -> None:
        self.study, self.cells, self.first = run.study, run.cells, number == 0
        self.known = {cell: state.best for cell, state in run.cells.items()} if number else None
        where = {cell: chunk for chunk in chunks for cell in chunk}
        self.order: TopologicalSorter[Chunk] = TopologicalSorter()
        for chunk in chunks:
            before = {c for cell in chunk for c in self.study.before(cell)} & where.keys()
            self.order.add(chunk, *({where[c] for c in before - set(chunk)} if self.first else ()))
        self.order.prepare()
        self.queue: deque[Chunk] = deque()

    def ready(self) -> Task | None:
        """The next task, if there is one now."""
        self.queue.extend(self.order.get_ready())
        if not self.queue:
            return None
        chunk = self.queue.popleft()
        return Task(chunk, (tuple(self._work(cell, chunk) for cell in chunk),))

    def _best(self, cell: Index) -> Attempt | None:
        return self.cells[cell].best if self.known is None else self.known[cell]

    def _work(self, cell: Index, chunk: Chunk) -> Work:
        study, state, best = self.study, self.cells[cell], self._best(cell)
        assert state.problem is not None
        sources = study.before(cell) if self.first else study.around(cell)
        inside = tuple(c for c in sources if c in chunk) if self.first else ()
        others = (self._best(c) for c in sources if c not in inside)
        return Work(
            cell,
            state.problem,
            self.first,
            inside,
            tuple(a.outcome.gait for a in others if a and a.gait_key not in state.scores),
            study.cold_numbers(cell) if self.first else (),
            best.outcome.value if best else 0.0,
            state.tried,
            study.warm_starts,
            study.time_limit,
            study.seed,
        )
