"""What is said of a solution at its end: lines for people, and one JSON object."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from colloc.gaits.gait_fields import fields
from colloc.gaits.objective import EFFICIENCY
from colloc.gaits.problem_file import Reference
from colloc.results.solution import Solution
from colloc.results.steps import PRESCRIBED, REALISED, REDUCED

if TYPE_CHECKING:
    from colloc.bounds.sampled import Bound


def summary_lines(solution: Solution, reference: Reference | None) -> list[str]:
    """What a person wants to know at the end."""
    lines = [f"{solution.problem.name}: {solution.status} in {solution.seconds:.1f} s"]
    certificate = solution.certificate
    best = solution.problem.objective
    if certificate.replayed:
        lines += [
            f"  {best.label:<15s} {certificate.value:.6f} +- {certificate.value_error:.0e} by independent replay "
            f"({certificate.instants} instants); {certificate.value_at_zero_delta:.6f} +- "
            f"{certificate.value_error_at_zero_delta:.0e} for delta -> 0",
            *_besides(solution),
            f"  distance d      {certificate.distance:.6f} +- {certificate.distance_error:.0e}      "
            f"work W  {certificate.work:.6f} +- {certificate.work_error:.0e}      at delta {solution.last.delta:.0e}",
        ]
        lines += [f"  search          {text}" for text in _search_lines(solution)]
        reason = solution.problem.paced_by
        paced = f"; run in a period of 1, as {reason}" if reason else ""
        lines += [] if solution.problem.slope is None else [f"  ground          {solution.problem.slope.describe()}"]
        gait = [f"class: {solution.problem.gait.describe()}{paced}", *solution.gait.lines()]
        lines += [f"  gait            {text}" for text in gait]
        lines += [f"  {check.line()}" for check in certificate.checks]
        if solution.relaxed is not None:
            lines += [f"  relaxed         {text}" for text in solution.relaxed.lines()]
            lines += [f"  {check.line()}" for check in solution.relaxed.certificate.checks]
        if reference is not None:
            lines.append(f"  {reference.verdict(solution.tends_to.efficiency)}")
    if solution.message:
        lines.append(f"  {solution.message}")
    return lines


def _besides(solution: Solution) -> list[str]:
    """What a period comes to that its objective, and what is asked for, make worth telling."""
    found, problem, lines = solution.certificate, solution.problem, []
    if problem.objective != EFFICIENCY:
        lines.append(f"  {EFFICIENCY.label:<15s} {found.efficiency:.6f} +- {found.efficiency_error:.0e}")
    if problem.uses("length"):
        lines.append(f"  path length L   {found.length:.6f} rad")
    if problem.uses("driven_work"):
        lines.append(f"  driven work W+  {found.driven_work:.6f}")
    if problem.rotation != 0:
        lines.append(f"  net rotation    {found.rotation:.6f} rad: {solution.turning}")
    return lines


def _search_lines(solution: Solution) -> list[str]:
    """What was solved last, and what the gait is the best of."""
    level = solution.last
    if level.program == PRESCRIBED:
        return [f"nothing is free: the motion is prescribed, measured on a mesh of {level.edges.size - 1} intervals"]
    if level.program == REALISED:
        intervals = level.edges.size - 1
        return [f"a polygon that repeats what a relaxed gait mixes, measured on {intervals} intervals", *solution.standing]
    rows = f"{level.x.size} variables, {level.lam_g.size} constraints"
    how = f"{level.iterations} iterations of IPOPT" if level.program != REDUCED else level.status
    lines = [f"{solution.problem.formulation} program: {rows}, {how}, KKT error {level.kkt_error:.0e}"]
    return [*lines, *solution.standing]


def summary_dict(solution: Solution, path: Path, reference: Reference | None, bound: Bound | None) -> dict:
    """The same as one JSON object."""
    certificate = solution.certificate
    result: dict = {
        "name": solution.problem.name,
        "status": solution.status,
        "message": solution.message,
        "file": str(path),
        "problem_hash": solution.problem.hash,
        "seconds": solution.seconds,
        "delta": solution.last.delta,
        "objective": solution.problem.objective.fields(),
        "value": solution.value,
        "efficiency": solution.efficiency,
        "distance": solution.distance,
        "work": solution.work,
        "iterations": sum(level.iterations for level in solution.levels),
        "class": solution.problem.gait.describe(),
        "program": solution.last.program,
        "variables": int(solution.last.x.size),
        "constraints": int(solution.last.lam_g.size),
        "kkt_error": solution.last.kkt_error,
        "starts": solution.starts,
        "finite": None if solution.finite is None else solution.finite.value,
        "relaxed": _relaxed_dict(solution),
        "others": [
            {"value": a.value, "delta": a.delta, "starts": a.starts, "on_speed_floor": a.on_speed_floor}
            for a in solution.others
        ],
        "gait": fields(solution.gait),
        "certificate": certificate.facts() if certificate.replayed else None,
        "reference": None,
        "bound": None if bound is None else {"sampled": bound.sampled, "guaranteed": bound.guaranteed},
        "versions": solution.versions,
    }
    if reference is not None:
        keys = ("efficiency", "tolerance", "source")
        result["reference"] = {key: getattr(reference, key) for key in keys}
    return result


def _relaxed_dict(solution: Solution) -> dict | None:
    """The relaxed gait and the finite ones near it."""
    if solution.relaxed is None:
        return None
    found = solution.relaxed.certificate
    keys = ("efficiency", "efficiency_error", "efficiency_at_zero_delta", "distance", "passed")
    finite = [
        {"repeats": r.repeats, "corners": r.corners, **{key: getattr(r.certificate, key) for key in keys}}
        for r in solution.relaxed.realised
    ]
    return {**{key: getattr(found, key) for key in keys}, "realised": finite}
