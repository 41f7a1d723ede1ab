"""The same gaits by other ways of computing them: compiled kernel and NumPy, Gauss and Radau
collocation.

    python -m benchmarks.ways [problems/three_link.py ...]

Each problem is solved from eight starts. Every way begins with that gait, finds its own optimum and
certifies it. Last columns: the largest relative difference of two values, and of two joint angles
at the same phase [rad]. A value is of its own optimum, so it may differ by what a mesh is asked to
keep to (`Problem.mesh_tolerance`), beyond the stated error of its replay.
"""

from __future__ import annotations

import contextlib
from itertools import combinations
from pathlib import Path

import numpy as np

import colloc
from benchmarks.tables import markdown_table
from colloc.mechanics.native_kernel import numpy_instead
from scripts.program import command_line

WAYS = {
    "gauss-3, kernel": ("gauss-3", False),
    "gauss-3, NumPy": ("gauss-3", True),
    "radau-3, kernel": ("radau-3", False),
    "gauss-5, kernel": ("gauss-5", False),
}
PROBLEMS = (
    "three_link", "three_link_two_harmonics", "three_link_wheels", "three_link_feet",
    "three_link_fast", "three_link_uphill",
    "three_link_offset", "four_link", "serpenoid_snake",
)  # fmt: skip


def row(path: Path) -> list[object]:
    """Name, value by each way, and by how much values and gaits differ."""
    problem, phases = colloc.load_problem(path), np.linspace(0.0, 1.0, 401)
    first = colloc.solve(problem, starts=8)
    found = []
    for scheme, numpy in WAYS.values():
        with numpy_instead() if numpy else contextlib.nullcontext():
            solution = colloc.solve(problem.with_(scheme=scheme, guess=first.gait), starts=1)
        found.append(solution)
    pairs = list(combinations(found, 2))
    values = max(abs(a.value / b.value - 1) for a, b in pairs)
    angles = max(np.abs(a.gait.angles(phases) - b.gait.angles(phases)).max() for a, b in pairs)
    return [problem.name, *map(_value, found), f"{values:.0e}", f"{angles:.0e}"]


def _value(solution: colloc.Solution) -> str:
    certificate = solution.certificate
    return f"{solution.value:.8f} ± {certificate.value_error:.0e}" + (
        "" if certificate.passed else " (not certified)"
    )


def main() -> None:
    header = ["problem", *WAYS, "values", "angles"]
    for number, path in enumerate(
        command_line(
            __doc__, ("problems", [Path("problems", f"{name}.py") for name in PROBLEMS])
        ).problems
    ):
        print(
            *markdown_table(header, [row(path)]).splitlines()[2 if number else 0 :],
            sep="\n",
            flush=True,
        )


if __name__ == "__main__":
    main()
