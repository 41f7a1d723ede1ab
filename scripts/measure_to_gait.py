"""From the bound to the gait: the multipliers of the bound's program as a measure, drawn, and a start for a relaxed gait.

python -m scripts.measure_to_gait [--out results] [--friction 1 1 1] [--limit 2.5] [--intervals 8]

Writes measure.png, and prints what the program says and what the search makes of it, with no other start.
"""

from __future__ import annotations

import argparse
from pathlib import Path

from colloc.bounds.cutting_plane import exchanged_optimum
from colloc.bounds.potential import PotentialSpace
from colloc.bounds.sampling import Domain
from colloc.gaits.problem import Problem
from colloc.gaits.relaxed import Relaxed
from colloc.mechanics.body import Chain
from colloc.mechanics.friction import Friction
from colloc.numerics.spline import TensorSpline
from colloc.pictures.measure_figure import measure_figure
from colloc.pictures.style import save
from colloc.search.relaxed_search import best_relaxed_gait


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, default=Path("results"))
    parser.add_argument("--friction", type=float, nargs=3, default=[1.0, 1.0, 1.0], metavar=("MU_T", "MU_F", "MU_B"))
    parser.add_argument("--limit", type=float, default=2.5)
    parser.add_argument("--intervals", type=int, default=8, help="knot intervals of the potential")
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    body, friction = Chain(), Friction(*options.friction)
    harmonics = (1, 3) if friction.reversible else (0, 1)
    space = PotentialSpace(TensorSpline(2, options.limit, options.intervals), harmonics, True)
    domain = Domain(body, friction, options.limit)
    bound = exchanged_optimum(domain, space, shapes=16, directions=36, rounds=30, starts=100, tolerance=2e-3)
    measure = bound.measure
    motions = measure.weight.size
    print(f"bound {bound.top:.4f}, program {bound.floor:.4f}, {motions} motions travel {measure.efficiency():.4f} per work")
    problem = Problem("measure", friction=friction, gait=Relaxed(3, "both"), delta=1e-5, joint_limit=options.limit)
    solution = best_relaxed_gait(problem, 0, (1, 4), first=(measure.path(),))
    relaxed, best = solution.certificate, solution.best
    print(f"relaxed {relaxed.efficiency:.4f}, {relaxed.efficiency_at_zero_delta:.4f} for delta -> 0")
    print(f"finite {best.certificate.efficiency:.4f} with {best.corners} corners, {solution.status}")
    print(*save(measure_figure(problem, measure, solution.gait), options.out / "measure", ("png",)))


if __name__ == "__main__":
    main()
