"""Commands verify, by a new replay with the NumPy solver at other instants, and compare.

KKT error and constraint violation are the solver's record: they need derivatives of the program.
"""

from __future__ import annotations

import argparse
import json
from dataclasses import replace
from pathlib import Path

import numpy as np

from colloc.commands import options as cli
from colloc.commands.ending import FAILED, OK
from colloc.gaits.objective import EFFICIENCY
from colloc.results.checks import Certificate
from colloc.results.distinct_optima import SAME_GAIT, SAME_VALUE, distance, fourier_series
from colloc.results.solution import Solution
from colloc.results.store import load
from colloc.search.certify import certify
from colloc.system.errors import ProblemError

DIFFERENT = 1
_TOLERANCE = 1e-6
# largest difference of numbers over the sum of their errors, and ratio of these (measured: 2.2, 8)
_AGREEMENT, _SAME_SIZE = 3.0, 10.0
_MOST_INSTANTS = 100_000
_NUMBERS = {
    "efficiency": ("efficiency_error", "an efficiency"),
    "value": ("value_error", "a value"),
    "distance": ("distance_error", "a distance"),
    "work": ("work_error", "a work"),
    "efficiency_at_zero_delta": ("error_at_zero_delta", "an efficiency for delta -> 0"),
    "value_at_zero_delta": ("value_error_at_zero_delta", "a value for delta -> 0"),
    "rotation": ("", "a rotation"),
}
"""Numbers of a certificate: the name of the error (else the tolerance is taken), and words."""


def disagreement(recorded: Certificate, now: Certificate, tolerance: float = _TOLERANCE) -> str:
    """A sentence if the certificate in a file disagrees with a new one, else ""."""
    if not recorded.replayed:
        return "the file holds no certificate."
    recorded, now = recorded.by_replay, now.by_replay  # without the residual of samples
    others = (name for name in recorded.values if name not in _NUMBERS)
    numbers = _NUMBERS | {name: ("", f"a {name.replace('_', ' ')}") for name in others}
    for name, (error, words) in numbers.items():
        stated, value = recorded.numbers[name], now.numbers.get(name, float("nan"))
        rounding = max(tolerance, _TOLERANCE) * max(abs(value), 1.0)
        errors = [each.numbers[error] for each in (recorded, now)] if error else [rounding, 0.0]
        if error and not max(errors) <= _SAME_SIZE * min(errors) + rounding:
            return (
                f"the file certifies {words} with an error of {errors[0]:.0e}, where "
                f"{errors[1]:.0e} is found."
            )
        if not abs(value - stated) <= _AGREEMENT * sum(errors) + 1e-9:
            return (
                f"the file certifies {words} of {stated:.8f}, which is off by {stated - value:.1e}."
            )
    before, after = ({x.name: x.threshold for x in each.checks} for each in (recorded, now))
    if before.keys() != after.keys():
        missing = ", ".join(sorted(before.keys() ^ after.keys()))
        return f"the file's certificate has not the checks of a new one: {missing}."
    for name, limit in before.items():  # the replay error has the tolerance that is requested
        if name != "replay error" and limit != after[name]:
            allowed = f"and {after[name]:.0e} is allowed"
            return f"the file allows {limit:.0e} for the check {name!r}, {allowed}."
    if recorded.passed and not now.passed:
        return "the file's certificate passed all checks, the new one does not."
    return ""


