"""Commands that end in a problem file or in one result, and its summary: init, solve, evaluate,
identify; and families of gaits as commands save them."""

from __future__ import annotations

import argparse
import csv
import io
import math
import re
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import asdict, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from colloc.commands import main as cli
from colloc.gaits.gait_fields import fields
from colloc.gaits.objective import EFFICIENCY
from colloc.gaits.problem_file import ProblemFile, Reference, read_problem_file
from colloc.gaits.regime import Free
from colloc.gaits.robot import Robot
from colloc.mechanics.chain import Chain
from colloc.pictures import render
from colloc.results.robot import in_si, limit_lines, limit_shares
from colloc.results.solution import CERTIFICATE_FAILED, INTERRUPTED, NOT_CONVERGED, SOLVED, Solution
from colloc.results.store import SavedFile, save_result
from colloc.system.errors import CollocError, NotConvergedError, ProblemError
from colloc.system.files import write_text
from colloc.system.progress import duration

if TYPE_CHECKING:
    from colloc.bounds.sampled import Bound
    from colloc.gaits.robot_model import Model
    from colloc.studies.families import ParetoFront

_ROLLING = 0.05  # resistance of a small wheel on a plain bearing, over its load
_FEWEST, _MOST, _LONGER = 3, 12, 1e6  # links, and the longest over the shortest
_LARGEST, _ALIKE = 3.14, 1e-6  # angle of a joint [rad], difference of like densities
_MANY_INTERVALS, _SECONDS_PER_INTERVAL = 1000, 0.02
EXIT = {
    SOLVED: cli.OK,
    NOT_CONVERGED: cli.NONE_FOUND,
    CERTIFICATE_FAILED: cli.FAILED,
    INTERRUPTED: cli.INTERRUPTED,
}
_OF_A_ROBOT = ["length", "mass", "period", "max_speed", "max_torque", "idle_power", "backlash"]


