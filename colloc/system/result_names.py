"""Names of files of results, and which names a problem cannot have for that.

The result of the problem NAME is NAME.h5. What else colloc makes of it is told apart by an ending
of its own before the suffix: NAME.failed.h5, NAME.shrunk.h5, NAME.starts.h5. So no problem's own
name may end like that.
"""

from __future__ import annotations

import re
from pathlib import Path

from colloc.system.errors import ProblemError

SUFFIX = ".h5"
FAILED, INTERRUPTED, SHRUNK, RUN = "failed", "interrupted", "shrunk", "run"
"""A solve that failed, or was interrupted; the better gait that shrank, beside the best one of
finite size; a run under way."""
_ENDING = re.compile(
    r"\.(failed|interrupted|shrunk|run|starts|front|(?:start|former)-\d+)$", re.IGNORECASE
)
_NAME, LONGEST_NAME = re.compile(r"[A-Za-z0-9_.-]+"), 200
"""File systems allow 255 bytes, and results of a problem add endings to its name."""


def reserved_ending(name: str) -> str:
    """The ending of a name, without its dot, that files which colloc makes beside results have; ""
    if it has none."""
    match = _ENDING.search(name)
    return match[1] if match else ""


def check_name(name: object) -> None:
    """A `ProblemError` for a name that files cannot be named after.

    Examples
    --------
    >>> check_name("mine.2")
    >>> check_name("mine.failed")
    Traceback (most recent call last):
    colloc.system.errors.ProblemError: name must not end in '.failed': colloc itself names files
    like that; not 'mine.failed'.
    """
    if not isinstance(name, str) or not _NAME.fullmatch(name):
        raise ProblemError(f"name must be letters, digits, '_', '-' or '.', not {name!r}.")
    if name[0] in ".-":
        raise ProblemError(
            f"name must begin with a letter, a digit or '_', not with '{name[0]}': {name!r}."
        )
    if ending := reserved_ending(name):
        raise ProblemError(
            f"name must not end in '.{ending}': colloc itself names files like that; not {name!r}."
        )
    if len(name) > LONGEST_NAME:
        raise ProblemError(
            f"name has {len(name)} characters; files are named after it, and {LONGEST_NAME} are "
            f"allowed."
        )


def beside(path: Path, ending: str) -> Path:
    """The file beside a result, of the same kind, with an ending: ``x.shrunk.h5`` beside
    ``x.h5``."""
    return path.with_name(f"{path.stem}.{ending}{path.suffix}")


def run_file(path: Path) -> Path:
    """The file that keeps the run, while it is under way, whose result goes to a path."""
    return beside(path, RUN).with_suffix(".sqlite")
