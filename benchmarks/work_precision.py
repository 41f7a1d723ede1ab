"""Work and precision of schemes, on uniform and on refined meshes: python -m benchmarks.work_precision

The isotropic one-harmonic three-link optimum at delta = 1e-4, from a good guess and delta = 1e-3 on. Every solve is held
against the optimum itself, as the finest refined solve finds it by independent replay, and against a replay of its own
gait. Outcomes are kept in results/work_precision.json, so an interrupted run goes on where it stopped. Writes
results/work_precision.md and results/work_precision.png and .pdf.
"""

from __future__ import annotations

import argparse
import time
from pathlib import Path

import numpy as np

from colloc import Harmonic, Problem, certify, ellipse
from colloc.continuation import continue_delta
from colloc.figures_precision import save_work_precision
from colloc.json_cache import load_entries, save_entry

SCHEMES = ("trapezoid", "hermite-simpson", "gauss-2", "gauss-3", "gauss-5", "radau-3")
UNIFORM, REFINED = (10, 20, 40, 80, 160), (1e-3, 1e-4, 1e-5, 1e-6)
SECOND_ORDER = "trapezoid"
REFERENCE = ("gauss-5", 20, 1e-7)


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


def outcome(problem: Problem) -> dict:
    """What the table needs of a solve."""
    begin = time.process_time()
    solution = continue_delta(problem)
    seconds = time.process_time() - begin
    replayed = certify(solution, tolerance=1e-8, instants=6400).efficiency
    return {
        "optimal": solution.last.optimal and solution.last.delta == problem.delta,
        "scheme": solution.mesh.scheme.name,
        "intervals": solution.mesh.n,
        "points": solution.mesh.n_point,
        "efficiency": solution.efficiency,
        "replayed": replayed,
        "iterations": sum(level.iterations for level in solution.levels),
        "seconds": seconds,
    }


def kept(cache: Path, problem: Problem) -> dict:
    """The outcome of a problem from the cache, or solved and put there."""
    key = problem.hash[:16]
    if key not in load_entries(cache):
        save_entry(cache, key, outcome(problem))
    return load_entries(cache)[key]


HEADER = """# Schemes, mesh tolerance and error

Written by `python -m benchmarks.work_precision`: the isotropic one-harmonic optimum at delta = 1e-4, half a period.
Processor seconds (certificate not included), one run on a machine that other work shared. Error: collocated efficiency
over that of the optimum ({reference:.8f}, a refined solve to 1e-7 by its own replay), less 1; beside it the same against
a replay of the same gait.

| scheme | mesh | ended with | points | efficiency | error | error against replay | iterations | CPU s |
|---|---|---|---|---|---|---|---|---|"""


def main() -> None:
    parser = argparse.ArgumentParser(description="Work and precision of schemes; see the top of this file.")
    parser.add_argument("--output", type=Path, default=Path("results"))
    options = parser.parse_args()
    options.output.mkdir(parents=True, exist_ok=True)
    cache = options.output / "work_precision.json"
    reference = kept(cache, run_problem(*REFERENCE))["replayed"]
    lines = [HEADER.format(reference=reference)]
    curves: dict[bool, dict[str, tuple[np.ndarray, np.ndarray]]] = {False: {}, True: {}}
    for scheme in SCHEMES:
        for refined in (False, True):
            rows = []
            for intervals, tolerance in [(20, t) for t in REFINED] if refined else [(n, 0.0) for n in UNIFORM]:
                if refined and scheme == SECOND_ORDER and tolerance < 1e-4:
                    continue  # thousands of intervals
                result = kept(cache, run_problem(scheme, intervals, tolerance))
                error = result["efficiency"] / reference - 1
                own = result["efficiency"] / result["replayed"] - 1
                mesh = f"to {tolerance:.0e}" if refined else "uniform"
                note = "" if result["optimal"] else " (not converged)"
                lines.append(
                    f"| {scheme} | {mesh}{note} | {result['scheme']} x {result['intervals']} | {result['points']} "
                    f"| {result['efficiency']:.7f} | {error:+.1e} | {own:+.1e} "
                    f"| {result['iterations']} | {result['seconds']:.1f} |"
                )
                print(lines[-1], flush=True)
                if result["optimal"]:
                    rows.append((result["seconds"], abs(error)))
            curves[refined][scheme] = tuple(np.array(rows).T)
    (options.output / "work_precision.md").write_text("\n".join(lines) + "\n")
    title = "Three links, isotropic, one harmonic"
    save_work_precision(options.output, "work_precision", curves[False], curves[True], title)


if __name__ == "__main__":
    main()