@cli.command(
    cli.option(Path, "problem FILE.py", "the file to write"),
    cli.option(
        float,
        "--links N",
        f"equal links (default: {_FEWEST}); or their lengths, tail to head, in any unit",
        nargs="+",
    ),
    cli.option(Path, "--from FILE", "URDF or MJCF of the robot, a planar chain"),
    cli.option(int, "--feet N", "feet on each link (default: none, links lie flat)"),
    cli.flag("--wheels", "a wheel in the middle of each link"),
    cli.option(float, "--mu MU", "coefficient of friction (default: the file's, or 1)", least=0),
    cli.in_units("joint_limit", f" (default: {_LARGEST})"),
    *map(cli.in_units, _OF_A_ROBOT[:2]),
    cli.in_units("period", "; or the shortest and the longest to search", nargs="+"),
    *map(cli.in_units, _OF_A_ROBOT[3:]),
)
def init(options: argparse.Namespace) -> int:
    path: Path = options.problem
    source: Path | None = getattr(options, "from")
    for one, other in (("feet", "wheels"), ("from", "links")):
        if getattr(options, one) is not None and getattr(options, other):
            raise ProblemError(f"--{one} and --{other} exclude each other; see colloc init --help.")
    model: Model | None = None
    lengths = options.links or [float(_FEWEST)]
    if source is not None:
        from colloc.gaits.robot_model import read_model

        model = read_model(source)
        lengths = model.lengths
    elif len(lengths) == 1:
        if not lengths[0].is_integer():
            raise ProblemError(f"--links must be a whole number of links, not {lengths[0]:g}.")
        lengths = [1.0] * max(0, min(int(lengths[0]), _MOST + 1))
    if not _FEWEST <= (links := len(lengths)) <= _MOST:
        more = " or more" * (links > _MOST)
        raise ProblemError(f"a chain must have {_FEWEST} to {_MOST} links here, not {links}{more}.")
    whole = math.fsum(lengths)
    if not (math.isfinite(whole) and 0 < max(lengths) <= _LONGER * min(lengths)):
        raise ProblemError(
            f"lengths of links must be positive numbers, the longest at most {_LONGER:g} times the "
            f"shortest, not {', '.join(f'{length:g}' for length in lengths)}."
        )
    if path.suffix != ".py":
        raise ProblemError(f"a problem file is a Python file: {path.name} should end in .py.")
    mu = options.mu or (model and model.mu) or 1.0
    robot, wheels = _stated_robot(options, model), bool(options.wheels)
    feet, most = options.feet or "", options.joint_limit or 0.0
    if most > math.pi:
        raise ProblemError(
            f"--joint-limit is at most pi [rad], not {most:g}; write degrees as 85deg."
        )
    if model and model.feet and not (wheels or feet):
        feet = f"({', '.join(model.feet)})".format(mu=mu, rolling=_ROLLING)
    limit, weights = f"{options.joint_limit or _LARGEST:.6g}", list[float]()
    symmetric = lengths == lengths[::-1]
    if model:
        densities = [m / x for m, x in zip(model.masses, lengths, strict=False)]
        if densities and max(densities) > (1 + _ALIKE) * min(densities):
            weights = model.masses
        if options.joint_limit is None:
            each = [f"{b:.6g}" if a == -b else f"({a:.6g}, {b:.6g})" for a, b in model.limits]
            limit = each[0] if len({*each}) == 1 else f"({', '.join(each)})"
        # a body with more to it may differ from both ends
        symmetric &= not model.feet and not weights and "(" not in limit
    smallest = min(mu, _ROLLING) if wheels or "Wheel(" in str(feet) else mu
    has_inertia = bool(robot) and Robot(**robot).dimensionless(0.0, smallest)["froude"] != 0
    try:
        with path.open("x", encoding="utf-8") as file:
            file.write(
                render(
                    "problem.txt", path=path, model=model, source=source and source.name,
                    lengths=lengths, weights=weights, wheels=wheels, rolling=_ROLLING, mu=mu,
                    feet=feet, limit=limit,
                    robot=_stated(robot), known=_stated(_known(model) if not robot else {}),
                    symmetry="bilateral" if symmetric and not has_inertia else "none",
                )
            )  # fmt: skip
    except FileExistsError:
        raise ProblemError(f"{path} is there already; choose another name.") from None
    try:
        read_problem_file(path)
    except ProblemError as error:
        path.unlink()
        raise ProblemError(re.sub(r".*, line \d+: ", "", str(error))) from None
    facts: dict[str, Any] = {"status": "written", "file": str(path), "links": links}
    lines = [f"wrote {path}: a problem of {links} links. Change it, then: colloc solve {path}"]
    if model:
        notes = [x for x in model.notes if options.mu is None or "--mu" not in x]
        if not (wheels or feet):
            notes.append("no wheels or feet found: links lie on the floor (--feet, --wheels)")
        facts |= {"joints": model.joints, "notes": notes}
        lines += [f"  {x}" for x in (f"angles in {source}: {model.joints}", *notes)]
    cli.tell(options, facts, lines)
    return cli.OK


def _stated(values: dict[str, Any]) -> str:
    return ", ".join(f"{name}={value!r}" for name, value in values.items())


def _known(model: Model | None) -> dict[str, Any]:
    if model is None:
        return {}
    whole = {"length": [math.fsum(model.lengths)], "mass": [math.fsum(model.masses)]}
    each = whole | {"max_speed": model.max_speed, "max_torque": model.max_torque}
    rows = {name: [float(f"{x:.9g}") for x in values] for name, values in each.items()}
    return {x: y[0] if len({*y}) == 1 else y for x, y in rows.items() if y and min(y) > 0}


def _stated_robot(options: argparse.Namespace, model: Model | None) -> dict[str, Any]:
    robot = cli.options_given(options, *_OF_A_ROBOT)
    if not robot:
        return {}
    robot = _known(model) | robot
    if missing := [f"--{name}" for name in _OF_A_ROBOT[:3] if name not in robot]:
        raise ProblemError(
            f"a robot in SI units needs --length, --mass, --period; missing: {', '.join(missing)}."
        )
    period = robot["period"]
    robot["period"] = period[0] if len(period) == 1 else tuple(period)
    return robot


def save_and_tell(options: argparse.Namespace, solution: Solution, path: Path) -> int:
    """Save a solution and print its summary; returns the exit code."""
    saved = save_result(solution, path)
    facts = summary_dict(solution, saved[0].path, None, None)
    lines = summary_lines(solution, None, verbose=options.verbose)
    cli.tell(options, facts, [*lines, f"  saved {saved[0].path}"], saved)
    return EXIT[solution.status]


