"""Commands that end in one result, and its summary: solve, evaluate."""

from __future__ import annotations

import argparse
import math
import re
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from colloc.commands import options as cli
from colloc.commands.ending import BAD_PROBLEM, FAILED, NONE_FOUND, OK, naming_saved_files
from colloc.commands.ending import INTERRUPTED as CODE_INTERRUPTED
from colloc.gaits.gait_fields import fields
from colloc.gaits.inertia import Free
from colloc.gaits.objective import EFFICIENCY
from colloc.gaits.problem_file import Reference
from colloc.results import limit_use
from colloc.results.answer import EVALUATED, PRESCRIBED, REDUCED
from colloc.results.checks import Certificate
from colloc.results.solution import CERTIFICATE_FAILED, INTERRUPTED, NOT_CONVERGED, SOLVED, Solution
from colloc.system.errors import CollocError, NotConvergedError, StoreError
from colloc.system.progress import duration

if TYPE_CHECKING:
    from colloc.bounds.sampled import Bound
    from colloc.results.kept import Saved

_MANY_INTERVALS, _SECONDS_PER_INTERVAL = 1000, 0.02
_SEARCHES = ("reduced", "full")
EXIT = {
    SOLVED: OK,
    NOT_CONVERGED: NONE_FOUND,
    CERTIFICATE_FAILED: FAILED,
    INTERRUPTED: CODE_INTERRUPTED,
}


def save_and_tell(options: argparse.Namespace, solution: Solution, path: Path) -> int:
    """Save a solution and print its summary; returns the exit code."""
    from colloc.results.kept import save_result

    saved = save_result(solution, path)
    facts = {**summary_dict(solution, saved[0].path, None, None), "kept": kept_facts(saved)}
    lines = summary_lines(solution, None, verbose=options.verbose)
    cli.tell(options, facts, [*lines, f"  saved {saved[0].path}", *kept_lines(saved)])
    return EXIT[solution.status]


def summary_lines(
    solution: Solution, reference: Reference | None, *, verbose: bool = False
) -> list[str]:
    """Lines about a result for people; with `verbose` also the search, the gait and every check."""
    verdict = f"{solution.problem.name}: {solution.status} in {solution.seconds:.1f} s"
    certificate, best = solution.certificate, solution.problem.objective
    lines = [verdict]
    if certificate.replayed:
        alone = solution.answer.program in (PRESCRIBED, EVALUATED)
        lines = [
            verdict if alone else f"{verdict} ({solution.standing[0]})",
            f"  {best.label:<15s} {certificate.value:.6f} +- {certificate.value_error:.0e}, "
            f"re-simulated at {certificate.instants} time points; "
            f"{certificate.value_at_zero_delta:.6f} +- "
            f"{certificate.value_error_at_zero_delta:.0e} for delta -> 0",
            *_quantities(solution),
            f"  distance d      {certificate.distance:.6f} +- "
            f"{certificate.errors['distance']:.0e}      work W  {certificate.work:.6f} +- "
            f"{certificate.errors['work']:.0e}      at delta {solution.answer.delta:.0e}",
            *(_background(solution) if verbose else []),
            *_check_lines(certificate, verbose),
        ]
        if reference is not None:
            lines.append(f"  {reference.verdict(certificate.efficiency)}")
    if solution.message:
        lines.append(f"  {solution.message}")
    return lines


def _background(solution: Solution) -> list[str]:
    problem = solution.problem
    paced = f"; run in a period of 1, as {problem.paced_by}" if problem.paced_by else ""
    rows = [("search", text) for text in _search_lines(solution)]
    rows += [("scene", problem.scene)] if problem.scene else []
    rows += [("gait", f"class: {problem.gait.describe()}{paced}")]
    rows += [("gait", text) for text in solution.gait.lines()]
    return [f"  {name:<15s} {text}" for name, text in rows]


def _check_lines(certificate: Certificate, verbose: bool) -> list[str]:
    """Every check; or those that failed, and the one nearest to its tolerance of the others."""
    if verbose:
        return [f"  {check.line()}" for check in certificate.checks]
    lines = [f"  {check.line()}" for check in certificate.failures]
    passed = [check for check in certificate.checks if check.passed]
    if passed:
        nearest = max(passed, key=lambda check: abs(check.value) / max(check.threshold, 1e-300))
        every = "" if lines else "all "
        lines.insert(
            0,
            f"  {every}{len(passed)} checks passed (tightest: {nearest.name} "
            f"{abs(nearest.value):.1e}, tolerance {nearest.threshold:.0e})",
        )
    return lines


