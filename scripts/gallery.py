"""Solve every problem file for the gallery of the documentation: python -m scripts.gallery [NAME
...]

Writes results/curated/gallery.json (numbers), gallery/NAME.png beside it (a picture each) and
gallery.png (all of them). The test tests/commands/test_gallery.py solves the same files and holds
them against these numbers and their own REFERENCE.
"""

from __future__ import annotations

import json
import runpy
import sys
import time
from pathlib import Path
from typing import Any, NamedTuple

from matplotlib.figure import Figure
from PIL import Image

from colloc.gaits.problem_file import Reference
from colloc.pictures.figure import draw_filmstrip, draw_gait, draw_lab
from colloc.pictures.style import figure_style
from colloc.results.solution import Solution
from colloc.search.options import OPTIONS
from colloc.search.solve import solve
from colloc.system.environment import versions
from scripts.program import command_line

ROOT = Path(__file__).resolve().parents[1]
TABLE, PICTURES = ROOT / "results/curated/gallery.json", ROOT / "results/curated/gallery"
SHEET = ROOT / "results/curated/gallery.png"
_SIZE, _RESOLUTION, _COLOURS = (9.0, 3.7), 110, 256
_COLUMNS, _THUMBNAIL = 2, 620


class Example(NamedTuple):
    """A problem file: its name, what it states, and how to run it."""

    name: str
    stated: dict[str, Any]

    @property
    def reference(self) -> Reference | None:
        return self.stated.get("REFERENCE")


def examples() -> list[Example]:
    """All files in problems/."""
    files = sorted((ROOT / "problems").glob("[!_]*.py"))
    return [Example(path.stem, runpy.run_path(str(path))) for path in files]


def solved_row(solution: Solution) -> dict[str, Any]:
    """Numbers of a solved problem, by its certificate."""
    certificate = solution.certificate
    row: dict[str, Any] = {"status": solution.status, "delta": solution.answer.delta}
    if certificate.replayed:
        row |= {"efficiency": certificate.efficiency, "error": certificate.efficiency_error}
        row |= {"distance": certificate.distance, "work": certificate.work}
    return row


def picture(solution: Solution) -> Figure:
    """A solution for the gallery: a period frame by frame, the paths in the lab, and the path or
    all angles beside them."""
    with figure_style():
        figure = Figure(figsize=_SIZE)
        grid = figure.add_gridspec(2, 2, width_ratios=(2.3, 1), height_ratios=(1, 1.5))
        draw_filmstrip(figure.add_subplot(grid[0, 0]), solution, count=9)
        draw_lab(figure.add_subplot(grid[1, 0]), solution)
        draw_gait(figure.add_subplot(grid[:, 1]), solution)
    return figure


def _quantised(path: Path) -> None:
    how: Any = {"method": Image.Quantize.MEDIANCUT, "dither": Image.Dither.NONE}
    Image.open(path).convert("RGB").quantize(_COLOURS, **how).save(path, optimize=True)


def _sheet() -> None:
    """All pictures on one sheet, with their names."""
    paths = sorted(PICTURES.glob("*.png"))
    rows = -(-len(paths) // _COLUMNS)
    with figure_style(font_size=10):
        height = _SIZE[1] / _SIZE[0] * _THUMBNAIL + 26
        figure = Figure(figsize=(_COLUMNS * _THUMBNAIL / 100, rows * height / 100), dpi=100)
        for path, axes in zip(paths, figure.subplots(rows, _COLUMNS).flat, strict=False):
            axes.imshow(Image.open(path).convert("RGB"))
            axes.set_title(path.stem, weight="bold")
        for axes in figure.axes:
            axes.set_axis_off()
        figure.savefig(SHEET)
    _quantised(SHEET)


def main() -> None:
    names = command_line(__doc__, ("names", [str])).names
    known = {example.name: example for example in examples()}
    if unknown := set(names) - set(known):
        sys.exit(f"no file in problems/ is called {', '.join(sorted(unknown))}.")
    table = json.loads(TABLE.read_text()) if TABLE.exists() else {}
    PICTURES.mkdir(parents=True, exist_ok=True)
    for example in (known[name] for name in names or known):
        begin = time.process_time()
        solution = solve(example.stated["PROBLEM"], example.stated.get("STARTS", OPTIONS.starts))
        row = solved_row(solution) | {"cpu_seconds": round(time.process_time() - begin, 1)}
        table[example.name] = row
        path = PICTURES / f"{example.name}.png"
        with figure_style():
            picture(solution).savefig(path, dpi=_RESOLUTION)
        _quantised(path)
        value = row.get("efficiency", float("nan"))
        print(f"{example.name:28} {row['status']:20} {value:10.6f} {row['cpu_seconds']:7.1f} s")
    table["versions"] = versions()
    _sheet()
    TABLE.write_text(json.dumps(table, indent=1, sort_keys=True) + "\n")


if __name__ == "__main__":
    main()
