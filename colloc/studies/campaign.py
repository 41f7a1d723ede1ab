"""Many starts of one problem over any `concurrent.futures` executor; one bad start never ends the
run."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from concurrent.futures import Executor
from dataclasses import replace

from colloc.gaits.gait_fields import AnyGait
from colloc.gaits.problem import Problem
from colloc.gaits.starts import LATIN_HYPERCUBE, start_gait
from colloc.mechanics.native_kernel import native_kernel
from colloc.results.outcome import CRASHED, ERROR, PASSED_OVER, TIME_LIMIT, TRIVIAL, Outcome
from colloc.results.solution import Solution
from colloc.search.certify import is_trivial
from colloc.search.optimum import Optimum
from colloc.search.run import Progress
from colloc.search.solve import FULL, REDUCED, solve
from colloc.system.errors import ProblemError
from colloc.system.task_pool import Lost, Task, completed, process_pool


def run_start(
    problem: Problem,
    sampler: str,
    seed: int,
    start: int,
    time_limit: float,
    known: AnyGait | None = None,
) -> Outcome:
    """Solve and certify one start. Whatever goes wrong becomes the outcome's status and message;
    nothing is raised.

    A start that takes longer than the time limit [s] is given up. A `known` gait takes the place of
    the sample.
    """
    return run_guess(
        problem, lambda: known or start_gait(problem, sampler, seed, start), start, time_limit
    )


def run_guess(
    problem: Problem,
    start_from: Callable[[], AnyGait],
    start: int,
    time_limit: float,
    *,
    literal: bool = False,
    worth: Callable[[Optimum], bool] = lambda end: True,
) -> Outcome:
    """Solve and certify a problem from the gait that `start_from` makes, as start number `start`;
    raises nothing.

    With `literal`, IPOPT searches on the full program (`colloc.search.literal`). Where the search
    ends at the final delta in what is not `worth` it, that is passed over.
    """
    begin, cpu, passed = time.perf_counter(), time.process_time(), list[Optimum]()

    def counts(end: Optimum) -> bool:
        if not worth(end):
            passed.append(end)
        return not passed

    guess, seen = problem.guess, list[Progress]()
    outcome = Outcome(start, ERROR, "", guess, guess)
    try:
        guess = start_from()
        outcome = Outcome(start, ERROR, "", guess, guess)
        search = FULL if literal else REDUCED
        how = {"search": search, "progress": seen.append, "worth": counts}
        solution = solve(problem.with_(guess=guess), 1, seconds=time_limit, **how)  # type: ignore[arg-type]
        if solution.interrupted:
            if time.perf_counter() - begin < time_limit:
                raise KeyboardInterrupt
            where = (
                f"the last optimum was at delta = {solution.answer.delta:.1e}"
                if seen[-1].best
                else "no optimum yet"
            )
            outcome = replace(
                outcome, status=TIME_LIMIT, message=f"gave up after {time_limit:g} s; {where}."
            )
        else:
            outcome = _outcome(start, guess, solution)
            outcome = replace(outcome, status=PASSED_OVER, message="") if passed else outcome
    except Exception as error:
        outcome = replace(outcome, status=ERROR, message=f"{type(error).__name__}: {error}")
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
        names = ("value", "efficiency", "distance", "work", "value_error", "efficiency_error")
        return replace(
            outcome,
            delta=solution.answer.delta,
            **{name: getattr(certificate, name) for name in names},
        )
    if optimal:
        last = optimal[-1]
        found = {name: getattr(last, name) for name in ("delta", "value", "distance", "work")}
        return replace(outcome, efficiency=last.distance / last.work, **found)
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
        Start numbers, each taken when a worker is free for it. A start depends only on the problem,
        the sampler, the seed and its number.
    sampler : {"latin-hypercube", "perturbed"}
    seed : int
    workers : int
        Starts under way at a time.
    time_limit : float
        Seconds a start may take.
    executor : callable
        Makes an executor for a number of workers: processes by default; threads, or the one a Dask
        client gives (``lambda n: client.get_executor()``), will do. When a worker dies (killed, out
        of memory) a new one is made, the starts under way are tried again one by one, and one that
        kills its worker again is recorded as crashed.
    known : mapping of int to a gait, optional
        Gaits from which starts of these numbers begin instead of a sample: results of an earlier
        run to go on from.

    Raises
    ------
    ProblemError
        If nothing is free: a prescribed motion is the same from every start.
    """
    if not problem.gait.free:
        raise ProblemError(
            "a prescribed motion is the same from every start; colloc solve measures it."
        )
    native_kernel()  # missed once for all workers, or there
    waiting = iter(starts)

    def ready() -> Task | None:
        start = next(waiting, None)
        return (
            None
            if start is None
            else Task(start, (problem, sampler, seed, start, time_limit, (known or {}).get(start)))
        )

    for task, outcome in completed(run_start, ready, workers=workers, executor=executor):
        if isinstance(outcome, Lost):
            outcome = Outcome(
                task.arguments[3], CRASHED, outcome.message, problem.guess, problem.guess
            )
        yield outcome
