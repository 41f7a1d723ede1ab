"""Many starts of one problem over any `concurrent.futures` executor; one bad start never ends the run."""

from __future__ import annotations

import contextlib
import multiprocessing
import os
import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, Executor, Future, ProcessPoolExecutor, wait
from dataclasses import replace

from colloc.basins import CRASHED, ERROR, TIME_LIMIT, TRIVIAL, Outcome
from colloc.gait import Fourier
from colloc.optimise import is_trivial, maximise_efficiency
from colloc.problem import Problem
from colloc.sampling import LATIN_HYPERCUBE, start_gait
from colloc.solution import Certificate, Level, Solution

_THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "VECLIB_MAXIMUM_THREADS")


class _TimeLimit(Exception):
    pass


def run_start(
    problem: Problem, sampler: str, seed: int, start: int, time_limit: float, known: Fourier | None = None
) -> Outcome:
    """Solve and certify one start. Whatever goes wrong becomes the outcome's status and message; nothing is raised.

    The time limit [s] is checked between the levels of the continuation. A `known` gait takes the place of the sample.
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
        guess = known or start_gait(problem, sampler, seed, start)
        outcome = Outcome(start, ERROR, "", guess, guess)
        solution = maximise_efficiency(problem.with_(guess=guess), watch)
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


def _outcome(start: int, guess: Fourier, solution: Solution) -> Outcome:
    optimal = [level for level in solution.levels if level.optimal]
    measured: Certificate | Level | None = solution.certificate or (optimal[-1] if optimal else None)
    status = TRIVIAL if is_trivial(solution) else solution.status
    outcome = Outcome(start, status, solution.message, guess.resized(solution.gait.n_harmonic), solution.gait)
    if measured is not None:
        efficiency, distance, work = measured.efficiency, measured.distance, measured.work
        outcome = replace(outcome, delta=optimal[-1].delta, efficiency=efficiency, distance=distance, work=work)
    if solution.certificate is not None:
        outcome = replace(outcome, efficiency_error=solution.certificate.efficiency_error)
    return outcome


@contextlib.contextmanager
def one_thread_each() -> Iterator[None]:
    """Processes started inside use one BLAS thread each; the environment is put back afterwards."""
    before = {name: os.environ.get(name) for name in _THREADS}
    os.environ.update(dict.fromkeys(_THREADS, "1"))
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value


def process_pool(workers: int) -> Executor:
    """Fresh processes: they inherit no state, and their number of BLAS threads is settled before NumPy is loaded."""
    return ProcessPoolExecutor(workers, mp_context=multiprocessing.get_context("spawn"))


def run_starts(
    problem: Problem,
    starts: Iterable[int],
    *,
    sampler: str = LATIN_HYPERCUBE,
    seed: int = 0,
    workers: int = 1,
    time_limit: float = 300.0,
    executor: Callable[[int], Executor] = process_pool,
    known: Mapping[int, Fourier] | None = None,
) -> Iterator[Outcome]:
    """Outcomes of the given starts, each as soon as it is there.

    Parameters
    ----------
    problem : Problem
    starts : iterable of int
        Start numbers; a start depends only on the problem, the sampler, the seed and its number.
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
    known : mapping of int to Fourier, optional
        Gaits from which starts of these numbers begin instead of a sample: results of an earlier run to go on from.
    """
    waiting = list(starts)[::-1]
    suspects: list[int] = []
    with one_thread_each():
        while waiting or suspects:
            alone = bool(suspects)
            queue = suspects if alone else waiting
            pool = executor(1 if alone else workers)
            pending: dict[Future[Outcome], int] = {}
            submitted = False
            try:
                while queue or pending:
                    while queue and len(pending) < (1 if alone else workers):
                        start = queue[-1]
                        pending[pool.submit(run_start, problem, sampler, seed, start, time_limit, (known or {}).get(start))] = (
                            start
                        )
                        queue.pop()
                        submitted = True
                    for future in wait(pending, return_when=FIRST_COMPLETED).done:
                        try:
                            outcome = future.result()
                        except BrokenExecutor:
                            raise
                        except Exception as error:
                            # `run_start` raises nothing: what carried it failed (Dask gives up on a start that kills workers)
                            text = f"the executor lost it: {type(error).__name__}: {error}"
                            outcome = Outcome(pending[future], CRASHED, text, problem.guess, problem.guess)
                        del pending[future]
                        yield outcome
            except BrokenExecutor:
                if not submitted:
                    raise
                if alone:
                    text = "its worker process died twice (killed, or out of memory)."
                    for start in pending.values():
                        yield Outcome(start, CRASHED, text, problem.guess, problem.guess)
                else:
                    suspects = list(pending.values())
            finally:
                for future in pending:
                    future.cancel()
                # not every executor knows cancel_futures (Dask's does not)
                pool.shutdown(wait=True)
