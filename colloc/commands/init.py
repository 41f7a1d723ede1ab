"""The command init: write a commented problem file that runs as it is."""

from __future__ import annotations

import argparse
import math
from collections.abc import Sequence
from pathlib import Path

from colloc.commands.ending import OK
from colloc.commands.options import command, count, flag, number, tell, text
from colloc.gaits.problem import Problem
from colloc.gaits.problem_file import read_problem_file
from colloc.mechanics.chain import Chain
from colloc.system.errors import ProblemError

_FEWEST, _MOST, _LONGER = 3, 12, 1e6
_FLOOR = {
    "": "    body=Chain({lengths}),",
    "feet": """\
    # and what they stand on: feet on each link, evenly spread; or one by one,
    # feet=(Foot(0), Wheel(1), ...)
    body=Chain({lengths}, feet={feet}),""",
    "wheels": """\
    # and what they stand on: a wheel in the middle of each link, with its own friction
    # in units of the weight
    body=Chain(
        {lengths},
        feet=tuple(Wheel(link, rolling=0.02, sideways=1.0) for link in range({links})),
    ),""",
}
_TEMPLATE = '''\
"""{links} links: change what is yours, then `colloc solve {file}`."""

from colloc import {names}

PROBLEM = Problem(
    name="{name}",
    # link lengths from tail to head; they add up to 1, the unit of length
{floor}
    # what sliding sideways, forwards and backwards costs, in units of the weight;
    # friction does not depend on speed
    friction=Friction(mu_t=1.0, mu_f=1.0, mu_b=1.0),
    # the class of gaits to search, which decides the answer: more harmonics allow finer motions.
    # "bilateral": the body run backwards in time looks the same from its head; it never turns,
    # and half a period is enough. It needs lengths that read the same from both ends.
    # Others: "antipodal" (the second half mirrors the first), "none"
    gait=Harmonic(harmonics=2, symmetry="{symmetry}"),
    # the largest angle of a joint [rad], at most pi. In degrees: `from math import radians`
    # above, and radians(100) here
    joint_limit=3.14,
    # No guess is needed: travelling waves, known gaits and random ones are tried.
    # guess=Fourier(mean, cos, sin) adds yours.
)
'''


def problem_text(path: Path, lengths: Sequence[float], feet: int = 0, wheels: bool = False) -> str:
    """Text of a problem file for a chain with link lengths in any unit."""
    links, whole = len(lengths), math.fsum(lengths)
    if not _FEWEST <= links <= _MOST:
        raise ProblemError(
            f"a chain must have {_FEWEST} to {_MOST} links here, not "
            f"{links}{' or more' * (links > _MOST)}."
        )
    if not (all(length > 0 for length in lengths) and math.isfinite(whole)):
        raise ProblemError(
            f"--lengths must be positive numbers, not "
            f"{', '.join(f'{length:g}' for length in lengths)}."
        )
    if max(lengths) > _LONGER * min(lengths):
        raise ProblemError(
            f"the longest of --lengths is more than {_LONGER:g} times as long as the shortest."
        )
    if path.suffix != ".py":
        raise ProblemError(f"a problem file is a Python file: {path.name} should end in .py.")
    # raises for a name that files cannot have
    Problem(path.stem, body=Chain(tuple(length / whole for length in lengths), feet=feet))
    names = ["Chain", "Friction", "Harmonic", "Problem", *(["Wheel"] if wheels else [])]
    floor = _FLOOR["wheels" if wheels else "feet" if feet else ""]
    return _TEMPLATE.format(
        links=links,
        file=path.name,
        name=path.stem,
        names=", ".join(names),
        floor=floor.format(
            lengths=f"({', '.join(f'{length:.12g} / {whole:.12g}' for length in lengths)})",
            feet=feet,
            links=links,
        ),
        symmetry="bilateral" if list(lengths) == list(reversed(lengths)) else "none",
    )


@command(
    "init",
    """\
The file runs as it is; one that is there already is left alone. Take --links or --lengths, --feet
or --wheels.

  colloc init mine.py --links 4 --feet 1
  colloc init mine.py --lengths 22 30 30 22 --wheels
  colloc solve mine.py""",
    text("problem", "FILE.py", "the file to write", type=Path),
    count("--links", "N", f"equal links (default: {_FEWEST})"),
    number("--lengths", "L", "of the links, tail to head, in any unit", nargs="+"),
    count("--feet", "N", "feet on each link (default: none, links lie flat)"),
    flag("--wheels", "a wheel in the middle of each link"),
)
def init(options: argparse.Namespace) -> int:
    path: Path = options.problem
    for one, other in (("links", "lengths"), ("feet", "wheels")):
        if getattr(options, one) is not None and getattr(options, other):
            raise ProblemError(f"--{one} and --{other} exclude each other; see colloc init --help.")
    links = _FEWEST if options.links is None else min(options.links, _MOST + 1)
    lengths = options.lengths or [1.0] * links
    text = problem_text(path, lengths, options.feet or 0, options.wheels)
    try:
        with path.open("x", encoding="utf-8") as file:
            file.write(text)
    except FileExistsError:
        raise ProblemError(f"{path} is there already; choose another name.") from None
    read_problem_file(path)
    line = f"wrote {path}: a problem of {len(lengths)} links. Change it, then: colloc solve {path}"
    tell(options, {"status": "written", "file": str(path), "links": len(lengths)}, [line])
    return OK
