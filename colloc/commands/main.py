"""The entry point ``colloc``: its commands, of which it imports the module of one alone, and what
they share: options, output paths, printing. Commands import what is slow to import once problem and
options are known to be good."""

from __future__ import annotations

import argparse
import codecs
import contextlib
import importlib
import io
import json
import math
import os
import re
import sys
import tempfile
import warnings
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn, TextIO

from colloc.system.environment import one_thread_each
from colloc.system.errors import (
    CollocError,
    OrderWarning,
    ProblemError,
    ReadOnlyRunWarning,
    SlowWarning,
)
from colloc.system.files import SUFFIX, reserved_ending
from colloc.system.interruption import INTERRUPTED, interruptible
from colloc.system.progress import StatusLine

if TYPE_CHECKING:
    from colloc.gaits.problem import Problem
    from colloc.gaits.problem_file import ProblemFile
    from colloc.results.store import SavedFile

SUBCOMMANDS = {
    "init": ("solve", "write a commented problem file for a chain of links, to change and solve"),
    "solve": ("solve", "find the best gait of a problem file, certify it, save and draw it"),
    "multistart": ("families", "solve from many random starts; list the distinct optima"),
    "sweep": ("families", "solve a study, a grid of problems, over processes"),
    "pareto": ("families", "trade-off (Pareto front) of two objectives, as verified gaits"),
    "steer": ("families", "verified gaits from sharp right to sharp left, for a controller"),
    "evaluate": ("solve", "evaluate a gait of your own: joint angles from a CSV file"),
    "identify": ("solve", "friction coefficients of a floor, from angles and path of a robot"),
    "verify": ("results", "check a result again by independent replay; or compare two results"),
    "report": ("results", "one self-contained web page about a result, to read or to send"),
    "animate": ("results", "the motion as GIF or MP4"),
    "export": ("results", "joint angles over time for a robot, as CSV or JSON; or the robot"),
    "robot": ("results", "speed, power and torques on a robot of given length and mass"),
    "sensitivity": ("results", "how the best value changes with friction, lengths, feet, limits"),
}
"""Name to module of this package, with a function of that name, and what the command does."""
_EXIT_CODES = """\
Exit codes: 0 success; 1 different (--compare); 2 bad problem, option or file; 3 nothing found; 4 a
certificate failed; 130 interrupted."""
_ANGLES = {"rad": 1.0, "deg": math.pi / 180}
_IN_UNITS: dict[str, tuple[dict[str, float], str, str]] = {
    "length": ({"m": 1.0, "cm": 0.01, "mm": 0.001}, "M", "length of the stretched robot [m]"),
    "mass": ({"kg": 1.0, "g": 0.001}, "KG", "mass of the robot [kg]"),
    "period": ({"s": 1.0, "ms": 0.001}, "S", "seconds per cycle"),
    "max_speed": (
        {"rad/s": 1.0, "deg/s": math.pi / 180, "rpm": math.pi / 30},
        "V",
        "speed limit of the joints [rad/s]",
    ),
    "max_torque": ({"Nm": 1.0, "mNm": 0.001}, "M", "torque limit of the joints [N m]"),
    "idle_power": ({"W": 1.0, "mW": 0.001}, "P", "power of the electronics [W]"),
    "backlash": (_ANGLES, "ANGLE", "backlash of the joints [rad]"),
    "joint_limit": (_ANGLES, "ANGLE", "largest angle of a joint [rad]"),
}
"""Options whose numbers may end in a unit: their units, what stands for the value, what it is."""
_LONGEST_NAME = 220  # bytes; systems allow 255, and temporary files have longer names
_MOST = 2**63 - 1
Option = tuple[str, dict[str, Any]]
Function = Callable[[argparse.Namespace], int]


def _help_page(name: str) -> str:
    return Path(__file__).with_name("help").joinpath(f"{name}.txt").read_text(encoding="utf-8")


def help_text() -> str:
    width = max(map(len, SUBCOMMANDS))
    lines = (f"  {name:<{width}}  {summary}" for name, (_, summary) in SUBCOMMANDS.items())
    return _help_page("colloc").format(commands="\n".join(lines)).rstrip()


def main(arguments: Sequence[str] | None = None) -> int:
    """Run ``colloc``; returns the exit code."""
    one_thread_each()
    words = list(sys.argv[1:] if arguments is None else arguments)
    return exit_code(lambda: _run(words), as_json="--json" in words)