def recheck_certificate(solution: Solution, tolerance: float = _TOLERANCE) -> Solution:
    """The solution with a new certificate at other instants."""
    before = min(solution.certificate.instants or 1600, _MOST_INSTANTS)
    instants = 2 * (3 * before // 8) + 2
    certificate = certify(solution.answer, tolerance=tolerance, instants=instants)
    return replace(solution, certificate=certificate.with_samples(solution.certificate.of_samples))


@cli.command(
    "verify",
    """\
The gait in the file is replayed with the NumPy solver on a grid of instants that no earlier replay
used. KKT error and constraint violation are the solver's own record.

  colloc verify results/three_link.h5 --tolerance 1e-8""",
    cli.RESULT,
    cli.number("--tolerance", "TOL", "of the replayed efficiency, relative", _TOLERANCE),
    cli.flag("--dry", "also bounds under dry friction, with no delta"),
)
def verify(options: argparse.Namespace) -> int:
    if not 0 < options.tolerance < 1:
        raise ProblemError(f"--tolerance must lie between 0 and 1, not {options.tolerance:g}.")
    solution = load(options.result)
    problem, recorded = solution.problem, solution.certificate
    with cli.status_line(options) as line:
        line.say(f"{problem.name}: replaying")
        now = recheck_certificate(solution, options.tolerance).certificate
    complaint = disagreement(recorded, now, options.tolerance)
    dry = solution.dry() if options.dry or recorded.dry is not None else None
    stated = recorded.dry if dry is not None and not complaint else None
    if stated and not np.allclose(stated, dry.efficiency, rtol=_TOLERANCE, atol=0):  # type: ignore[union-attr]
        complaint = (
            f"the file certifies between {stated[0]:.8f} and {stated[1]:.8f} under dry friction, "
            f"which is not what is found."
        )
    good = now.passed and not complaint and solution.success
    lines = [
        f"{problem.name}: {'certified' if good else 'NOT CERTIFIED'}",
        f"  {problem.objective.label:<15s} {now.value:.8f} +- {now.value_error:.0e} by replay "
        f"({now.instants} instants)",
    ]
    if recorded.replayed:
        value = f"{recorded.value:.8f} +- {recorded.value_error:.0e}"
        lines.append(f"  in the file     {value} ({recorded.instants} instants)")
    if not options.quiet:
        lines += [f"  {check.line()}" for check in now.checks]
    if complaint:
        lines.append(f"  {complaint}")
    if solution.status != "solved" and now.passed:
        lines.append(f"  the solve itself ended as: {solution.status}. {solution.message}")
    if dry is not None:
        lines.append(f"  dry friction: {dry}")
    facts = {
        "file": options.result,
        "objective": problem.objective.name,
        "name": problem.name,
        "certified": good,
        "complaint": complaint,
        **({} if dry is None else {"dry": dry.facts()}),
    }
    cli.tell(options, facts | now.facts(), lines)
    return OK if good else FAILED


def gait_distance(a: Solution, b: Solution) -> float | None:
    """R.m.s. distance [rad] of two gaits of a body, minimised over phase and symmetries."""
    if a.problem.body != b.problem.body:
        return None
    law = b.problem.law if a.problem.law.reversible else a.problem.law
    first, second = (fourier_series(each.problem, each.gait) for each in (a, b))
    return distance(first, second, a.problem.body, law)


def verdict(a: Solution, b: Solution) -> tuple[bool, str]:
    """True if two results are the same optimum, and a sentence."""
    what, other = a.problem.objective, b.problem.objective
    if other != what:
        return False, f"other objectives: {what.name} and {other.name}."
    values = [each.measured.value for each in (a, b)]
    difference = abs(values[0] - values[1]) / max(*map(abs, values), 1e-300)
    values_of = "efficiencies" if what == EFFICIENCY else f"values of {what.name}"
    differ = f"{values_of} differ by {100 * difference:.3g} %"
    apart = gait_distance(a, b)
    if apart is None:
        return False, f"other bodies; {differ}."
    same = difference <= SAME_VALUE and apart < SAME_GAIT
    angles = f"joint angles by {apart:.3g} rad (root mean square)"
    return same, f"{'the same optimum' if same else 'different'}: {differ}, {angles}."


def _short(value: object) -> str:
    text = json.dumps(value)
    return text if len(text) <= 44 else text[:41] + "..."


def _outcome(solution: Solution) -> dict[str, str]:
    answer, certificate, measured = solution.answer, solution.certificate, solution.measured
    error, value_error, limit = " (not replayed)", "-", "-"
    if certificate.replayed:
        error = f" +- {certificate.efficiency_error:.0e}"
        value_error = f"{certificate.value_error:.0e}"
        limit = f"{certificate.efficiency_at_zero_delta:.6f}"
    return {
        "": solution.problem.name,
        "status": solution.status,
        "objective": solution.problem.objective.name,
        "value": f"{measured.value:.6f}",
        "  error": value_error,
        "efficiency": f"{measured.efficiency:.6f}{error}",
        "  at delta -> 0": limit,
        "distance d": f"{measured.distance:.6f}",
        "work W": f"{measured.work:.6f}",
        "delta": f"{answer.delta:.1e}",
        "intervals": str(answer.edges.size - 1),
        "iterations": str(sum(step.iterations for step in solution.history)),
        "seconds": f"{solution.seconds:.1f}",
    }


@cli.command(
    "compare",
    """\
Joint angles are compared at the start phase and the symmetry of body and friction (mirror image,
other end, reversed in time) for which they are nearest.

  colloc compare results/a.h5 results/b.h5""",
    cli.text("first", "A.h5", "a result that colloc solve wrote"),
    cli.text("second", "B.h5", "another one"),
)
def compare(options: argparse.Namespace) -> int:
    a, b = load(options.first), load(options.second)
    same, sentence = verdict(a, b)
    one, two = a.problem.to_dict(), b.problem.to_dict()
    names = [name for name in {**one, **two} if one.get(name) != two.get(name)]
    changes = [(name, _short(one.get(name)), _short(two.get(name))) for name in names]
    second = _outcome(b)
    rows = [(name, value, second[name]) for name, value in _outcome(a).items()]
    facts = {
        "same": same,
        "verdict": sentence,
        "results": {name.strip() or "name": [x, y] for name, x, y in rows},
        "problem": {name: [x, y] for name, x, y in changes},
    }
    lines = [("", Path(options.first).name, Path(options.second).name), *rows]
    if changes and not options.quiet:
        lines += [("", "", ""), ("problem:", "", "")]
        lines += [(f"  {name}", x, y) for name, x, y in changes]
    widths = [max(len(line[k]) for line in lines) for k in range(2)]
    table = [f"{x:<{widths[0]}}  {y:<{widths[1]}}  {z}".rstrip() for x, y, z in lines]
    cli.tell(options, facts, [*table, sentence])
    return OK if same else DIFFERENT
