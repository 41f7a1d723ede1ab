"""Command line: by how much the best value of a problem changes with its friction, lengths, feet
and limits.

Exit codes: 0 printed, 2 bad file or option.
"""

from __future__ import annotations

import argparse

from colloc.commands.ending import OK, command
from colloc.commands.options import add_printing, add_result, new_parser, tell
from colloc.results.store import load
from colloc.system.progress import StatusLine

_EPILOG = """\
The slope is the exact derivative at the optimum; multiply it by 0.1 for a tenth more. With --again
the gait is sought again for every number, from the gait on file, with each a tenth smaller and
larger; that takes a second or two for each.

  colloc sensitivity results/three_link.h5
  colloc sensitivity results/three_link.h5 --again"""


def _parser() -> argparse.ArgumentParser:
    parser = new_parser(
        "sensitivity",
        "What a wrong floor, or other lengths, feet and limits, cost the best gait.",
        _EPILOG,
    )
    add_result(parser)
    parser.add_argument(
        "--again", action="store_true", help="also seek the best gaits there, and replay this one"
    )
    add_printing(parser)
    return parser


@command(_parser)
def main(options: argparse.Namespace) -> int:
    solution = load(options.result)
    with StatusLine(enabled=options.again and not (options.quiet or options.json)) as line:
        line.say(f"{solution.problem.name}: seeking the best gaits again")
        found = solution.sensitivity(resolve=options.again)
    tell(options, {"file": options.result, **found.facts()}, found.lines())
    return OK