def _quantities(solution: Solution) -> list[str]:
    """Numbers of a period that matter to its objective and limits."""
    period, problem, rows = solution.certificate, solution.problem, []
    if problem.objective != EFFICIENCY:
        error = f"{period.efficiency_error:.0e}"
        rows.append((EFFICIENCY.label, f"{period.efficiency:.6f} +- {error}"))
    if period.dry is not None:
        low, high = period.dry
        rows.append(("dry friction", f"between {low:.8f} and {high:.8f}, with no delta"))
    for each in problem.integrals:
        rows.append((each.name.replace("_", " "), f"{period.values[each.name]:.6f}"))
    if isinstance(problem.froude, Free):
        pace, (low, high) = solution.froude, problem.froude
        ends = ((low, ", the slowest allowed"), (high, ", the fastest allowed"))
        end = next((text for x, text in ends if math.isclose(pace, x, rel_tol=1e-5)), "")
        rows.append(("pace", f"Froude number {pace:.4g}{end}"))
    with suppress(NotConvergedError):  # a body that slides down a slope
        if problem.froude:
            what = f"({problem.objective.short} of the same gait without inertia)"
            rows.append(("played slowly", f"{solution.played_slowly:.6f} {what}"))
    if (held := solution.share_held).any():
        shares = ", ".join(f"{100 * share:.0f}" for share in held)
        rows.append(("feet stick", f"during {shares} % of the period (tail to head)"))
    if (travels := solution.travels) != "head first":
        rows.append(("travels", travels))
    rows += [("limits", text) for text in limit_use.lines(solution)]
    if problem.rotation != 0:
        rows.append(("net rotation", f"{period.rotation:.6f} rad: {solution.turning}"))
    return [f"  {name:<15s} {text}" for name, text in rows]


def _search_lines(solution: Solution) -> list[str]:
    answer = solution.answer
    measured = f"measured on a mesh of {answer.edges.size - 1} intervals"
    if answer.program == PRESCRIBED:
        return [f"nothing is free: the motion is prescribed, {measured}"]
    if answer.program == EVALUATED:
        return [f"nothing is sought: the gait was given, {measured}"]
    rows = f"{answer.x.size} variables, {answer.lam_g.size} constraints"
    how = f"{answer.iterations} iterations of IPOPT" if answer.program != REDUCED else answer.status
    program = f"{solution.problem.formulation} program: {rows}, {how}"
    return [f"{program}, KKT error {answer.kkt_error:.0e}", *solution.standing]


def summary_dict(
    solution: Solution, path: Path | None, reference: Reference | None, bound: Bound | None
) -> dict:
    """A solution as one JSON object."""
    problem, answer, certificate = solution.problem, solution.answer, solution.certificate
    replayed = certificate.replayed
    numbers = ("value", "efficiency", "distance", "work", "travels")
    other = ("value", "delta", "starts", "on_speed_floor")
    stated = ("efficiency", "tolerance", "source")
    return {
        "name": problem.name,
        "status": solution.status,
        "message": solution.message,
        "file": None if path is None else str(path),
        "problem_hash": problem.hash,
        "seconds": solution.seconds,
        "delta": answer.delta,
        "objective": problem.objective.fields(),
        **{name: getattr(solution, name) for name in numbers},
        "iterations": sum(step.iterations for step in solution.history),
        "class": problem.gait.describe(),
        "program": answer.program,
        "variables": int(answer.x.size),
        "constraints": int(answer.lam_g.size),
        "kkt_error": answer.kkt_error,
        "starts": solution.starts,
        "shrunk": None if solution.shrunk is None else solution.shrunk.value,
        "limits": limit_use.shares(solution) if replayed else {},
        "feet_hold": solution.share_held.tolist() if replayed else [],
        "others": [{name: getattr(each, name) for name in other} for each in solution.others],
        "gait": fields(solution.gait),
        "certificate": certificate.facts() if replayed else None,
        "reference": reference and {name: getattr(reference, name) for name in stated},
        "bound": bound_facts(bound),
        "versions": solution.versions,
    }


def bound_facts(bound: Bound | None) -> dict | None:
    return None if bound is None else {"sampled": bound.sampled, "guaranteed": bound.guaranteed}


def kept_lines(saved: Sequence[Saved]) -> list[str]:
    return [f"  {one.why} is kept as {one.former}" for one in saved if one.former is not None]


def kept_facts(saved: Sequence[Saved]) -> list[str]:
    return [str(one.former) for one in saved if one.former is not None]


