"""A result as a small HTML card, for notebooks."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from colloc.results.chart import COLOURS, Chart
from colloc.results.markup import element, text

_GOOD, _BAD = "#00704f", "#b34700"


def solution_card(
    name: str,
    status: str,
    message: str,
    facts: Sequence[tuple[str, str]],
    checks: Sequence[tuple[str, bool, str]],
    angles: np.ndarray | None,
) -> str:
    """The card as HTML; all text is escaped.

    Parameters
    ----------
    name, status, message : str
    facts : sequence of (name, value)
    checks : sequence of (name, passed, measured)
    angles : (n_joint, n_time) or None
        Joint angles over one period, for a small chart.
    """
    good = status == "solved"
    title = element("b", name), " ", element("span", status, style=f"color:{_GOOD if good else _BAD};font-weight:600")
    failed = sum(not passed for _, passed, _ in checks)
    tally = f"{len(checks)} checks, {'all hold' if failed == 0 else f'{failed} failed'}"
    rows = [element("tr", element("td", key, style="text-align:left"), element("td", value)) for key, value in facts]
    lines = [
        element(
            "tr",
            element("td", ("✓ " if passed else "✗ ") + key, style=f"text-align:left;color:{_GOOD if passed else _BAD}"),
            element("td", measured),
        )
        for key, passed, measured in checks
    ]
    listed = element("table", element("tbody", lines))
    return element(
        "div",
        element("div", *title),
        element("div", message, style=f"color:{_BAD}") if message else None,
        element(
            "div",
            element("table", element("tbody", rows)),
            _angles(angles) if angles is not None else None,
            style="display:flex;flex-wrap:wrap;gap:16px;align-items:center",
        ),
        element("details", element("summary", tally), listed, open=failed > 0) if checks else None,
        style="font-family:system-ui,sans-serif",
    )


def _angles(angles: np.ndarray) -> object:
    reach = 1.05 * max(float(np.abs(angles).max()), 0.1)
    chart = Chart((0.0, 1.0), (-reach, reach), "joint angles [rad]", "phase t", width=300, height=180)
    for j, colour in zip(range(len(angles)), COLOURS, strict=False):
        chart.line(np.linspace(0.0, 1.0, angles.shape[1]), angles[j], colour, f"{j + 1}")
    return element("div", text(chart.svg()), style="width:300px;font:11px system-ui,sans-serif")
