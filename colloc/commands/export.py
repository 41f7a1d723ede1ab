"""Command line: the gait of a result as joint angles over time, for a robot: CSV or JSON.

Exit codes: 0 written, 2 bad file or option.
"""

from __future__ import annotations

import argparse
import io
import json
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from colloc.commands.ending import OK, run
from colloc.commands.options import add_printing, add_result, new_parser, output_kind, output_path, tell
from colloc.commands.verify import check_trusted
from colloc.gaits.gait_fields import law_fields
from colloc.results.solution import Solution
from colloc.results.store import load
from colloc.system.errors import ProblemError
from colloc.system.replaced_file import replaced_file
from colloc.verification.trajectory import Trajectory, timed

_EPILOG = """\
Under dry friction pacing does not change what a gait does: distance and work per period are those of the result. With
--max-speed the path is run through as evenly as the limits allow; without --period as fast as they allow. The period is rounded
up to a whole number of samples, and the sample after the last is the first one again.

  colloc export results/three_link.h5 --period 4                          50 samples a second
  colloc export results/three_link.h5 --max-speed 2.0 --rate 100          as fast as 2 rad/s allow
  colloc export results/three_link.h5 --max-speed 2.0 1.0 --format json   a limit for each joint

CSV: '#' lines about the result, then time_s, joint_1_rad, ..., joint_1_rad_per_s, ... Joint angles count from tail to head;
each is a link's direction less that of the link behind it, positive counter-clockwise."""


def _parser() -> argparse.ArgumentParser:
    parser = new_parser("export", "Write the joint angles of a result over time, as CSV or JSON.", _EPILOG)
    add_result(parser)
    parser.add_argument("--rate", type=float, default=50.0, metavar="HZ", help="samples a second (default: 50)")
    parser.add_argument("--period", type=float, metavar="S", help="seconds a period takes")
    parser.add_argument("--max-speed", type=float, nargs="+", metavar="V", help="joint speed limit(s) [rad/s], one or one each")
    parser.add_argument("--periods", type=int, default=1, metavar="N", help="repeat the period N times (default: 1)")
    parser.add_argument("--format", choices=("csv", "json"), default=None, help="default: by the suffix of --output, else csv")
    parser.add_argument("--output", metavar="PATH", help="folder or file (default: beside the result)")
    add_printing(parser)
    return parser


def about(solution: Solution, trajectory: Trajectory, rate: float, limits: Sequence[float] | None) -> dict:
    """What a reader of the samples has to know, as plain numbers and strings."""
    measured, reason = solution.measured, solution.problem.paced_by
    paced = {"pace": f"meant for the gait's own pace in a period of 1, as {reason}"} if reason else {}
    return {
        "name": solution.problem.name,
        "status": solution.status,
        "period_s": trajectory.period,
        "rate_hz": rate,
        "samples_per_period": trajectory.time.size,
        "max_speed_rad_per_s": None if limits is None else list(limits),
        "largest_speed_rad_per_s": np.abs(trajectory.speeds).max(axis=1).tolist(),
        "body": solution.problem.body.describe(),
        "friction": law_fields(solution.problem.friction),
        "efficiency": measured.efficiency,
        "objective": solution.problem.objective.name,
        "value": measured.value,
        "distance_per_period_body_lengths": measured.distance,
        "work_per_period_weight_times_length": measured.work,
        "problem_hash": solution.problem.hash,
        **paced,
    }


def repeated(trajectory: Trajectory, periods: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Time, angles and speeds of several periods in a row."""
    time = (np.arange(periods)[:, None] * trajectory.period + trajectory.time).ravel()
    return time, np.tile(trajectory.angles, periods), np.tile(trajectory.speeds, periods)


def csv_text(facts: dict, trajectory: Trajectory, periods: int = 1, coordinate: str = "joint") -> str:
    """The samples as comma-separated values, with the facts in '#' lines."""
    time, angles, speeds = repeated(trajectory, periods)
    n = len(angles)
    names = [f"{coordinate}_{j}_{unit}" for unit in ("rad", "rad_per_s") for j in range(1, n + 1)]
    text = io.StringIO()
    for key, value in facts.items():
        text.write(f"# {key}: {json.dumps(value)}\n")
    text.write(",".join(["time_s", *names]) + "\n")
    np.savetxt(text, np.concatenate([time[None], angles, speeds]).T, fmt="%.9g", delimiter=",")
    return text.getvalue()


def json_text(facts: dict, trajectory: Trajectory, periods: int = 1) -> str:
    """The samples as one JSON object."""
    time, angles, speeds = repeated(trajectory, periods)
    arrays = {"time_s": time.tolist(), "angles_rad": angles.tolist(), "speeds_rad_per_s": speeds.tolist()}
    return json.dumps({**facts, **arrays}) + "\n"


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line; returns the exit code."""
    return run(_parser(), _export, arguments)


def _export(options: argparse.Namespace) -> int:
    if options.periods < 1:
        raise ProblemError(f"--periods must be at least 1, not {options.periods}.")
    source = Path(options.result)
    solution = load(source)
    if not solution.problem.gait.free:
        raise ProblemError(f"{source} holds a prescribed motion of a smooth body: it has no joints to export.")
    check_trusted(solution, options.result)
    kind = output_kind(options, ("csv", "json"))
    path = output_path(options.output, source.with_suffix(f".{kind}"))
    limits = options.max_speed
    trajectory = timed(solution.gait, options.rate, options.period, None if limits is None else np.array(limits))
    facts = about(solution, trajectory, options.rate, limits)
    coordinate = solution.problem.body.coordinate
    if kind == "json":
        text = json_text(facts, trajectory, options.periods)
    else:
        text = csv_text(facts, trajectory, options.periods, coordinate)
    with replaced_file(path) as temporary:
        Path(temporary).write_text(text, encoding="utf-8")
    samples = trajectory.time.size * options.periods
    fastest = ", ".join(f"{speed:.3g}" for speed in facts["largest_speed_rad_per_s"])
    lines = [
        f"saved {path}: {samples} samples, period {trajectory.period:g} s",
        f"  {coordinate} speeds up to {fastest} rad/s; {facts['distance_per_period_body_lengths']:.4g} body lengths a period",
    ]
    if not solution.success:
        lines.append(f"  note: the result is not certified ({solution.status})")
    tell(options, {**facts, "file": str(path), "samples": samples}, lines)
    return OK
