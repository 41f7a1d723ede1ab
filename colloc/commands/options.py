"""What the subcommands share: one way to refuse bad options, and to name the problem and the
output."""

from __future__ import annotations

import argparse
import json
import os
import re
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NoReturn

from colloc.commands.ending import show
from colloc.gaits.problem import Problem
from colloc.mechanics.bodies import FORMULATIONS
from colloc.system.errors import ProblemError
from colloc.system.result_names import SUFFIX, reserved_ending

_LONGEST_NAME = 220
"""Bytes of the name of an output: systems allow 255, and files under way have longer names than
finished ones."""


_IN_WORDS = (
    (r"^argument (\S+): invalid int value: (.*)", r"\1 must be a whole number, not \2"),
    (r"^argument (\S+): invalid float value: (.*)", r"\1 must be a number, not \2"),
    (
        r"^argument (\S+): invalid choice: (.*) \(choose from (.*)\)",
        r"\1 must be one of \3, not \2",
    ),
)
"""What argparse says, and how a person would."""


class Parser(argparse.ArgumentParser):
    """Refuses bad options in one sentence."""

    def error(self, message: str) -> NoReturn:
        for argparses, ours in _IN_WORDS:
            message = re.sub(argparses, ours, message)
        raise ProblemError(f"{message}; see {self.prog} --help.")


def new_parser(command: str, description: str, epilog: str) -> Parser:
    """The parser of ``colloc COMMAND``; line breaks of the epilog are kept."""
    style = argparse.RawDescriptionHelpFormatter
    return Parser(
        prog=f"colloc {command}", description=description, epilog=epilog, formatter_class=style
    )


def add_problem(parser: argparse.ArgumentParser) -> None:
    """The problem file, and the changes to it that every solving command takes (see `changed`)."""
    parser.add_argument(
        "problem", help="a Python file that states PROBLEM, for example problems/three_link.py"
    )
    parser.add_argument(
        "--delta", type=float, metavar="SPEED", help="final regularisation speed of friction"
    )
    parser.add_argument(
        "--delta-start", type=float, metavar="SPEED", help="where the continuation in delta begins"
    )
    parser.add_argument(
        "--mesh", dest="intervals", type=int, metavar="N", help="intervals of the first mesh"
    )
    parser.add_argument(
        "--mesh-tolerance", type=float, metavar="TOL", help="relative error to refine to; 0: never"
    )
    parser.add_argument(
        "--scheme", metavar="NAME", help="trapezoid, hermite-simpson, gauss-N or radau-N"
    )
    parser.add_argument(
        "--formulation", choices=FORMULATIONS, help="how the balance becomes constraints"
    )


_CHANGES = ("delta", "delta_start", "intervals", "mesh_tolerance", "scheme", "formulation")


def changed(problem: Problem, options: argparse.Namespace) -> Problem:
    """The problem with the changes of `add_problem`, and with the gait of the result that
    ``--start`` names as guess. `ProblemError` if a value cannot be used, or the gait cannot be the
    guess; the message names the file."""
    changes = {
        name: getattr(options, name) for name in _CHANGES if getattr(options, name) is not None
    }
    problem = problem.with_(**changes) if changes else problem
    if getattr(options, "start", None) is None:
        return problem
    from colloc.results.store import load

    gait = load(options.start).gait
    try:
        return problem.with_(guess=gait)
    except ProblemError as error:
        raise ProblemError(f"the gait of {options.start} cannot be the guess: {error}") from None


def add_result(parser: argparse.ArgumentParser) -> None:
    """The results file that a command reads."""
    parser.add_argument("result", metavar="FILE.h5", help="a result that colloc solve wrote")


def add_robot(parser: argparse.ArgumentParser, *, required: bool = False) -> None:
    """The size and mass of a robot, in SI units."""
    parser.add_argument(
        "--length", type=float, required=required, metavar="M", help="of the robot, stretched [m]"
    )
    parser.add_argument(
        "--mass", type=float, required=required, metavar="KG", help="of the robot [kg]"
    )
    parser.add_argument(
        "--gravity", type=float, default=9.81, metavar="G", help="default: 9.81 m/s^2"
    )


def robot_options(options: argparse.Namespace) -> dict[str, float]:
    """Its values by name; none where neither was given. `ProblemError` where one is missing."""
    if options.length is None and options.mass is None:
        return {}
    if options.length is None or options.mass is None:
        raise ProblemError(
            f"a robot needs --length and --mass; "
            f"--{'length' if options.length is None else 'mass'} is missing."
        )
    return {name: getattr(options, name) for name in ("length", "mass", "gravity")}


