"""Best bilateral optima of the multi-start against grid sweeps that know nothing of collocation.

    python -m benchmarks.grid_confirmation [results/robustness.json]

For anisotropic friction with mu_b = mu_f (a sweep over ellipses needs that): every admissible ellipse of a grid is solved
instant by instant by the NumPy solver, the local maxima of the grid are climbed by Nelder and Mead's simplex and replayed.
Beside them stands the best certified bilateral optimum of the robustness table. Writes results/grid_confirmation.md.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path

import numpy as np

from colloc import Chain, Friction
from scripts.models.ellipses import gait_grid
from scripts.models.sweep import Route, distinct_maxima, performance

LAWS = ((10, 1, 1), (3, 1, 1))
STEP, INSTANTS, FINE_INSTANTS, CANDIDATES = 0.2, 48, 400, 3
DELTA = 1e-4


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("table", nargs="?", type=Path, default=Path("results/robustness.json"), help="of benchmarks.robustness")
    table = parser.parse_args().table
    if not table.exists():
        parser.error(f"there is no {table}; python -m benchmarks.robustness writes one, results/curated holds a run.")
    rows = json.loads(table.read_text(encoding="utf-8"))["rows"]
    lines = [
        "# Grid sweeps against the multi-start",
        "",
        f"Ellipses on a grid of {STEP} rad, bilateral, delta = {DELTA:g}. Written by `python -m benchmarks.grid_confirmation`.",
        "",
        "| (mu_t, mu_f, mu_b) | gaits | best of the grid | climbed and replayed | A0, A1, B1 | multi-start | difference |",
        "|---|---|---|---|---|---|---|",
    ]
    for law in LAWS:
        route = Route(Chain(), Friction(*law), DELTA)
        grid = gait_grid(route.body, STEP)
        values = grid.unflattened(performance(route, grid.gaits, instants=INSTANTS).efficiency)
        gaits = np.stack(np.meshgrid(grid.A0, grid.A1, grid.B1, indexing="ij"))
        best = distinct_maxima(route, values, gaits, most=CANDIDATES, instants=FINE_INSTANTS)[0]
        found = max(
            r["optima"][0][0]
            for r in rows
            if tuple(r["law"]) == law and r["symmetry"] == "bilateral" and r["delta"] == DELTA and r["optima"]
        )
        swept = best.replay.efficiency
        lines.append(
            f"| {law} | {grid.inside.sum()} | {np.nanmax(values):.4f} | {swept:.5f} "
            f"| {best.A0:.3f}, {best.A1:.3f}, {best.B1:.3f} | {found:.5f} | {found / swept - 1:+.0e} |"
        )
        print(lines[-1], flush=True)
    Path("results").mkdir(exist_ok=True)
    Path("results/grid_confirmation.md").write_text("\n".join(lines) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
