"""Results of stages, stored as they appear and read again by the next run of the same problem; and
stages computed ahead in other processes.

A stage is a function of values, so its result is stored under a digest of its name and arguments. A
run that was interrupted calls every stage once more and ends the same to the last bit; results of
other processes become known in the same way.
"""

import functools
import importlib
import json
import pickle
import time
import warnings
from collections.abc import Callable, Iterator
from concurrent.futures import BrokenExecutor, CancelledError, Executor, Future, wait
from contextlib import contextmanager, suppress
from contextvars import ContextVar
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, ParamSpec, TypeVar

import numpy as np

from colloc.gaits import gait_fields
from colloc.gaits.problem import Problem
from colloc.gaits.starts import is_visible
from colloc.results.answer import Answer, SecondOrder, Step
from colloc.results.checks import Certificate, Check
from colloc.results.solution import Solution
from colloc.search.iterate import SPACES, Iterate, space_of
from colloc.search.options import OPTIONS
from colloc.system.environment import available_threads
from colloc.system.errors import CollocError, ReadOnlyRunWarning, StoreError
from colloc.system.interruption import interruptible, time_limit
from colloc.system.row_file import Codec, put_rows, read_rows
from colloc.system.task_pool import process_pool, worker_environment

Arguments = ParamSpec("Arguments")
Result = TypeVar("Result")
ROWS = "colloc run 4"
STAGES = ("explore", "follow", "descend", "refine", "confirm", "certify")
_PROBLEM = "problem"


@dataclass(frozen=True, eq=False)
class Progress:
    """Progress of a solve: `done` of `count` starts, gaits, levels of delta, or meshes; fewer
    may be enough."""

    stage: str  # of `STAGES`
    done: int
    count: int
    best: Iterate | None  # one that shrank only if none of finite size is known
    seconds: float
    round: int = 1  # times the stages were begun: for another gait, a smaller delta, off a saddle

    def __str__(self) -> str:
        text = f"round {self.round}, " if self.round > 1 else ""
        text += f"{self.stage}, {self.done} of {self.count}"
        if (best := self.best) is None:
            return text
        name = best.problem.objective.short
        return f"{text}; best {name} = {best.value:.4f} at delta = {best.delta:.0e}"


@dataclass(eq=False)
class Run:
    """Results of one solve: in a file, if there is a path; else, with `stores`, in `rows` alone."""

    path: Path | None = None
    problem: Problem | None = None
    progress: Callable[[Progress], object] = lambda progress: None
    stores: bool = False
    best: Iterate | None = None
    solutions: list[Solution] = field(default_factory=list)
    n_reused: int = 0

    def __post_init__(self) -> None:
        self._begin = self._last_write = time.monotonic()
        self._stage, self._round, self._seconds = STAGES[0], 1, np.inf
        self.ahead = Ahead(self)
        self.rows: dict[str, Any] = {}
        self._pending: dict[str, Any] = {}
        self._disk_refused = False
        self.stores = self.stores or self.path is not None
        if self.problem is None:
            return
        self.codec = _codec()
        if self.path is None:
            return
        try:
            self.rows = read_rows(self.path, ROWS)
        except StoreError as error:
            raise StoreError(
                f"{error} It was left by an interrupted run; remove it to begin again (solve "
                f"--fresh)."
            ) from None
        if self.rows.pop(_PROBLEM, self.problem.hash) != self.problem.hash:
            raise StoreError(
                f"{self.path} was left by a run of another problem of that name; --fresh begins "
                f"again."
            )

    def update(self, rows: dict[str, Any]) -> None:
        self.rows.update(rows)
        self._pending.update(rows)

    def result(self, stage: Callable[..., Result], arguments: tuple) -> Result:
        """The stored result of a stage, else the computed one, which is stored."""
        if not self.stores and not self.rows:
            return stage(*arguments)
        digest = gait_fields.statement_hash(self.codec.encode(arguments))
        key = f"{stage.__name__} {digest}"
        if key in self.rows:
            with suppress(KeyError, TypeError, ValueError):
                stored = self.codec.decode(self.rows[key])
                self.n_reused += 1
                return stored
        value = stage(*arguments)
        if self.stores:
            self.rows[key] = self._pending[key] = self.codec.encode(value)
            late = time.monotonic() - self._last_write > OPTIONS.checkpoint_interval
            if late and not self._disk_refused:
                self.write()
        return value

    def write(self) -> None:
        """Add new results to the file; warn, once, where that is not possible.

        A refused file is left as it was, and tried again at the end of the run.
        """
        self._last_write = time.monotonic()
        if self.path is None or self.problem is None or not self._pending:
            return
        try:
            put_rows(self.path, ROWS, {_PROBLEM: self.problem.hash, **self._pending})
            self._pending = {}
        except StoreError as error:
            if not self._disk_refused:
                text = f"{error} The solve goes on, and tries again at its end."
                warnings.warn(text, ReadOnlyRunWarning, stacklevel=2)
            self._disk_refused = True
            with suppress(OSError):
                if self.path.stat().st_size == 0:
                    self.path.unlink()

    def has_time(self) -> bool:
        """True if there is time for another start, or another gait to follow."""
        return time.monotonic() < self._begin + OPTIONS.exploring * self._seconds

    def report(self, stage: str, done: int, count: int, best: Iterate | None = None) -> None:
        """Report how far a stage has come, and its best gait: one of finite size is preferred to
        one that shrank."""
        if (self._stage, stage) == ("follow", "descend"):
            return  # each gait is followed by a descent of its own

        def may_be_the_answer(iterate):
            return iterate.problem.shrinking or is_visible(iterate.gait)

        if best is not None and self.problem and best.problem.froude != self.problem.froude:
            best = None  # a gait of slow motion, of a search that goes on with inertia
        if best is not None and (
            self.best is None
            or best.delta < self.best.delta
            or may_be_the_answer(best)
            or not may_be_the_answer(self.best)
        ):
            self.best = best
        self._round += STAGES.index(stage) < STAGES.index(self._stage)
        self._stage = stage
        seconds = time.monotonic() - self._begin
        self.progress(Progress(stage, done, count, self.best, seconds, self._round))

    def begin_again(self) -> None:
        """Report from here on as if no stage had been."""
        self.best, self._stage, self._round = None, STAGES[0], 1

    @contextmanager
    def active(self, seconds: float) -> Iterator[None]:
        """A block whose stages store their results here, ended by KeyboardInterrupt at Ctrl-C or
        after so many seconds. New results are written however it ends."""
        token, self._seconds = _ACTIVE.set(self), seconds
        try:
            with interruptible(polled=False), time_limit(seconds):
                yield
        finally:
            self.write()
            _ACTIVE.reset(token)


