"""Solve every problem file for the gallery of the documentation: python -m scripts.gallery [NAME
...]

Writes results/curated/gallery.json (numbers), gallery/NAME.png beside it (a picture each) and
gallery.png (all of them). The test tests/commands/test_gallery.py solves the same files and holds
them against these numbers and their own REFERENCE.
"""

from __future__ import annotations

import argparse
import json
import runpy
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from matplotlib.figure import Figure
from PIL import Image

from colloc.gaits.problem_file import Reference
from colloc.pictures.figure import draw_filmstrip, draw_gait, draw_lab
from colloc.pictures.style import styled
from colloc.results.solution import Solution
from colloc.search.options import OPTIONS
from colloc.search.solve import solve
from colloc.system.environment import versions

ROOT = Path(__file__).resolve().parents[1]
TABLE, PICTURES = ROOT / "results/curated/gallery.json", ROOT / "results/curated/gallery"
SHEET = ROOT / "results/curated/gallery.png"
_SIZE, _RESOLUTION, _COLOURS = (9.0, 3.7), 110, 256
_COLUMNS, _THUMBNAIL = 2, 620


@dataclass(frozen=True)
class Example:
    """A problem file: its name, what it states, and how to run it."""

    name: str
    stated: dict[str, Any]

    @property
    def reference(self) -> Reference | None:
        return self.stated.get("REFERENCE")


def examples() -> list[Example]:
    """All files in problems/."""
    return [Example(path.stem, runpy.run_path(str(path))) for path in _problem_files()]


def _problem_files() -> list[Path]:
    return sorted((ROOT / "problems").glob("[!_]*.py"))


def solved_row(solution: Solution) -> dict[str, Any]:
    """Numbers of a solved problem, by its certificate."""
    certificate = solution.certificate
    if not certificate.replayed:
        return {"status": solution.status, "delta": solution.answer.delta}
    return {
        "status": solution.status,
        "efficiency": certificate.efficiency,
        "error": certificate.efficiency_error,
        "distance": certificate.distance,
        "work": certificate.work,
        "delta": solution.answer.delta,
    }


def picture(solution: Solution) -> Figure:
    """A solution for the gallery: a period frame by frame, the paths in the lab, and the path or
    all angles beside them."""
    with styled():
        figure = Figure(figsize=_SIZE)
        grid = figure.add_gridspec(2, 2, width_ratios=(2.3, 1), height_ratios=(1, 1.5))
        draw_filmstrip(figure.add_subplot(grid[0, 0]), solution, count=9)
        draw_lab(figure.add_subplot(grid[1, 0]), solution)
        draw_gait(figure.add_subplot(grid[:, 1]), solution)
    return figure


def _save(example: Example, solution: Solution) -> None:
    PICTURES.mkdir(parents=True, exist_ok=True)
    path = PICTURES / f"{example.name}.png"
    with styled():
        picture(solution).savefig(path, dpi=_RESOLUTION)
    _quantised(Image.open(path)).save(path, optimize=True)


def _quantised(image: Image.Image) -> Image.Image:
    return image.convert("RGB").quantize(
        _COLOURS, Image.Quantize.MEDIANCUT, dither=Image.Dither.NONE
    )


def _sheet() -> None:
    """All pictures on one sheet, with their names."""
    paths = sorted(PICTURES.glob("*.png"))
    rows = -(-len(paths) // _COLUMNS)
    with styled(font_size=10):
        height = _SIZE[1] / _SIZE[0] * _THUMBNAIL + 26
        figure = Figure(figsize=(_COLUMNS * _THUMBNAIL / 100, rows * height / 100), dpi=100)
        for path, axes in zip(paths, figure.subplots(rows, _COLUMNS).flat, strict=False):
            axes.imshow(Image.open(path).convert("RGB"))
            axes.set_title(path.stem, weight="bold")
        for axes in figure.axes:
            axes.set_axis_off()
        figure.savefig(SHEET)
    _quantised(Image.open(SHEET)).save(SHEET, optimize=True)


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    known = [path.stem for path in _problem_files()]
    parser.add_argument(
        "names",
        nargs="*",
        metavar="NAME",
        help=f"files to solve (default: all): {', '.join(known)}",
    )
    names = parser.parse_args().names
    if unknown := set(names) - set(known):
        parser.error(f"no file in problems/ is called {', '.join(sorted(unknown))}.")
    table = json.loads(TABLE.read_text()) if TABLE.exists() else {}
    for example in examples():
        if names and example.name not in names:
            continue
        begin = time.process_time()
        solution = solve(example.stated["PROBLEM"], example.stated.get("STARTS", OPTIONS.starts))
        row = solved_row(solution)
        row["cpu_seconds"] = round(time.process_time() - begin, 1)
        table[example.name] = row
        _save(example, solution)
        print(
            f"{example.name:28} {row['status']:20} {row.get('efficiency', float('nan')):10.6f} "
            f"{row['cpu_seconds']:7.1f} s"
        )
    table["versions"] = versions()
    _sheet()
    TABLE.write_text(json.dumps(table, indent=1, sort_keys=True) + "\n")


if __name__ == "__main__":
    main()
