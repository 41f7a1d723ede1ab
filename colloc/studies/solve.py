"""Solve one problem, with a checkpoint, or from many starts over an executor: the functions behind
the commands solve and multistart. One bad start never ends a run."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Executor
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass, replace
from functools import cached_property, partial
from pathlib import Path
from typing import Any

import numpy as np

from colloc.gaits.gait_fields import AnyGait
from colloc.gaits.problem import Problem
from colloc.gaits.problem_file import ProblemFile, read_problem_file
from colloc.gaits.starts import LARGEST_SEED, LATIN_HYPERCUBE, SAMPLERS, start_gait
from colloc.mechanics.native_kernel import native_kernel
from colloc.results.answer import Step
from colloc.results.archive import (
    CRASHED,
    ERROR,
    PASSED_OVER,
    TIME_LIMIT,
    TRIVIAL,
    Archive,
    Basin,
    Outcome,
    StartName,
    basins,
    counts,
    open_archive,
    save_archive,
)
from colloc.results.solution import SOLVED, Solution
from colloc.results.store import SavedFile, save_result
from colloc.search.certify import is_trivial
from colloc.search.checkpoint import Progress
from colloc.search.explore import with_reachable_distance
from colloc.search.iterate import Iterate
from colloc.search.solve import REDUCED
from colloc.search.solve import solve as search_solve
from colloc.system.arguments import check_choice, check_count, shown
from colloc.system.errors import NotConvergedError, ProblemError
from colloc.system.files import run_file
from colloc.system.task_pool import LostTask, Task, pool_for, process_pool, run_tasks

Stated = Problem | str | os.PathLike[str]
_FOLDER: ContextVar[Path | None] = ContextVar("folder", default=None)
_CERTIFIED = ("value", "efficiency", "distance", "work", "value_error", "efficiency_error")


def solve(
    problem: Stated,
    starts: int | None = None,
    *,
    seconds: float = np.inf,
    search: str = REDUCED,
    output: str | os.PathLike[str] | None = None,
    verbose: bool = False,
    progress: Callable[[Progress], object] | None = None,
) -> Solution:
    """Find and certify the best gait of a problem, as ``colloc solve`` does.

    Parameters
    ----------
    problem : Problem or path-like
        A problem, or a problem file.
    starts : int, optional
        Minimum number of starting points; 1 is the guess alone. By default what the file says,
        else 32.
    seconds : float
        Wall time, after which the best gait so far is returned.
    search : {"reduced", "full"}
        "full": IPOPT on the full program at every level of delta, from the guess alone.
    output : path-like, optional
        HDF5 file for the solution. After Ctrl-C or a crash the same call resumes.
    verbose : bool
        Print a line for every step.
    progress : callable, optional
        Called with every `colloc.search.checkpoint.Progress`.

    Returns
    -------
    Solution
        Its ``success`` and ``message`` say whether it converged; nothing is raised if not.

    Raises
    ------
    ProblemError
        If the file states no problem that can be solved.
    StoreError
        If `output` cannot be written, or an earlier call's checkpoint cannot be read.

    Examples
    --------
    >>> import colloc
    >>> problem = colloc.Problem("quick", gait=colloc.Harmonic(1, "bilateral"), delta=1e-2)
    >>> solution = colloc.solve(problem, starts=4)
    >>> solution.success, round(solution.efficiency, 2)
    (True, 0.26)
    """
    file = _read(problem)
    if starts is not None:
        check_count(starts=starts)
    if not seconds > 0:
        raise ProblemError(f"seconds must be positive, not {seconds:g}.")
    if output is not None and not Path(output).name:
        raise ProblemError(f"output must name a file, not {shown(str(output))}.")
    path, report = None if output is None else Path(output), reporter(verbose, progress)
    settings: dict[str, Any] = {"seconds": seconds, "search": search, "progress": report}
    solution = resume(file, path, starts=starts or file.starts, **settings)
    if path is not None:
        save_and_clear(solution, path)
    return solution


def _read(problem: Stated) -> ProblemFile:
    if isinstance(problem, Problem):
        return ProblemFile(problem, None, "")
    return read_problem_file(problem)


def reporter(verbose: bool, progress: Callable[..., object] | None) -> Callable[..., None]:
    def report(news):
        if verbose:
            print(news, flush=True)
        if progress is not None:
            progress(news)

    return report


def resume(
    file: ProblemFile, path: Path | None, *, fresh: bool = False, **settings: Any
) -> Solution:
    """Solve with a checkpoint beside the result's path, or from the beginning if `fresh`."""
    keep = None if path is None else run_file(path)
    if fresh and keep is not None:
        keep.unlink(missing_ok=True)
    solution = search_solve(file.problem, keep=keep, **settings)
    for one in (solution, solution.shrunk):
        if one is not None:
            one.source = file.source
    return solution


