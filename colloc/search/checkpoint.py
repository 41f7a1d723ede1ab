"""Results of stages, stored as they appear and read again by the next run of the same problem.

A stage is a function of values. So its result is stored under a digest of its name and arguments,
and a run that was interrupted goes on by calling every stage once more: what is stored takes no
time, and the end is the same to the last bit.
"""

from __future__ import annotations

import functools
import inspect
import json
import time
import warnings
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from contextvars import ContextVar
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, ParamSpec, TypeVar

from colloc.gaits import gait_fields
from colloc.gaits.problem import Problem
from colloc.gaits.starts import is_visible
from colloc.results.answer import Answer, SecondOrder, Step
from colloc.results.checks import Certificate, Check
from colloc.results.solution import Solution
from colloc.search.iterate import Iterate
from colloc.search.options import OPTIONS
from colloc.search.spaces import SPACES, space_of
from colloc.system.errors import ReadOnlyRunWarning, StoreError
from colloc.system.interruption import interruptible, time_limit
from colloc.system.plain_values import Codec
from colloc.system.row_file import put_rows, read_rows

Arguments = ParamSpec("Arguments")
Result = TypeVar("Result")
ROWS = "colloc run 3"
STAGES = ("explore", "follow", "descend", "refine", "confirm", "certify")
_PROBLEM = "problem"


@dataclass(frozen=True, eq=False)
class Progress:
    """Progress of a solve.

    Attributes
    ----------
    stage : str
        "explore", "follow", "descend", "refine", "confirm" or "certify".
    done, count : int
        Starts, gaits followed to the final delta, levels of delta, or meshes; fewer may be enough.
    best : Iterate, optional
        The best gait so far; one that shrank only if none of finite size is known.
    seconds : float
    round : int
        Times the stages were begun: again for another gait, a smaller delta, or off a saddle.
    """

    stage: str
    done: int
    count: int
    best: Iterate | None
    seconds: float
    round: int = 1

    def __str__(self) -> str:
        text = f"{self.stage}, {self.done} of {self.count}"
        if self.round > 1:
            text = f"round {self.round}, {text}"
        if self.best is None:
            return text
        best = self.best
        return (
            f"{text}; best {best.problem.objective.short} = {best.value:.4f} at delta = "
            f"{best.delta:.0e}"
        )


