"""Command line: two results side by side: what was asked, what came out, and whether it is the same
gait."""

from __future__ import annotations

import argparse
import json
from pathlib import Path

from colloc.commands.ending import OK, command
from colloc.commands.options import add_printing, new_parser, tell
from colloc.gaits.objective import EFFICIENCY
from colloc.results.distinct_optima import SAME_GAIT, SAME_VALUE, distance, fourier_series
from colloc.results.solution import Solution
from colloc.results.store import load

DIFFERENT = 1
_EPILOG = """\
Joint angles are compared at the start phase, and in the mirror image, where they are nearest; of a
symmetric body also named from the other end, under friction that is the same both ways also run
backwards. Exit codes: 0 the same optimum; 1 different; 2 bad file.

  colloc compare results/a.h5 results/b.h5"""


def gait_distance(a: Solution, b: Solution) -> float | None:
    """Root-mean-square distance [rad] of the joint angles of two gaits, where start phase and the
    symmetries of body and friction bring them nearest; None for other bodies."""
    if a.problem.body != b.problem.body:
        return None
    law = b.problem.law if a.problem.law.reversible else a.problem.law
    first, second = (fourier_series(each.problem, each.gait) for each in (a, b))
    return distance(first, second, a.problem.body, law)


def changed_fields(a: Solution, b: Solution) -> list[tuple[str, str, str]]:
    """Fields of the two problems that differ, as text."""
    first, second = a.problem.to_dict(), b.problem.to_dict()
    names = [name for name in {**first, **second} if first.get(name) != second.get(name)]
    return [(name, _short(first.get(name)), _short(second.get(name))) for name in names]


def _short(value: object) -> str:
    text = json.dumps(value)
    return text if len(text) <= 44 else text[:41] + "..."


def rows(a: Solution, b: Solution) -> list[tuple[str, str, str]]:
    """What came out, as text: name, first, second."""
    first, second = _outcome(a), _outcome(b)
    return [
        ("", a.problem.name, b.problem.name),
        *((name, text, second[name]) for name, text in first.items()),
    ]


def _outcome(solution: Solution) -> dict[str, str]:
    answer, certificate, measured = solution.answer, solution.certificate, solution.measured
    error = f" +- {certificate.efficiency_error:.0e}" if certificate.replayed else " (not replayed)"
    return {
        "status": solution.status,
        "objective": solution.problem.objective.name,
        "value": f"{measured.value:.6f}",
        "  error": f"{certificate.value_error:.0e}" if certificate.replayed else "-",
        "efficiency": f"{measured.efficiency:.6f}{error}",
        "  at delta -> 0": f"{certificate.efficiency_at_zero_delta:.6f}"
        if certificate.replayed
        else "-",
        "distance d": f"{measured.distance:.6f}",
        "work W": f"{measured.work:.6f}",
        "delta": f"{answer.delta:.1e}",
        "intervals": str(answer.edges.size - 1),
        "iterations": str(sum(step.iterations for step in solution.history)),
        "seconds": f"{solution.seconds:.1f}",
    }


def verdict(a: Solution, b: Solution) -> tuple[bool, str]:
    """Whether the two are the same optimum, and why, in a sentence."""
    what = a.problem.objective
    if b.problem.objective != what:
        return False, f"other objectives: {what.name} and {b.problem.objective.name}."
    values = [s.measured.value for s in (a, b)]
    difference = abs(values[0] - values[1]) / max(abs(values[0]), abs(values[1]), 1e-300)
    apart, named = (
        gait_distance(a, b),
        "efficiencies" if what == EFFICIENCY else f"values of {what.name}",
    )
    if apart is None:
        return False, f"other bodies; {named} differ by {100 * difference:.3g} %."
    text = (
        f"{named} differ by {100 * difference:.3g} %, joint angles by {apart:.3g} rad (root "
        f"mean square)"
    )
    same = difference <= SAME_VALUE and apart < SAME_GAIT
    return same, f"{'the same optimum' if same else 'different'}: {text}."


def _parser() -> argparse.ArgumentParser:
    parser = new_parser("compare", "Hold two results against each other.", _EPILOG)
    parser.add_argument("first", metavar="A.h5")
    parser.add_argument("second", metavar="B.h5")
    add_printing(parser)
    return parser


@command(_parser)
def main(options: argparse.Namespace) -> int:
    a, b = load(options.first), load(options.second)
    same, sentence = verdict(a, b)
    table = {name.strip() or "name": [x, y] for name, x, y in rows(a, b)}
    fields = {name: [x, y] for name, x, y in changed_fields(a, b)}
    facts = {"same": same, "verdict": sentence, "results": table, "problem": fields}
    lines = [("", Path(options.first).name, Path(options.second).name), *rows(a, b)]
    changes = changed_fields(a, b) if not options.quiet else []
    if changes:
        lines += [
            ("", "", ""),
            ("problem:", "", ""),
            *((f"  {name}", x, y) for name, x, y in changes),
        ]
    widths = [max(len(line[k]) for line in lines) for k in range(2)]
    tell(
        options,
        facts,
        [*(f"{x:<{widths[0]}}  {y:<{widths[1]}}  {z}".rstrip() for x, y, z in lines), sentence],
    )
    return OK if same else DIFFERENT
