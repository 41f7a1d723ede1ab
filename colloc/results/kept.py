"""Results saved without loss: a former one of another problem, or a better one, is kept beside the
new one."""

from __future__ import annotations

import itertools
import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path

from colloc.results import store
from colloc.results.solution import Solution
from colloc.system.errors import StoreError
from colloc.system.files import FAILED, INTERRUPTED, SHRUNK, alone_in, beside
from colloc.system.interruption import interruptible

_HOW = {"guess", "intervals", "scheme", "formulation", "mesh_tolerance", "delta_start"}
"""Fields of a problem that do not change the question."""


@dataclass(frozen=True)
class Saved:
    """A saved result, and where and why the former one was kept."""

    path: Path
    former: Path | None = None
    why: str = ""


def save_result(solution: Solution, path: Path) -> list[Saved]:
    """Save a solution at `path` (NAME.h5), or beside it if it failed (NAME.failed.h5) or was
    interrupted (NAME.interrupted.h5); then the better gait that shrank, if there is one, as
    NAME.shrunk.h5.

    A result that is there already is replaced only by an answer to the same question that is as
    good, and only if nobody added anything to it. Else it is kept, with its figures, under the
    first free name of NAME.former-1.h5, NAME.former-2.h5, ... Ctrl-C waits until all is saved.
    `StoreError` if the folder cannot be written; what was there is left as it was.
    """
    place = path
    if not solution.success:
        place = beside(path, INTERRUPTED if solution.interrupted else FAILED)
    with interruptible(), alone_in(path.parent):
        saved = [_save(solution, place)]
        if solution.shrunk is not None:
            saved.append(_save(solution.shrunk, beside(path, SHRUNK)))
        if solution.success:  # it is the end of what was interrupted
            beside(path, INTERRUPTED).unlink(missing_ok=True)
    return saved


def _save(solution: Solution, path: Path) -> Saved:
    there = _solution_at(path)
    why = _worth(there, solution, path)
    if not why:
        return Saved(store.save(solution, path))
    places = (beside(path, f"former-{k}") for k in itertools.count(1))
    # a free one, or one whose result the one that is there could replace
    place = next(
        place
        for place in places
        if not place.exists()
        or (there is not None and not _worth(_solution_at(place), there, place))
    )
    with _set_aside(path, place):
        store.save(solution, path)
    return Saved(path, place, why)


def _solution_at(path: Path) -> Solution | None:
    try:
        return store.load(path)
    except StoreError:
        return None


def _question(solution: Solution) -> dict:
    return {name: value for name, value in solution.problem.to_dict().items() if name not in _HOW}


def _worth(there: Solution | None, new: Solution, path: Path) -> str:
    """Description of a result that must not be replaced; "" if there is none."""
    if there is None:
        return "what was there and cannot be read" if path.exists() else ""
    if _question(there) != _question(new):
        return f"the former result, of another problem called {there.problem.name},"
    old, now = there.certificate, new.certificate
    # as far as both values are known
    as_good = now.value + now.value_error >= old.value - old.value_error
    if there.success and not (new.success and as_good):
        return (
            f"the former result, which is better ({old.value:.6g}, best of {there.starts} starts),"
        )
    if store.holds_more(path, there):
        return "the former result, which holds more than colloc wrote,"
    return ""


@contextmanager
def _set_aside(path: Path, place: Path) -> Iterator[None]:
    """Move a result aside with its figures; back again if the block fails."""
    pairs = [(path.with_suffix(kind), place.with_suffix(kind)) for kind in (".png", ".pdf")]
    pairs.append((beside(path, SHRUNK), beside(place, SHRUNK)))
    try:
        place.unlink(missing_ok=True)
        try:
            os.link(path, place)
        except OSError:  # a file system without a second name for a file
            os.replace(path, place)
        for old, new in pairs:
            if old.exists():
                os.replace(old, new)
        yield
    except BaseException as error:
        for old, new in [(path, place), *pairs]:
            with suppress(FileNotFoundError):
                if not old.exists():
                    os.replace(new, old)
                elif old.samefile(new):
                    new.unlink()
        if isinstance(error, OSError) and not isinstance(error, StoreError):
            raise StoreError(f"cannot keep {path} as {place}: {error.strerror or error}.") from None
        raise