def summary_lines(
    solution: Solution, reference: Reference | None, *, verbose: bool = False
) -> list[str]:
    """Lines about a result for people; with `verbose` also the search, the gait and every check."""
    problem, pace, slowly, moves = solution.problem, None, None, list[float]()
    replayed = solution.certificate.replayed
    if isinstance(problem.froude, Free):
        ends = zip(problem.froude, (", the slowest allowed", ", the fastest allowed"), strict=True)
        at_end = (text for x, text in ends if math.isclose(solution.froude, x, rel_tol=1e-5))
        pace = solution.froude, next(at_end, "")
    if problem.froude and replayed:
        with suppress(NotConvergedError):  # a body that slides down a slope
            slowly = solution.played_slowly, *solution.cycles_from_rest
    if isinstance(problem.body, Chain) and problem.gait.free:
        moves = [math.degrees(swing) for swing in solution.swings]
    return render(
        "summary.txt", solution=solution, reference=reference, verbose=verbose, slowly=slowly,
        si=in_si(solution), limits=limit_lines(solution) if replayed else [], pace=pace,
        moves=moves, whole=lambda row: ", ".join(f"{x:.0f}" for x in row), efficiency=EFFICIENCY,
    ).splitlines()  # fmt: skip


def summary_dict(
    solution: Solution, path: Path | None, reference: Reference | None, bound: Bound | None
) -> dict:
    problem, answer, certificate = solution.problem, solution.answer, solution.certificate
    replayed = certificate.replayed
    plain = {
        solution: "status message seconds value efficiency distance work travels starts versions",
        answer: "delta program kkt_error",
    }
    other = ("value", "delta", "starts", "on_speed_floor")
    return {
        "name": problem.name,
        "file": None if path is None else str(path),
        "problem_hash": problem.hash,
        "objective": problem.objective.fields(),
        **{name: getattr(each, name) for each, names in plain.items() for name in names.split()},
        "iterations": sum(step.iterations for step in solution.history),
        "class": problem.gait.describe(),
        "variables": int(answer.x.size),
        "constraints": int(answer.lam_g.size),
        "shrunk": None if solution.shrunk is None else solution.shrunk.value,
        "limits": limit_shares(solution) if replayed else {},
        "robot": in_si(solution),
        "swings_rad": solution.swings.tolist() if problem.gait.free else [],
        "tiny": solution.is_tiny,
        "feet_hold": solution.share_held.tolist() if replayed else [],
        "others": [{name: getattr(each, name) for name in other} for each in solution.others],
        "gait": fields(solution.gait),
        "certificate": certificate.facts() if replayed else None,
        "reference": reference
        and {name: getattr(reference, name) for name in ("efficiency", "tolerance", "source")},
        "bound": bound_facts(bound),
    }


def bound_facts(bound: Bound | None) -> dict | None:
    return None if bound is None else {"sampled": bound.sampled, "guaranteed": bound.guaranteed}


