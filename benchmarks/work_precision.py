"""Work and precision of schemes, on uniform and on refined meshes:
python -m benchmarks.work_precision

The isotropic one-harmonic three-link optimum at delta = 1e-4, from a good guess. Every solve is
held against the optimum itself, as the finest refined solve finds it by independent replay, and
against a replay of its own gait. Outcomes are kept in results/work_precision.json, so an
interrupted run goes on where it stopped. Writes results/work_precision.md and
results/work_precision.png and .pdf.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import NamedTuple

import numpy as np
from matplotlib.figure import Figure

from benchmarks.tables import cached
from colloc import Harmonic, Problem, certify, ellipse
from colloc.pictures.style import (
    BLACK,
    BLUE,
    GREEN,
    GREY,
    ORANGE,
    PURPLE,
    SKY,
    VERMILION,
    figure_style,
    save,
)
from colloc.results.solution import Solution
from colloc.search.explore import first_optimum
from colloc.search.solve import confirm_optimum
from scripts.program import command_line

_COLOURS = (BLUE, VERMILION, GREEN, ORANGE, PURPLE, SKY, BLACK, GREY)
_MARKERS = "osD^vPX*"

Series = Mapping[str, tuple[np.ndarray, np.ndarray] | np.ndarray]
"""Name of a scheme to processor seconds and relative errors."""

SECOND_ORDER = "trapezoid"
REFERENCE = ("gauss-5", 20, 1e-7)


class Picture(NamedTuple):
    """What is solved for one picture: schemes, uniform meshes, and tolerances to refine a mesh of
    `first` intervals to."""

    name: str
    title: str
    problem: Callable[[str, int, float], Problem]
    schemes: tuple[str, ...]
    uniform: tuple[int, ...]
    refined: tuple[float, ...]
    first: int

    def meshes(self, refine: bool) -> list[tuple[int, float]]:
        """Intervals and mesh tolerance of each solve; 0 for a uniform mesh."""
        return (
            [(self.first, tolerance) for tolerance in self.refined]
            if refine
            else [(n, 0.0) for n in self.uniform]
        )


def run_problem(scheme: str, intervals: int, tolerance: float) -> Problem:
    """One solve of the picture."""
    return Problem(
        "optimum",
        ellipse(0, 2.85, 1.29),
        gait=Harmonic(1, "bilateral"),
        delta_start=1e-3,
        intervals=intervals,
        scheme=scheme,
        mesh_tolerance=tolerance,
    )


ELLIPSE = Picture(
    "work_precision",
    "Three links, isotropic, one harmonic",
    run_problem,
    ("trapezoid", "hermite-simpson", "gauss-2", "gauss-3", "gauss-5", "radau-3"),
    (10, 20, 40, 80, 160),
    (1e-3, 1e-4, 1e-5, 1e-6),
    20,
)


def outcome(problem: Problem) -> dict:
    """What the table needs of a solve."""
    begin = time.process_time()
    solution = Solution(problem, confirm_optimum(first_optimum(problem, problem.guess)))
    seconds = time.process_time() - begin
    replayed = certify(solution.answer, tolerance=1e-8, instants=6400).efficiency
    return {
        "optimal": solution.answer.optimal and solution.answer.delta == problem.delta,
        "scheme": solution.mesh.scheme.name,
        "intervals": solution.mesh.n,
        "points": solution.mesh.n_point,
        "efficiency": solution.efficiency,
        "replayed": replayed,
        "iterations": sum(level.iterations for level in solution.history),
        "seconds": seconds,
    }


def kept(cache: Path, problem: Problem) -> dict:
    """The outcome of a problem from the cache, or solved and put there."""
    return cached(cache, problem.hash, lambda: outcome(problem))


def save_work_precision(
    folder: Path, name: str, uniform: Series, refined: Series, title: str
) -> list[Path]:
    """Errors on uniform and on refined meshes against processor time, one colour a scheme; PNG and
    PDF."""
    with figure_style():
        figure = Figure(figsize=(6.6, 4.4))
        axes = figure.subplots()
        for index, scheme in enumerate({**uniform, **refined}):
            style = {
                "color": _COLOURS[index % len(_COLOURS)],
                "marker": _MARKERS[index % len(_MARKERS)],
                "ms": 5,
            }
            if scheme in uniform:
                unless_refined = None if scheme in refined else scheme
                axes.loglog(*uniform[scheme], ls=":", mfc="white", label=unless_refined, **style)
            if scheme in refined:
                axes.loglog(*refined[scheme], ls="-", label=scheme, **style)
        axes.plot([], [], ":", color=BLACK, marker="o", mfc="white", label="uniform meshes")
        axes.plot([], [], "-", color=BLACK, marker="o", label="refined")
        axes.set(
            xlabel="processor time [s]", ylabel="relative error of the efficiency", title=title
        )
        low, high = axes.get_xlim()
        ticks = [0.1, 0.2, 0.5, 1, 2, 5, 10, 20, 50] if high < 500 * low else [0.01, 0.1, 1, 10]
        axes.set_xticks(
            [t for t in ticks if low <= t <= high], [f"{t:g}" for t in ticks if low <= t <= high]
        )
        axes.set_xticks([], minor=True)
        axes.legend(loc="center left", bbox_to_anchor=(1.0, 0.5))
        axes.grid(alpha=0.25)
        return save(figure, folder / name)


HEADER = """# Schemes, mesh tolerance and error

Written by `python -m benchmarks.work_precision`: the isotropic one-harmonic optimum at delta = 1e-4, half a period.
Processor seconds (certificate not included), one run on a machine that other work shared. Error: collocated efficiency
over that of the optimum ({reference:.8f}, a refined solve to 1e-7 by its own replay), less 1; beside it the same against
a replay of the same gait.

| scheme | mesh | ended with | points | efficiency | error | error against replay | iterations | CPU s |
|---|---|---|---|---|---|---|---|---|"""


def main() -> None:
    options = command_line(__doc__, output=Path("results"))
    options.output.mkdir(parents=True, exist_ok=True)
    cache = options.output / "work_precision.sqlite"
    picture = ELLIPSE
    reference = kept(cache, run_problem(*REFERENCE))["replayed"]
    lines = [HEADER.format(reference=reference)]
    curves: dict[bool, dict[str, tuple[np.ndarray, np.ndarray]]] = {False: {}, True: {}}
    for scheme in picture.schemes:
        for refine in (False, True):
            rows = []
            for intervals, tolerance in picture.meshes(refine):
                if scheme == SECOND_ORDER and 0 < tolerance < 1e-4:
                    continue  # thousands of intervals
                result = kept(cache, picture.problem(scheme, intervals, tolerance))
                own = result["efficiency"] / result["replayed"] - 1
                error = result["efficiency"] / reference - 1
                mesh = f"to {tolerance:.0e}" if refine else "uniform"
                note = "" if result["optimal"] else " (not converged)"
                errors = f"{error:+.1e} | {own:+.1e}"
                lines.append(
                    f"| {scheme} | {mesh}{note} | {result['scheme']} x {result['intervals']} | "
                    f"{result['points']} "
                    f"| {result['efficiency']:.7f} | {errors} | {result['iterations']} | "
                    f"{result['seconds']:.1f} |"
                )
                print(lines[-1], flush=True)
                if result["optimal"]:
                    rows.append((result["seconds"], abs(error)))
            if rows:
                curves[refine][scheme] = tuple(np.array(rows).T)
    (options.output / f"{picture.name}.md").write_text("\n".join(lines) + "\n")
    save_work_precision(options.output, picture.name, curves[False], curves[True], picture.title)


if __name__ == "__main__":
    main()
