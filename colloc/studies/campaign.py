"""Many starts of one problem over any `concurrent.futures` executor; one bad start never ends the run."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from concurrent.futures import Executor
from dataclasses import replace

from colloc.gaits.gait_fields import AnyGait
from colloc.gaits.problem import Problem
from colloc.gaits.starts import LATIN_HYPERCUBE, start_gait
from colloc.mechanics.native_kernel import native_kernel
from colloc.results.checks import Certificate
from colloc.results.outcome import CRASHED, ERROR, TIME_LIMIT, TRIVIAL, Outcome
from colloc.results.solution import Solution
from colloc.results.steps import Level
from colloc.search.optimise import is_trivial, maximise_efficiency
from colloc.system.errors import ProblemError
from colloc.system.task_pool import Lost, Task, completed, process_pool


class _TimeLimit(Exception):
    pass


def run_start(
    problem: Problem, sampler: str, seed: int, start: int, time_limit: float, known: AnyGait | None = None
) -> Outcome:
    """Solve and certify one start. Whatever goes wrong becomes the outcome's status and message; nothing is raised.

    The time limit [s] is checked between the levels of the continuation. A `known` gait takes the place of the sample.
    """
    return run_guess(problem, lambda: known or start_gait(problem, sampler, seed, start), start, time_limit)


def run_guess(
    problem: Problem, start_from: Callable[[], AnyGait], start: int, time_limit: float, *, literal: bool = False
) -> Outcome:
    """Solve and certify a problem from the gait that `start_from` makes, as start number `start`; raises nothing.

    With `literal`, IPOPT searches on the full program (`colloc.search.literal_search`).
    """
    begin, cpu = time.perf_counter(), time.process_time()
    guess = problem.guess
    reached: list[Level] = []
    outcome = Outcome(start, ERROR, "", guess, guess)

    def watch(level: Level) -> None:
        reached.append(level)
        if time.perf_counter() - begin > time_limit:
            raise _TimeLimit

    try:
        guess = start_from()
        outcome = Outcome(start, ERROR, "", guess, guess)
        solution = maximise_efficiency(problem.with_(guess=guess), watch, literal=literal)
        outcome = _outcome(start, guess, solution)
    except _TimeLimit:
        deltas = [level.delta for level in reached if level.optimal]
        where = f"the last optimum was at delta = {min(deltas):.1e}" if deltas else "no optimum at any delta yet"
        status, message = TIME_LIMIT, f"gave up after {time_limit:g} s; {where}."
    except Exception as error:
        status, message = ERROR, f"{type(error).__name__}: {error}"
    else:
        status, message = outcome.status, outcome.message
    iterations = sum(level.iterations for level in reached)
    wall, cpu = time.perf_counter() - begin, time.process_time() - cpu
    return replace(outcome, status=status, message=message, iterations=iterations, seconds=wall, cpu_seconds=cpu)


def _outcome(start: int, guess: AnyGait, solution: Solution) -> Outcome:
    optimal = [level for level in solution.levels if level.optimal]
    certificate = solution.certificate
    measured: Certificate | Level | None = certificate if certificate.replayed else optimal[-1] if optimal else None
    status = TRIVIAL if is_trivial(solution) else solution.status
    outcome = Outcome(start, status, solution.message, guess, solution.gait)
    if measured is not None:
        found = {name: getattr(measured, name) for name in ("value", "efficiency", "distance", "work")}
        level = solution.last if certificate.replayed else optimal[-1]
        outcome = replace(outcome, delta=level.delta, **found)
    if certificate.replayed:
        errors = {name: getattr(certificate, name) for name in ("value_error", "efficiency_error")}
        outcome = replace(outcome, **errors)
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
    """Outcomes of the given starts, each as soon as it is there.

    Parameters
    ----------
    problem : Problem
    starts : iterable of int
        Start numbers, each taken when a worker is free for it. A start depends only on the problem, the sampler, the seed and
        its number.
    sampler : {"latin-hypercube", "perturbed"}
    seed : int
    workers : int
        Starts under way at a time.
    time_limit : float
        Seconds a start may take, checked between levels.
    executor : callable
        Makes an executor for a number of workers: processes by default; threads, or the one a Dask client gives
        (``lambda n: client.get_executor()``), will do. When a worker dies (killed, out of memory) a new one is made, the
        starts under way are tried again one by one, and one that kills its worker again is recorded as crashed.
    known : mapping of int to a gait, optional
        Gaits from which starts of these numbers begin instead of a sample: results of an earlier run to go on from.

    Raises
    ------
    ProblemError
        If nothing is free: a prescribed motion is the same from every start.
    """
    if not problem.gait.free:
        raise ProblemError("a prescribed motion is the same from every start; colloc solve measures it.")
    native_kernel()  # compiled before the workers begin, or missed once for all of them
    waiting = iter(starts)

    def ready() -> Task | None:
        start = next(waiting, None)
        return None if start is None else Task(start, (problem, sampler, seed, start, time_limit, (known or {}).get(start)))

    for task, outcome in completed(run_start, ready, workers=workers, executor=executor):
        if isinstance(outcome, Lost):
            outcome = Outcome(task.arguments[3], CRASHED, outcome.message, problem.guess, problem.guess)
        yield outcome
