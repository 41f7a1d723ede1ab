"""A run of the search: what its stages found is kept as it appears, and found again, not computed
again, by the next run.

A stage is a function of values. So what it finds can be kept under a digest of its name and these
values, and a run that was interrupted, by Ctrl-C or a power cut, goes on by doing everything once
more: whatever is known already takes no time, and the end is the same to the last bit. No stage
knows of it but for the line that says what is worth keeping (`kept`).
"""

from __future__ import annotations

import json
import time
import warnings
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from contextvars import ContextVar
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TypeVar

from colloc.gaits import gait_fields
from colloc.gaits.problem import Problem
from colloc.gaits.starts import is_visible
from colloc.reduced.given import Given
from colloc.results.answer import Answer, SecondOrder, Step
from colloc.results.checks import Certificate, Check
from colloc.search.effort import Effort
from colloc.search.optimum import Optimum
from colloc.system.errors import ReadOnlyRunWarning, StoreError
from colloc.system.interruption import interruptible, time_limit
from colloc.system.plain_values import Codec, Own
from colloc.system.row_file import put_rows, read_rows

Value = TypeVar("Value")
ROWS = "colloc run 2"
EVERY = 2.0
"""Seconds between writes: as much may have to be computed again after a crash. Short solves write
nothing."""
_PROBLEM = "problem"
STAGES = ("explore", "follow", "descend", "refine", "confirm", "certify")


@dataclass(frozen=True, eq=False)
class Progress:
    """How far a solve has come.

    Attributes
    ----------
    stage : str
        "explore", "follow", "descend", "refine", "confirm" or "certify".
    done, count : int
        Of starts, of gaits followed to the final delta, of levels of delta, or of meshes. Fewer may
        be enough: nobody knows how long a stage will take.
    best : Optimum, optional
        The best gait so far; one that shrank as far as the problem allows only if none of finite
        size is known.
    seconds : float
        Since the solve began.
    round : int
        Counts from 1 how often the stages were begun: again for a second gait that may be the
        answer, at a smaller delta, or off a saddle.
    """

    stage: str
    done: int
    count: int
    best: Optimum | None
    seconds: float
    round: int = 1

    def __str__(self) -> str:
        text = f"{self.stage}, {self.done} of {self.count}"
        if self.round > 1:
            text = f"round {self.round}, {text}"
        if self.best is None:
            return text
        return (
            f"{text}; best {self.best.problem.objective.short} = {self.best.value:.4f} at "
            f"delta "
            f"= {self.best.delta:.0e}"
        )


