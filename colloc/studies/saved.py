"""A solve whose result is a file, or several that belong together: they go on from a run that was
interrupted, and their end removes what was kept for that."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from pathlib import Path

import numpy as np

from colloc.gaits.problem import Problem
from colloc.gaits.problem_file import ProblemFile
from colloc.results.kept import Saved, save_result
from colloc.results.solution import Solution
from colloc.search.run import Progress
from colloc.search.solve import REDUCED, solve
from colloc.system.result_names import run_file

_FOLDER: ContextVar[Path | None] = ContextVar("folder", default=None)


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
    solution = solve(
        stated.problem, starts, seconds=seconds, search=search, keep=keep, progress=progress
    )
    solution.source = stated.source
    if solution.shrunk is not None:
        solution.shrunk.source = stated.source
    return solution


def save_end(solution: Solution, path: Path) -> list[Saved]:
    """Save a solution (`colloc.results.kept.save_result`); the run that led to it is kept only if
    it was interrupted.

    Raises
    ------
    StoreError
        If a file cannot be written.
    """
    saved = save_result(solution, path)
    if not solution.interrupted:
        run_file(path).unlink(missing_ok=True)
    return saved


@contextmanager
def members_kept(folder: Path) -> Iterator[None]:
    """A block that solves several problems, of which each keeps what it finds in a folder
    (`member_file`) until the block ends well. After Ctrl-C, which says so, or a power cut, the same
    block goes on from there."""
    token = _FOLDER.set(folder)
    try:
        yield
    except KeyboardInterrupt as stop:
        kept = f"what was found is kept in {folder}; the same command goes on from there."
        raise KeyboardInterrupt(str(stop) or kept) from None
    finally:
        _FOLDER.reset(token)
    for file in folder.glob(run_file(Path("member-*.h5")).name):
        file.unlink(missing_ok=True)


def member_file(problem: Problem) -> Path | None:
    """Where a solve within `members_kept` keeps what it finds; None outside."""
    folder = _FOLDER.get()
    return None if folder is None else run_file(folder / f"member-{problem.hash[:16]}.h5")