def _run(words: list[str]) -> int:
    if "_ARGCOMPLETE" in os.environ:  # a shell completes a line (argcomplete)
        words = _command_on_the_line()
    name = words[0] if words else ""
    if name in ("", "-h", "--help", "help"):
        print(help_text())
        return OK if words else BAD_PROBLEM
    if name == "--version":
        from colloc.system.environment import versions

        print(", ".join(f"{name} {version}" for name, version in versions().items()))
        return OK
    if name in SUBCOMMANDS:
        module = importlib.import_module(f"colloc.commands.{SUBCOMMANDS[name][0]}")
        return getattr(module, name)(words[1:])
    import difflib

    hints = [f"solve {name}"] if name.endswith(".py") else []
    hints += difflib.get_close_matches(name, SUBCOMMANDS, n=1)
    if name == "compare":
        hints = ["verify --compare"]
    choose = f"choose one of {', '.join(SUBCOMMANDS)}."
    hint = f"do you mean colloc {hints[0]}?" if hints else choose
    raise ProblemError(f"there is no command {name!r}; {hint}")


def _command_on_the_line() -> list[str]:
    """The command whose parser completes the rest of the line; before its name ends, the names are
    completed."""
    import argcomplete

    line, point = os.environ["COMP_LINE"], int(os.environ["COMP_POINT"])
    command = [*argcomplete.split_line(line, point)[3], "", ""][1]
    if command in SUBCOMMANDS:
        os.environ["_ARGCOMPLETE"] = "2"  # the words before the options
    else:
        parser = Parser("colloc")
        parser.add_argument("command", choices=SUBCOMMANDS)
        argcomplete.autocomplete(parser)
    return [command]


class Parser(argparse.ArgumentParser):
    """Refuses bad options in one sentence."""

    def error(self, message: str) -> NoReturn:
        choices = r"invalid choice: (.*) \(choose from (.*)\)"
        message = re.sub(choices, r"must be one of \2, not \1", message)
        message = re.sub(r"^argument (\S+): (must|expected)", r"\1 \2", message)
        raise ProblemError(f"{message}; see {self.prog} --help.")


def command(*options: Option) -> Callable[[Function], Callable[..., int]]:
    """Make the subcommand of its name of a function of its options; it is called with the
    arguments, and returns an exit code. `help` has a page for each."""

    def register(function: Function) -> Callable[..., int]:
        def call(arguments: Sequence[str] | None = None) -> int:
            name = function.__name__
            what = SUBCOMMANDS[name][1]
            parser = Parser(
                f"colloc {name}",
                description=f"{what[0].upper()}{what[1:]}.",
                epilog=f"{_help_page(name)}\n{_EXIT_CODES}",
                formatter_class=argparse.RawDescriptionHelpFormatter,
            )
            for option, settings in (*options, *PRINTING):
                parser.add_argument(option, **settings)
            if "_ARGCOMPLETE" in os.environ:
                importlib.import_module("argcomplete").autocomplete(parser)
            return run(parser, function, arguments)

        return call

    return register


def option(
    kind: Callable[[str], Any],
    signature: str,
    help: str,
    default: Any = None,
    least: float | None = None,
    **more: Any,
) -> Option:
    """An option with a value, its name and what stands for the value in a signature: a whole number
    of at least `least`, or a number above it."""
    name, _, metavar = signature.partition(" ")
    more = {"metavar": metavar or None} | more
    whole = kind is int

    def read(text):
        try:
            value = kind(text)
        except ValueError:
            what = f"must be a {'whole ' * whole}number, not {text!r}"
            raise argparse.ArgumentTypeError(what) from None
        if least is None or (least <= value <= _MOST if whole else value > least):
            return value
        what = f"at least {least}, and at most {_MOST}" if whole else "positive"
        raise argparse.ArgumentTypeError(f"must be {what}, not {value}")

    return name, {"help": help, "type": read, "default": default, **more}


def in_units(name: str, help: str = "", **more: Any) -> Option:
    """Option of a positive number, which may end in a unit; else it is in the first."""
    units, metavar, what = _IN_UNITS[name]

    def read(text):
        match = re.fullmatch(r"\s*([-+.\deE]*[\d.])\s*([A-Za-z/]*)\s*", text)
        if not match or match[2] not in {"", *units}:
            why = f"must be a number, or one in {' or '.join(units)}, not {text!r}"
            raise argparse.ArgumentTypeError(why)
        return float(match[1]) * units.get(match[2], 1.0)

    return option(read, f"--{name.replace('_', '-')} {metavar}", what + help, least=0, **more)


def output(what: str) -> Option:
    return option(str, "--output PATH", what)


def flag(name: str, help: str) -> Option:
    return name, {"action": "store_true", "help": help}


