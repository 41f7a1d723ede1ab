"""A solution as a small HTML card: what a notebook shows of it."""

from __future__ import annotations

from collections.abc import Iterable
from html import escape

from colloc.gaits.objective import EFFICIENCY
from colloc.results.solution import Solution


def solution_card(solution: Solution) -> str:
    """Verdict, numbers and checks as HTML; all text is escaped."""
    checks = solution.certificate.checks if solution.certificate.replayed else ()
    failed = sum(not check.passed for check in checks)
    tally = f"{len(checks)} checks, {'all hold' if failed == 0 else f'{failed} failed'}"
    listed = _table(
        (f"{'✓' if check.passed else '✗'} {check.name}", f"{check.value:.1e} (≤ {check.threshold:.0e})") for check in checks
    )
    parts = [
        f"<div><b>{escape(solution.problem.name)}</b> {escape(solution.status)}</div>",
        f"<div>{escape(solution.message)}</div>" if solution.message else "",
        _table(_facts(solution)),
        f"<details{' open' if failed else ''}><summary>{tally}</summary>{listed}</details>" if checks else "",
    ]
    return f"<div>{''.join(parts)}</div>"


def _facts(solution: Solution) -> list[tuple[str, str]]:
    """Names and values."""
    certificate, best = solution.certificate, solution.problem.objective
    if not certificate.replayed:
        return [(f"{best.name} (not replayed)", f"{solution.value:.5f}"), ("δ", f"{solution.answer.delta:.0e}")]
    own = [] if best == EFFICIENCY else [(EFFICIENCY.label, f"{certificate.efficiency:.5f}")]
    return [
        (best.label, f"{certificate.value:.5f} ± {certificate.value_error:.0e}"),
        ("for δ → 0", f"{certificate.value_at_zero_delta:.5f} ± {certificate.value_error_at_zero_delta:.0e}"),
        *own,
        ("distance d", f"{certificate.distance:.5f}"),
        ("work W", f"{certificate.work:.5f}"),
        *([("course", solution.turning)] if solution.turning else []),
        ("δ", f"{solution.answer.delta:.0e}"),
        ("search", solution.standing[0]),
    ]


def _table(rows: Iterable[tuple[str, str]]) -> str:
    lines = (f'<tr><td style="text-align:left">{escape(key)}</td><td>{escape(value)}</td></tr>' for key, value in rows)
    return f"<table><tbody>{''.join(lines)}</tbody></table>"
