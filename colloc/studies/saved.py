"""A solve whose result is a file: it goes on from a run that was interrupted, and its end removes what was kept for that."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np

from colloc.gaits.problem_file import ProblemFile
from colloc.results.kept import Saved, save_result
from colloc.results.solution import Solution
from colloc.search.run import Progress
from colloc.search.solve import REDUCED, solve
from colloc.system.result_names import run_file


def resumed(
    stated: ProblemFile,
    path: Path,
    *,
    starts: int | None = None,
    seconds: float = np.inf,
    search: str = REDUCED,
    fresh: bool = False,
    progress: Callable[[Progress], object] = lambda news: None,
) -> Solution:
    """The solution of a problem, from where an interrupted run left it.

    Parameters
    ----------
    stated : ProblemFile
    path : path
        Of the result, ``NAME.h5``: beside it the run is kept.
    starts, seconds, search, progress
        As for `colloc.search.solve.solve`.
    fresh : bool
        Do not go on from an interrupted run.

    Raises
    ------
    StoreError
        If what an earlier run left cannot be read.
    """
    if fresh:
        run_file(path).unlink(missing_ok=True)
    keep = run_file(path)
    solution = solve(stated.problem, starts, seconds=seconds, search=search, keep=keep, progress=progress)
    solution.source = stated.source
    if solution.shrunk is not None:
        solution.shrunk.source = stated.source
    return solution


def save_end(solution: Solution, path: Path) -> list[Saved]:
    """Save a solution (`colloc.results.kept.save_result`); the run that led to it is kept only if it was interrupted.

    Raises
    ------
    StoreError
        If a file cannot be written.
    """
    saved = save_result(solution, path)
    if not solution.interrupted:
        run_file(path).unlink(missing_ok=True)
    return saved