@dataclass(eq=False)
class Run:
    """What one solve found so far.

    Parameters
    ----------
    path : path, optional
        Of the file that keeps it; by default nothing is kept.
    problem : Problem, optional
        That is solved; a file knows its problems by how they differ from that.
    progress : callable, optional
        Called with every `Progress`.
    remembers : bool
        What is found is kept, as `rows`, without a file too.
    """

    path: Path | None = None
    problem: Problem | None = None
    progress: Callable[[Progress], object] = lambda news: None
    remembers: bool = False
    best: Optimum | None = None
    answers: list[tuple[Answer, Certificate]] = field(default_factory=list)
    found_again: int = 0
    """Values that an earlier run had kept."""

    def __post_init__(self) -> None:
        self._begin = self._last = time.monotonic()
        self._stage, self._round = STAGES[0], 1
        self._known: dict[str, Any] = {}
        self._pending: dict[str, Any] = {}
        self._problems: dict[str, Problem] = {}
        self._refused = (
            False  # by the disk; tried again at the end, since another try may have to wait
        )
        if self.problem is None:
            return
        self._stated = self.problem.to_dict()
        stages = [Answer, Certificate, Check, Effort, Given, Optimum, SecondOrder, Step]
        self._codec = Codec(
            [*stages, *gait_fields.GAITS, *gait_fields.CLASSES],
            {Problem: Own(self._changes, self._with_changes)},
        )
        if self.path is None:
            return
        try:
            rows = read_rows(self.path, ROWS)
        except StoreError as error:
            raise StoreError(
                f"{error} It was left by an interrupted run; remove it to begin again (solve "
                f"--fresh)."
            ) from None
        if rows.pop(_PROBLEM, self.problem.hash) != self.problem.hash:
            raise StoreError(
                f"{self.path} was left by a run of another problem of that name; --fresh begins "
                f"again."
            )
        self._known = rows

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

    def written(self, value: Any) -> Any:
        """A value that a run can keep, as JSON can hold it."""
        return self._codec.written(value)

    def read(self, plain: Any) -> Any:
        """The value that `written` wrote."""
        return self._codec.read(plain)

    @property
    def rows(self) -> dict[str, Any]:
        """All that is known, written, by stage and values."""
        return self._known

    def learn(self, rows: Mapping[str, Any]) -> None:
        """Know what another run of the problem has found."""
        self._known.update(rows)
        self._pending.update(rows)

    def kept(self, stage: str, given: tuple, compute: Callable[[], Value]) -> Value:
        """What a stage makes of given values: as an earlier run found it, else computed, and
        kept."""
        keeps = self.remembers or self.path is not None
        if not keeps and not self._known:
            return compute()
        key = f"{stage} {gait_fields.statement_hash(self.written(given))}"
        if key in self._known:
            with suppress(KeyError, TypeError, ValueError):
                found = self.read(self._known[key])
                self.found_again += 1
                return found
        value = compute()
        if not keeps:
            return value
        self._known[key] = self._pending[key] = self.written(value)
        if not self._refused and time.monotonic() - self._last > EVERY:
            self.write()
        return value

    def write(self) -> None:
        """Put what was found since the last time into the file; a warning, once, where that is not
        possible. The file then holds what it held; an empty one goes."""
        self._last = time.monotonic()
        if self.path is None or not self._pending:
            return
        assert self.problem is not None
        try:
            put_rows(self.path, ROWS, {_PROBLEM: self.problem.hash, **self._pending})
            self._pending = {}
        except StoreError as error:
            if not self._refused:
                said = f"{error} The solve goes on, and tries again at its end."
                warnings.warn(said, ReadOnlyRunWarning, stacklevel=2)
            self._refused = True
            with suppress(OSError):
                if self.path.stat().st_size == 0:
                    self.path.unlink()

    def told(self, stage: str, done: int, count: int, best: Optimum | None = None) -> None:
        """Say how far a stage has come, and which gait is the best so far: one of finite size is,
        beside one that shrank."""
        if (self._stage, stage) == ("follow", "descend"):
            return  # each gait is followed by a descent of its own
        if best is not None and (
            self.best is None
            or best.delta < self.best.delta
            or _counts(best)
            or not _counts(self.best)
        ):
            self.best = best
        self._round += STAGES.index(stage) < STAGES.index(self._stage)
        self._stage = stage
        self.progress(
            Progress(stage, done, count, self.best, time.monotonic() - self._begin, self._round)
        )

    @contextmanager
    def under_way(self, seconds: float) -> Iterator[None]:
        """A block whose stages keep what they find here. It ends in KeyboardInterrupt at Ctrl-C,
        and after so many seconds. However it ends, all of it is written: the result may yet fail to
        be saved."""
        token = _CURRENT.set(self)
        try:
            with interruptible(polled=False), time_limit(seconds):
                yield
        finally:
            self.write()
            _CURRENT.reset(token)


def _counts(optimum: Optimum) -> bool:
    """Whether a gait may be the answer, though others that are less good are known."""
    return optimum.problem.shrinking or is_visible(optimum.gait)


_CURRENT: ContextVar[Run] = ContextVar("run")
_NOTHING = Run()
"""Where a stage is called by itself."""


def this_run() -> Run:
    """The run that is under way; one that keeps nothing if there is none."""
    return _CURRENT.get(_NOTHING)
