"""Many starts of one problem over an executor; one bad start never ends the run."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from concurrent.futures import Executor
from dataclasses import replace
from functools import partial

from colloc.gaits.gait_fields import AnyGait
from colloc.gaits.problem import Problem
from colloc.gaits.starts import LATIN_HYPERCUBE, start_gait
from colloc.mechanics.native_kernel import native_kernel
from colloc.results.archive import Archive, StartName
from colloc.results.outcome import CRASHED, ERROR, PASSED_OVER, TIME_LIMIT, TRIVIAL, Outcome
from colloc.results.solution import Solution
from colloc.search.certify import is_trivial
from colloc.search.checkpoint import Progress
from colloc.search.iterate import Iterate
from colloc.search.solve import solve
from colloc.system.errors import ProblemError
from colloc.system.task_pool import Lost, Task, process_pool, run_tasks

_CERTIFIED = ("value", "efficiency", "distance", "work", "value_error", "efficiency_error")


def run_start(
    problem: Problem, sampler: str, seed: int, start: int, time_limit: float, known: AnyGait | None
) -> Outcome:
    """Solve and certify one start of a sampler, or from a known gait in its place."""
    begin = partial(start_gait, problem, sampler, seed, start)
    return run_guess(problem, lambda: known or begin(), start, time_limit)


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
    passed, news = list[Iterate](), list[Progress]()

    def accept(end: Iterate) -> bool:
        if not worth(end):
            passed.append(end)
        return not passed

    guess = problem.guess
    try:
        guess = start_from()
        solution = solve(
            problem.with_(guess=guess), 1, seconds=time_limit, progress=news.append, accept=accept
        )
        if not solution.interrupted:
            outcome = _outcome(start, guess, solution)
            outcome = replace(outcome, status=PASSED_OVER, message="") if passed else outcome
        elif time.perf_counter() - begin < time_limit:
            raise KeyboardInterrupt
        else:
            where = "no optimum yet"
            if news[-1].best:
                where = f"the last optimum was at delta = {solution.answer.delta:.1e}"
            message = f"gave up after {time_limit:g} s; {where}."
            outcome = Outcome(start, TIME_LIMIT, message, guess, guess)
    except Exception as error:
        outcome = Outcome(start, ERROR, f"{type(error).__name__}: {error}", guess, guess)
    return replace(
        outcome, seconds=time.perf_counter() - begin, cpu_seconds=time.process_time() - cpu
    )


def _outcome(start: int, guess: AnyGait, solution: Solution) -> Outcome:
    optimal = [step for step in solution.history if step.optimal]
    certificate = solution.certificate
    status = TRIVIAL if is_trivial(solution.answer) else solution.status
    iterations = sum(step.iterations for step in solution.history)
    outcome = Outcome(start, status, solution.message, guess, solution.gait, iterations=iterations)
    if certificate.replayed:
        numbers = {name: getattr(certificate, name) for name in _CERTIFIED}
        return replace(outcome, delta=solution.answer.delta, **numbers)
    if optimal:
        last = optimal[-1]
        numbers = {name: getattr(last, name) for name in ("delta", "value", "distance", "work")}
        return replace(outcome, efficiency=last.distance / last.work, **numbers)
    return outcome


def run_starts(
    problem: Problem,
    starts: Iterable[int],
    *,
    sampler: str = LATIN_HYPERCUBE,
    seed: int = 0,
    workers: int = 1,
    time_limit: float = 300.0,
    executor: Callable[[int], Executor] = process_pool,
    known: Mapping[int, AnyGait] | None = None,
) -> Iterator[Outcome]:
    """Outcomes of starts, each as soon as it is there; some begin at `known` gaits.

    A start depends only on the problem, the sampler, the seed and its number. Workers and executor
    are as for `colloc.system.task_pool.run_tasks`; a start that kills its worker twice has crashed.
    """
    if not problem.gait.free:
        raise ProblemError(
            "a prescribed motion is the same from every start; colloc solve measures it."
        )
    native_kernel()  # its absence is reported once for all workers
    tasks = (Task(k, (problem, sampler, seed, k, time_limit, (known or {}).get(k))) for k in starts)
    ready = partial(next, tasks, None)
    for task, outcome in run_tasks(run_start, ready, workers=workers, executor=executor):
        if isinstance(outcome, Lost):
            guess = problem.guess
            outcome = Outcome(task.arguments[3], CRASHED, outcome.message, guess, guess)
        yield outcome


def run_archive(
    archive: Archive, starts: Iterable[int], *, sampler: str, seed: int, **settings
) -> Iterator[Outcome]:
    """Outcomes of `run_starts` for an archive, each added to it before it is yielded."""
    for outcome in run_starts(archive.problem, starts, sampler=sampler, seed=seed, **settings):
        archive.add({StartName(sampler, seed, outcome.start): outcome})
        yield outcome
