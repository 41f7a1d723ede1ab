"""The three-link problem in colloc: python -m benchmarks.peers.colloc_three_link --starts 20
[--refined]

Without --refined the mesh, scheme and levels are those of the other tools (no refinement); with it,
everything is at its defaults (on other --intervals but the mesh tolerance), and a start counts only
with a certificate.
"""

from __future__ import annotations

import argparse

import numpy as np

from benchmarks.peers.runs import arguments, failed, found, run
from benchmarks.peers.settings import INTERVALS, MESHES
from colloc import Harmonic, Problem, ellipse
from colloc.results.solution import SOLVED, Solution
from colloc.search.explore import first_optimum
from colloc.search.solve import confirm_optimum, solve


def best(options: argparse.Namespace, start: np.ndarray) -> dict:
    """The gait and efficiency from one start, or what went wrong."""
    mesh: dict = (
        {"intervals": INTERVALS, "mesh_tolerance": MESHES[options.intervals]}
        if options.refined
        else {"intervals": options.intervals, "scheme": "radau-3", "mesh_tolerance": 0}
    )
    problem = Problem("peer", ellipse(*start), gait=Harmonic(1, "bilateral"), **mesh)
    solution = (
        solve(problem, 1)
        if options.refined
        else Solution(problem, confirm_optimum(first_optimum(problem, problem.guess)))
    )
    good = (
        solution.status == SOLVED
        if options.refined
        else solution.history[-1].optimal and solution.history[-1].delta <= 1e-4
    )
    if not good:
        return failed(solution.history[-1].delta, solution.message)
    gait = solution.gait
    return found(solution.efficiency, [gait.mean[0], gait.cos[0, 0], gait.sin[0, 0]])


if __name__ == "__main__":
    chosen = arguments(__doc__, refined="everything at its defaults, certified")
    run(chosen, lambda: chosen, best)
