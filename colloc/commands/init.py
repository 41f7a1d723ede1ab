"""Command line: write a commented problem file that runs as it is, for a user to change."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path

from colloc.commands.ending import OK, run
from colloc.commands.options import add_printing, new_parser, tell
from colloc.gaits.problem import Problem
from colloc.gaits.problem_file import read_problem_file
from colloc.mechanics.chain import Chain
from colloc.system.errors import ProblemError

_FEWEST, _MOST = 3, 12
_EPILOG = """\
  colloc init mine.py --links 4 --feet 1
  colloc solve mine.py"""
_LINE = "\n    body=Chain(({lengths})),"
_FEET = """
    # and what they stand on: feet on each link, evenly spread; or one by one, feet=(Foot(0), Wheel(1), ...)
    body=Chain(({lengths}), feet={feet}),"""
_TEMPLATE = '''\
"""{links} equal links: change what is yours, then `colloc solve {file}`."""

from colloc import Chain, Friction, Harmonic, Problem

PROBLEM = Problem(
    name="{name}",
    # link lengths from tail to head; they add up to 1, the unit of length{floor}
    # what sliding sideways, forwards and backwards costs, in units of the weight; friction does not depend on speed
    friction=Friction(mu_t=1.0, mu_f=1.0, mu_b=1.0),
    # the class of gaits to search, which decides the answer: more harmonics allow finer motions.
    # "bilateral": the body run backwards in time looks the same from its head; it never turns, and half a period is enough.
    # It needs lengths that read the same from both ends. Others: "antipodal" (the second half mirrors the first), "none"
    gait=Harmonic(harmonics=2, symmetry="bilateral"),
    # the largest angle of a joint [rad], at most pi
    joint_limit=3.14,
    # No guess is needed: travelling waves, known gaits and random ones are tried. guess=Fourier(mean, cos, sin) adds yours.
)
'''


def _parser() -> argparse.ArgumentParser:
    parser = new_parser("init", "Write a commented problem file for a chain of equal links; it runs as it is.", _EPILOG)
    parser.add_argument("problem", type=Path, metavar="FILE.py", help="the file to write; an existing one is left alone")
    parser.add_argument("--links", type=int, default=_FEWEST, metavar="N", help=f"links of the chain (default: {_FEWEST})")
    parser.add_argument("--feet", type=int, default=0, metavar="N", help="feet on each link (default: none, it lies)")
    add_printing(parser)
    return parser


def problem_text(path: Path, links: int, feet: int = 0) -> str:
    """A problem file for a chain of so many equal links, on so many feet each. `ProblemError` if a number is out of range, or
    the file's name cannot be a problem's."""
    if not _FEWEST <= links <= _MOST:
        raise ProblemError(f"--links must be {_FEWEST} to {_MOST}, not {links}.")
    if path.suffix != ".py":
        raise ProblemError(f"a problem file is a Python file: {path.name} should end in .py.")
    lengths = ", ".join([f"1 / {links}"] * links)
    Problem(path.stem, body=Chain((1 / links,) * links, feet=feet))  # refuses names and feet that files cannot have
    floor = (_FEET if feet else _LINE).format(lengths=lengths, feet=feet)
    return _TEMPLATE.format(links=links, file=path.name, name=path.stem, floor=floor)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line; returns the exit code."""
    return run(_parser(), _init, arguments)


def _init(options: argparse.Namespace) -> int:
    path: Path = options.problem
    text = problem_text(path, options.links, options.feet)
    try:
        with path.open("x", encoding="utf-8") as file:
            file.write(text)
    except FileExistsError:
        raise ProblemError(f"{path} is there already; choose another name.") from None
    read_problem_file(path)
    line = f"wrote {path}: a problem of {options.links} links. Change it, then: colloc solve {path}"
    tell(options, {"status": "written", "file": str(path), "links": options.links}, [line])
    return OK
