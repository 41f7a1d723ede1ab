"""Command line: the gait of a result as joint angles over time, for a robot: CSV or JSON; or the
robot as MJCF or URDF.

Exit codes: 0 written, 2 bad file or option.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from colloc.commands.ending import OK, command
from colloc.commands.options import (
    add_printing,
    add_result,
    add_robot,
    new_parser,
    output_kind,
    output_path,
    robot_options,
    tell,
)
from colloc.results.store import load

_EPILOG = """\
Under dry friction pacing does not change what a gait does: distance and work per period are those
of the result. With --max-speed the path is run through as evenly as the limits allow; without
--period as fast as they allow. Where the pace matters (drag, power limits) it stays the gait's own,
and limits make the period longer. The period is rounded up to a whole number of samples, and the
sample after the last is the first one again. Samples at times below 0 (# ramp_s seconds of them)
lead from the straight body, at rest, into the gait, which begins at time 0; where the body ends is
said. --no-ramp leaves them out.

  colloc export results/three_link.h5 --period 4                          50 samples a second
  colloc export results/three_link.h5 --max-speed 2.0 --rate 100          as fast as 2 rad/s allow
  colloc export results/three_link.h5 --max-speed 2.0 1.0 --format json   a limit for each joint
  colloc export results/three_link.h5 --period 5 --length 1.2 --mass 3    with torques, powers
  colloc export results/three_link.h5 --period 5 --length 1.2 --mass 3 --format mjcf    for MuJoCo
  colloc export results/three_link.h5 --period 5 --length 1.2 --mass 3 --format urdf    for others

CSV: '#' lines about the result, then time_s, joint_1_rad, ..., joint_1_rad_per_s, ... (mode_1_rad,
... of a smooth body) and, with --length and --mass, joint_1_N_m, ..., joint_1_W, ... Joint angles
count from tail to head; each is a link's direction less that of the link behind it, positive
counter-clockwise."""


def _parser() -> argparse.ArgumentParser:
    parser = new_parser(
        "export", "Write the joint angles of a result over time, as CSV or JSON.", _EPILOG
    )
    add_result(parser)
    parser.add_argument(
        "--rate", type=float, default=50.0, metavar="HZ", help="samples a second (default: 50)"
    )
    parser.add_argument("--period", type=float, metavar="S", help="seconds a period takes")
    parser.add_argument(
        "--max-speed",
        type=float,
        nargs="+",
        metavar="V",
        help="joint speed limit(s) [rad/s], one or one each",
    )
    add_robot(parser)
    parser.add_argument(
        "--periods", type=int, default=1, metavar="N", help="repeat the period N times (default: 1)"
    )
    parser.add_argument(
        "--ramp",
        action=argparse.BooleanOptionalAction,
        default=True,
        help="begin straight, at rest, before time 0 (default)",
    )
    parser.add_argument(
        "--format",
        choices=("csv", "json", "mjcf", "urdf"),
        default=None,
        help="default: --output's, else csv",
    )
    parser.add_argument(
        "--output", metavar="PATH", help="folder or file (default: beside the result)"
    )
    add_printing(parser)
    return parser


@command(_parser)
def main(options: argparse.Namespace) -> int:
    source = Path(options.result)
    solution = load(source)
    options.format = "xml" if options.format == "mjcf" else options.format
    kind = output_kind(options, ("csv", "json", "xml", "urdf"))
    path = output_path(options.output, source.with_suffix(f".{kind}"))
    settings = {
        "period": options.period,
        "max_speed": options.max_speed,
        "rate": options.rate,
        "periods": options.periods,
    }
    settings["ramp"] = options.ramp
    settings |= robot_options(options)
    facts = solution.export(path, **settings)
    if kind in ("xml", "urdf"):
        said = (
            f"saved {path}: a robot of {facts['length_m']:g} m and {facts['mass_kg']:g} "
            f"kg; its "
            f"joint angles: --format csv"
        )
        lines = [said]
        if (moves := facts.get("moves_body_lengths_per_period")) is not None:
            lines.append(
                f"  colloc has it move {moves:.4g} body lengths a period on its floor, with inertia"
            )
        tell(
            options,
            {**facts, "file": str(path)},
            [*lines, *([f"  note: {facts['note']}"] if "note" in facts else [])],
        )
        return OK
    samples = facts["samples_per_period"] * options.periods
    fastest = ", ".join(f"{speed:.3g}" for speed in facts["largest_speed_rad_per_s"])
    lines = [
        f"saved {path}: {samples} samples, period {facts['period_s']:g} s",
        f"  {solution.gait.driven.coordinate} speeds up to {fastest} rad/s; "
        f"{facts['distance_per_period_body_lengths']:.4g} body lengths a period",
    ]
    if "ramp_s" in facts:
        lines.append(
            f"  {facts['ramp_s']:g} s before time 0 lead from straight, at rest, into the gait "
            f"(--no-ramp leaves them out)"
        )
    if "end_body_lengths" in facts:
        lines.append(_end(facts, options.periods))
    if solution.turning:
        lines.append(f"  {solution.turning}")
    if "pace" in facts:
        lines.append(f"  pace: {facts['pace']}")
    if not solution.success:
        lines.append(f"  note: the result is not certified ({solution.status})")
    tell(options, {**facts, "file": str(path), "samples": samples}, lines)
    return OK


def _end(facts: dict[str, Any], periods: int) -> str:
    """Where the body ends, in words."""
    size = facts.get("length_m", 1.0)
    unit, (x, y) = (
        "m" if "length_m" in facts else "body lengths",
        (size * place for place in facts["end_body_lengths"]),
    )
    ahead, aside = ("ahead" if x >= 0 else "behind"), ("left" if y >= 0 else "right")
    return (
        f"  after {periods} period{'s' * (periods > 1)} its centre is {abs(x):.3g} {unit} {ahead} "
        f"and {abs(y):.3g} to the "
        f"{aside} of where it was straight, its tail link turned by {facts['end_turned_deg']:.3g}° "
        f"({'with inertia' if facts['end_includes_inertia'] else 'in slow motion'})"
    )
