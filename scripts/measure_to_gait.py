"""From the bound to the gait: the multipliers of the bound's program as a measure, drawn, and a start for a relaxed gait.

python -m scripts.measure_to_gait [--out results] [--friction 1 1 1] [--limit 2.5] [--intervals 8] [--first 8] [--no-gait]
    [--harmonics 1 3] [--lengths L1 L2 L3] [--law Elliptic] [--keep]

Writes measure.png, and prints what the program says and what the search makes of it, with no other start. With `--no-gait` it
prints only what the program says, its unknowns and its knots; with `--keep` the potential joins those kept.
"""

from __future__ import annotations

import argparse
import time
from pathlib import Path

from colloc.bounds.coulomb_motion import swaps_ends
from colloc.bounds.cutting_plane import exchanged_optimum
from colloc.bounds.potential import PotentialSpace
from colloc.gaits.problem import Problem
from colloc.gaits.relaxed import Relaxed
from colloc.numerics.spline import TensorSpline
from colloc.pictures.style import save
from colloc.search.relaxed import explore_relaxed, realised_solution
from scripts.check_potential import Kept, add_domain, domain_of, keep
from scripts.figures_measure import measure_figure


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, default=Path("results"))
    add_domain(parser, 2.5)
    parser.add_argument("--intervals", type=int, default=8, help="knot intervals of the potential")
    parser.add_argument("--first", type=int, default=8, help="even ones to begin with; the rest goes where it is wanted")
    parser.add_argument("--harmonics", type=int, nargs="+", help="in the heading; 1 3, or 0 1 where mu_b differs from mu_f")
    parser.add_argument("--tolerance", type=float, default=2e-3, help="of the climbs above the program")
    parser.add_argument("--no-gait", action="store_true", help="the bound only")
    parser.add_argument("--keep", action="store_true", help="add the potential to results/curated/potentials.json")
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    domain = domain_of(options)
    harmonics = tuple(options.harmonics or ((1, 3) if domain.friction.reversible else (0, 1)))
    space = PotentialSpace(
        TensorSpline(2, options.limit, min(options.first, options.intervals)), harmonics, swaps_ends(domain.body)
    )
    lattice = {"shapes": 20, "directions": 48, "rounds": 60, "starts": 150}
    begin = time.process_time()
    bound = exchanged_optimum(domain, space, intervals=options.intervals, tolerance=options.tolerance, **lattice)
    measure, seconds = bound.measure, time.process_time() - begin
    motions = measure.weight.size
    print(
        f"bound {bound.top:.5f}, program {bound.floor:.5f} with {bound.space.size} unknowns, {motions} motions travel "
        f"{measure.efficiency():.4f} per work; {seconds:.0f} s of processor time"
    )
    print("knots", *(f"{knot:.3f}" for knot in bound.space.spline.knots if knot > -1e-9))
    if options.keep:
        keep(Kept(domain, bound.space, bound.free, bound.floor))
    if options.no_gait:
        return
    problem = Problem(
        "measure", body=domain.body, friction=domain.friction, gait=Relaxed(3, "both"), delta=1e-5, joint_limit=options.limit
    )
    solution = realised_solution(explore_relaxed(problem, 0, first=(measure.path(),)).optima[0], (1, 4))
    assert solution.relaxed is not None
    relaxed, best = solution.relaxed.certificate, solution.relaxed.best
    print(f"relaxed {relaxed.efficiency:.4f}, {relaxed.efficiency_at_zero_delta:.4f} for delta -> 0")
    print(f"finite {best.certificate.efficiency:.4f} with {best.corners} corners, {solution.status}")
    print(*save(measure_figure(problem, measure, solution.gait), options.out / "measure", ("png",)))


if __name__ == "__main__":
    main()
