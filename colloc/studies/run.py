"""Run a study: a wavefront of tasks over any executor, then rounds in which good gaits spread to all their neighbours.

A task waits for the cells its warm starts come from, and takes from nowhere else. So what a study finds does not depend
on how many workers there are or which is faster.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, field
from pathlib import Path

from colloc.gaits.equivalence import distance
from colloc.gaits.problem import Problem
from colloc.results.distinct_optima import CRASHED, ERROR, TIME_LIMIT, Outcome
from colloc.studies.cell import GUESS, Attempt, Work, best_attempt, run_chunk, start_key
from colloc.studies.journal import Journal, Record, read_journal
from colloc.studies.study import Index, Study
from colloc.system.errors import ProblemError
from colloc.system.task_pool import Lost, Task, completed, process_pool

RETRIED = (ERROR, CRASHED, TIME_LIMIT)
_SAME_FAMILY = 0.2
"""Gaits of neighbours closer than this root-mean-square distance [rad] are one family: nothing is gained by exchanging them."""


@dataclass(eq=False)
class CellState:
    """What is known about a cell: its problem (or why there is none), and all attempts."""

    problem: Problem | None
    message: str = ""
    attempts: list[Attempt] = field(default_factory=list)

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
        text = read_journal(folder)
        self.damaged = text.damaged
        by_hash: dict[str, list[Attempt]] = {}
        for record in text.records:
            kept = [a for a in record.attempts if not (retry and a.outcome.status in RETRIED)]
            by_hash.setdefault(record.problem_hash, []).extend(kept)
        self.cells: dict[Index, CellState] = {}
        for cell in study.cells():
            try:
                problem = study.problem_at(cell)
            except ProblemError as error:
                self.cells[cell] = CellState(None, str(error))
            else:
                self.cells[cell] = CellState(problem, attempts=list(by_hash.get(problem.hash, [])))
        if all(state.problem is None for state in self.cells.values()):
            raise ProblemError(f"the study {study.name} has no problem in any cell; {next(iter(self.cells.values())).message}")

    @property
    def missing(self) -> list[Index]:
        """Cells with a problem and no attempt yet."""
        return [cell for cell, state in self.cells.items() if state.problem is not None and not state.attempts]

    def run(
        self, *, workers: int = 1, executor: Callable[[int], Executor] = process_pool, ahead: int | None = None
    ) -> Iterator[Progress]:
        """Work on all that is missing; each cell is on the disk before it is yielded.

        Parameters
        ----------
        workers, executor, ahead
            As for `colloc.system.task_pool.completed`; `ahead` is a quarter of the workers, and one, by default.
        """
        ahead = 1 + workers // 4 if ahead is None else ahead
        with Journal(self.folder) as journal:
            yield from self._round(0, self._first_chunks(), workers, executor, ahead, journal)
            for number in range(1, self.study.passes + 1):
                chunks = self._improvable()
                if not chunks:
                    break
                yield from self._round(number, chunks, workers, executor, ahead, journal)

    def _first_chunks(self) -> list[tuple[Index, ...]]:
        """Missing cells in runs along the last axis."""
        size = self.study.chunk
        grouped: dict[Index, list[Index]] = {}
        for cell in self.missing:
            grouped.setdefault((*cell[:-1], cell[-1] // size), []).append(cell)
        return [tuple(cells) for cells in grouped.values()]

    def _improvable(self) -> list[tuple[Index, ...]]:
        """Cells around which there is a gait of another family, or any gait if they have none."""
        found: list[tuple[Index, ...]] = []
        best = {cell: state.best for cell, state in self.cells.items()}
        for cell, state in self.cells.items():
            problem, own = state.problem, best[cell]
            if problem is None:
                continue
            for near in self.study.around(cell):
                other = best[near]
                if other is None or other.outcome.gait.n_joint != problem.body.n_joint:
                    continue
                gaits = (other.outcome.gait, own.outcome.gait) if own is not None else None
                if gaits is None or distance(*gaits, problem.body, problem.friction) > _SAME_FAMILY:
                    found.append((cell,))
                    break
        return found

    def _round(
        self,
        number: int,
        chunks: Sequence[tuple[Index, ...]],
        workers: int,
        executor: Callable[[int], Executor],
        ahead: int,
        journal: Journal,
    ) -> Iterator[Progress]:
        waiting: dict[int, set[Index]] = {}
        free: deque[int] = deque()
        unlocks: dict[Index, list[int]] = {}
        todo = {cell for chunk in chunks for cell in chunk}
        for k, chunk in enumerate(chunks):
            needs = {c for cell in chunk for c in self.study.before(cell)} & todo - set(chunk) if number == 0 else set()
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
        for task, result in completed(run_chunk, ready, workers=workers, executor=executor, ahead=ahead):
            if isinstance(result, Lost):
                result = [(work.cell, [_lost(work, result.message)]) for work in task.arguments[0]]
            hashes = {work.cell: work.problem.hash for work in task.arguments[0]}
            journal.append([Record(hashes[cell], tuple(attempts)) for cell, attempts in result if attempts])
            for cell, attempts in result:
                self.cells[cell].attempts += attempts
                for k in unlocks.get(cell, []):
                    waiting[k].discard(cell)
                    if not waiting[k]:
                        free.append(k)
                done += 1
                yield Progress(cell, self.cells[cell], attempts, number, done, len(todo))

    def _work(self, cell: Index, chunk: tuple[Index, ...], known: dict[Index, Attempt | None] | None) -> Work:
        study, state = self.study, self.cells[cell]
        assert state.problem is not None
        if known is None:
            inside = tuple(c for c in study.before(cell) if c in chunk)
            near = [self.cells[c].best for c in study.before(cell) if c not in chunk]
            gaits = tuple(a.outcome.gait for a in near if a is not None)
            cold = study.has_cold_starts(cell) or not (inside or gaits)
            incumbent = 0.0
        else:
            inside, cold = (), False
            gaits = tuple(a.outcome.gait for c in study.around(cell) if (a := known[c]) is not None)
            own = known[cell]
            incumbent = 0.0 if own is None else own.outcome.efficiency
        return Work(
            cell,
            state.problem,
            inside,
            gaits,
            tuple(range(study.cold_starts)) if cold else (),
            incumbent,
            state.tried,
            study.warm_starts,
            study.warm_delta_start,
            study.time_limit,
            study.seed,
        )


def _lost(work: Work, message: str) -> Attempt:
    guess = work.problem.guess
    return Attempt(GUESS, start_key(guess), Outcome(0, CRASHED, message, guess, guess))
