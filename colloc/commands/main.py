"""The entry point ``colloc``: one line per subcommand, whose module is only imported when it is
asked for."""

from __future__ import annotations

import importlib
import sys
from collections.abc import Sequence

from colloc.commands.ending import BAD_PROBLEM, OK, exit_code
from colloc.system.errors import ProblemError
from colloc.system.processors import one_thread_each

SUBCOMMANDS = {
    "init": ("init", "write a commented problem file for a chain of links, to change and solve"),
    "solve": ("solve", "find the best gait of a problem file, certify it, save and draw it"),
    "multistart": (
        "multistart",
        "solve a problem from many random starts; distinct optima with their frequencies",
    ),
    "open": ("open", "what an archive of starts holds; the whole result of one of them"),
    "sweep": ("sweep", "solve a study: a grid of problems, over processes or a cluster; resumable"),
    "pareto": ("pareto", "what two objectives cost each other: a front of certified gaits"),
    "steer": (
        "steer",
        "certified gaits from sharp right to sharp left, in one file that a controller can "
        "interpolate",
    ),
    "evaluate": (
        "evaluate",
        "what a gait of your own achieves: joint angles from a CSV file, replayed and certified",
    ),
    "verify": ("verify", "check a result again by independent replay, without CasADi"),
    "compare": ("compare", "hold two results against each other"),
    "report": ("report", "one self-contained web page about a result, to read or to send"),
    "animate": ("animate", "the motion as GIF or MP4"),
    "export": ("export", "joint angles over time for a robot, as CSV or JSON"),
    "robot": (
        "robot",
        "speed, power and torques of a result on a robot of so many metres and kilograms",
    ),
    "sensitivity": (
        "sensitivity",
        "what a wrong floor costs: how the best value changes with friction, lengths, feet, limits",
    ),
}
"""Name to module of this package with a ``main(arguments)`` that returns an exit code, and what it
does."""

_EXAMPLE = """\
From a problem to a page to send:

  colloc solve problems/three_link.py        results/three_link.h5, .png
  colloc report results/three_link.h5        results/three_link.html
  colloc animate results/three_link.h5       results/three_link.gif
  colloc export results/three_link.h5 --max-speed 2.0 --rate 50

`colloc COMMAND --help` explains a command."""


def help_text() -> str:
    """What ``colloc --help`` prints."""
    width = max(map(len, SUBCOMMANDS))
    lines = [
        "usage: colloc COMMAND ...",
        "",
        "The most efficient ways to crawl, found and certified.",
        "",
        "commands:",
    ]
    lines += [f"  {name:<{width}}  {summary}" for name, (_, summary) in SUBCOMMANDS.items()]
    return "\n".join([*lines, "", _EXAMPLE])


def main(arguments: Sequence[str] | None = None) -> int:
    """Run ``colloc``; returns the exit code."""
    one_thread_each()
    words = list(sys.argv[1:] if arguments is None else arguments)
    return exit_code(lambda: _command(words), as_json="--json" in words)


def _command(words: list[str]) -> int:
    if not words or words[0] in ("-h", "--help", "help"):
        print(help_text())
        return OK if words else BAD_PROBLEM
    if words[0] == "--version":
        from colloc.system.versions import versions

        print(", ".join(f"{name} {version}" for name, version in versions().items()))
        return OK
    if words[0] == "referee":
        raise ProblemError(
            "the table of known gaits is a benchmark: python -m benchmarks.referee, in a clone."
        )
    if words[0] not in SUBCOMMANDS:
        import difflib

        near = difflib.get_close_matches(words[0], SUBCOMMANDS, n=1)
        if words[0].endswith(".py"):
            near = [f"solve {words[0]}"]
        hint = (
            f"do you mean colloc {near[0]}?" if near else f"choose one of {', '.join(SUBCOMMANDS)}."
        )
        raise ProblemError(f"there is no command {words[0]!r}; {hint}")
    return importlib.import_module(f"colloc.commands.{SUBCOMMANDS[words[0]][0]}").main(words[1:])
