"""Command line: check a result again, from the file alone and without CasADi.

The gait is replayed anew by the NumPy solver, on other instants than before; optimality (KKT error,
violation) is what the solver recorded, since it takes derivatives of the whole program.
"""

from __future__ import annotations

import argparse
from dataclasses import replace

import numpy as np

from colloc.commands.ending import FAILED, OK, command
from colloc.commands.options import add_printing, add_result, new_parser, tell
from colloc.results.checks import Certificate
from colloc.results.solution import Solution
from colloc.results.store import load
from colloc.search.certify import certify
from colloc.system.errors import ProblemError
from colloc.system.progress import StatusLine

_EPILOG = """\
Exit codes: 0 certified; 2 bad file; 4 a check fails, or the certificate in the file says something
else.

CasADi is not needed: the gait in the file is replayed with the NumPy solver on a grid of instants
that no earlier replay used. KKT error and constraint violation are the solver's own record.

  colloc verify results/three_link.h5
  colloc verify results/three_link.h5 --tolerance 1e-8
  colloc verify results/three_link.h5 --dry"""
_TOLERANCE = 1e-6
_AGREEMENT, _SAME_SIZE = 3.0, 10.0
"""Certified and rechecked numbers may differ by so many times the sum of their estimated errors,
and 1e-9; these errors by so many times the smaller one, and the tolerance: replays on other
instants estimate them anew (measured: 2.2 and 8)."""
_MOST_INSTANTS = 100_000
_NUMBERS = (
    ("efficiency", "efficiency_error", "an efficiency"),
    ("value", "value_error", "a value"),
    ("distance", "distance_error", "a distance"),
    ("work", "work_error", "a work"),
    ("efficiency_at_zero_delta", "error_at_zero_delta", "an efficiency for delta -> 0"),
    ("value_at_zero_delta", "value_error_at_zero_delta", "a value for delta -> 0"),
    ("rotation", "", "a rotation"),
)
"""What a certificate states: its number, the error of it, and words. What has no error of its own
is known to the tolerance."""


def _parser() -> argparse.ArgumentParser:
    parser = new_parser(
        "verify", "Check a result again by independent replay, without CasADi.", _EPILOG
    )
    add_result(parser)
    parser.add_argument(
        "--tolerance",
        type=float,
        default=_TOLERANCE,
        metavar="TOL",
        help="of the replayed efficiency, relative",
    )
    parser.add_argument(
        "--dry", action="store_true", help="also bounds under dry friction, with no delta"
    )
    add_printing(parser)
    return parser


def disagreement(recorded: Certificate, now: Certificate, tolerance: float = _TOLERANCE) -> str:
    """A sentence if the certificate in a file is not what a new one says, in any of its numbers;
    empty if they agree."""
    if not recorded.replayed:
        return "the file holds no certificate."
    recorded, now = recorded.by_replay, now.by_replay  # what samples are off by is not found anew
    besides = [
        (name, "", f"a {name.replace('_', ' ')}")
        for name in recorded.values
        if name not in dict.fromkeys(n for n, *_ in _NUMBERS)
    ]
    for name, error, words in (*_NUMBERS, *besides):
        stated, found = recorded.numbers[name], now.numbers.get(name, float("nan"))
        own = max(tolerance, _TOLERANCE) * max(abs(found), 1.0)
        errors = [each.numbers[error] for each in (recorded, now)] if error else [own, 0.0]
        if error and not max(errors) <= _SAME_SIZE * min(errors) + own:
            return (
                f"the file certifies {words} with an error of {errors[0]:.0e}, where "
                f"{errors[1]:.0e} is found."
            )
        if not abs(found - stated) <= _AGREEMENT * sum(errors) + 1e-9:
            return (
                f"the file certifies {words} of {stated:.8f}, which is off by {stated - found:.1e}."
            )
    return _other_checks(recorded, now)


def _other_checks(recorded: Certificate, now: Certificate) -> str:
    """A sentence if a file's checks are not those of a new certificate, or end otherwise."""
    before, after = ({check.name: check for check in each.checks} for each in (recorded, now))
    if before.keys() != after.keys():
        missing = ", ".join(sorted(before.keys() ^ after.keys()))
        return f"the file's certificate has not the checks of a new one: {missing}."
    for name, check in before.items():
        if (
            name != "replay error" and check.threshold != after[name].threshold
        ):  # that one is as large as asked for
            return (
                f"the file allows {check.threshold:.0e} for the check {name!r}, and "
                f"{after[name].threshold:.0e} is allowed."
            )
    if recorded.passed and not now.passed:
        return "the file's certificate passed all checks, the new one does not."
    return ""


def _dry_disagreement(recorded: tuple[float, float] | None, now: tuple[float, float]) -> str:
    """A sentence if a file states other bounds under dry friction than there are; empty if it
    states none."""
    if recorded is None or np.allclose(recorded, now, rtol=_TOLERANCE, atol=0):
        return ""
    return (
        f"the file certifies between {recorded[0]:.8f} and {recorded[1]:.8f} under dry "
        f"friction, which is not what is found."
    )


def rechecked(solution: Solution, tolerance: float = _TOLERANCE) -> Solution:
    """The solution with a new certificate, on other instants than before; first- and second-order
    conditions are those that the answer states."""
    before = min(solution.certificate.instants or 1600, _MOST_INSTANTS)
    instants = 2 * (3 * before // 8) + 2
    certificate = certify(solution.answer, tolerance=tolerance, instants=instants)
    return replace(solution, certificate=certificate.with_samples(solution.certificate.of_samples))


@command(_parser)
def main(options: argparse.Namespace) -> int:
    if not 0 < options.tolerance < 1:
        raise ProblemError(f"--tolerance must lie between 0 and 1, not {options.tolerance:g}.")
    solution = load(options.result)
    with StatusLine(enabled=not (options.quiet or options.json)) as line:
        line.say(f"{solution.problem.name}: replaying")
        again = rechecked(solution, options.tolerance)
    certificate = again.certificate
    complaint = disagreement(solution.certificate, certificate, options.tolerance)
    good = certificate.passed and not complaint and solution.success
    facts = {
        "file": options.result, "objective": solution.problem.objective.name,
        "name": solution.problem.name,
        "certified": good, "complaint": complaint,
    }  # fmt: skip
    dry = solution.dry() if options.dry or solution.certificate.dry is not None else None
    if dry is not None:
        complaint = complaint or _dry_disagreement(solution.certificate.dry, dry.efficiency)
        good = good and not complaint
        facts |= {"dry": dry.facts(), "certified": good, "complaint": complaint}
    lines = [
        f"{solution.problem.name}: {'certified' if good else 'NOT CERTIFIED'}",
        f"  {solution.problem.objective.label:<15s} {certificate.value:.8f} +- "
        f"{certificate.value_error:.0e} by replay "
        f"({certificate.instants} instants)",
    ]
    if solution.certificate.replayed:
        recorded = solution.certificate
        lines.append(
            f"  in the file     {recorded.value:.8f} +- {recorded.value_error:.0e} "
            f"({recorded.instants} instants)"
        )
    if not options.quiet:
        lines += [f"  {check.line()}" for check in certificate.checks]
    if complaint:
        lines.append(f"  {complaint}")
    if solution.status != "solved" and certificate.passed:
        lines.append(f"  the solve itself ended as: {solution.status}. {solution.message}")
    if dry is not None:
        lines.append(f"  dry friction: {dry}")
    tell(options, {**facts, **certificate.facts()}, lines)
    return OK if good else FAILED
