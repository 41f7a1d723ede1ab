"""What is said of a solution at its end: lines for people, and one JSON object."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING

from colloc.gaits.gait_fields import fields
from colloc.gaits.objective import EFFICIENCY
from colloc.gaits.problem_file import Reference
from colloc.results import limit_use
from colloc.results.answer import EVALUATED, PRESCRIBED, REDUCED
from colloc.results.checks import Certificate
from colloc.results.solution import Solution
from colloc.system.errors import NotConvergedError

if TYPE_CHECKING:
    from colloc.bounds.sampled import Bound
    from colloc.results.kept import Saved


def summary_lines(
    solution: Solution, reference: Reference | None, *, verbose: bool = False
) -> list[str]:
    """What a person wants to know at the end: the result, whether the checks hold, and what failed;
    with `verbose` also the search, the gait and every check."""
    verdict = f"{solution.problem.name}: {solution.status} in {solution.seconds:.1f} s"
    certificate = solution.certificate
    lines = [verdict]
    if certificate.replayed:
        # what these are the best of, `_search_lines` tells
        alone = solution.answer.program in (PRESCRIBED, EVALUATED)
        best = solution.problem.objective
        lines = [
            verdict if alone else f"{verdict} ({solution.standing[0]})",
            f"  {best.label:<15s} {certificate.value:.6f} +- {certificate.value_error:.0e} by "
            f"independent replay "
            f"({certificate.instants} instants); {certificate.value_at_zero_delta:.6f} +- "
            f"{certificate.value_error_at_zero_delta:.0e} for delta -> 0",
            *_besides(solution),
            f"  distance d      {certificate.distance:.6f} +- "
            f"{certificate.errors['distance']:.0e}      "
            f"work W  {certificate.work:.6f} +- {certificate.errors['work']:.0e}      at delta "
            f"{solution.answer.delta:.0e}",
        ]
        lines += _background(solution) if verbose else []
        lines += _check_lines(certificate, verbose)
        if reference is not None:
            lines.append(f"  {reference.verdict(solution.certificate.efficiency)}")
    if solution.message:
        lines.append(f"  {solution.message}")
    return lines


def _background(solution: Solution) -> list[str]:
    """How the gait was found, where it moves, and the gait itself."""
    problem = solution.problem
    paced = f"; run in a period of 1, as {problem.paced_by}" if problem.paced_by else ""
    gait = [f"class: {problem.gait.describe()}{paced}", *solution.gait.lines()]
    return [
        *(f"  search          {text}" for text in _search_lines(solution)),
        *([f"  scene           {problem.scene}"] if problem.scene else []),
        *(f"  gait            {text}" for text in gait),
    ]


def _check_lines(certificate: Certificate, verbose: bool) -> list[str]:
    """Every check; or in one line that they hold, with the one that comes nearest to its limit, and
    those that fail."""
    if verbose:
        return [f"  {check.line()}" for check in certificate.checks]
    held = [check for check in certificate.checks if check.passed]
    nearest = max(
        held, key=lambda check: abs(check.value) / max(check.threshold, 1e-300), default=None
    )
    lines = [f"  {check.line()}" for check in certificate.failures]
    if nearest is not None:
        largest = (
            f"largest: {nearest.name}, {abs(nearest.value):.1e} where "
            f"{nearest.threshold:.0e} is allowed"
        )
        lines.insert(0, f"  {len(held)} checks hold ({largest})")
    return lines


def _besides(solution: Solution) -> list[str]:
    """What a period comes to that its objective, and what is asked for, make worth telling."""
    found, problem, lines = solution.certificate, solution.problem, []
    if problem.objective != EFFICIENCY:
        lines.append(
            f"  {EFFICIENCY.label:<15s} {found.efficiency:.6f} +- {found.efficiency_error:.0e}"
        )
    if found.dry is not None:
        lines.append(
            f"  dry friction    between {found.dry[0]:.8f} and {found.dry[1]:.8f}, with no delta"
        )
    lines += [
        f"  {each.name.replace('_', ' '):<15s} {found.values[each.name]:.6f}"
        for each in problem.integrals
    ]
    with suppress(NotConvergedError):  # of what a slope holds only while it moves
        if problem.froude:
            slowly = (
                f"{solution.played_slowly:.6f} ({problem.objective.short} of the same gait "
                f"without inertia)"
            )
            lines.append(f"  played slowly   {slowly}")
    if (held := solution.share_held).any():
        shares = ", ".join(f"{100 * share:.0f}" for share in held)
        lines.append(f"  feet hold       {shares} % of the period, from the tail")
    if (travels := solution.travels) != "head first":
        lines.append(f"  travels         {travels}")
    lines += [f"  limits          {text}" for text in limit_use.lines(solution)]
    if problem.rotation != 0:
        lines.append(f"  net rotation    {found.rotation:.6f} rad: {solution.turning}")
    return lines


def _search_lines(solution: Solution) -> list[str]:
    """What was solved last, and what the gait is the best of."""
    answer = solution.answer
    if answer.program == PRESCRIBED:
        return [
            f"nothing is free: the motion is prescribed, measured on a mesh of "
            f"{answer.edges.size - 1} intervals"
        ]
    if answer.program == EVALUATED:
        return [
            f"nothing is sought: the gait was given, measured on a mesh of {answer.edges.size - 1} "
            f"intervals"
        ]
    rows = f"{answer.x.size} variables, {answer.lam_g.size} constraints"
    how = f"{answer.iterations} iterations of IPOPT" if answer.program != REDUCED else answer.status
    lines = [
        f"{solution.problem.formulation} program: {rows}, {how}, KKT error {answer.kkt_error:.0e}"
    ]
    return [*lines, *solution.standing]


def summary_dict(
    solution: Solution, path: Path | None, reference: Reference | None, bound: Bound | None
) -> dict:
    """The same as one JSON object; without a path nothing is saved."""
    certificate = solution.certificate
    result: dict = {
        "name": solution.problem.name,
        "status": solution.status,
        "message": solution.message,
        "file": None if path is None else str(path),
        "problem_hash": solution.problem.hash,
        "seconds": solution.seconds,
        "delta": solution.answer.delta,
        "objective": solution.problem.objective.fields(),
        "value": solution.value,
        "efficiency": solution.efficiency,
        "distance": solution.distance,
        "work": solution.work,
        "travels": solution.travels,
        "iterations": sum(step.iterations for step in solution.history),
        "class": solution.problem.gait.describe(),
        "program": solution.answer.program,
        "variables": int(solution.answer.x.size),
        "constraints": int(solution.answer.lam_g.size),
        "kkt_error": solution.answer.kkt_error,
        "starts": solution.starts,
        "shrunk": None if solution.shrunk is None else solution.shrunk.value,
        "limits": limit_use.shares(solution) if certificate.replayed else {},
        "feet_hold": solution.share_held.tolist() if certificate.replayed else [],
        "others": [
            {
                "value": a.value,
                "delta": a.delta,
                "starts": a.starts,
                "on_speed_floor": a.on_speed_floor,
            }
            for a in solution.others
        ],
        "gait": fields(solution.gait),
        "certificate": certificate.facts() if certificate.replayed else None,
        "reference": None,
        "bound": bound_facts(bound),
        "versions": solution.versions,
    }
    if reference is not None:
        keys = ("efficiency", "tolerance", "source")
        result["reference"] = {key: getattr(reference, key) for key in keys}
    return result


def bound_facts(bound: Bound | None) -> dict | None:
    """An upper bound, if there is one, as the one JSON object states it."""
    return None if bound is None else {"sampled": bound.sampled, "guaranteed": bound.guaranteed}


def kept_lines(saved: Sequence[Saved]) -> list[str]:
    """What became of former results, for people."""
    return [f"  {one.why} is kept as {one.former}" for one in saved if one.former is not None]


def kept_facts(saved: Sequence[Saved]) -> list[str]:
    """Where former results are now, as the one JSON object lists them."""
    return [str(one.former) for one in saved if one.former is not None]
