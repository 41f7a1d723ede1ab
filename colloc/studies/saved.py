"""A solve whose result is a file: where it goes, what is kept beside it while it is under way, and what an interrupt leaves."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np

from colloc.gaits.problem_file import ProblemFile
from colloc.results.solution import INTERRUPTED, SOLVED, Solution
from colloc.results.store import save
from colloc.search.run import Progress
from colloc.search.solve import REDUCED, solve

ENDINGS = {SOLVED: ".h5", INTERRUPTED: ".interrupted.h5"}
FAILED = ".failed.h5"
"""What a result is saved as: a solve that did not end well never replaces one that did."""


def run_path(path: Path) -> Path:
    """Where the run is kept whose result goes to `path`."""
    return path.with_suffix(".run.sqlite")


def shrunk_path(path: Path) -> Path:
    """Where the better gait is saved that is too small to build."""
    return path.with_suffix(".shrunk.h5")


def solved_and_saved(
    stated: ProblemFile,
    path: Path,
    *,
    starts: int | None = None,
    seconds: float = np.inf,
    search: str = REDUCED,
    fresh: bool = False,
    progress: Callable[[Progress], object] = lambda news: None,
) -> tuple[Solution, list[Path]]:
    """Solve a problem, going on from a run that was interrupted, and save what comes out.

    Parameters
    ----------
    stated : ProblemFile
    path : path
        Of the result, ``NAME.h5``. A solve that was interrupted is saved as ``NAME.interrupted.h5``, one that failed as
        ``NAME.failed.h5``; the run of the first one is kept, for the next call.
    starts, seconds, search, progress
        As for `colloc.search.solve.solve`.
    fresh : bool
        Do not go on from an interrupted run.

    Returns
    -------
    Solution
    list of path
        The files written, the result first.

    Raises
    ------
    StoreError
        If a file cannot be written, or what an earlier run left cannot be read.
    """
    run = run_path(path)
    if fresh:
        run.unlink(missing_ok=True)
    solution = solve(stated.problem, starts, seconds=seconds, search=search, keep=run, progress=progress)
    solution.source = stated.source
    written = [save(solution, path.with_suffix(ENDINGS.get(solution.status, FAILED)))]
    if solution.shrunk is not None:
        solution.shrunk.source = solution.source
        written.append(save(solution.shrunk, shrunk_path(path)))
    if solution.status != INTERRUPTED:
        run.unlink(missing_ok=True)
        path.with_suffix(ENDINGS[INTERRUPTED]).unlink(missing_ok=True)
    return solution, written