@dataclass(eq=False)
class Run:
    """Results of one solve.

    Parameters
    ----------
    path : path, optional
        File that stores them.
    problem : Problem, optional
        Problem that is solved; stored problems are differences from it.
    progress : callable, optional
        Called with every `Progress`.
    stores : bool
        Store results in `rows` without a file too.
    """

    path: Path | None = None
    problem: Problem | None = None
    progress: Callable[[Progress], object] = lambda progress: None
    stores: bool = False
    best: Iterate | None = None
    solutions: list[Solution] = field(default_factory=list)
    n_reused: int = 0

    def __post_init__(self) -> None:
        self._begin = self._last_write = time.monotonic()
        self._stage, self._round = STAGES[0], 1
        self.rows: dict[str, Any] = {}
        self._pending: dict[str, Any] = {}
        self._problems: dict[str, Problem] = {}
        self._spaces: dict[str, Any] = {}
        self._disk_refused = False
        if self.problem is None:
            return
        self._stated = self.problem.to_dict()
        records = [Answer, Certificate, Check, Iterate, SecondOrder, Step]
        by_rule: dict[type, Any] = {Problem: (self._changes, self._with_changes)}
        by_rule |= dict.fromkeys(SPACES, (self._space_arguments, self._space))
        self._codec = Codec([*records, *gait_fields.GAITS, *gait_fields.CLASSES], by_rule)
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

    def _changes(self, problem: Problem) -> dict[str, Any]:
        stated = problem.to_dict()
        return {
            name: stated.get(name)
            for name in {*stated, *self._stated}
            if stated.get(name) != self._stated.get(name)
        }

    def _with_changes(self, changes: dict[str, Any]) -> Problem:
        key = json.dumps(changes, sort_keys=True)
        if key not in self._problems:
            stated = {**self._stated, **changes}
            self._problems[key] = Problem.from_dict(
                {name: value for name, value in stated.items() if value is not None}
            )
        return self._problems[key]

    def _space_arguments(self, space: Any) -> Any:
        return self.encode((space.control.problem, None, space.edges, space.scheme, space.far))

    def _space(self, arguments: Any) -> Any:
        key = json.dumps(arguments, sort_keys=True)
        if key not in self._spaces:
            self._spaces[key] = space_of(*self.decode(arguments))
        return self._spaces[key]

    def encode(self, value: Any) -> Any:
        """The value as JSON can hold it."""
        return self._codec.encode(value)

    def decode(self, plain: Any) -> Any:
        return self._codec.decode(plain)

    def update(self, rows: Mapping[str, Any]) -> None:
        """Add results of another run of the same problem."""
        self.rows.update(rows)
        self._pending.update(rows)

    def result(self, stage: str, arguments: tuple, compute: Callable[[], Result]) -> Result:
        """The stored result of a stage, else the computed one, which is stored."""
        stores = self.stores or self.path is not None
        if not stores and not self.rows:
            return compute()
        key = f"{stage} {gait_fields.statement_hash(self.encode(arguments))}"
        if key in self.rows:
            with suppress(KeyError, TypeError, ValueError):
                stored = self.decode(self.rows[key])
                self.n_reused += 1
                return stored
        value = compute()
        if stores:
            self.rows[key] = self._pending[key] = self.encode(value)
            late = time.monotonic() - self._last_write > OPTIONS.checkpoint_interval
            if late and not self._disk_refused:
                self.write()
        return value

    def write(self) -> None:
        """Add new results to the file; warn, once, where that is not possible.

        A refused file is left as it was, and tried again at the end of the run.
        """
        self._last_write = time.monotonic()
        if self.path is None or not self._pending:
            return
        assert self.problem is not None
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

    def report(self, stage: str, done: int, count: int, best: Iterate | None = None) -> None:
        """Report how far a stage has come, and its best gait: one of finite size is preferred to
        one that shrank."""
        if (self._stage, stage) == ("follow", "descend"):
            return  # each gait is followed by a descent of its own
        if best is not None and (
            self.best is None
            or best.delta < self.best.delta
            or _may_be_the_answer(best)
            or not _may_be_the_answer(self.best)
        ):
            self.best = best
        self._round += STAGES.index(stage) < STAGES.index(self._stage)
        self._stage = stage
        seconds = time.monotonic() - self._begin
        self.progress(Progress(stage, done, count, self.best, seconds, self._round))

    @contextmanager
    def active(self, seconds: float) -> Iterator[None]:
        """A block whose stages store their results here, ended by KeyboardInterrupt at Ctrl-C or
        after so many seconds. New results are written however it ends."""
        token = _ACTIVE.set(self)
        try:
            with interruptible(polled=False), time_limit(seconds):
                yield
        finally:
            self.write()
            _ACTIVE.reset(token)


def _may_be_the_answer(iterate: Iterate) -> bool:
    return iterate.problem.shrinking or is_visible(iterate.gait)


_ACTIVE: ContextVar[Run] = ContextVar("run")
_STORES_NOTHING = Run()


def active_run() -> Run:
    """The run under way; one that stores nothing where a stage is called by itself."""
    return _ACTIVE.get(_STORES_NOTHING)


def checkpointed(stage: Callable[Arguments, Result]) -> Callable[Arguments, Result]:
    """A function of values whose results are stored in the run under way, by name and arguments."""
    signature = inspect.signature(stage)

    @functools.wraps(stage)
    def stored(*positional: Arguments.args, **named: Arguments.kwargs) -> Result:
        arguments = signature.bind(*positional, **named)
        arguments.apply_defaults()
        return active_run().result(
            stage.__name__, arguments.args, lambda: stage(*positional, **named)
        )

    return stored
