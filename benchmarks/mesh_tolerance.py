"""The whole solve: scheme and mesh tolerance against error and time: python -m benchmarks --only mesh_tolerance

The isotropic one-harmonic three-link optimum at delta = 1e-4, from a good guess: intervals that refinement ended with,
collocated efficiency, its relative difference to a replay of the same gait that shares nothing with collocation, and
processor seconds (one run, certificate not included).
"""

import time
from pathlib import Path

from benchmarks.tables import markdown_table
from colloc import Harmonic, Problem, certify, ellipse
from colloc.pictures.style import BLUE, GREEN, ORANGE, PURPLE, SKY, save, styled, subplots
from colloc.results.solution import Solution
from colloc.search.explore import begin_at
from colloc.search.solve import confirmed

SCHEMES = ("trapezoid", "hermite-simpson", "gauss-2", "gauss-3", "gauss-5", "radau-3")
COLOURS = dict(zip(SCHEMES, ("#999999", SKY, GREEN, BLUE, PURPLE, ORANGE), strict=True))
TOLERANCES = (0.0, 1e-4, 1e-5, 1e-6)


def solved(name: str, tolerance: float) -> list[object]:
    """A row of the table."""
    problem = Problem(
        "optimum",
        ellipse(0, 2.85, 1.29),
        gait=Harmonic(1, "bilateral"),
        delta_start=1e-3,
        intervals=20,
        scheme=name,
        mesh_tolerance=tolerance,
    )
    begin = time.process_time()
    solution = Solution(problem, confirmed(begin_at(problem, problem.guess)))
    seconds = time.process_time() - begin
    error = solution.efficiency / certify(solution.answer, tolerance=1e-8, instants=6400).efficiency - 1
    effort = sum(level.iterations for level in solution.history)
    label = "uniform" if tolerance == 0 else f"{tolerance:.0e}"
    return [name, label, solution.mesh.n, f"{solution.efficiency:.7f}", error, effort, seconds]


def report(quick: bool, folder: Path) -> str:
    """The table and a diagram of error against time."""
    schemes, tolerances = (("gauss-3",), TOLERANCES[:3]) if quick else (SCHEMES, TOLERANCES)
    rows = [
        solved(name, tolerance)
        for name in schemes
        for tolerance in tolerances
        if name != "trapezoid" or not 0 < tolerance < 1e-4  # second order: thousands of intervals
    ]
    _figure(rows, folder)
    header = ["scheme", "tolerance", "intervals (half period)", "efficiency", "error against replay", "iterations", "seconds"]
    return markdown_table(header, rows)


def _figure(rows: list[list], folder: Path) -> None:
    with styled():
        figure, axis = subplots(figsize=(5.2, 3.6))
        for name in dict.fromkeys(r[0] for r in rows):
            own = [(float(r[6]), abs(float(r[4]))) for r in rows if r[0] == name]
            axis.loglog(*zip(*own, strict=True), color=COLOURS[name], marker="o", ms=4, label=name)
        axis.set(xlabel="processor seconds of a whole solve", ylabel="relative error of d/W against the replay")
        axis.set_xticks([0.3, 0.5, 1, 2, 5], labels=["0.3", "0.5", "1", "2", "5"])
        axis.minorticks_off()
        axis.legend(fontsize=7)
        save(figure, folder / "mesh_tolerance")
