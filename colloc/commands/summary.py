"""The end of a command about a solution: lines for people, and one JSON object."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING

from colloc.commands import ending
from colloc.commands.ending import FAILED, NONE_FOUND, OK
from colloc.commands.options import tell
from colloc.gaits.gait_fields import fields
from colloc.gaits.objective import EFFICIENCY
from colloc.gaits.problem_file import Reference
from colloc.results import limit_use
from colloc.results.answer import EVALUATED, PRESCRIBED, REDUCED
from colloc.results.checks import Certificate
from colloc.results.solution import CERTIFICATE_FAILED, INTERRUPTED, NOT_CONVERGED, SOLVED, Solution
from colloc.system.errors import NotConvergedError

if TYPE_CHECKING:
    from colloc.bounds.sampled import Bound
    from colloc.results.kept import Saved

EXIT = {
    SOLVED: OK,
    NOT_CONVERGED: NONE_FOUND,
    CERTIFICATE_FAILED: FAILED,
    INTERRUPTED: ending.INTERRUPTED,
}


def save_and_tell(options: argparse.Namespace, solution: Solution, path: Path) -> int:
    """Save a solution and print its summary; returns the exit code."""
    from colloc.results.kept import save_result

    saved = save_result(solution, path)
    facts = {**summary_dict(solution, saved[0].path, None, None), "kept": kept_facts(saved)}
    lines = summary_lines(solution, None, verbose=options.verbose)
    tell(options, facts, [*lines, f"  saved {saved[0].path}", *kept_lines(saved)])
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