def _codec() -> Codec:
    """Encoder of all that stages take and return; a problem as it is stated, a space by what makes
    it, each made once."""
    known: dict[str, Any] = {}

    def once(plain, make):
        key = json.dumps(plain, sort_keys=True)
        if key not in known:
            known[key] = make(plain)
        return known[key]

    def problem_fields(problem):
        plain = problem.to_dict()
        once(plain, lambda _: problem)  # from other processes it comes back
        return plain

    def arguments(space):
        return codec.encode((space.control.problem, space.edges, space.scheme, space.far))

    def space(plain):
        return once(plain, lambda plain: space_of(*codec.decode(plain)))

    records = [Answer, Certificate, Check, Iterate, SecondOrder, Step]
    by_rule: dict[type, Any] = dict.fromkeys(SPACES, (arguments, space))
    by_rule[Problem] = problem_fields, lambda plain: once(plain, Problem.from_dict)
    codec = Codec([*records, *gait_fields.GAITS, *gait_fields.CLASSES], by_rule)
    return codec


class Ahead:
    """Processes that compute ahead, one for each other processor, begun when there is enough left
    to do; they end with the exploration, whatever they do."""

    def __init__(self, run: Run) -> None:
        self._run = run
        self._pool: Executor | None = None
        self._futures: dict[str, Future[dict[str, Any]]] = {}
        self.count = 0

    def begin(self, seconds_left: float) -> None:
        count = available_threads() - 1
        problem = self._run.problem
        if self._pool or problem is None or count == 0 or seconds_left < OPTIONS.worth_a_process:
            return
        try:
            pickle.dumps(problem)
        except (pickle.PicklingError, AttributeError, TypeError):
            return  # a part of the problem is known in this process only
        self._pool, self.count = process_pool(count), count

    def submit(self, number: int, function: Callable[..., object], *arguments: Any) -> None:
        """Call a function of a module, with arguments that a run can store, in another process;
        the search does its own share of such numbered pieces."""
        problem = self._run.problem
        if self._pool is None or problem is None or number % (self.count + 1) == 0:
            return
        if (task := self._task(function, arguments)) not in self._futures:
            with suppress(BrokenExecutor), worker_environment(), interruptible():
                self._futures[task] = self._pool.submit(_rows_of, problem, task)

    def wait_for(self, function: Callable[..., object], *arguments: Any) -> None:
        """Wait for a call that was submitted and has begun; the run knows its results then."""
        future = self._futures.pop(self._task(function, arguments), None) if self._pool else None
        if future is None or future.cancel():
            return
        while not future.done():
            with interruptible():  # Ctrl-C is held back no longer than a tenth of a second
                wait([future], timeout=0.1)
        with suppress(BrokenExecutor, CancelledError):
            self._run.update(future.result())

    def _task(self, function: Callable[..., object], arguments: tuple) -> str:
        encoded = self._run.codec.encode(arguments)
        return json.dumps([function.__module__, function.__name__, encoded])

    def end(self) -> None:
        pool, self._pool, self.count, self._futures = self._pool, None, 0, {}
        if pool is not None:
            processes = list((getattr(pool, "_processes", None) or {}).values())
            pool.shutdown(wait=False, cancel_futures=True)
            for process in processes:  # what they compute is of no use any more
                process.kill()


def _rows_of(problem: Problem, task: str) -> dict[str, Any]:
    module, name, arguments = json.loads(task)
    run = Run(problem=problem, stores=True)
    with suppress(CollocError), run.active(np.inf):
        getattr(importlib.import_module(module), name)(*run.codec.decode(arguments))
    return run.rows


_ACTIVE: ContextVar[Run] = ContextVar("run")
_STORES_NOTHING = Run()


def active_run() -> Run:
    """The run under way; one that stores nothing where a stage is called by itself."""
    return _ACTIVE.get(_STORES_NOTHING)


def checkpoint(stage: Callable[Arguments, Result]) -> Callable[Arguments, Result]:
    """A function of values, called by place, whose results are stored in the run under way."""

    @functools.wraps(stage)
    def call(*arguments: Arguments.args, **named: Arguments.kwargs) -> Result:
        if named:
            raise TypeError(f"{stage.__name__} takes its arguments by place.")
        return active_run().result(stage, arguments)

    return call