PRINTING = (
    flag("--json", "print one JSON object on standard output, and nothing else"),
    flag("--quiet", "no progress, only the final summary"),
)
VERBOSE = flag("--verbose", "also print the search, the gait and every check")
NO_FIGURE = flag("--no-figure", "do not draw a figure")
BOUND = flag("--bound", "compute an upper bound on every gait (a minute; kept in bounds.sqlite)")
WORKERS = option(int, "--workers N", "processes, one BLAS thread each (default: 1)", 1, least=1)
RETRY = flag("--retry", "solve again what ended in an error, a crash or the time limit")
RESULT = option(str, "result FILE.h5", "a result that colloc solve wrote")
CHANGES = (
    option(float, "--delta SPEED", "final regularisation speed of friction"),
    option(float, "--delta-start SPEED", "first delta of the continuation"),
    option(int, "--mesh N", "intervals of the first mesh", dest="intervals"),
    option(float, "--mesh-tolerance TOL", "relative error to refine to; 0: never"),
    option(str, "--scheme NAME", "trapezoid, hermite-simpson, gauss-N or radau-N"),
    option(str, "--formulation NAME", "the balance as constraints: full, or implicit velocity"),
)
PROBLEM = (
    option(str, "problem", "a Python file that states PROBLEM, for example problems/three_link.py"),
    *CHANGES,
)
"""The problem file, and the changes to it that every solving command takes."""
LENGTH, _MASS = (in_units(name, " (default: the problem's)") for name in ("length", "mass"))
ROBOT = LENGTH, _MASS, option(float, "--gravity G", "default: the problem's, or 9.81 m/s^2")
PERIOD = in_units("period")
MAX_SPEED, MAX_TORQUE = (
    in_units(name, ": one for all or one each", nargs="+") for name in ("max_speed", "max_torque")
)


def _attribute(option: Option) -> str:
    name, settings = option
    return settings.get("dest", name[2:].replace("-", "_"))


def refuse(options: argparse.Namespace, why: str, *unused: Option) -> None:
    """Raise a `ProblemError` if options that would do nothing are not as by default."""
    useless = [x for x in unused if getattr(options, _attribute(x)) != x[1].get("default", False)]
    if useless:
        raise ProblemError(f"{why}: leave {', '.join(name for name, _ in useless)} out.")


def read_problem(
    options: argparse.Namespace, start: str | None = None
) -> tuple[ProblemFile, Problem]:
    """The problem file; and its problem with the changes of the options of `PROBLEM`, and the gait
    of the result `start` as guess."""
    from colloc.gaits.problem_file import read_problem_file

    file = read_problem_file(options.problem)
    changes = options_given(options, *map(_attribute, CHANGES))
    problem = file.problem.with_(**changes) if changes else file.problem
    if start is None:
        return file, problem
    from colloc.results.store import load

    gait = load(start).gait
    try:
        return file, problem.with_(guess=gait)
    except ProblemError as error:
        raise ProblemError(f"the gait of {start} cannot be the guess: {error}") from None


def values(options: argparse.Namespace, *names: str) -> dict[str, Any]:
    return {name: getattr(options, name) for name in names}


def options_given(options: argparse.Namespace, *names: str) -> dict[str, Any]:
    return {name: x for name, x in values(options, *names).items() if x is not None}


def quiet(options: argparse.Namespace) -> bool:
    return options.quiet or options.json


def status_line(options: argparse.Namespace) -> StatusLine:
    return StatusLine(enabled=not quiet(options))


def complain(sentence: str) -> None:
    print(f"colloc: {sentence}", file=sys.stderr, flush=True)


def tell(
    options: argparse.Namespace,
    facts: dict,
    lines: Sequence[str],
    saved: list[SavedFile] | None = None,
) -> None:
    """Print a result and what became of former ones: as JSON, or lines for people."""
    former = [one for one in saved or () if one.former is not None]
    if saved is not None:
        facts = facts | {"kept": [str(one.former) for one in former]}
    lines = [*lines, *(f"  {one.why} is kept as {one.former}" for one in former)]
    show(json.dumps(facts) if options.json else "\n".join(lines))


def output_path(options: argparse.Namespace, default: Path, kinds: Sequence[str] = ()) -> Path:
    """The file to write: the default, or a folder or file that ``--output`` names.

    Its ending is that of the default; or one of `kinds`, by ``--format``, else by ``--output``,
    else the first. `ProblemError` if it cannot be written, or is named like one that another
    command makes.
    """
    output, endings = options.output, [f".{kind}" for kind in kinds] or [default.suffix]
    if kinds and options.format:
        endings = [f".{options.format}"]
    path = default.with_suffix(endings[0])
    if output is not None:
        file = Path(output)
        folder = output.endswith(("/", os.sep)) or not file.suffix or os.path.isdir(output)
        path = file / path.name if folder else file
    if path.suffix not in endings:
        raise ProblemError(
            f"--output {path} should end in {' or '.join(endings)}; a folder of that name is "
            f"written {path}/."
        )
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
        tempfile.TemporaryFile(dir=path.parent).close()
        if path.is_dir():
            raise IsADirectoryError(0, "it is a folder")
    except OSError as error:
        why = error.strerror or error
        raise ProblemError(f"cannot write {path}: {why}; choose another --output.") from None
    return path


