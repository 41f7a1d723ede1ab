"""Run a study: a wavefront of tasks over any executor, then rounds in which good gaits spread to
all their neighbours.

A task waits for the cells its warm starts come from, and takes from nowhere else. So what a study
finds does not depend on how many workers there are or which is faster. Rounds end when no gait does
better in a neighbouring cell, as it is, than what is known there; a cell of which that cannot be
said although it was tried is marked (`StudyRun.neighbour_value`).
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, field
from pathlib import Path

from colloc.gaits.problem import Problem
from colloc.mechanics.native_kernel import native_kernel
from colloc.results.outcome import CRASHED, RETRIED
from colloc.studies.cell import (
    BETTER,
    Attempt,
    Work,
    best_attempt,
    failed_visit,
    run_chunk,
    start_key,
)
from colloc.studies.journal import Record, append_records, read_journal
from colloc.studies.study import Index, Study
from colloc.system.errors import ProblemError
from colloc.system.task_pool import Lost, Task, completed, process_pool


@dataclass(eq=False)
class CellState:
    """What is known about a cell: its problem (or why there is none), all attempts, and what gaits
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
    """A study under way: the state of every cell, kept in a folder.

    Parameters
    ----------
    study : Study
    folder : Path
        Of the journal. What it holds already is not solved again.
    retry : bool
        Forget attempts that ended in an error, a crash or the time limit.

    Raises
    ------
    ProblemError
        If the study's function gives no problem for any cell.
    StoreError
        If the journal cannot be read.
    """

    def __init__(self, study: Study, folder: Path, *, retry: bool = False) -> None:
        self.study, self.folder = study, folder
        attempts: dict[str, list[Attempt]] = {}
        scores: dict[str, dict[str, float]] = {}
        for record in read_journal(folder):
            kept = [a for a in record.attempts if not (retry and a.outcome.status in RETRIED)]
            attempts.setdefault(record.problem_hash, []).extend(kept)
            scores.setdefault(record.problem_hash, {}).update(record.scores)
        self.cells: dict[Index, CellState] = {}
        for cell in study.cells():
            try:
                problem = study.problem_at(cell)
            except ProblemError as error:
                self.cells[cell] = CellState(None, str(error))
            else:
                known = problem.hash
                self.cells[cell] = CellState(
                    problem, "", list(attempts.get(known, [])), dict(scores.get(known, {}))
                )
        if all(state.problem is None for state in self.cells.values()):
            raise ProblemError(
                f"the study {study.name} has no problem in any cell; "
                f"{next(iter(self.cells.values())).message}"
            )

    @property
    def missing(self) -> list[Index]:
        """Cells with a problem whose own guess was not tried yet."""
        cells = self.cells.items()
        return [
            c
            for c, state in cells
            if state.problem is not None and start_key(state.problem.guess) not in state.tried
        ]

    def neighbours(self, cell: Index) -> list[Attempt]:
        """The best attempts of the cells around one, as far as there are any."""
        return [
            best for near in self.study.around(cell) if (best := self.cells[near].best) is not None
        ]

    def neighbour_value(self, cell: Index) -> float:
        """The most that the best gait of a neighbour, moved into the cell's class and otherwise as
        it is, achieves there.

        NaN if there is none. Where it is more than the cell's own value, the search there has
        missed something.
        """
        scores = [
            self.cells[cell].scores.get(near.gait_key, math.nan) for near in self.neighbours(cell)
        ]
        return max((score for score in scores if not math.isnan(score)), default=math.nan)

    def below_neighbour(self, cell: Index) -> bool:
        """Whether a neighbour's gait does clearly better in the cell than its own best, though it
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
        """Work on all that is missing; each cell is on the disk before it is yielded. Cells in
        which nothing was tried are not.

        Arguments are those of `colloc.system.task_pool.completed`; `ahead` is a quarter of the
        workers, and one, by default.
        """
        native_kernel()  # missed once for all workers, or there
        ahead = 1 + workers // 4 if ahead is None else ahead
        number, chunks = 0, self._first_chunks()
        while number == 0 or chunks:
            yield from self._round(number, chunks, workers, executor, ahead)
            number, chunks = number + 1, self._improvable()

    def _first_chunks(self) -> list[tuple[Index, ...]]:
        """Missing cells in runs along the last axis."""
        size = self.study.chunk
        grouped: dict[Index, list[Index]] = {}
        for cell in self.missing:
            grouped.setdefault((*cell[:-1], cell[-1] // size), []).append(cell)
        return [tuple(cells) for cells in grouped.values()]

    def _improvable(self) -> list[tuple[Index, ...]]:
        """Cells with a neighbour whose best gait was not looked at there."""
        return [
            (cell,)
            for cell, state in self.cells.items()
            if state.problem is not None
            and any(near.gait_key not in state.scores for near in self.neighbours(cell))
        ]

    def _round(
        self,
        number: int,
        chunks: Sequence[tuple[Index, ...]],
        workers: int,
        executor: Callable[[int], Executor],
        ahead: int,
    ) -> Iterator[Progress]:
        waiting: dict[int, set[Index]] = {}
        free: deque[int] = deque()
        unlocks: dict[Index, list[int]] = {}
        todo = {cell for chunk in chunks for cell in chunk}
        for k, chunk in enumerate(chunks):
            needs = (
                {c for cell in chunk for c in self.study.before(cell)} & todo - set(chunk)
                if number == 0
                else set()
            )
            waiting[k] = needs
            for c in needs:
                unlocks.setdefault(c, []).append(k)
            if not needs:
                free.append(k)
        # in later rounds all cells start from what is known now, whatever order they come in
        known = {cell: state.best for cell, state in self.cells.items()} if number else None

        def ready() -> Task | None:
            if not free:
                return None
            k = free.popleft()
            return Task(k, (tuple(self._work(cell, chunks[k], known) for cell in chunks[k]),))

        done = 0
        for task, result in completed(
            run_chunk, ready, workers=workers, executor=executor, ahead=ahead
        ):
            works = task.arguments[0]
            visits = (
                [failed_visit(w, CRASHED, result.message) for w in works]
                if isinstance(result, Lost)
                else result
            )
            hashes = {work.cell: work.problem.hash for work in works}
            told = [v for v in visits if v.attempts or v.scores]
            append_records(
                self.folder, [Record(hashes[v.cell], tuple(v.attempts), v.scores) for v in told]
            )
            for found in visits:
                state = self.cells[found.cell]
                state.attempts += found.attempts
                state.scores |= found.scores
                for k in unlocks.get(found.cell, []):
                    waiting[k].discard(found.cell)
                    if not waiting[k]:
                        free.append(k)
                done += 1
                if found.attempts:
                    yield Progress(found.cell, state, found.attempts, number, done, len(todo))

    def _work(
        self, cell: Index, chunk: tuple[Index, ...], known: dict[Index, Attempt | None] | None
    ) -> Work:
        study, state = self.study, self.cells[cell]
        assert state.problem is not None
        first = known is None
        inside = tuple(c for c in study.before(cell) if c in chunk) if first else ()
        near = study.before(cell) if first else study.around(cell)
        best = (self.cells[c].best if known is None else known[c] for c in near if c not in inside)
        gaits = tuple(
            a.outcome.gait for a in best if a is not None and a.gait_key not in state.scores
        )
        own = state.best if known is None else known[cell]
        return Work(
            cell,
            state.problem,
            first,
            inside,
            gaits,
            study.cold_numbers(cell) if first else (),
            0.0 if own is None else own.outcome.value,
            state.tried,
            study.warm_starts,
            study.time_limit,
            study.seed,
        )
