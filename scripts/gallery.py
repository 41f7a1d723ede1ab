"""Run every problem file for the gallery of the documentation: python -m scripts.gallery [NAME ...]

Writes results/curated/gallery.json (numbers, and what a script prints), and into gallery/ beside it
the figures and films of those that are scripts. The test tests/test_examples.py runs the
same files and holds them against these numbers and their REFERENCE.
"""

from __future__ import annotations

import contextlib
import io
import json
import runpy
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

from PIL import Image

from colloc.results.solution import Solution
from colloc.search.options import OPTIONS
from colloc.search.solve import solve
from colloc.system.environment import versions
from scripts.program import command_line

ROOT = Path(__file__).resolve().parents[1]
TABLE, PICTURES = ROOT / "results/curated/gallery.json", ROOT / "results/curated/gallery"
FILES = sorted((ROOT / "problems").glob("[!_]*.py"))


def solution_of(file: Path) -> Solution:
    """Run a problem file in the current folder as a script, and solve what it only states."""
    names = runpy.run_path(str(file), run_name="__main__")
    return names.get("solution") or solve(names["PROBLEM"], names.get("STARTS", OPTIONS.starts))


def solved_row(solution: Solution) -> dict[str, Any]:
    """Numbers of a solved problem, by its certificate."""
    certificate = solution.certificate
    row: dict[str, Any] = {"status": solution.status, "delta": solution.answer.delta}
    if certificate.replayed:
        row |= {"efficiency": certificate.efficiency, "error": certificate.efficiency_error}
        row |= {"distance": certificate.distance, "work": certificate.work}
    return row


def main() -> None:
    names = command_line(__doc__, ("names", [str])).names
    if unknown := set(names) - {file.stem for file in FILES}:
        sys.exit(f"no file in problems/ is called {', '.join(sorted(unknown))}.")
    table = json.loads(TABLE.read_text()) if TABLE.exists() else {}
    PICTURES.mkdir(parents=True, exist_ok=True)
    for file in FILES:
        if names and file.stem not in names:
            continue
        begin = time.process_time()
        printed = io.StringIO()
        with tempfile.TemporaryDirectory() as folder, contextlib.chdir(folder):
            with contextlib.redirect_stdout(printed):
                row = solved_row(solution_of(file)) | {"printed": printed.getvalue()}
            for film in Path().glob("*.gif"):
                (PICTURES / film.name).write_bytes(film.read_bytes())
            for figure in Path().glob("*.png"):
                quantised = Image.open(figure).convert("RGB").quantize(256, dither=0)
                quantised.save(PICTURES / figure.name, optimize=True)
        table[file.stem] = row | {"cpu_seconds": round(time.process_time() - begin, 1)}
        print(file.stem, table[file.stem])
    table["versions"] = versions()
    TABLE.write_text(json.dumps(table, indent=1, sort_keys=True) + "\n")


if __name__ == "__main__":
    main()