def add_pace(parser: argparse.ArgumentParser, *, required: bool = False) -> None:
    """The period of a robot, and what its motors can do."""
    parser.add_argument(
        "--period", type=float, required=required, metavar="S", help="seconds a period takes"
    )
    parser.add_argument(
        "--max-speed",
        type=float,
        nargs="+",
        metavar="V",
        help="of the joints [rad/s], one or one each",
    )
    parser.add_argument(
        "--max-torque",
        type=float,
        nargs="+",
        metavar="M",
        help="of the joints [N m], one or one each",
    )


def pace_options(options: argparse.Namespace) -> dict[str, Any]:
    """Its values by name."""
    return {name: getattr(options, name) for name in ("period", "max_speed", "max_torque")}


def add_printing(parser: argparse.ArgumentParser) -> None:
    """``--json`` and ``--quiet``."""
    parser.add_argument(
        "--json",
        action="store_true",
        help="print one JSON object on standard output, and nothing else",
    )
    parser.add_argument("--quiet", action="store_true", help="no progress, only the final summary")


def add_verbose(parser: argparse.ArgumentParser) -> None:
    """``--verbose``, for commands that end in the summary of a result."""
    parser.add_argument(
        "--verbose", action="store_true", help="also tell the search, the gait and every check"
    )


def tell(options: argparse.Namespace, facts: dict, lines: Sequence[str]) -> None:
    """What a command ends with: one JSON object of the facts if that was asked for, else lines for
    people."""
    show(json.dumps(facts) if options.json else "\n".join(lines))


def add_bound(parser: argparse.ArgumentParser) -> None:
    """``--bound``."""
    parser.add_argument(
        "--bound",
        action="store_true",
        help="compute an upper bound on every gait (a minute; kept in bounds.sqlite)",
    )


def output_kind(options: argparse.Namespace, kinds: Sequence[str]) -> str:
    """Which of several kinds of files to write: ``--format``, else the ending of ``--output``, else
    the first. `ProblemError` if ``--output`` ends in something else."""
    ending = "" if _is_folder(options.output) else Path(options.output).suffix
    if options.format is None and ending and ending.lstrip(".") not in kinds:
        raise _wrong_ending(options.output, " or ".join(f".{kind}" for kind in kinds))
    return options.format or ending.lstrip(".") or kinds[0]


def _is_folder(output: str | None) -> bool:
    """Whether what the user named is a folder: by a separator at its end, by having no ending, or
    because it is one."""
    return (
        output is None
        or output.endswith(("/", os.sep))
        or not Path(output).suffix
        or os.path.isdir(output)
    )


def output_folder(output: str) -> Path:
    """The folder that the user named. `ProblemError` if it looks like a file."""
    if not _is_folder(output):
        raise ProblemError(
            f"--output {output} should be a folder, as files in it have their own names; a folder "
            f"of that name is written "
            f"{output}/."
        )
    return Path(output)


def _wrong_ending(output: str, wanted: str) -> ProblemError:
    return ProblemError(
        f"--output {output} should end in {wanted}; a folder of that name is written {output}/."
    )


def output_path(output: str | None, default: Path) -> Path:
    """The file to write, in a folder that exists and can be written: what the user named, a folder
    or a file with the suffix of `default`, or else that. `ProblemError` if nothing can be written
    there, or it ends in another suffix, or like a file that another command makes."""
    path = (
        default
        if output is None
        else Path(output) / default.name
        if _is_folder(output)
        else Path(output)
    )
    if path.suffix != default.suffix:
        raise _wrong_ending(str(path), default.suffix)
    ending = reserved_ending(path.stem) if path.suffix == SUFFIX else ""
    if ending and ending.partition("-")[0] != reserved_ending(default.stem).partition("-")[0]:
        raise ProblemError(
            f"--output {path.name} ends in .{ending}{SUFFIX}: colloc itself names files like that; "
            f"choose another."
        )
    if len(os.fsencode(path.name)) > _LONGEST_NAME:
        raise ProblemError(
            f"the file name {path.name[:30]}... is too long: choose an --output of at most "
            f"{_LONGEST_NAME} bytes."
        )
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise ProblemError(
            f"cannot make the folder {path.parent}: {error.strerror or error}."
        ) from None
    try:
        tempfile.TemporaryFile(dir=path.parent).close()
    except OSError:
        raise ProblemError(f"cannot write {path}; choose another --output.") from None
    if path.is_dir():
        raise ProblemError(f"cannot write {path}; choose another --output.")
    return path
