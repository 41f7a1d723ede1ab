"""Commands about a result: verify (by a new replay with the NumPy solver at other instants; or
compare two), report, animate, export, robot, sensitivity."""

import argparse
from pathlib import Path
from typing import Any

import numpy as np

from colloc.commands import main as cli
from colloc.gaits.problem_file import read_problem_file
from colloc.pictures import render
from colloc.results.checks import Certificate
from colloc.results.comparison import compare, verdict
from colloc.results.robot import RobotSheet, stated_robot
from colloc.results.solution import Solution
from colloc.results.store import load
from colloc.search.certify import certify
from colloc.system.errors import ProblemError

DIFFERENT = 1
_TOLERANCE = 1e-6
# largest difference of numbers over the sum of their errors, and ratio of these (measured: 2.2, 8)
_AGREEMENT, _SAME_SIZE = 3.0, 10.0
_MOST_INSTANTS = 100_000
_ROBOT = ("length", "mass", "gravity", "period", "max_speed", "max_torque")
_REPLAY = cli.option(float, "--tolerance TOL", "relative, of the replayed efficiency", _TOLERANCE)
_DRY = cli.flag("--dry", "also bound the efficiency under dry friction, without smoothing")
_ERRORS = {
    **{name: f"{name}_error" for name in ("efficiency", "value", "distance", "work")},
    "efficiency_at_zero_delta": "error_at_zero_delta",
    "value_at_zero_delta": "value_error_at_zero_delta",
}
"""Numbers of a certificate that have an error of their own; for others the tolerance is taken."""
_ENDINGS = {
    "csv": "csv",
    "json": "json",
    "pulses": "csv",
    "ros": "yaml",
    "c": "h",
    "mjcf": "xml",
    "urdf": "urdf",
}
_BESIDE = "beside", {"metavar": "OTHER.h5", "nargs": "?", "help": "another result, shown beside it"}
_SERVO = tuple(
    cli.option(kind, f"--{name}", f"servos: {what}; one for all or one each", nargs="+")
    for kind, name, what in (
        (float, "neutral PULSE", "pulse of the straight joint (default: 1500)"),
        (float, "scale PULSES", "pulses per degree (default: 2000 for 180 degrees)"),
        (int, "sign SIGN", "1, or -1 where larger pulses turn clockwise"),
        (float, "clamp PULSE", "LOW HIGH (default: 500 2500, without --scale)"),
    )
)


def disagreement(recorded: Certificate, now: Certificate, tolerance: float = _TOLERANCE) -> str:
    """A sentence if the certificate in a file disagrees with a new one, else ""."""
    if not recorded.replayed:
        return "the file holds no certificate."
    recorded, now = recorded.by_replay, now.by_replay  # without the residual of samples
    for name in {**_ERRORS, "rotation": "", **recorded.values}:
        of_file, value = recorded.numbers[name], now.numbers.get(name, float("nan"))
        rounding, error = max(tolerance, _TOLERANCE) * max(abs(value), 1.0), _ERRORS.get(name)
        errors = [each.numbers[error] for each in (recorded, now)] if error else [rounding, 0.0]
        what = f"the file certifies {name.replace('_', ' ')} {of_file:.8f}"
        if error and not max(errors) <= _SAME_SIZE * min(errors) + rounding:
            return f"{what} with an error of {errors[0]:.0e}, where {errors[1]:.0e} is found."
        if not abs(value - of_file) <= _AGREEMENT * sum(errors) + 1e-9:
            return f"{what}, which is off by {of_file - value:.1e}."
    before, after = ({x.name: x.threshold for x in each.checks} for each in (recorded, now))
    if before.keys() != after.keys():
        missing = ", ".join(sorted(before.keys() ^ after.keys()))
        return f"the file's certificate lacks the checks {missing}."
    for name, limit in before.items():  # the replay error has the tolerance that is requested
        if name != "replay error" and limit != after[name]:
            allowed = f"and {after[name]:.0e} is allowed"
            return f"the file allows {limit:.0e} for the check {name!r}, {allowed}."
    if recorded.passed and not now.passed:
        return "the file's certificate passed all checks, the new one does not."
    return ""


