"""A result as a small HTML card, for notebooks."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape


def solution_card(
    name: str, status: str, message: str, facts: Sequence[tuple[str, str]], checks: Sequence[tuple[str, bool, str]]
) -> str:
    """The card as HTML; all text is escaped.

    Parameters
    ----------
    name, status, message : str
    facts : sequence of (name, value)
    checks : sequence of (name, passed, measured)
    """
    failed = sum(not passed for _, passed, _ in checks)
    tally = f"{len(checks)} checks, {'all hold' if failed == 0 else f'{failed} failed'}"
    listed = _table([(f"{'✓' if passed else '✗'} {key}", measured) for key, passed, measured in checks])
    parts = [
        f"<div><b>{escape(name)}</b> {escape(status)}</div>",
        f"<div>{escape(message)}</div>" if message else "",
        _table(facts),
        f"<details{' open' if failed else ''}><summary>{tally}</summary>{listed}</details>" if checks else "",
    ]
    return f"<div>{''.join(parts)}</div>"


def _table(rows: Sequence[tuple[str, str]]) -> str:
    lines = (f'<tr><td style="text-align:left">{escape(key)}</td><td>{escape(value)}</td></tr>' for key, value in rows)
    return f"<table><tbody>{''.join(lines)}</tbody></table>"
