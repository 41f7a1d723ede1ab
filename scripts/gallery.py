"""Solve every problem file for the gallery of the documentation: python -m scripts.gallery [NAME ...]

Writes results/curated/gallery.json (numbers) and results/curated/gallery/NAME.png (a picture each). The test
tests/commands/test_gallery.py solves the same files and holds them against these numbers and their own REFERENCE.
"""

from __future__ import annotations

import argparse
import json
import runpy
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
from matplotlib.figure import Figure

from colloc.gaits.problem import Problem, Reference
from colloc.mechanics.friction import Friction
from colloc.pictures.figure import draw_filmstrip, draw_shape_path
from colloc.pictures.style import styled
from colloc.results.solution import Solution, versions
from colloc.search.global_search import STARTS
from colloc.search.optimise import best_gait
from colloc.smooth.concertina import Concertina
from colloc.smooth.motion import Motion
from colloc.smooth.period import measured_period
from scripts.models.smooth_record import snapshots

ROOT = Path(__file__).resolve().parents[1]
TABLE, PICTURES = ROOT / "results/curated/gallery.json", ROOT / "results/curated/gallery"
_SIZE, _RESOLUTION = (7.2, 2.1), 75


@dataclass(frozen=True)
class Example:
    """A problem file: its name, what it states, and how to run it."""

    name: str
    stated: dict[str, Any]

    @property
    def reference(self) -> Reference | None:
        return self.stated.get("REFERENCE")

    @property
    def optimised(self) -> bool:
        """A gait is sought; otherwise a motion is prescribed."""
        return isinstance(self.stated.get("PROBLEM"), Problem)


def examples() -> list[Example]:
    """All files in problems/."""
    return [Example(path.stem, runpy.run_path(str(path))) for path in _problem_files()]


def _problem_files() -> list[Path]:
    return sorted((ROOT / "problems").glob("[!_]*.py"))


def _motion(stated: dict[str, Any]) -> tuple[Motion, Friction, float]:
    """The prescribed motion of a smooth body, friction and delta."""
    problem = stated.get("PROBLEM")
    if isinstance(problem, Concertina):
        return problem.motion(), problem.friction, problem.delta
    return stated["MOTION"], stated["FRICTION"], stated["DELTA"]


def prescribed_row(example: Example) -> dict[str, Any]:
    """Numbers of a file about a smooth body."""
    problem = example.stated.get("PROBLEM")
    motion, friction, delta = _motion(example.stated)
    p = problem.measured_period(intervals=2) if isinstance(problem, Concertina) else measured_period(motion, friction, delta)
    return {
        "status": "computed",
        "efficiency": p.efficiency,
        "error": p.errors["efficiency"],
        "distance": p.d,
        "work": p.W,
        "delta": delta,
    }


def solved_row(solution: Solution) -> dict[str, Any]:
    """Numbers of a solved problem, by its certificate."""
    certificate = solution.certificate
    if not certificate.replayed:
        return {"status": solution.status, "delta": solution.last.delta}
    return {
        "status": solution.status,
        "efficiency": certificate.efficiency,
        "error": certificate.efficiency_error,
        "distance": certificate.distance,
        "work": certificate.work,
        "delta": solution.last.delta,
    }


def _picture(example: Example, solution: Solution | None) -> None:
    PICTURES.mkdir(parents=True, exist_ok=True)
    with styled():
        figure = Figure(figsize=_SIZE)
        if solution is not None:
            grid = figure.add_gridspec(1, 2, width_ratios=(2.6, 1))
            draw_filmstrip(figure.add_subplot(grid[0]), solution, count=6)
            t = np.linspace(0.0, 1.0, 801)
            if solution.problem.body.n_joint > 1:
                draw_shape_path(figure.add_subplot(grid[1]), solution.problem, solution.sample(t).angles)
        else:
            _draw_snapshots(figure, example.stated)
        figure.savefig(PICTURES / f"{example.name}.png", dpi=_RESOLUTION)


def _draw_snapshots(figure: Figure, stated: dict[str, Any]) -> None:
    motion, friction, delta = _motion(stated)
    shown = snapshots(motion, friction, delta, count=6)
    axes = figure.add_subplot()
    spacing, low = max(1.15 * float(np.ptp(shown.x, axis=0).max()), 0.6), float(shown.y.min()) - 0.1
    for k, t in enumerate(shown.t):
        middle = 0.5 * (shown.x[:, k].min() + shown.x[:, k].max())
        colour = matplotlib.colormaps["cividis_r"](0.15 + 0.85 * k / shown.t.size)
        axes.plot(shown.x[:, k] - middle + k * spacing, shown.y[:, k], color=colour, lw=1.8)
        axes.text(k * spacing, low, f"t = {t:.2f}", ha="center", va="top", fontsize=7)
    axes.set_aspect("equal")
    axes.set_axis_off()
    axes.set_ylim(low - 0.12, max(0.2, float(shown.y.max()) + 0.05))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    known = [path.stem for path in _problem_files()]
    parser.add_argument("names", nargs="*", metavar="NAME", help=f"files to solve (default: all): {', '.join(known)}")
    names = parser.parse_args().names
    if unknown := set(names) - set(known):
        parser.error(f"no file in problems/ is called {', '.join(sorted(unknown))}.")
    table = json.loads(TABLE.read_text()) if TABLE.exists() else {}
    for example in examples():
        if names and example.name not in names:
            continue
        begin = time.process_time()
        solution = best_gait(example.stated["PROBLEM"], example.stated.get("STARTS", STARTS)) if example.optimised else None
        row = solved_row(solution) if solution is not None else prescribed_row(example)
        row["cpu_seconds"] = round(time.process_time() - begin, 1)
        table[example.name] = row
        _picture(example, solution)
        print(f"{example.name:28} {row['status']:20} {row.get('efficiency', float('nan')):10.6f} {row['cpu_seconds']:7.1f} s")
    table["versions"] = versions()
    TABLE.write_text(json.dumps(table, indent=1, sort_keys=True) + "\n")


if __name__ == "__main__":
    main()