def save_and_clear(solution: Solution, path: Path) -> list[SavedFile]:
    """Save a solution, and remove the checkpoint unless it was interrupted."""
    saved = save_result(solution, path)
    if not solution.interrupted:
        run_file(path).unlink(missing_ok=True)
    return saved


@contextmanager
def checkpoints_in(folder: Path) -> Iterator[None]:
    """Have `solve_member` keep checkpoints in a folder until the block succeeds."""
    token = _FOLDER.set(folder)
    try:
        yield
    except KeyboardInterrupt as stop:
        sentence = f"what was found is kept in {folder}; the same command goes on from there."
        raise KeyboardInterrupt(str(stop) or sentence) from None
    finally:
        _FOLDER.reset(token)
    for file in folder.glob(run_file(Path("member-*.h5")).name):
        file.unlink(missing_ok=True)


def solve_member(problem: Problem, starts: int | None) -> Solution:
    """Solve one problem of a family. KeyboardInterrupt if that is interrupted."""
    folder = _FOLDER.get()
    keep = None if folder is None else run_file(folder / f"member-{problem.hash[:16]}.h5")
    solution = search_solve(problem, starts, keep=keep)
    if solution.interrupted:
        raise KeyboardInterrupt
    return solution


def reopen(problem: Problem, outcome: Outcome) -> Solution:
    """Solve a start at the final delta from its gait, or again from its guess if it failed."""
    if outcome.status != SOLVED:
        return search_solve(problem.with_(guess=outcome.guess), 1)
    return search_solve(problem.with_(guess=outcome.gait, delta_start=problem.delta), 1)


@dataclass(frozen=True, eq=False)
class Starts:
    """Outcomes of a search over many starts, by number.

    Examples
    --------
    >>> import colloc
    >>> problem = colloc.Problem("quick", gait=colloc.Harmonic(1, "bilateral"), delta=1e-2)
    >>> found = colloc.multistart(problem, starts=2)
    >>> found.solution().success
    True
    """

    problem: Problem
    outcomes: tuple[Outcome, ...]

    @cached_property
    def optima(self) -> list[Basin]:
        """The distinct certified optima, best first."""
        return basins(self.problem, self.outcomes)

    def solution(self, start: int | None = None) -> Solution:
        """Solve a start again from its gait, by default the best one (`NotConvergedError` if no
        start was certified)."""
        if start is not None:
            return reopen(self.problem, next(o for o in self.outcomes if o.start == start))
        if not self.optima:
            raise NotConvergedError(
                f"none of {len(self.outcomes)} starts of {self.problem.name} was verified."
            )
        return reopen(self.problem, self.optima[0].best)

    def __repr__(self) -> str:
        tally = ", ".join(f"{n} {status}" for status, n in counts(self.outcomes).items())
        best = ""
        if self.optima:
            best = f"; best {self.problem.objective.short} = {self.optima[0].best.value:.6g}"
        return f"<Starts of {self.problem.name}: {tally}; {len(self.optima)} distinct optima{best}>"


def multistart(
    problem: Stated,
    starts: int = 20,
    *,
    seed: int = 0,
    sampler: str = LATIN_HYPERCUBE,
    workers: int = 1,
    time_limit: float = 300.0,
    archive: str | os.PathLike[str] | None = None,
    verbose: bool = False,
    progress: Callable[[Outcome], object] | None = None,
) -> Starts:
    """Find local optima of a problem from seeded random starts, as ``colloc multistart`` does.

    Parameters
    ----------
    problem : Problem or path-like
        A problem, or a problem file.
    starts, seed : int
        Starts 0 to `starts` - 1 of a seed, which do not depend on how many there are.
    sampler : {"latin-hypercube", "perturbed"}
    workers : int
        Processes; with one everything runs in this process. A script that defines a part of the
        problem needs ``if __name__ == "__main__":`` with more.
    time_limit : float
        Seconds for one start.
    archive : path-like, optional
        HDF5 file in which starts are kept and not solved again.
    verbose : bool
        Print every outcome.
    progress : callable, optional
        Called with every `colloc.results.archive.Outcome`.

    Examples
    --------
    >>> import colloc
    >>> problem = colloc.Problem("quick", gait=colloc.Harmonic(1, "bilateral"), delta=1e-2)
    >>> found = colloc.multistart(problem, starts=3)
    >>> found.optima[0].best.efficiency > 0.2
    True
    """
    check_count(starts=starts, workers=workers)
    check_count(LARGEST_SEED, least=0, seed=seed)
    check_choice(SAMPLERS, sampler=sampler)
    if not time_limit > 0:
        raise ProblemError(f"time_limit must be positive, not {time_limit:g}.")
    problem, _ = with_reachable_distance(_read(problem).problem)
    store = Archive(problem) if archive is None else open_archive(problem, archive)
    done, report = store.done(sampler, seed, starts), reporter(verbose, progress)
    how: dict[str, Any] = {"workers": workers, "time_limit": time_limit, "executor": pool_for}
    todo = (k for k in range(starts) if k not in done)
    try:
        for outcome in run_starts(store, todo, sampler=sampler, seed=seed, **how):
            report(outcome)
    finally:
        if archive is not None:
            save_archive(store, "colloc.multistart")
    return Starts(problem, tuple(store.of_search(sampler, seed, starts).values()))


