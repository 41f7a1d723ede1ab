"""What the subcommands share: one way to refuse bad options, to name the problem and the output, and to end.

Exit codes: 0 well; 2 bad problem, option or file; 3 not converged or none found; 4 a certificate failed; 130 interrupted.
"""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Callable
from pathlib import Path
from typing import NoReturn

from colloc.gaits.problem import FORMULATIONS, Problem
from colloc.system.errors import CollocError, ProblemError

OK, BAD_PROBLEM, NONE_FOUND, FAILED, INTERRUPTED = 0, 2, 3, 4, 130


class Parser(argparse.ArgumentParser):
    """Refuses bad options in one sentence, with the exit code of a bad problem."""

    def error(self, message: str) -> NoReturn:
        self.exit(BAD_PROBLEM, f"colloc: {message}; see {self.prog} --help.\n")


def new_parser(command: str, description: str, epilog: str) -> Parser:
    """The parser of ``colloc COMMAND``; line breaks of the epilog are kept."""
    style = argparse.RawDescriptionHelpFormatter
    return Parser(prog=f"colloc {command}", description=description, epilog=epilog, formatter_class=style)


def add_problem(parser: argparse.ArgumentParser) -> None:
    """The problem file, and the changes to it that every solving command takes (see `changed`)."""
    parser.add_argument("problem", help="a Python file that states PROBLEM, for example problems/three_link.py")
    parser.add_argument("--delta", type=float, metavar="SPEED", help="final regularisation speed of friction")
    parser.add_argument("--delta-start", type=float, metavar="SPEED", help="where the continuation in delta begins")
    parser.add_argument("--mesh", dest="intervals", type=int, metavar="N", help="intervals of the first mesh")
    parser.add_argument("--mesh-tolerance", type=float, metavar="TOL", help="relative efficiency error to refine to; 0: never")
    parser.add_argument("--scheme", metavar="NAME", help="trapezoid, hermite-simpson, gauss-N or radau-N")
    parser.add_argument("--formulation", choices=FORMULATIONS, help="how the balance becomes constraints")


_CHANGES = ("delta", "delta_start", "intervals", "mesh_tolerance", "scheme", "formulation")


def changed(problem: Problem, options: argparse.Namespace) -> Problem:
    """The problem with the changes of `add_problem`, and with the gait of the result that ``--start`` names as guess."""
    changes = {name: getattr(options, name) for name in _CHANGES if getattr(options, name) is not None}
    if getattr(options, "start", None) is not None:
        from colloc.results.store import load

        changes["guess"] = load(options.start).gait
    return problem.with_(**changes) if changes else problem


def add_result(parser: argparse.ArgumentParser) -> None:
    """The results file that a command reads."""
    parser.add_argument("result", metavar="FILE.h5", help="a result that colloc solve wrote")


def add_printing(parser: argparse.ArgumentParser) -> None:
    """``--json`` and ``--quiet``."""
    parser.add_argument("--json", action="store_true", help="print one JSON object on standard output, and nothing else")
    parser.add_argument("--quiet", action="store_true", help="no progress, only the final summary")


def add_bound(parser: argparse.ArgumentParser) -> None:
    """``--bound``."""
    parser.add_argument(
        "--bound", action="store_true", help="compute an upper bound on every gait (a minute; kept in bounds.json)"
    )


def output_path(output: str | None, default: Path) -> Path:
    """The file to write, in a folder that exists and can be written.

    Parameters
    ----------
    output : str or None
        What the user named: a folder, or a file with the suffix of `default`; None: `default`.
    default : Path

    Raises
    ------
    ProblemError
        If nothing can be written there.
    """
    path = default if output is None else Path(output)
    path = path if path.suffix == default.suffix else path / default.name
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise ProblemError(f"cannot make the folder {path.parent}: {error.strerror or error}.") from None
    if not os.access(path.parent, os.W_OK) or path.is_dir():
        raise ProblemError(f"cannot write {path}; choose another --output.")
    return path


def exit_code(command: Callable[[], int]) -> int:
    """Run a command; errors made for people become one sentence on standard error and an exit code.

    A KeyboardInterrupt may carry a sentence about what was kept.
    """
    try:
        return command()
    except CollocError as error:
        print(f"colloc: {error}", file=sys.stderr)
        return BAD_PROBLEM
    except BrokenPipeError:
        sys.stdout = open(os.devnull, "w")  # noqa: SIM115  the reader of a pipe left; results are saved
        return BAD_PROBLEM
    except KeyboardInterrupt as stop:
        print(f"colloc: interrupted; {str(stop) or 'nothing was written.'}", file=sys.stderr)
        return INTERRUPTED