@cli.command(
    *cli.PROBLEM,
    cli.option(str, "--start FILE.h5", "start from the gait of an earlier result"),
    cli.flag("--fresh", "do not resume an interrupted run"),
    cli.output("folder, or .h5 file (default: results/NAME.h5)"),
    cli.option(
        int,
        "--starts N",
        "minimum number of starting points (default: 32); 1: the guess alone",
        least=1,
    ),
    cli.option(
        float, "--seconds S", "stop after this time with the best gait so far", math.inf, least=0
    ),
    cli.option(
        str,
        "--search",
        "reduced: SQP on the gait's parameters, confirmed by IPOPT on the full program (default); "
        "full: IPOPT on the full program at every level of delta, from the guess alone",
        "reduced",
        choices=("reduced", "full"),
    ),
    cli.BOUND,
    cli.flag("--dry", "also certify under dry friction, without smoothing (a second)"),
    cli.flag("--front", "also the front to the farthest gait: NAME.front.csv, NAME.front/"),
    cli.NO_FIGURE,
    cli.flag("--pdf", "draw NAME.pdf too"),
    cli.VERBOSE,
)
def solve(options: argparse.Namespace) -> int:
    file, problem = cli.read_problem(options, options.start)
    path = cli.output_path(options, Path("results") / f"{problem.name}.h5")
    from colloc.bounds.optimality_gap import gap_line, upper_bound
    from colloc.studies.solve import resume, save_and_clear

    complaints: list[str] = []

    @contextmanager
    def complaining(what: str) -> Iterator[None]:
        try:
            yield
        except CollocError as error:  # what is solved is not lost for it
            complaints.append(f"{what}: {error}")

    if not cli.quiet(options) and problem.intervals > _MANY_INTERVALS:
        seconds = duration(_SECONDS_PER_INTERVAL * problem.intervals)
        cli.complain(
            f"{problem.intervals} intervals will take about {seconds} or more; mesh_tolerance "
            f"refines a small mesh where it has to be fine."
        )
    with cli.status_line(options) as line:
        solution = resume(
            replace(file, problem=problem),
            path,
            # a gait that is given on the command line is to be improved
            starts=options.starts or (1 if options.start else file.starts),
            progress=lambda news: line.say(f"{problem.name}: {news}"),
            **cli.values(options, "seconds", "search", "fresh"),
        )
    bound, saved, records, ended = None, list[str](), list[SavedFile](), not solution.interrupted
    if options.dry and solution.certificate.replayed:
        with complaining("no bounds under dry friction"):
            solution.certify_dry()
    with complaining("the result is not saved"):
        records = save_and_clear(solution, path)
        path = records[0].path
        saved = [str(path), *(f"{one.path} (the gait that shrank)" for one in records[1:])]
    with cli.naming_saved_files(saved):
        with cli.status_line(options) as line, complaining("no bound"):
            if options.bound:
                line.say("computing an upper bound on every gait")
            bound = upper_bound(problem, path.parent, compute=options.bound and ended)
        facts = summary_dict(solution, path if saved else None, file.reference, bound)
        lines = summary_lines(solution, file.reference, verbose=options.verbose)
        gap = gap_line(problem, solution.measured.efficiency, bound, asked=options.bound)
        if not options.json:
            cli.tell(options, facts, [*lines, gap], records)
        if saved and not options.no_figure and ended:
            from colloc.pictures.style import save as save_figure

            with cli.status_line(options) as line, complaining("no figure"):
                line.say("drawing")
                figure, kinds = solution.plot(), ("png", "pdf")[: 1 + options.pdf]
                saved += map(str, save_figure(figure, path.with_suffix(""), kinds))
        if saved and not options.json:
            print(f"  saved {', '.join(saved)}", flush=True)
        if options.front and not solution.success:
            cli.complain("no front, as the answer is not verified.")
        elif options.front:
            from colloc.search.options import OPTIONS

            with complaining("no front"):
                how = {"best": solution, "starts": options.starts or OPTIONS.reach_starts}
                table = path.with_suffix(".front.csv")
                _, facts["front"], lines, more = find_front(options, file, table, **how)
                records += more
                if not options.json:
                    cli.tell(options, facts, lines, more)
        if options.json:
            cli.tell(options, facts, [], records)
    if not ended:
        complaints.append("interrupted; the same command goes on from there.")
    for complaint in complaints:
        cli.complain(complaint)
    return cli.BAD_PROBLEM if complaints and ended else EXIT[solution.status]


_OF_A_GAIT = (
    cli.option(str, "problem", "a Python file that states PROBLEM, for body, friction and limits"),
    cli.option(str, "gait GAIT.csv", "times and joint angles"),
    cli.option(float, "--period T", "in the file's unit of time (default: from repetition)"),
    cli.option(int, "--harmonics N", "of the fit (default: as many as the samples determine)"),
    cli.flag("--degrees", "angles without a unit are in degrees"),
)


@cli.command(
    *_OF_A_GAIT, cli.output("folder or .h5 file (default: results/GAIT-evaluated.h5)"), cli.VERBOSE
)
def evaluate(options: argparse.Namespace) -> int:
    from colloc.search.evaluate import evaluate as evaluate_gait

    problem = read_problem_file(options.problem).problem
    # not where the result is that it was exported from
    name = re.sub(r"[^A-Za-z0-9_.-]", "_", Path(options.gait).stem) + "-evaluated"
    settings = cli.values(options, "period", "harmonics", "degrees")
    solution = evaluate_gait(problem.with_(name=name), options.gait, **settings)
    path = cli.output_path(options, Path("results") / f"{name}.h5")
    return save_and_tell(options, solution, path)


