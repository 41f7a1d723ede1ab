"""Solutions of either kind as files: what ``colloc.save`` and ``colloc.load`` do."""

from __future__ import annotations

import os
from pathlib import Path

from colloc.results import relaxed_store, store
from colloc.results.relaxed_solution import RelaxedSolution
from colloc.results.solution import Solution


def save(solution: Solution | RelaxedSolution, path: str | os.PathLike[str]) -> Path:
    """Write a solution; an existing file is replaced only once the new one is complete.

    Raises
    ------
    StoreError
        If the folder cannot be made or written.

    Examples
    --------
    >>> import colloc, os, tempfile
    >>> problem = colloc.Problem("quick", gait=colloc.Harmonic(1, "bilateral"), delta=1e-2)
    >>> solution = colloc.solve(problem, starts=1)
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = colloc.save(solution, os.path.join(folder, "quick.h5"))
    ...     again = colloc.load(path)
    >>> again.certificate == solution.certificate
    True
    """
    return relaxed_store.save_relaxed(solution, path) if isinstance(solution, RelaxedSolution) else store.save(solution, path)


def load(path: str | os.PathLike[str]) -> Solution | RelaxedSolution:
    """The solution in a file that `save` wrote; see `colloc.results.store.load`.

    Raises
    ------
    StoreError
        If the file is missing, damaged, or not a colloc solution. Nothing in the file is executed.

    Examples
    --------
    >>> import colloc
    >>> colloc.load("nothing.h5")
    Traceback (most recent call last):
    colloc.system.errors.StoreError: there is no file nothing.h5.
    """
    return relaxed_store.load_relaxed(path) if relaxed_store.is_relaxed(path) else store.load(path)
