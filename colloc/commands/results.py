"""Commands about a result: report, animate, export, robot, sensitivity."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from colloc.commands import options as cli
from colloc.commands.ending import OK
from colloc.results.solution import Solution
from colloc.results.store import load
from colloc.system.errors import ProblemError

_PACE = ("period", "max_speed", "max_torque")


def _write(path: Path) -> tuple[dict[str, Any], str]:
    size = path.stat().st_size
    return {"status": "written", "file": str(path), "bytes": size}, f"{size / 1000:.0f} kB"


@cli.command(
    "report",
    """\
The page needs no network and no other file. Results that failed get one too.

  colloc report results/three_link.h5                 results/three_link.html
  colloc report results/three_link.h5 --length 1.2 --mass 3 --period 5   of a robot""",
    cli.RESULT,
    cli.text("--problem", "FILE.py", "problem file with the REFERENCE to compare the result with"),
    cli.flag("--figures", "also write publication figures, PDF and PNG, one panel each"),
    *cli.ROBOT,
    *(cli.PERIOD, cli.MAX_SPEED, cli.MAX_TORQUE),
    cli.output("folder, or .html file (default: beside the result)"),
)
def report(options: argparse.Namespace) -> int:
    from colloc.gaits.problem_file import read_problem_file
    from colloc.pictures.report_page import write_report
    from colloc.results.robot import Robot

    source = Path(options.result)
    solution = load(source)
    path = cli.output_path(options.output, source.with_suffix(".html"))
    reference = read_problem_file(options.problem).reference if options.problem else None
    size, pace, robot = cli.robot_size(options), cli.values(options, *_PACE), None
    if size or any(value is not None for value in pace.values()):
        if not size or options.period is None:
            raise ProblemError("the page of a robot needs --length, --mass and --period.")
        robot = Robot(solution, **size, **pace)
    figures: list[str] = []
    with cli.status_line(options) as line:
        line.say("writing the page")
        write_report(solution, path, reference, source.parent, robot=robot)
        if options.figures:
            from colloc.pictures.publication import save_panels

            line.say("drawing the figures")
            figures = [*map(str, save_panels(solution, path.with_suffix("")))]
    facts, kilobytes = _write(path)
    lines = [f"saved {path} ({kilobytes}, self-contained)", *(f"  {each}" for each in figures)]
    cli.tell(options, facts | {"figures": figures}, lines)
    return OK


@cli.command(
    "animate",
    """\
Orange arrows are the friction on the links; the large disc is the head; the small plane shows the
first two joint angles.

  colloc animate results/three_link.h5                            results/three_link.gif
  colloc animate results/three_link.h5 --format mp4 --fps 50      needs ffmpeg""",
    cli.RESULT,
    cli.choice("--format", ("gif", "mp4"), "default: by the suffix of --output, else gif"),
    cli.count("--periods", "N", "periods in a row (default: 2)", 2),
    cli.number("--seconds", "S", "per period (default: 4)", 4.0),
    cli.number("--fps", "N", "frames per second (default: 20)", 20.0),
    cli.count("--width", "PIXELS", "default: 900", 900),
    cli.flag("--from-rest", "with inertia: the first periods of a body that starts at rest"),
    cli.flag("--no-arrows", "do not draw friction"),
    cli.output("folder or file (default: beside the result)"),
)
def animate(options: argparse.Namespace) -> int:
    source = Path(options.result)
    solution = load(source)
    kind = cli.output_kind(options, ("gif", "mp4"))
    path = cli.output_path(options.output, source.with_suffix(f".{kind}"))
    # slow imports only now: a bad option is refused at once
    from colloc.pictures.movie import write_movie

    settings = cli.values(options, "periods", "seconds", "fps", "width", "from_rest")
    write_movie(solution, path, **settings, arrows=not options.no_arrows, quiet=cli.quiet(options))
    facts, kilobytes = _write(path)
    cli.tell(options, facts, [f"saved {path} ({kilobytes})"])
    return OK


@cli.command(
    "export",
    """\
With --max-speed the path is retimed as evenly as the limits allow; without --period as fast as they
allow. Where the pace matters (drag, power limits) the gait's own timing is kept and the period
stretched. The period is a whole number of samples; the cycle repeats after the last one. Samples
before time 0 lead from the straight body, at rest, into the gait.

  colloc export results/three_link.h5 --period 4                          50 samples a second
  colloc export results/three_link.h5 --max-speed 2.0 1.0 --rate 100      as fast as they allow
  colloc export results/three_link.h5 --period 5 --length 1.2 --mass 3    with torques, powers
  colloc export results/three_link.h5 --period 5 --length 1.2 --mass 3 --format mjcf    for MuJoCo

