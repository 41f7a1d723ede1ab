"""The commands solve, multistart and sweep as functions, for scripts and notebooks."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from colloc.gaits.problem import Problem
from colloc.gaits.problem_file import ProblemFile, read_problem_file
from colloc.gaits.starts import LARGEST_SEED, LATIN_HYPERCUBE, SAMPLERS
from colloc.results.archive import Archive, open_archive, save_archive
from colloc.results.distinct_optima import Basin, basins
from colloc.results.outcome import Outcome, counts
from colloc.results.solution import SOLVED, Solution
from colloc.search.checkpoint import Progress
from colloc.search.solve import REDUCED
from colloc.search.solve import solve as search_solve
from colloc.studies.multistart import run_archive
from colloc.studies.run import Progress as StudyProgress
from colloc.studies.run import StudyRun
from colloc.studies.saved import resume, save_and_clear
from colloc.studies.study import Study, read_study_file
from colloc.studies.table import StudyTable, study_table
from colloc.system.arguments import check_count, is_whole, shown
from colloc.system.errors import NotConvergedError, ProblemError
from colloc.system.task_pool import pool_for

Stated = Problem | str | os.PathLike[str]


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
    stated = _read(problem)
    if starts is not None:
        check_count(starts=starts)
    if not seconds > 0:
        raise ProblemError(f"seconds must be positive, not {seconds:g}.")
    if output is not None and not Path(output).name:
        raise ProblemError(f"output must name a file, not {shown(str(output))}.")
    path, report = None if output is None else Path(output), _reporter(verbose, progress)
    settings: dict[str, Any] = {"seconds": seconds, "search": search, "progress": report}
    solution = resume(stated, path, starts=starts or stated.starts, **settings)
    if path is not None:
        save_and_clear(solution, path)
    return solution


def _read(problem: Stated) -> ProblemFile:
    if isinstance(problem, Problem):
        return ProblemFile(problem, None, "")
    return read_problem_file(problem)


def _reporter(verbose: bool, progress: Callable[..., object] | None) -> Callable[..., None]:
    def report(news: object) -> None:
        if verbose:
            print(news, flush=True)
        if progress is not None:
            progress(news)

    return report


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
                f"none of {len(self.outcomes)} starts of {self.problem.name} was certified."
            )
        return reopen(self.problem, self.optima[0].best)

    def __repr__(self) -> str:
        tally = ", ".join(f"{n} {status}" for status, n in counts(self.outcomes).items())
        best = ""
        if self.optima:
            best = f"; best {self.problem.objective.short} = {self.optima[0].best.value:.6g}"
        return f"<Starts of {self.problem.name}: {tally}; {len(self.optima)} distinct optima{best}>"


def reopen(problem: Problem, outcome: Outcome) -> Solution:
    """Solve a start at the final delta from its gait, or again from its guess if it failed."""
    if outcome.status != SOLVED:
        return search_solve(problem.with_(guess=outcome.guess), 1)
    return search_solve(problem.with_(guess=outcome.gait, delta_start=problem.delta), 1)


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
        Called with every `colloc.results.outcome.Outcome`.

    Examples
    --------
    >>> import colloc
    >>> problem = colloc.Problem("quick", gait=colloc.Harmonic(1, "bilateral"), delta=1e-2)
    >>> found = colloc.multistart(problem, starts=3)
    >>> found.optima[0].best.efficiency > 0.2
    True
    """
    check_count(starts=starts, workers=workers)
    if not is_whole(seed, 0, LARGEST_SEED):
        raise ProblemError(
            f"seed must be a whole number from 0 to {LARGEST_SEED}, not {shown(seed)}."
        )
    if sampler not in SAMPLERS:
        raise ProblemError(f"sampler must be one of {', '.join(SAMPLERS)}, not {shown(sampler)}.")
    if not time_limit > 0:
        raise ProblemError(f"time_limit must be positive, not {time_limit:g}.")
    problem = _read(problem).problem
    store = Archive(problem) if archive is None else open_archive(problem, archive)
    done, report = store.done(sampler, seed, starts), _reporter(verbose, progress)
    how: dict[str, Any] = {"workers": workers, "time_limit": time_limit, "executor": pool_for}
    todo = (k for k in range(starts) if k not in done)
    try:
        for outcome in run_archive(store, todo, sampler=sampler, seed=seed, **how):
            report(outcome)
    finally:
        if archive is not None:
            save_archive(store, "colloc.multistart")
    return Starts(problem, tuple(store.of_search(sampler, seed, starts).values()))


def sweep(
    study: Study | str | os.PathLike[str],
    folder: str | os.PathLike[str] | None = None,
    *,
    workers: int = 1,
    verbose: bool = False,
    progress: Callable[[StudyProgress], object] | None = None,
) -> StudyTable:
    """Solve every problem of a study, as ``colloc sweep`` does.

    Parameters
    ----------
    study : Study or path-like
        A study, or a study file.
    folder : path-like, optional
        Folder of the journal, in which results are kept and not solved again.
    workers : int
        Processes, as for `multistart`.
    verbose : bool
        Print every cell that is solved.
    progress : callable, optional
        Called with every `colloc.studies.run.Progress`.

    Returns
    -------
    StudyTable
        Labelled arrays; ``.to_xarray()`` makes a Dataset.

    Examples
    --------
    >>> import colloc
    >>> def problem(mu_t):
    ...     return colloc.Problem(
    ...         "grid",
    ...         friction=colloc.Friction(mu_t=mu_t),
    ...         gait=colloc.Harmonic(1, "bilateral"),
    ...         delta=1e-2,
    ...     )
    >>> study = colloc.Study("grid", (colloc.Axis("mu_t", (1, 2)),), problem, cold_starts=0)
    >>> colloc.sweep(study).variables["status"].tolist()
    ['solved', 'solved']
    """
    check_count(workers=workers)
    study = study if isinstance(study, Study) else read_study_file(study)[0]
    with tempfile.TemporaryDirectory() as scratch:
        run = StudyRun(study, Path(folder or scratch))
        for news in run.run(workers=workers, executor=pool_for):
            if verbose:
                best = news.state.best
                value = best.outcome.value if best else np.nan
                print(f"{study.label(news.cell)}: {value:.6f}", flush=True)
            if progress is not None:
                progress(news)
        return study_table(run)
