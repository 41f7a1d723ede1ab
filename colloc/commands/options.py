"""Commands, their options, and what they share: errors, output paths, printing."""

from __future__ import annotations

import argparse
import json
import os
import re
import sys
import tempfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn

from colloc.commands.ending import run, show
from colloc.system.errors import ProblemError
from colloc.system.files import SUFFIX, reserved_ending
from colloc.system.progress import StatusLine

if TYPE_CHECKING:
    from colloc.gaits.problem import Problem
    from colloc.gaits.problem_file import ProblemFile

SUBCOMMANDS = {
    "init": ("init", "write a commented problem file for a chain of links, to change and solve"),
    "solve": ("solve", "find the best gait of a problem file, certify it, save and draw it"),
    "multistart": ("families", "solve from many random starts; distinct optima, how often found"),
    "open": ("families", "list the optima of an archive of starts; make a result of one start"),
    "sweep": ("families", "solve a study, a grid of problems, over processes or a cluster"),
    "pareto": ("families", "trade-off (Pareto front) of two objectives, as certified gaits"),
    "steer": ("families", "certified gaits from sharp right to sharp left, for a controller"),
    "evaluate": ("solve", "evaluate a gait of your own: joint angles from a CSV file"),
    "verify": ("verify", "check a result again by independent replay, without CasADi"),
    "compare": ("verify", "compare two results"),
    "report": ("results", "one self-contained web page about a result, to read or to send"),
    "animate": ("results", "the motion as GIF or MP4"),
    "export": ("results", "joint angles over time for a robot, as CSV or JSON; or the robot"),
    "robot": ("results", "speed, power and torques on a robot of given length and mass"),
    "sensitivity": ("results", "how the best value changes with friction, lengths, feet, limits"),
}
"""Name to module of this package and what the command does."""
_LONGEST_NAME = 220  # bytes; systems allow 255, and temporary files have longer names
_MOST = 2**63 - 1
_EXIT_CODES = """\
Exit codes: 0 success; 1 different (compare); 2 bad problem, option or file; 3 nothing found; 4 a
certificate failed; 130 interrupted."""
_IN_WORDS = (
    (r"invalid int value: (.*)", r"must be a whole number, not \2"),
    (r"invalid float value: (.*)", r"must be a number, not \2"),
    (r"invalid choice: (.*) \(choose from (.*)\)", r"must be one of \3, not \2"),
)
Option = tuple[str, dict[str, Any]]
Function = Callable[[argparse.Namespace], int]


class Parser(argparse.ArgumentParser):
    """Refuses bad options in one sentence."""

    def error(self, message: str) -> NoReturn:
        for argparses, ours in _IN_WORDS:
            message = re.sub(rf"^argument (?P<name>\S+): {argparses}", rf"\g<name> {ours}", message)
        raise ProblemError(f"{message}; see {self.prog} --help.")


@dataclass(frozen=True, eq=False)
class Command:
    """A subcommand; called with its arguments it returns an exit code."""

    name: str
    epilog: str
    options: Sequence[Option]
    function: Function

    def __call__(self, arguments: Sequence[str] | None = None) -> int:
        what = SUBCOMMANDS[self.name][1]
        parser = Parser(
            f"colloc {self.name}",
            description=f"{what[0].upper()}{what[1:]}.",
            epilog=f"{self.epilog}\n\n{_EXIT_CODES}",
            formatter_class=argparse.RawDescriptionHelpFormatter,
        )
        for name, settings in (*self.options, *PRINTING):
            parser.add_argument(name, **settings)
        return run(parser, self.function, arguments)


COMMANDS: dict[str, Command] = {}
"""Those whose modules are imported."""


def command(name: str, epilog: str, *options: Option) -> Callable[[Function], Command]:
    """Make a subcommand of a function of its options."""

    def register(function: Function) -> Command:
        COMMANDS[name] = Command(name, epilog, options, function)
        return COMMANDS[name]

    return register


def text(name: str, metavar: Any, help: str, **settings: Any) -> Option:
    return name, {"metavar": metavar, "help": help, **settings}


def number(name: str, metavar: Any, help: str, default: Any = None, **settings: Any) -> Option:
    return text(name, metavar, help, type=float, default=default, **settings)


def count(name: str, metavar: Any, help: str, default: Any = None, **settings: Any) -> Option:
    return text(name, metavar, help, type=int, default=default, **settings)


def choice(name: str, choices: Sequence[str], help: str, default: Any = None) -> Option:
    return text(name, None, help, choices=choices, default=default)


def flag(name: str, help: str) -> Option:
    return name, {"action": "store_true", "help": help}


def output(what: str) -> Option:
    return text("--output", "PATH", what)


