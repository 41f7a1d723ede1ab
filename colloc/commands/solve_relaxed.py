"""What ``colloc solve`` does with a class of relaxed gaits: the relaxed optimum, and finite gaits that come near it."""

from __future__ import annotations

import argparse
import json
from pathlib import Path

from colloc.bounds.optimality_gap import gap_line, upper_bound
from colloc.commands.ending import FAILED, OK
from colloc.commands.finish import finished
from colloc.gaits.problem import Problem
from colloc.gaits.problem_file import ProblemFile, Reference
from colloc.results.relaxed_solution import RelaxedSolution
from colloc.results.relaxed_store import save_relaxed
from colloc.results.solution import SOLVED
from colloc.search.relaxed_search import RELAXED_STARTS, best_relaxed_gait
from colloc.system.errors import CollocError
from colloc.system.progress import StatusLine


def summary_lines(solution: RelaxedSolution, reference: Reference | None = None) -> list[str]:
    """What a person wants to know at the end."""
    relaxed, best = solution.certificate, solution.best
    lines = [
        f"{solution.problem.name}: {solution.status} in {solution.seconds:.1f} s",
        f"  efficiency d/W  {best.certificate.efficiency:.6f} +- {best.certificate.efficiency_error:.0e} by replay; "
        f"{best.certificate.efficiency_at_zero_delta:.6f} +- {best.certificate.error_at_zero_delta:.0e} for delta -> 0",
        f"  distance d      {best.certificate.distance:.6f}      work W  {best.certificate.work:.6f}      "
        f"at delta {solution.problem.delta:.0e}",
        f"  gait            polygon of {best.corners} corners, path {best.gait.length:.2f} rad",
        f"  relaxed         {relaxed.efficiency:.6f} +- {relaxed.efficiency_error:.0e} "
        f"({relaxed.efficiency_at_zero_delta:.6f} for delta -> 0): what finite gaits tend to, and none attains",
        f"  search          best of {solution.starts} starts"
        + "".join(f"; also met {e:.4f} (angles range over {a:.2g} rad)" for e, a in solution.others),
    ]
    for r in solution.realised:
        verdict = "certified" if r.certificate.passed else "FAILED: " + ", ".join(c.name for c in r.certificate.failures)
        lines.append(
            f"  {r.repeats:3d} repeats     {r.certificate.efficiency:.6f}, {r.corners} corners, distance "
            f"{r.certificate.distance:.4f}, {verdict}"
        )
    lines += [f"  {check.line()}" for check in relaxed.checks]
    if reference is not None:
        agrees = abs(relaxed.efficiency - reference.efficiency) <= reference.tolerance
        verdict = "agrees with" if agrees else "DIFFERS from"
        lines.append(f"  relaxed {verdict} {reference.efficiency:g} +- {reference.tolerance:g} ({reference.source})")
    return lines if not solution.message else [*lines, f"  {solution.message}"]


def summary_dict(solution: RelaxedSolution, path: Path, bound: float | None) -> dict:
    """The same as one JSON object."""
    relaxed = solution.certificate
    return {
        "name": solution.problem.name,
        "status": solution.status,
        "file": str(path),
        "problem_hash": solution.problem.hash,
        "seconds": solution.seconds,
        "delta": solution.problem.delta,
        "class": solution.problem.gait.describe(),
        "efficiency": solution.measured.efficiency,
        "distance": solution.measured.distance,
        "work": solution.measured.work,
        "corners": solution.best.corners,
        "relaxed": {"efficiency": relaxed.efficiency, "efficiency_at_zero_delta": relaxed.efficiency_at_zero_delta},
        "realised": [
            {
                "repeats": r.repeats,
                "corners": r.corners,
                "efficiency": r.certificate.efficiency,
                "distance": r.certificate.distance,
                "passed": r.certificate.passed,
            }
            for r in solution.realised
        ],
        "others": [{"efficiency": e, "extent": a} for e, a in solution.others],
        "bound": bound,
        "versions": solution.versions,
    }


def solve_relaxed(problem: Problem, stated: ProblemFile, path: Path, options: argparse.Namespace) -> int:
    """Solve, certify, save, draw and report; returns the exit code."""
    quiet = options.quiet or options.json
    with StatusLine(enabled=not quiet) as line:
        solution = best_relaxed_gait(
            problem, options.starts or stated.starts or RELAXED_STARTS, seconds=options.seconds,
            report=lambda what: line.say(f"{problem.name}: {what}"),
        )  # fmt: skip
    solution.source = stated.source
    if solution.status != SOLVED:
        path = path.with_suffix(".failed.h5")
    save_relaxed(solution, path)
    bound, complaints = None, []
    try:
        bound = upper_bound(problem, path.parent, compute=options.bound)
    except CollocError as error:  # what is solved is not lost for it
        complaints.append(f"no bound: {error}")
    if options.json:
        print(json.dumps(summary_dict(solution, path, None if bound is None else bound.sampled)), flush=True)
    else:
        lines = [*summary_lines(solution, stated.reference), gap_line(problem, solution.measured.efficiency, bound)]
        print("\n".join(lines), flush=True)

    def figure() -> object:
        from colloc.pictures.relaxed_figure import relaxed_figure

        return relaxed_figure(solution)

    return finished(options, path, [str(path)], complaints, figure, OK if solution.status == SOLVED else FAILED)
