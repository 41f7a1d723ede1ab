"""The table results/paper.md: one row for every number the paper prints, made from the stored parts
only."""

from __future__ import annotations

from collections.abc import Callable, Iterator

from scripts.paper import rows_scenes, rows_three_link
from scripts.paper.rows import Row
from scripts.paper.study import PaperStudy

_HEADER = """# The paper's numbers, computed

Source: S. Alben, "Efficient sliding locomotion with isotropic friction" (2019). Printed: as in the paper. Computed: by
colloc, with delta = 1e-4 unless stated. Error: estimated as the row says. Verdict: *agrees* if the printed value, to its
last digit, lies within the error of the computed one; *consistent* if a range or a statement holds; otherwise how far off.

This file is written by `python -m scripts.reproduce_paper{quick}`; every row by that command with `--only PART`.
"""


_ROWS: dict[str, Callable[[PaperStudy], Iterator[Row]]] = {
    "connection": rows_three_link.connection,
    "sweep": rows_three_link.sweep,
    "pacing": rows_three_link.pacing,
    "plane": rows_three_link.plane,
    "optima": rows_three_link.optima,
    "delta": rows_three_link.delta,
    "motions": rows_three_link.motions,
    "instant": rows_scenes.instant,
    "static": rows_scenes.static,
    "flap": rows_scenes.flap,
    "waves": rows_scenes.waves,
    "wave_parameters": rows_scenes.wave_parameters,
    "crawlers": rows_scenes.crawlers,
}
_ALSO = {"optima": ("delta", "sweep"), "motions": ("optima",)}
"""Parts whose arrays the rows of another part use too."""


def table(study: PaperStudy) -> str:
    """The table in Markdown; parts that have not been computed are named at its end."""
    quick = " --quick" if study.quick else ""
    lines = [
        _HEADER.format(quick=quick),
        "| number | printed | computed | estimated error | verdict | part |",
        "|---|---|---|---|---|---|",
    ]
    missing = []
    for part, rows in _ROWS.items():
        needs = {part, *_ALSO.get(part, ())}
        if not all(study.finished(name) for name in needs):
            missing.append(part)
            continue
        for row in rows(study):
            lines.append(
                f"| {row.what} | {row.printed} | {row.computed} | {row.error} | {row.verdict} | "
                f"`{part}` |"
            )
    if missing:
        lines += [
            "",
            "Not computed yet, or inputs have changed since: "
            + ", ".join(f"`{name}`" for name in missing)
            + ".",
        ]
    return "\n".join(lines) + "\n"
