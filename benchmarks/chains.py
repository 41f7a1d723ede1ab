"""Time and memory of a solve against the number of links, 2 to 8: python -m benchmarks.chains [--output results]

n equal links in a travelling wave, angle_j = 0.8 cos(2 pi (t - j/n)) as a guess, antipodal, mu_t = 10 and mu_f = 1 (mu_b = 5
for two links, which could not move otherwise); each solved and certified in a process of its own. Writes chains.md. The best
gaits of four and five links are those of `scripts.class_table`.
"""

from __future__ import annotations

import argparse
import json
import resource
import subprocess
import sys
import time
from pathlib import Path

import numpy as np

from colloc import Chain, Fourier, Friction, Harmonic, Problem
from colloc.search.solve import solve

SIZES = (2, 3, 4, 5, 6, 7, 8)


def wave_problem(links: int) -> Problem:
    """A travelling wave on n equal links."""
    phase = 2 * np.pi * np.arange(links - 1) / links
    return Problem(
        name=f"wave-{links}",
        body=Chain((1 / links,) * links),
        friction=Friction(10, 1, 5 if links == 2 else 1),
        gait=Harmonic(1, "antipodal"),
        guess=Fourier(np.zeros(links - 1), 0.8 * np.cos(phase)[:, None], 0.8 * np.sin(phase)[:, None]),
        intervals=24,
    )


def outcome(problem: Problem) -> dict:
    """What the table needs of one solve."""
    begin = time.process_time()
    solution = solve(problem, 1)
    return {
        "status": solution.status,
        "efficiency": solution.measured.efficiency,
        "distance": solution.measured.distance,
        "cpu_seconds": time.process_time() - begin,
        "megabytes": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024,
        "iterations": sum(level.iterations for level in solution.history),
        "points": solution.mesh.n_point,
        "variables": int(solution.layout.n),
    }


def row(links: int) -> str:
    """A line of the table, measured in a fresh process."""
    command = [sys.executable, "-m", "benchmarks.chains", "--wave", str(links)]
    o = json.loads(subprocess.run(command, check=True, capture_output=True, text=True).stdout)
    return (
        f"| {links} | {(links - 1) * (links - 2) // 2} | {o['status']} | {o['efficiency']:.5f} | {o['distance']:.4f} "
        f"| {o['points']} | {o['variables']} | {o['iterations']} | {o['cpu_seconds']:.1f} | {o['megabytes']:.0f} |"
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--output", type=Path, default=Path("results"))
    parser.add_argument("--wave", type=int, metavar="LINKS", help="solve one travelling wave and print JSON")
    options = parser.parse_args()
    if options.wave:
        print(json.dumps(outcome(wave_problem(options.wave))))
        return
    options.output.mkdir(parents=True, exist_ok=True)
    rows = []
    for links in SIZES:
        rows.append(row(links))
        print(rows[-1], flush=True)
    (options.output / "chains.md").write_text(document(rows), encoding="utf-8")


def document(rows: list[str]) -> str:
    """The table with its head."""
    return "\n".join(
        [
            "# Time and memory against the number of links",
            "",
            "Written by `python -m benchmarks.chains`. Antipodal travelling wave, one harmonic, delta = 1e-4, friction",
            "(10, 1, 1); (10, 1, 5) for two links. Pairs: those that are not neighbours, all checked between nodes. d/W is",
            "that of an independent replay. Seconds: processor time of one solve, certificate included, on a core that other",
            "work shared. Memory: peak of the process, libraries included.",
            "",
            "| links | pairs | status | d/W | d | points | variables | iterations | CPU s | MB |",
            "|---|---|---|---|---|---|---|---|---|---|",
            *rows,
            "",
        ]
    )


if __name__ == "__main__":
    main()