OK, BAD_PROBLEM, NONE_FOUND, FAILED, UNREAD = 0, 2, 3, 4, 141  # the last as shells report SIGPIPE
_IN_WORDS = {"π": " pi ", "δ": "delta", "μ": "mu", "±": "+-", "→": "->", "·": "*", "…": "..."}
_json_page: list[TextIO] = []  # standard output while it is reserved for one JSON object


def run(
    parser: argparse.ArgumentParser,
    command: Callable[[argparse.Namespace], int],
    arguments: Sequence[str] | None,
) -> int:
    """Run a command on its arguments, or those of the process; `options.command` is the line."""
    words = sys.argv[1:] if arguments is None else list(arguments)
    typed = argparse.Namespace(command=" ".join([parser.prog, *words]))
    return exit_code(lambda: command(parser.parse_args(words, typed)), as_json="--json" in words)


def exit_code(command: Callable[[], int], *, as_json: bool = False) -> int:
    """Run a command; errors become one sentence on standard error, and with `as_json` an object.

    A KeyboardInterrupt may carry a sentence about what was kept.
    """
    for number, name in enumerate(("stdin", "stdout", "stderr")):
        if getattr(sys, name) is None:  # closed by the caller: no other file may take its number
            setattr(sys, name, open(os.devnull, "w" if number else "r", encoding="utf-8"))  # noqa: SIM115
    codecs.register_error("colloc.words", _spell_out)
    if isinstance(sys.stdout, io.TextIOWrapper):
        sys.stdout.reconfigure(errors="colloc.words")
    status, sentence, output_fails = "error", "", False
    try:
        with interruptible(polled=False), _short_warnings():
            try:
                with _stdout_for_json(as_json):
                    code = command()
            finally:
                sys.stdout.flush()
    except CollocError as error:
        code, sentence = BAD_PROBLEM, str(error)
    except BrokenPipeError:
        code, as_json, output_fails = UNREAD, False, True
        sentence = "the output was closed by its reader; what was saved before is kept."
    except OSError as error:
        code, output_fails = BAD_PROBLEM, error.filename is None
        what = f"{error.filename or 'the output'}: {error.strerror or error}"
        sentence = f"cannot read or write {what}."
    except KeyboardInterrupt as stop:
        code, status = INTERRUPTED, "interrupted"
        sentence = f"interrupted; {str(stop) or 'nothing was written.'}"
    if code == INTERRUPTED and "multiprocessing" in sys.modules:
        for child in sys.modules["multiprocessing"].active_children():  # Python would wait for them
            child.terminate()
    if output_fails:  # Python is not to try to print the rest as it ends
        with contextlib.suppress(OSError, ValueError):
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    if sentence and as_json:
        with contextlib.suppress(OSError):
            show(json.dumps({"status": status, "message": sentence, "exit_code": code}))
    if sentence:
        print(f"colloc: {sentence}", file=sys.stderr)
    return code


def show(text: str) -> None:
    """Print the result of a command, also where standard output is reserved for it."""
    print(text, file=_json_page[-1] if _json_page else sys.stdout, flush=True)


@contextlib.contextmanager
def _stdout_for_json(as_json: bool) -> Iterator[None]:
    if not as_json or _json_page:
        yield
        return
    _json_page.append(sys.stdout)
    try:
        with contextlib.redirect_stdout(sys.stderr):
            yield
    finally:
        _json_page.clear()


@contextlib.contextmanager
def naming_saved_files(saved: Sequence[str]) -> Iterator[None]:
    """Have Ctrl-C in the block say which files are saved already."""
    try:
        yield
    except KeyboardInterrupt as stop:
        what = f"{', '.join(saved)} {'are' if len(saved) > 1 else 'is'} saved." if saved else ""
        raise KeyboardInterrupt(str(stop) or what) from None


def _spell_out(error: UnicodeError) -> tuple[str | bytes, int]:
    assert isinstance(error, UnicodeEncodeError)
    words = (
        _IN_WORDS.get(c) or c.encode("ascii", "backslashreplace").decode()
        for c in error.object[error.start : error.end]
    )
    return "".join(words), error.end


@contextlib.contextmanager
def _short_warnings() -> Iterator[None]:
    of_colloc = OrderWarning, ReadOnlyRunWarning, SlowWarning
    with warnings.catch_warnings():
        before = warnings.showwarning

        def show(message, category, *where, **more):
            if issubclass(category, of_colloc):
                print(f"colloc: {message}", file=sys.stderr)
            else:
                before(message, category, *where, **more)

        for category in of_colloc:
            once = category is not ReadOnlyRunWarning
            warnings.simplefilter("once" if once else "always", category)
        warnings.showwarning = show
        yield