Columns: time_s, joint_1_rad, ..., joint_1_rad_per_s, ..., joint_1_N_m, ..., joint_1_W, ... (mode_1
of a smooth body). Joints count from tail to head; angles are positive counter-clockwise.""",
    cli.RESULT,
    cli.number("--rate", "HZ", "samples a second (default: 50)", 50.0),
    cli.PERIOD,
    cli.MAX_SPEED,
    *cli.ROBOT,
    cli.count("--periods", "N", "repeat the period N times (default: 1)", 1),
    cli.text(
        "--ramp", None, "begin straight, at rest, before time 0 (default)", default=True,
        action=argparse.BooleanOptionalAction,
    ),
    cli.choice("--format", ("csv", "json", "mjcf", "urdf"), "default: --output's, else csv"),
    cli.output("folder or file (default: beside the result)"),
)  # fmt: skip
def export(options: argparse.Namespace) -> int:
    source = Path(options.result)
    solution = load(source)
    options.format = "xml" if options.format == "mjcf" else options.format
    kind = cli.output_kind(options, ("csv", "json", "xml", "urdf"))
    path = cli.output_path(options.output, source.with_suffix(f".{kind}"))
    settings = cli.values(options, "period", "max_speed", "rate", "periods", "ramp")
    facts = solution.export(path, **settings, **cli.robot_size(options)) | {"file": str(path)}
    if kind in ("xml", "urdf"):
        lines = [
            f"saved {path}: a robot of {facts['length_m']:g} m and {facts['mass_kg']:g} kg; "
            f"its joint angles: --format csv"
        ]
        if (moves := facts.get("moves_body_lengths_per_period")) is not None:
            lines.append(
                f"  colloc has it move {moves:.4g} body lengths a period on its floor, with inertia"
            )
        lines += [f"  note: {facts['note']}"] if "note" in facts else []
    else:
        facts["samples"] = facts["samples_per_period"] * options.periods
        lines = _trajectory_lines(solution, facts, options.periods)
    cli.tell(options, facts, lines)
    return OK


def _trajectory_lines(solution: Solution, facts: dict[str, Any], periods: int) -> list[str]:
    fastest = ", ".join(f"{speed:.3g}" for speed in facts["largest_speed_rad_per_s"])
    lines = [
        f"saved {facts['file']}: {facts['samples']} samples, period {facts['period_s']:g} s",
        f"  {solution.gait.motor_gait.coordinate} speeds up to {fastest} rad/s; "
        f"{facts['distance_per_period_body_lengths']:.4g} body lengths a period",
    ]
    if "ramp_s" in facts:
        lines.append(
            f"  {facts['ramp_s']:g} s before time 0 lead from straight, at rest, into the gait "
            f"(--no-ramp leaves them out)"
        )
    if "end_body_lengths" in facts:
        x, y = (facts.get("length_m", 1.0) * place for place in facts["end_body_lengths"])
        unit = "m" if "length_m" in facts else "body lengths"
        ahead, aside = "ahead" if x >= 0 else "behind", "left" if y >= 0 else "right"
        how = "with inertia" if facts["end_includes_inertia"] else "in slow motion"
        lines.append(
            f"  after {periods} period{'s' * (periods > 1)} its centre is {abs(x):.3g} {unit} "
            f"{ahead} and {abs(y):.3g} to the {aside} of where it was straight, its tail link "
            f"turned by {facts['end_turned_deg']:.3g}° ({how})"
        )
    if solution.turning:
        lines.append(f"  {solution.turning}")
    if "pace" in facts:
        lines.append(f"  pace: {facts['pace']}")
    if not solution.success:
        lines.append(f"  note: the result is not certified ({solution.status})")
    return lines


@cli.command(
    "robot",
    """\
Numbers include inertia at the period that is given.

  colloc robot results/three_link.h5 --length 1.2 --mass 3 --period 5 --max-torque 2.5 2.0""",
    cli.RESULT,
    *(
        (name, settings | {"required": True})
        for name, settings in (cli.LENGTH, cli.MASS, cli.PERIOD)
    ),
    *(cli.ROBOT[-1], cli.MAX_SPEED, cli.MAX_TORQUE),
    cli.flag("--figure", "also draw torque, speed and power over time"),
    cli.output("folder or .png file of the figure (default: beside the result)"),
)
def robot(options: argparse.Namespace) -> int:
    from colloc.results.robot import Robot

    source = Path(options.result)
    sheet = Robot(load(source), **cli.robot_size(options), **cli.values(options, *_PACE))
    facts, lines = dict(sheet.facts), sheet.lines()
    if options.figure or options.output:
        path = cli.output_path(options.output, source.with_suffix(".robot.png"))
        from colloc.pictures.style import save

        save(sheet.plot(), path.with_suffix(""), kinds=("png",))
        facts["figure"] = str(path)
        lines.append(f"saved {path}")
    cli.tell(options, facts | {"notes": sheet.sentences()}, lines)
    return OK


@cli.command(
    "sensitivity",
    """\
The slope is the exact derivative at the optimum. With --again every number is made a tenth smaller
and larger and the gait re-optimised, a second or two each.

  colloc sensitivity results/three_link.h5 --again""",
    cli.RESULT,
    cli.flag("--again", "also re-optimise there, and compare with this gait"),
)
def sensitivity(options: argparse.Namespace) -> int:
    solution = load(options.result)
    with cli.status_line(options) as line:
        if options.again:
            line.say(f"{solution.problem.name}: re-optimising")
        slopes = solution.sensitivity(resolve=options.again)
    cli.tell(options, {"file": options.result, **slopes.facts()}, slopes.lines())
    return OK
