"""Solves that resume from a checkpoint, which their successful end removes."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from pathlib import Path
from typing import Any

from colloc.gaits.problem import Problem
from colloc.gaits.problem_file import ProblemFile
from colloc.results.kept import Saved, save_result
from colloc.results.solution import Solution
from colloc.search.solve import solve
from colloc.system.files import run_file

_FOLDER: ContextVar[Path | None] = ContextVar("folder", default=None)


def resume(
    stated: ProblemFile, path: Path | None, *, fresh: bool = False, **settings: Any
) -> Solution:
    """Solve with a checkpoint beside the result's path, or from the beginning if `fresh`."""
    keep = None if path is None else run_file(path)
    if fresh and keep is not None:
        keep.unlink(missing_ok=True)
    solution = solve(stated.problem, keep=keep, **settings)
    for one in (solution, solution.shrunk):
        if one is not None:
            one.source = stated.source
    return solution


def save_and_clear(solution: Solution, path: Path) -> list[Saved]:
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
        kept = f"what was found is kept in {folder}; the same command goes on from there."
        raise KeyboardInterrupt(str(stop) or kept) from None
    finally:
        _FOLDER.reset(token)
    for file in folder.glob(run_file(Path("member-*.h5")).name):
        file.unlink(missing_ok=True)


def solve_member(problem: Problem, starts: int) -> Solution:
    """Solve one problem of a family. KeyboardInterrupt if that is interrupted."""
    folder = _FOLDER.get()
    keep = None if folder is None else run_file(folder / f"member-{problem.hash[:16]}.h5")
    solution = solve(problem, starts, keep=keep)
    if solution.interrupted:
        raise KeyboardInterrupt
    return solution