@cli.command(
    *_OF_A_GAIT,
    cli.LENGTH,
    cli.option(float, "--mu-forward MU", "the forward coefficient, measured separately", least=0),
)
def identify(options: argparse.Namespace) -> int:
    from colloc.search.evaluate import identify as identify_friction

    problem = read_problem_file(options.problem).problem
    names = ("period", "harmonics", "degrees", "length", "mu_forward")
    with cli.status_line(options) as line:
        line.say(f"{problem.name}: identifying friction")
        result = identify_friction(problem, options.gait, **cli.values(options, *names))
    cli.tell(options, result.facts(), [f"{problem.name}: {result.message}", str(result)])
    return cli.OK


FamilyResult = tuple[Any, dict[str, Any], list[str], list[SavedFile]]
"""A family, facts about it, lines for people, and what is saved."""


def find_family(
    options: argparse.Namespace,
    file: ProblemFile,
    table: Path,
    find: Callable[[Callable[..., None]], Any],
    describe: Callable[[Any, dict[Path, Solution]], tuple[str, dict[str, Any], list[str]]],
) -> FamilyResult:
    """Find a family, save its members and its table, and draw it.

    `find` is called with what shows progress. From the family and its members by their paths
    `describe` gives the text of the table, facts, and lines for people.
    """
    from colloc.studies.solve import checkpoints_in

    members, saved, name = dict[Path, Solution](), list[SavedFile](), file.problem.name
    with checkpoints_in(table.with_suffix("")):
        with cli.status_line(options) as line:

            def say(what, point=None):
                value = point and f": {point.problem.objective.short} = {point.value:.6g}"
                line.say(f"{name}: {what}{value or ''}")

            family = find(say)
        members_by_name = {f"{k:02d}": point for k, point in enumerate(family.points)}
        if spot := getattr(family, "on_the_spot", None):
            members_by_name |= {f"spot_{k:02d}": point for k, point in enumerate(spot.points)}
        for stem, solution in members_by_name.items():
            solution.source = file.source
            saved += (one := save_result(solution, table.with_suffix("") / f"{stem}.h5"))
            members[one[0].path] = solution
        content, facts, lines = describe(family, members)
        write_text(table, content)
        points, files = f", {next(iter(members))} ...", [table]
        if not options.no_figure:
            from colloc.pictures.style import save as save_figure

            with cli.naming_saved_files([f"{table}{points}"]):
                files += save_figure(family.plot(), table.with_suffix(""), ("png",))
        last = f"  saved {', '.join(map(str, files))}{points}"
    return family, facts | {"file": str(table)}, [f"{name}: {lines[0]}", *lines[1:], last], saved


def find_front(
    options: argparse.Namespace, file: ProblemFile, table: Path, **how: Any
) -> FamilyResult:
    """Find, save and draw a front, by arguments of `colloc.pareto_front`."""
    from colloc.studies.families import pareto_front

    def find(say):
        def report(k, point):
            say(f"gait {k} of the front", point)

        say("the ends of the front")
        return pareto_front(file.problem, **how, progress=report)

    return find_family(options, file, table, find, _front_table)


def _front_table(
    front: ParetoFront, members: dict[Path, Solution]
) -> tuple[str, dict[str, Any], list[str]]:
    (names, in_units), gaps = front.in_units, {gap.after: gap for gap in front.gaps}
    aims, rows = [aim.expression for aim in front.objectives], list[dict[str, Any]]()
    every = zip(members.items(), front.values.tolist(), in_units.tolist(), strict=True)
    for k, ((path, point), values, numbers) in enumerate(every):
        both = zip((*aims, *names), (*values, *numbers), strict=True)
        rows.append(
            {"point": k}
            | {name: x for name, x in both if name in aims or numbers != values}
            | {name: getattr(point, name) for name in ("distance", "work", "status")}
            | {"file": str(path), "gap": gaps[k].why if k in gaps else ""}
        )
    content = io.StringIO(newline="")
    writer = csv.DictWriter(content, rows[0])
    writer.writeheader()
    writer.writerows(rows)
    facts = {
        "objectives": [aim.fields() for aim in front.objectives],
        "points": rows,
        "gaps": [asdict(gap) for gap in front.gaps],
    }
    table: Any = {"names": names, "shown": in_units.tolist(), "gaps": gaps}
    text = render("front.txt", front=front, members=members, **table)
    return content.getvalue(), facts, text.splitlines()
