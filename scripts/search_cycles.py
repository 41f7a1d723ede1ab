"""Near-global search for gaits by maximum-ratio cycles, replayed independently; optionally polished by collocation.

python -m scripts.search_cycles [--mu 1 1 1] [--limit 3.14159265] [--cases 24,2 24,4 24,7] [--harmonics 3] [--out results]

A case is INTERVALS,TURNING of `colloc.bounds.cycle_search.best_cycle`. Writes `cycles.md` and the polygons as JSON.
"""

from __future__ import annotations

import argparse
import json
import time
from pathlib import Path

import numpy as np

from colloc import Chain, CollocError, Friction, Harmonic, Problem, maximise_efficiency
from colloc.bounds.cycle_search import Cycle, best_cycle, polygon_gait, polygon_path
from colloc.verification.replay import replay

HEAD = """# Cycles of largest ratio on a lattice of shapes, {friction}, |angles| <= {limit:.4g}

`python -m scripts.search_cycles`. Intervals of the lattice, largest turn from step to step (in 1/16 of a full turn), corners,
ratio on the lattice; then an independent replay of the polygon at constant speed (delta = 1e-6 per period) with what its
rotation misses over a period; then the certified efficiency of collocation started there, with {harmonics} harmonics.

| intervals | turning | corners | ratio | replay | rotation | distance | collocation | CPU s |
|---|---|---|---|---|---|---|---|---|
"""


def polished(cycle: Cycle, friction: Friction, limit: float, harmonics: int, delta: float = 1e-3) -> str:
    """Certified efficiency of collocation from the polygon's Fourier series, or what kept it from one."""
    try:
        problem = Problem(
            name="cycle",
            friction=friction,
            gait=Harmonic(harmonics=harmonics),
            guess=polygon_gait(cycle.shapes, harmonics, limit),
            delta=delta,
            joint_limit=limit,
        )
        solution = maximise_efficiency(problem)
    except CollocError as error:
        return f"none ({type(error).__name__})"
    if not solution.certificate.replayed:
        return f"none ({solution.status})"
    return f"{solution.certificate.efficiency:.4f} ({solution.status})"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--mu", type=float, nargs=3, default=(1.0, 1.0, 1.0))
    parser.add_argument("--limit", type=float, default=float(np.pi))
    parser.add_argument("--cases", nargs="+", default=["24,2", "24,4", "24,7"])
    parser.add_argument("--harmonics", type=int, default=0, help="of the gaits collocation starts from; 0: no collocation")
    parser.add_argument("--out", type=Path, default=Path("results"))
    arguments = parser.parse_args()
    body, friction = Chain(), Friction(*arguments.mu)
    arguments.out.mkdir(parents=True, exist_ok=True)
    lines, polygons = [], {}
    for case in arguments.cases:
        intervals, turning = map(int, case.split(","))
        begin = time.process_time()
        cycle = best_cycle(body, friction, arguments.limit, intervals=intervals, turning=turning)
        seconds = time.process_time() - begin
        again = replay(body, friction, polygon_path(cycle.shapes), 1e-6, tolerance=1e-4, most_instants=12800)
        solved = polished(cycle, friction, arguments.limit, arguments.harmonics) if arguments.harmonics else "-"
        lines.append(
            f"| {intervals} | {turning} | {cycle.shapes.shape[1]} | {cycle.ratio:.4f} | {again.efficiency:.4f} "
            f"| {again.rotation:.3f} | {again.distance:.4f} | {solved} | {seconds:.0f} |"
        )
        polygons[case] = cycle.shapes.round(12).tolist()
        print(lines[-1], flush=True)
    head = HEAD.format(friction=friction, limit=arguments.limit, harmonics=arguments.harmonics)
    (arguments.out / "cycles.md").write_text(head + "\n".join(lines) + "\n")
    (arguments.out / "cycles.json").write_text(json.dumps(polygons))


if __name__ == "__main__":
    main()