@cli.command(
    "solve",
    """\
A failed solve is kept as NAME.failed.h5, a former result of another problem called NAME, or a
better one of this problem, as NAME.former-1.h5. After Ctrl-C or a crash the same command goes on
from NAME.run.sqlite; Ctrl-C leaves the best gait so far in NAME.interrupted.h5.

  colloc solve problems/three_link.py --delta 1e-6 --output results/dry.h5
  colloc solve mine.py --start results/three_link.h5      begin with the gait of another result""",
    *cli.PROBLEM,
    cli.text("--start", "FILE.h5", "start from the gait of an earlier result"),
    cli.flag("--fresh", "do not go on from an interrupted run"),
    cli.output("folder, or .h5 file (default: results/NAME.h5)"),
    cli.count(
        "--starts", "N", "minimum number of starting points (default: 32); 1: the guess alone"
    ),
    cli.number("--seconds", "S", "wall time allowed; then the best gait so far counts", math.inf),
    cli.choice(
        "--search",
        _SEARCHES,
        "reduced: SQP on the gait's parameters, confirmed by IPOPT on the full program (default); "
        "full: IPOPT on the full program at every level of delta, from the guess alone",
        _SEARCHES[0],
    ),
    cli.BOUND,
    cli.flag("--dry", "certify it also under dry friction, with no delta (a second)"),
    cli.NO_FIGURE,
    cli.flag("--pdf", "draw NAME.pdf too"),
    cli.VERBOSE,
)
def solve(options: argparse.Namespace) -> int:
    cli.check_least(options, starts=1)
    cli.check_positive(options, "seconds")
    stated, problem = cli.read_problem(options)
    path = cli.output_path(options.output, Path("results") / f"{problem.name}.h5")
    # slow imports only now: a bad problem is refused at once
    from colloc.bounds.optimality_gap import gap_line, upper_bound
    from colloc.studies.saved import resume, save_and_clear

    if not cli.quiet(options) and problem.intervals > _MANY_INTERVALS:
        seconds = duration(_SECONDS_PER_INTERVAL * problem.intervals)
        cli.complain(
            f"{problem.intervals} intervals will take about {seconds} or more; mesh_tolerance "
            f"refines a small mesh where it has to be fine."
        )
    with cli.status_line(options) as line:
        solution = resume(
            replace(stated, problem=problem),
            path,
            # a gait that is given on the command line is to be improved
            starts=options.starts or (1 if options.start else stated.starts),
            progress=lambda news: line.say(f"{problem.name}: {news}"),
            **cli.values(options, "seconds", "search", "fresh"),
        )
    bound, complaints, saved, records = None, [], [], []
    if options.dry and solution.certificate.replayed:
        try:
            solution.certify_dry()
        except CollocError as error:  # what is solved is not lost for it
            complaints.append(f"no bounds under dry friction: {error}")
    try:
        records = save_and_clear(solution, path)
        path = records[0].path
        saved = [str(path), *(f"{one.path} (the gait that shrank)" for one in records[1:])]
    except StoreError as error:  # the result is printed all the same
        complaints.append(f"the result is not saved: {error}")
    with naming_saved_files(saved):
        with cli.status_line(options) as line:
            if options.bound:
                line.say("computing an upper bound on every gait")
            try:
                compute = options.bound and not solution.interrupted
                bound = upper_bound(problem, path.parent, compute=compute)
            except CollocError as error:
                complaints.append(f"no bound: {error}")
        facts = summary_dict(solution, path if saved else None, stated.reference, bound)
        lines = summary_lines(solution, stated.reference, verbose=options.verbose)
        gap = gap_line(problem, solution.measured.efficiency, bound, asked=options.bound)
        cli.tell(options, facts | {"kept": kept_facts(records)}, [*lines, gap])
        if saved and not options.no_figure and not solution.interrupted:
            from colloc.pictures.publication import solution_figure
            from colloc.pictures.style import save as save_figure

            with cli.status_line(options) as line:
                line.say("drawing")
                try:
                    figure, kinds = solution_figure(solution), ("png", "pdf")[: 1 + options.pdf]
                    saved += map(str, save_figure(figure, path.with_suffix(""), kinds))
                except CollocError as error:
                    complaints.append(f"no figure: {error}")
    if saved and not options.json:
        print("\n".join([f"  saved {', '.join(saved)}", *kept_lines(records)]))
    if solution.interrupted:
        complaints.append("interrupted; the same command goes on from there.")
    for complaint in complaints:
        cli.complain(complaint)
    return BAD_PROBLEM if complaints and not solution.interrupted else EXIT[solution.status]


@cli.command(
    "evaluate",
    """\
The file has a line for each time point: its time, then the angle of each joint. Columns are known
by their names (joint_1 at the tail, joint_2, ...; units as _deg, [deg], time_ms); without names
they go from tail to head. Angles are radians unless names or --degrees say otherwise. Errors
include the residual of the samples, with two standard deviations.

  colloc evaluate problems/three_link.py mine.csv                          results/mine-evaluated.h5
  colloc compare results/mine-evaluated.h5 results/three_link.h5""",
    cli.text("problem", None, "a Python file that states PROBLEM, for body, friction and limits"),
    cli.text("gait", "GAIT.csv", "times and joint angles"),
    cli.number("--period", "T", "in the file's unit of time (default: from repetition)"),
    cli.count("--harmonics", "N", "of the fit (default: as many as the samples determine)"),
    cli.flag("--degrees", "angles are degrees where names do not say what they are"),
    cli.output("folder or .h5 file (default: results/GAIT-evaluated.h5)"),
    cli.VERBOSE,
)
def evaluate(options: argparse.Namespace) -> int:
    from colloc.gaits.problem_file import read_problem_file
    from colloc.search.evaluate import evaluate as evaluate_gait

    problem = read_problem_file(options.problem).problem
    # not where the result is that it was exported from
    name = re.sub(r"[^A-Za-z0-9_.-]", "_", Path(options.gait).stem) + "-evaluated"
    settings = cli.values(options, "period", "harmonics", "degrees")
    solution = evaluate_gait(problem.with_(name=name), options.gait, **settings)
    path = cli.output_path(options.output, Path("results") / f"{name}.h5")
    return save_and_tell(options, solution, path)