PRINTING = (
    flag("--json", "print one JSON object on standard output, and nothing else"),
    flag("--quiet", "no progress, only the final summary"),
)
VERBOSE = flag("--verbose", "also print the search, the gait and every check")
NO_FIGURE = flag("--no-figure", "do not draw a figure")
BOUND = flag("--bound", "compute an upper bound on every gait (a minute; kept in bounds.sqlite)")
WORKERS = count("--workers", "N", "processes, one BLAS thread each (default: 1)", 1)
RETRY = flag("--retry", "solve again what ended in an error, a crash or the time limit")
RESULT = text("result", "FILE.h5", "a result that colloc solve wrote")
SEED = count("--seed", "N", "of the sampler (default: 0)", 0)
PROBLEM = (
    text("problem", None, "a Python file that states PROBLEM, for example problems/three_link.py"),
    number("--delta", "SPEED", "final regularisation speed of friction"),
    number("--delta-start", "SPEED", "first delta of the continuation"),
    count("--mesh", "N", "intervals of the first mesh", dest="intervals"),
    number("--mesh-tolerance", "TOL", "relative error to refine to; 0: never"),
    text("--scheme", "NAME", "trapezoid, hermite-simpson, gauss-N or radau-N"),
    text("--formulation", "NAME", "of the balance as constraints: full, or implicit velocity"),
)
"""The problem file, and the changes to it that every solving command takes."""
_CHANGES = ("delta", "delta_start", "intervals", "mesh_tolerance", "scheme", "formulation")
LENGTH = number("--length", "M", "of the stretched robot [m]")
MASS = number("--mass", "KG", "of the robot [kg]")
ROBOT = (LENGTH, MASS, number("--gravity", "G", "default: 9.81 m/s^2", 9.81))
PERIOD = number("--period", "S", "seconds per period")
MAX_SPEED = number("--max-speed", "V", "of the joints [rad/s], one or one each", nargs="+")
MAX_TORQUE = number("--max-torque", "M", "of the joints [N m], one or one each", nargs="+")


def read_problem(options: argparse.Namespace) -> tuple[ProblemFile, Problem]:
    """The problem file; and its problem with the changes of the options of `PROBLEM`, and the gait
    of the result of ``--start`` as guess."""
    from colloc.gaits.problem_file import read_problem_file

    stated = read_problem_file(options.problem)
    changes = {name: x for name in _CHANGES if (x := getattr(options, name)) is not None}
    problem = stated.problem.with_(**changes) if changes else stated.problem
    if getattr(options, "start", None) is None:
        return stated, problem
    from colloc.results.store import load

    gait = load(options.start).gait
    try:
        return stated, problem.with_(guess=gait)
    except ProblemError as error:
        raise ProblemError(f"the gait of {options.start} cannot be the guess: {error}") from None


def robot_size(options: argparse.Namespace) -> dict[str, float]:
    """Values of `ROBOT` by name; none without length and mass."""
    missing = [name for name in ("length", "mass") if getattr(options, name) is None]
    if len(missing) == 1:
        raise ProblemError(f"a robot needs --length and --mass; --{missing[0]} is missing.")
    return {} if missing else values(options, "length", "mass", "gravity")


def values(options: argparse.Namespace, *names: str) -> dict[str, Any]:
    return {name: getattr(options, name) for name in names}


def check_least(options: argparse.Namespace, **least: int) -> None:
    for name, smallest in least.items():
        value = getattr(options, name)
        if value is not None and not smallest <= value <= _MOST:
            raise ProblemError(
                f"--{name} must be at least {smallest}, and at most {_MOST}, not {value}."
            )


def check_positive(options: argparse.Namespace, name: str) -> None:
    if not (value := getattr(options, name)) > 0:
        raise ProblemError(f"--{name.replace('_', '-')} must be positive, not {value:g}.")


def quiet(options: argparse.Namespace) -> bool:
    return options.quiet or options.json


def status_line(options: argparse.Namespace) -> StatusLine:
    return StatusLine(enabled=not quiet(options))


def complain(sentence: str) -> None:
    print(f"colloc: {sentence}", file=sys.stderr, flush=True)


def tell(options: argparse.Namespace, facts: dict, lines: Sequence[str]) -> None:
    """Print the result of a command: facts as one JSON object, or lines for people."""
    show(json.dumps(facts) if options.json else "\n".join(lines))


def output_kind(options: argparse.Namespace, kinds: Sequence[str]) -> str:
    """The kind of file to write: ``--format``, else the ending of ``--output``, else the first."""
    ending = "" if _is_folder(options.output) else Path(options.output).suffix.lstrip(".")
    if options.format is None and ending and ending not in kinds:
        raise _wrong_ending(options.output, " or ".join(f".{kind}" for kind in kinds))
    return options.format or ending or kinds[0]


def _is_folder(output: str | None) -> bool:
    if output is None or output.endswith(("/", os.sep)):
        return True
    return not Path(output).suffix or os.path.isdir(output)


def output_folder(output: str) -> Path:
    if not _is_folder(output):
        raise ProblemError(
            f"--output {output} should be a folder, as files in it have their own names; a folder "
            f"of that name is written {output}/."
        )
    return Path(output)


def _wrong_ending(output: str, wanted: str) -> ProblemError:
    return ProblemError(
        f"--output {output} should end in {wanted}; a folder of that name is written {output}/."
    )


def output_path(output: str | None, default: Path) -> Path:
    """The file to write: the default, or a folder or file with its suffix that the user named.

    `ProblemError` if it cannot be written, or is named like one that another command makes.
    """
    path = default
    if output is not None:
        path = Path(output) / default.name if _is_folder(output) else Path(output)
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
        why = error.strerror or error
        raise ProblemError(f"cannot make the folder {path.parent}: {why}.") from None
    try:
        tempfile.TemporaryFile(dir=path.parent).close()
        writable = not path.is_dir()
    except OSError:
        writable = False
    if not writable:
        raise ProblemError(f"cannot write {path}; choose another --output.")
    return path
