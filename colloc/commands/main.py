"""The entry point ``colloc``, which imports the module of the subcommand alone."""

from __future__ import annotations

import importlib
import sys
from collections.abc import Sequence

from colloc.commands.ending import BAD_PROBLEM, OK, exit_code
from colloc.commands.options import COMMANDS, SUBCOMMANDS, Command
from colloc.system.errors import ProblemError
from colloc.system.processors import one_thread_each

_EXAMPLE = """\
From a problem to a page to send:

  colloc solve problems/three_link.py        results/three_link.h5, .png
  colloc report results/three_link.h5        results/three_link.html
  colloc animate results/three_link.h5       results/three_link.gif
  colloc export results/three_link.h5 --max-speed 2.0 --rate 50

`colloc COMMAND --help` explains a command."""


def help_text() -> str:
    width = max(map(len, SUBCOMMANDS))
    head = "usage: colloc COMMAND ...\n\nFind and certify efficient gaits of crawling robots.\n\n"
    lines = [f"  {name:<{width}}  {summary}" for name, (_, summary) in SUBCOMMANDS.items()]
    return head + "\n".join(["commands:", *lines, "", _EXAMPLE])


def command(name: str) -> Command:
    importlib.import_module(f"colloc.commands.{SUBCOMMANDS[name][0]}")
    return COMMANDS[name]


def main(arguments: Sequence[str] | None = None) -> int:
    """Run ``colloc``; returns the exit code."""
    one_thread_each()
    words = list(sys.argv[1:] if arguments is None else arguments)
    return exit_code(lambda: _run(words), as_json="--json" in words)


def _run(words: list[str]) -> int:
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

        hints = difflib.get_close_matches(words[0], SUBCOMMANDS, n=1)
        if words[0].endswith(".py"):
            hints = [f"solve {words[0]}"]
        hint = f"choose one of {', '.join(SUBCOMMANDS)}."
        hint = f"do you mean colloc {hints[0]}?" if hints else hint
        raise ProblemError(f"there is no command {words[0]!r}; {hint}")
    return command(words[0])(words[1:])
