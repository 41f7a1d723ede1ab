"""Command line: what a gait does on a robot of so many metres and kilograms: speed, power, torques.

Exit codes: 0 printed, 2 bad file or option.
"""

from __future__ import annotations

import argparse
from pathlib import Path

from colloc.commands.ending import OK, command
from colloc.commands.options import (
    add_pace,
    add_printing,
    add_result,
    add_robot,
    new_parser,
    output_path,
    pace_options,
    robot_options,
    tell,
)
from colloc.results.robot import Robot
from colloc.results.store import load

_EPILOG = """\
The robot is as long as its links together, and its mass is spread over them as the problem says.
The numbers are those at the period that is given, with inertia. The friction coefficients are those
of the problem.

  colloc robot results/three_link.h5 --length 1.2 --mass 3 --period 5
  colloc robot results/three_link.h5 --length 1.2 --mass 3 --period 5 \\
    --max-speed 2.0 --max-torque 2.5 2.0
  colloc robot results/three_link.h5 --length 1.2 --mass 3 --period 5 --figure   with a picture"""


def _parser() -> argparse.ArgumentParser:
    parser = new_parser(
        "robot",
        "What a gait does on a robot: speed, work, power, torques, the shortest period.",
        _EPILOG,
    )
    add_result(parser)
    add_robot(parser, required=True)
    add_pace(parser, required=True)
    parser.add_argument(
        "--figure", action="store_true", help="also draw torque, speed and power over time"
    )
    parser.add_argument(
        "--output",
        metavar="PATH",
        help="folder or .png file of the figure (default: beside the result)",
    )
    add_printing(parser)
    return parser


@command(_parser)
def main(options: argparse.Namespace) -> int:
    source = Path(options.result)
    solution = load(source)
    robot = Robot(solution, **robot_options(options), **pace_options(options))
    facts, lines = dict(robot.facts), robot.lines()
    if options.figure or options.output:
        path = output_path(options.output, source.with_suffix(".robot.png"))
        from colloc.pictures.style import save

        save(robot.plot(), path.with_suffix(""), kinds=("png",))
        facts["figure"] = str(path)
        lines.append(f"saved {path}")
    tell(options, facts | {"notes": robot.sentences()}, lines)
    return OK