def run_starts(
    archive: Archive,
    starts: Iterable[int],
    *,
    sampler: str = LATIN_HYPERCUBE,
    seed: int = 0,
    workers: int = 1,
    time_limit: float = 300.0,
    executor: Callable[[int], Executor] = process_pool,
) -> Iterator[Outcome]:
    """Outcomes of starts, each as soon as it is there and in the archive.

    A start depends only on the problem, the sampler, the seed and its number. Workers and executor
    are as for `colloc.system.task_pool.run_tasks`; a start that kills its worker twice has crashed.
    """
    problem = archive.problem
    if not problem.gait.free:
        raise ProblemError(
            "a prescribed motion is the same from every start; colloc solve measures it."
        )
    native_kernel()  # its absence is reported once for all workers
    tasks = (Task(k, (problem, sampler, seed, k, time_limit)) for k in starts)
    ready = partial(next, tasks, None)
    for task, outcome in run_tasks(_run_start, ready, workers=workers, executor=executor):
        if isinstance(outcome, LostTask):
            guess, number = problem.guess, task.arguments[3]
            outcome = Outcome(number, CRASHED, outcome.message, guess, guess)
        archive.add({StartName(sampler, seed, outcome.start): outcome})
        yield outcome


def _run_start(problem: Problem, sampler: str, seed: int, start: int, time_limit: float) -> Outcome:
    return run_guess(problem, partial(start_gait, problem, sampler, seed, start), start, time_limit)


def run_guess(
    problem: Problem,
    start_from: Callable[[], AnyGait],
    start: int,
    time_limit: float,
    *,
    worth: Callable[[Iterate], bool] = lambda end: True,
) -> Outcome:
    """Solve and certify a problem from the gait that `start_from` makes, within a time limit [s].

    Errors become the outcome's status and message. An optimum that is not `worth` it is passed
    over.
    """
    begin, cpu = time.perf_counter(), time.process_time()
    news = list[Progress]()

    def check(end):
        if not worth(end):
            raise _NotWorthIt(end)

    guess = problem.guess
    try:
        guess = start_from()
        solution = search_solve(
            problem.with_(guess=guess), 1, seconds=time_limit, progress=news.append, check=check
        )
        if not solution.interrupted:
            outcome = _outcome(start, guess, solution)
        elif time.perf_counter() - begin < time_limit:
            raise KeyboardInterrupt
        else:
            where = "no optimum yet"
            if news and news[-1].best:
                where = f"the last optimum was at delta = {solution.answer.delta:.1e}"
            message = f"gave up after {time_limit:g} s; {where}."
            outcome = Outcome(start, TIME_LIMIT, message, guess, guess)
    except _NotWorthIt as stop:
        end: Iterate = stop.args[0]
        outcome = _of_steps(Outcome(start, PASSED_OVER, "", guess, end.gait), end.history)
    except Exception as error:
        outcome = Outcome(start, ERROR, f"{type(error).__name__}: {error}", guess, guess)
    return replace(
        outcome, seconds=time.perf_counter() - begin, cpu_seconds=time.process_time() - cpu
    )


class _NotWorthIt(Exception):
    """Ends the solve of an optimum, its argument, that is passed over."""


def _outcome(start: int, guess: AnyGait, solution: Solution) -> Outcome:
    status = TRIVIAL if is_trivial(solution.answer) else solution.status
    outcome = Outcome(start, status, solution.message, guess, solution.gait)
    outcome = _of_steps(outcome, solution.history)
    if solution.certificate.replayed:
        numbers = {name: getattr(solution.certificate, name) for name in _CERTIFIED}
        return replace(outcome, delta=solution.answer.delta, **numbers)
    return outcome


def _of_steps(outcome: Outcome, history: Iterable[Step]) -> Outcome:
    outcome = replace(outcome, iterations=sum(step.iterations for step in history))
    if optimal := [step for step in history if step.optimal]:
        last = optimal[-1]
        numbers = {name: getattr(last, name) for name in ("delta", "value", "distance", "work")}
        return replace(outcome, efficiency=last.distance / last.work, **numbers)
    return outcome