@cli.command(
    cli.RESULT,
    _REPLAY,
    _DRY,
    cli.option(str, "--compare FILE.h5", "compare with this result, and replay neither"),
)
def verify(options: argparse.Namespace) -> int:
    if not 0 < options.tolerance < 1:
        raise ProblemError(f"--tolerance must lie between 0 and 1, not {options.tolerance:g}.")
    solution = load(options.result)
    if options.compare is not None:
        cli.refuse(options, "--compare replays neither result", _REPLAY, _DRY)
        return _compare(options, solution, load(options.compare))
    problem, recorded = solution.problem, solution.certificate
    with cli.status_line(options) as line:
        line.say(f"{problem.name}: replaying")
        before = min(recorded.instants or 1600, _MOST_INSTANTS)
        instants = 2 * (3 * before // 8) + 2  # others than any replay so far
        now = certify(solution.answer, tolerance=options.tolerance, instants=instants)
        now = now.with_samples(recorded.of_samples)
    complaint = disagreement(recorded, now, options.tolerance)
    dry = solution.dry() if options.dry or recorded.dry is not None else None
    former = recorded.dry if dry is not None and not complaint else None
    if former and not np.allclose(former, dry.efficiency, rtol=_TOLERANCE, atol=0):  # type: ignore[union-attr]
        complaint = (
            f"the file certifies between {former[0]:.8f} and {former[1]:.8f} under dry friction, "
            f"which is not what is found."
        )
    good = now.passed and not complaint and solution.success
    facts = {
        "file": options.result,
        "objective": problem.objective.name,
        "name": problem.name,
        "certified": good,
        "complaint": complaint,
        **({} if dry is None else {"dry": dry.facts()}),
    }
    more = {"now": now, "dry": dry, "checks": not options.quiet}
    text = render("verify.txt", f=facts, solution=solution, **more)
    cli.tell(options, facts | now.facts(), text.splitlines())
    return cli.OK if good else cli.FAILED


def _compare(options: argparse.Namespace, a: Solution, b: Solution) -> int:
    (same, sentence), (rows, changes) = verdict(a, b), compare(a, b)
    rows = [("", a.problem.name, b.problem.name), *rows]
    facts = {
        "same": same,
        "verdict": sentence,
        "results": {name.strip() or "name": [x, y] for name, x, y in rows},
        "problem": {name: [x, y] for name, x, y in changes},
    }
    lines = [("", Path(options.result).name, Path(options.compare).name), *rows]
    if changes and not options.quiet:
        lines += [("", "", ""), ("problem:", "", "")]
        lines += [(f"  {name}", x, y) for name, x, y in changes]
    widths = [max(len(line[k]) for line in lines) for k in range(2)]
    table = [f"{x:<{widths[0]}}  {y:<{widths[1]}}  {z}".rstrip() for x, y, z in lines]
    cli.tell(options, facts, [*table, sentence])
    return cli.OK if same else DIFFERENT


def _output_name(source: Path, other: str | Path | None, kind: str) -> Path:
    stem = f"{source.stem}-{Path(other).stem}" if other else source.stem
    return source.with_name(stem + kind)


def _write(path: Path) -> tuple[dict[str, Any], str]:
    size = path.stat().st_size
    return {"status": "written", "file": str(path), "bytes": size}, f"{size / 1000:.0f} kB"


@cli.command(
    cli.RESULT,
    _BESIDE,
    cli.option(
        str, "--problem FILE.py", "problem file with the REFERENCE to compare the result with"
    ),
    cli.flag("--figures", "also write publication figures, PDF and PNG, one panel each"),
    *cli.ROBOT,
    *(cli.PERIOD, cli.MAX_SPEED, cli.MAX_TORQUE),
    cli.output("folder, or .html file (default: beside the result)"),
)
def report(options: argparse.Namespace) -> int:
    from colloc.pictures.report_page import write_report
    from colloc.studies.families import read_front

    source = Path(options.result)
    solution = load(source)
    beside = load(options.beside) if options.beside else None
    path = cli.output_path(options, _output_name(source, options.beside, ".html"))
    reference = read_problem_file(options.problem).reference if options.problem else None
    arguments = stated_robot(solution, **cli.values(options, *_ROBOT))
    robot = RobotSheet(solution, **arguments) if arguments else None
    table, front, figures = source.with_suffix(".front.csv"), None, list[str]()
    if table.exists():
        front = read_front(table, solution.problem)
        if front is None:
            cli.complain(f"{table} is about another problem, and left out.")
    with cli.status_line(options) as line:
        line.say("writing the page")
        sections = {"robot": robot, "front": front, "beside": beside}
        write_report(solution, path, reference, source.parent, **sections)
        if options.figures:
            from colloc.pictures.figure import save_panels

            line.say("drawing the figures")
            figures = [*map(str, save_panels(solution, path.with_suffix("")))]
    facts, kilobytes = _write(path)
    lines = [f"saved {path} ({kilobytes}, self-contained)", *(f"  {each}" for each in figures)]
    cli.tell(options, facts | {"figures": figures}, lines)
    return cli.OK


@cli.command(
    cli.RESULT,
    _BESIDE,
    cli.option(
        str, "--format", "default: by the suffix of --output, else gif", choices=("gif", "mp4")
    ),
    cli.option(int, "--periods N", "cycles in a row (default: 2)", 2, least=1),
    cli.option(float, "--seconds S", "seconds per cycle (default: the robot's, or 4)", least=0),
    cli.option(float, "--fps N", "frames per second (default: 20)", 20.0, least=0),
    cli.option(int, "--width PIXELS", "default: 900", 900),
    cli.flag("--from-rest", "with inertia: the first cycles of a body that starts at rest"),
    cli.flag("--no-arrows", "do not draw friction"),
    cli.output("folder or file (default: beside the result)"),
)
def animate(options: argparse.Namespace) -> int:
    source = Path(options.result)
    solution, other = load(source), options.beside and Path(options.beside)
    beside = load(other) if other else None
    path = cli.output_path(options, _output_name(source, other, ".gif"), ("gif", "mp4"))
    from colloc.pictures.movie import write_movie

    settings = cli.values(options, "periods", "seconds", "fps", "width", "from_rest")
    settings |= {"arrows": not options.no_arrows, "quiet": cli.quiet(options)}
    names = (source.stem, other.stem) if other else ()
    write_movie(solution, path, **settings, beside=beside, names=names)
    facts, kilobytes = _write(path)
    cli.tell(options, facts, [f"saved {path} ({kilobytes})"])
    return cli.OK


@cli.command(
    cli.RESULT,
    cli.option(float, "--rate HZ", "samples a second (default: 50)", 50.0),
    cli.PERIOD,
    cli.MAX_SPEED,
    *cli.ROBOT,
    cli.option(int, "--periods N", "repeat the cycle N times (default: 1)", 1),
    ("--ramp", {
        "action": argparse.BooleanOptionalAction, "default": True,
        "help": "begin straight, at rest, before time 0 (default)",
    }),
    cli.option(
        str, "--format", "default: --output's, else csv",
        choices=tuple(_ENDINGS)),
    cli.flag("--degrees", "instead of radians, in CSV and JSON"),
    *_SERVO,
    cli.output("folder or file (default: beside the result)"),
)  # fmt: skip
def export(options: argparse.Namespace) -> int:
    from colloc.pictures.export import Servo

    source = Path(options.result)
    solution = load(source)
    of_servo = cli.options_given(options, "neutral", "scale", "sign", "clamp")
    pulses = options.format == "pulses" or of_servo
    servo = Servo(**of_servo) if pulses else None
    options.format = _ENDINGS.get(options.format)
    beside = source.with_suffix(".pulses.csv") if pulses else source
    path = cli.output_path(options, beside, [*dict.fromkeys(_ENDINGS.values())])
    names = ("period", "max_speed", "rate", "periods", "ramp", "degrees")
    settings = cli.values(options, *names, "length", "mass", "gravity")
    facts = solution.export(path, **settings, servo=servo) | {"file": str(path)}
    if "samples_per_period" in facts:
        facts["samples"] = facts["samples_per_period"] * options.periods
    text = render("export.txt", f=facts, solution=solution, periods=options.periods)
    cli.tell(options, facts, text.splitlines())
    return cli.OK


@cli.command(
    cli.RESULT,
    *cli.ROBOT,
    *(cli.PERIOD, cli.MAX_SPEED, cli.MAX_TORQUE),
    cli.flag("--figure", "also draw torque, speed and power over time"),
    cli.output("folder or .png file of the figure (default: beside the result)"),
)
def robot(options: argparse.Namespace) -> int:
    source = Path(options.result)
    sheet = load(source).robot(**cli.values(options, *_ROBOT))
    facts, lines = dict(sheet.facts), str(sheet).splitlines()
    if options.figure or options.output:
        path = cli.output_path(options, source.with_suffix(".robot.png"))
        from colloc.pictures.style import save

        save(sheet.plot(), path.with_suffix(""), kinds=("png",))
        facts["figure"] = str(path)
        lines.append(f"saved {path}")
    cli.tell(options, facts | {"notes": sheet.sentences()}, lines)
    return cli.OK


@cli.command(cli.RESULT, cli.flag("--again", "also re-optimise for each change, and compare"))
def sensitivity(options: argparse.Namespace) -> int:
    solution = load(options.result)
    with cli.status_line(options) as line:
        if options.again:
            line.say(f"{solution.problem.name}: re-optimising")
        slopes = solution.sensitivity(resolve=options.again)
    cli.tell(options, {"file": options.result, **slopes.facts()}, str(slopes).splitlines())
    return cli.OK
