"""Problem files: Python that is executed and defines ``PROBLEM``, and perhaps ``REFERENCE``."""

from __future__ import annotations

import contextlib
import json
import os
import pprint
import sys
import traceback
import types
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from colloc.gaits.gait_fields import check_kind
from colloc.gaits.problem import Problem
from colloc.system.arguments import check_count, named_arguments
from colloc.system.errors import ProblemError

_HDF5 = b"\x89HDF\r\n\x1a\n"
LONGEST_TEXT = 2**20
"""Bytes of a problem file, which results keep a copy of."""


@named_arguments
@dataclass(frozen=True)
class Reference:
    """A value to hold the result against.

    Parameters
    ----------
    efficiency : float
    tolerance : float
        Largest difference that counts as agreement.
    source : str
        Where the value comes from.

    Examples
    --------
    >>> from colloc import Reference
    >>> Reference(efficiency=0.259, tolerance=0.0015, source="S. Alben (2019)").efficiency
    0.259
    """

    efficiency: float
    tolerance: float
    source: str

    def verdict(self, efficiency: float) -> str:
        agrees = abs(efficiency - self.efficiency) <= self.tolerance
        verb = "agrees with" if agrees else "DIFFERS from"
        return f"{verb} {self.efficiency:g} +- {self.tolerance:g} ({self.source})"


@dataclass(frozen=True)
class ProblemFile:
    problem: Problem
    reference: Reference | None
    source: str  # text of the file
    starts: int | None = None  # starts of the search; 1 for the optimum that the guess leads to


def read_problem_file(path: str | os.PathLike[str]) -> ProblemFile:
    """Execute a problem file. `ProblemError` if it cannot be read, fails (with the line), defines
    no ``PROBLEM``, or more than results can keep."""
    path, names, source = stated_names(path, "problem")
    problem, reference, starts = (names.get(each) for each in ("PROBLEM", "REFERENCE", "STARTS"))
    if problem is None:
        raise ProblemError(f"{path} states no PROBLEM; end it with PROBLEM = Problem(...).")
    check_kind(f"{path}: PROBLEM", problem, [Problem])
    if reference is not None:
        check_kind(f"{path}: REFERENCE", reference, [Reference])
    length = len(json.dumps(problem.to_dict()).encode())
    if length > LONGEST_TEXT:
        raise ProblemError(f"{path}: {_too_long('the description of PROBLEM', length)}")
    if starts is not None:
        check_count(**{f"{path}: STARTS": starts})
    return ProblemFile(problem, reference, source, starts)


def load_problem(path: str | os.PathLike[str]) -> Problem:
    """The problem that a file states; the file is executed.

    Raises
    ------
    ProblemError
        As for `read_problem_file`.

    Examples
    --------
    >>> import colloc
    >>> colloc.load_problem("problems/three_link.py")
    <Problem three_link: 2 joints, friction (1, 1, 1), 1 harmonic, symmetry bilateral, delta 1e-04>
    """
    return read_problem_file(path).problem


def problem_file_text(problem: Problem) -> str:
    text = pprint.pformat(problem.to_dict(), sort_dicts=False, width=100)
    return f"from colloc import Problem\n\nPROBLEM = Problem.from_dict(\n{text}\n)\n"


def _too_long(what: str, size: int) -> str:
    return (
        f"{what} has {size} bytes, and results keep at most {LONGEST_TEXT}: let the file read "
        "large data from another file, or state a guess of fewer numbers."
    )


def stated_names(path: str | os.PathLike[str], kind: str) -> tuple[Path, dict[str, Any], str]:
    """Execute a file; its path, the names it leaves and its text. Its output goes to standard
    error. `kind` ("problem", "study") is for messages."""
    path = Path(path)
    if not os.path.isfile(path):  # Path.is_file raises for a name that is too long
        raise ProblemError(f"there is no {kind} file {path}.")
    try:
        size = path.stat().st_size
        with open(path, "rb") as file:
            content = file.read(LONGEST_TEXT)
    except OSError as error:
        raise ProblemError(f"cannot read {path}: {error.strerror or error}.") from None
    if content.startswith(_HDF5):
        raise ProblemError(
            f"{path} is a results file (HDF5), not a {kind} file in Python; colloc report or "
            f"verify reads it, and colloc solve MINE.py --start {path} begins with its gait."
        )
    if path.suffix != ".py":
        model = path.suffix in (".urdf", ".xml")
        cure = f"colloc init MINE.py --from {path} makes one" if model else "one comes first"
        raise ProblemError(f"{path} is no {kind} file in Python (.py); {cure}.")
    if size > LONGEST_TEXT:
        raise ProblemError(_too_long(str(path), size))
    try:
        source = content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise ProblemError(
            f"{path} is no text in UTF-8 (byte {error.start}), so no {kind} file."
        ) from None
    module = types.ModuleType(f"colloc_{kind}")
    module.__file__ = str(path)
    names = vars(module)
    try:
        sys.modules[module.__name__] = module  # where dataclasses of the file look for their names
        with contextlib.redirect_stdout(sys.stderr):  # standard output is for results
            exec(compile(source, str(path), "exec", dont_inherit=True), names)
    except SyntaxError as error:
        where = "" if error.lineno is None else f", line {error.lineno}"
        raise ProblemError(f"{path}{where}: {error.msg}.") from None
    except KeyboardInterrupt:
        raise
    except BaseException as error:
        what = words_of(error)
        if isinstance(error, SystemExit):
            what = f"the file ends the program ({what}); it should only state {kind.upper()}."
        raise ProblemError(f"{place_of(error) or path}: {what}") from None
    return path, names, source


def place_of(error: BaseException) -> str:
    """File and line of a user's code that raised; "" if it was not reached."""
    theirs = traceback.extract_tb(error.__traceback__)[1:]
    lines = [frame.lineno for frame in theirs if frame.filename == theirs[0].filename]
    return f"{theirs[0].filename}, line {lines[-1]}" if lines else ""


def words_of(error: BaseException) -> str:
    """The message of an exception, with its kind unless it is a `ProblemError`."""
    if isinstance(error, ProblemError):
        return str(error)
    try:
        return f"{type(error).__name__}: {error}"
    except Exception:  # of somebody's own, which cannot say what it is
        return type(error).__name__
