"""The three-link problem in colloc: python -m benchmarks.peers.colloc_three_link --starts 20 [--refined] [--compiled]

Without --refined the mesh, scheme and levels are those of the other tools (no refinement); with it, everything is at its
defaults, and a start counts only with a certificate. With --compiled the derivatives are compiled first; the first start pays.
"""

from __future__ import annotations

import argparse
import json
import os
import tempfile

import numpy as np

from benchmarks.peers.settings import INTERVALS
from benchmarks.peers.starts import starts
from colloc import Harmonic, Problem, ellipse, maximise_efficiency
from colloc.numerics.machine_code import BALANCE_ONLY, FOLDER
from colloc.results.solution import SOLVED
from colloc.search.compiled_problem import compile_problem
from colloc.search.continuation import continue_delta


def solve(start: np.ndarray, refined: bool) -> dict:
    """The gait and efficiency from one start, or what went wrong."""
    same_work: dict = {} if refined else {"scheme": "radau-3", "mesh_tolerance": 0}
    problem = Problem("peer", ellipse(*start), gait=Harmonic(1, "bilateral"), intervals=INTERVALS, **same_work)
    solution = maximise_efficiency(problem) if refined else continue_delta(problem)
    good = solution.status == SOLVED if refined else solution.levels[-1].optimal and solution.levels[-1].delta <= 1e-4
    if not good:
        return {"failed_at": solution.levels[-1].delta, "message": solution.message[:80]}
    gait = solution.gait
    return {"efficiency": solution.efficiency, "gait": [gait.mean[0], gait.cos[0, 0], gait.sin[0, 0]]}


def main() -> None:
    parser = argparse.ArgumentParser(description="The three-link problem in colloc; see the top of this file.")
    parser.add_argument("--starts", type=int, default=20)
    parser.add_argument("--refined", action="store_true")
    parser.add_argument("--compiled", action="store_true")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as code:
        os.environ[FOLDER] = code if options.compiled else BALANCE_ONLY
        begin = sum(os.times()[:4])  # the compiler's time too
        if options.compiled:
            compile_problem(Problem("peer", ellipse(0.3, 1.0, 0.5), gait=Harmonic(1, "bilateral")))
        for start in starts(options.starts):
            result = solve(start, options.refined)
            now = sum(os.times()[:4])
            result |= {"cpu": now - begin, "start": start.tolist(), "with_build": True}
            begin = now
            print(json.dumps(result), flush=True)


if __name__ == "__main__":
    main()
