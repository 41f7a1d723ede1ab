"""Optimised against prescribed concertina crawlers, epsilon falling: python -m scripts.optimise_crawlers [epsilon ...].

Both may use tangent angles up to 1.5 rad within the same region, and both are replayed by the general smooth-body solver at
the delta that belongs to epsilon. The optimum is that at a softer delta, where first-order conditions can be met.
"""

import argparse
import time
from pathlib import Path

import numpy as np

from colloc.mechanics.friction import Friction
from colloc.search.bump_optimum import best_start, optimise_bump, prescribed_vertices
from colloc.smooth.bump_body import BumpBody
from colloc.smooth.concertina import Concertina
from scripts.figures_smooth import crawler_comparison
from scripts.models.epsilon_study import Crawler, delta_for

EPSILONS, PIECES, ANGLE, SOFTER = (0.1, 0.05, 0.02, 0.01), 12, 1.5, 32


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("epsilons", nargs="*", type=float, default=EPSILONS, help="half-widths of the region, falling")
    parser.add_argument("--output", type=Path, default=Path("results/figures"), help="folder of the figure")
    options = parser.parse_args()
    friction, rows = Friction(), []
    starts: list[np.ndarray] = []
    print(f"{'epsilon':>8} {'prescribed':>11} {'+-':>8} {'optimised':>11} {'+-':>8} {'loss ratio':>10} {'CPU s':>8}  optimum")
    for epsilon in options.epsilons:
        body, delta = BumpBody(epsilon, modes=4, panels=6), delta_for(epsilon)
        prescribed = Crawler(Concertina(epsilon=epsilon, amplitude=ANGLE), friction, delta).measured_period(intervals=2)
        clock = time.process_time()
        above = 2 if starts else 8  # the optimum before is a better start than the prescribed crawler
        start = best_start(body, friction, [prescribed_vertices(body, ANGLE, PIECES), *starts], above * SOFTER * delta)
        found = optimise_bump(body, friction, start, SOFTER * delta, delta_start=above * SOFTER * delta, largest_angle=ANGLE)
        seconds = time.process_time() - clock
        starts = [found.vertices]
        failed = ", ".join(f"{c.name} {c.value:.1e}" for c in found.checks(ANGLE) if not c.passed)
        verdict = f"not certified: {failed}" if failed else f"certified at delta = {found.delta:.1e}"
        replay = found.replay(delta=delta)
        ratio = (1 / replay.efficiency - 1) / (1 / prescribed.efficiency - 1)
        print(
            f"{epsilon:8.3g} {prescribed.efficiency:11.7f} {prescribed.errors['efficiency']:8.1e} {replay.efficiency:11.7f} "
            f"{replay.errors['efficiency']:8.1e} {ratio:10.4f} {seconds:8.1f}  {verdict}",
            flush=True,
        )
        rows.append((epsilon, prescribed.efficiency, replay.efficiency))
    column = np.array(rows).T
    crawler_comparison(
        body,
        prescribed_vertices(body, ANGLE, PIECES),
        found.vertices,
        column[0],
        {"prescribed": column[1], "optimised": column[2]},
        options.output,
    )


if __name__ == "__main__":
    main()
