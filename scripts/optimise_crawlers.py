"""Optimised against prescribed concertina crawlers, epsilon falling: python -m scripts.optimise_crawlers [epsilon ...].

Both may use tangent angles up to 1.5 rad within the same region, and both are replayed at the delta that belongs to epsilon.
The optimum is that at a softer delta, on the class's coarsest mesh; every one starts from the optimum at the epsilon before, so
delta falls along. `colloc solve problems/crawler.py` refines and certifies one of them.
"""

import argparse
import time
from pathlib import Path

import numpy as np

from colloc.gaits.polygon import Corners
from colloc.mechanics.friction import Friction
from colloc.search.converge import FIRST_RADIUS, converged
from colloc.search.optimum import ROUGH
from colloc.search.spaces import space_near
from colloc.smooth.concertina import Concertina
from colloc.smooth.crawler_body import LAP, CrawlerBody
from colloc.verification.replay import Replay, replay
from problems import crawler
from scripts.figures_smooth import crawler_comparison
from scripts.models.epsilon_study import Crawler, delta_for

EPSILONS, ANGLE, SOFTER, ACCURACY = (0.1, 0.05, 0.02, 0.01), 1.5, 32, 1e-4
LENGTH = 2 * (LAP + 2 * ANGLE)
"""Of the paper's crawler in shape space, less its return while straight: delta per period over it is that at unit speed."""


def replayed(body: CrawlerBody, gait: Corners, delta: float) -> Replay:
    """What a gait achieves on isotropic friction at a delta per period."""

    def path(t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return gait.angles(t), gait.rates(t)

    return replay(body, Friction(), path, delta, instants=200, tolerance=ACCURACY, breaks=gait.corner_phases)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("epsilons", nargs="*", type=float, default=EPSILONS, help="half-widths of the region, falling")
    parser.add_argument("--output", type=Path, default=Path("results/figures"), help="folder of the figure")
    options = parser.parse_args()
    rows, gait = [], crawler.PROBLEM.guess
    print(
        f"{'epsilon':>8} {'prescribed':>11} {'+-':>8} {'optimised':>11} {'+-':>8} {'loss ratio':>10} {'KKT error':>9} "
        f"{'softer':>11} {'replay gap':>10} {'CPU s':>6}"
    )
    for epsilon in options.epsilons:
        body, delta = CrawlerBody(epsilon), delta_for(epsilon)
        prescribed = Crawler(Concertina(epsilon=epsilon, amplitude=ANGLE), Friction(), delta).measured_period(intervals=2)
        clock, soft = time.process_time(), SOFTER * delta / LENGTH
        sides = crawler.PROBLEM.gait.corners
        stated = crawler.PROBLEM.with_(body=body, guess=gait, delta=soft, delta_start=soft, joint_limit=ANGLE, intervals=sides)
        space, v = space_near(stated, gait)
        found = converged(space, v, soft, FIRST_RADIUS, ROUGH)
        seconds, gait = time.process_time() - clock, found.gait
        near, best = (replayed(body, gait, at) for at in (SOFTER * delta, delta))
        ratio = (1 / best.efficiency - 1) / (1 / prescribed.efficiency - 1)
        print(
            f"{epsilon:8.3g} {prescribed.efficiency:11.7f} {prescribed.errors['efficiency']:8.1e} {best.efficiency:11.7f} "
            f"{best.efficiency * best.error:8.1e} {ratio:10.4f} {found.kkt_error:9.1e} {near.efficiency:11.7f} "
            f"{-found.objective / near.efficiency - 1:10.1e} {seconds:6.1f}",
            flush=True,
        )
        rows.append((epsilon, prescribed.efficiency, best.efficiency))
    column = np.array(rows).T
    efficiencies = {"prescribed": column[1], "optimised": column[2]}
    crawler_comparison(body, Corners(body.concertina(ANGLE), "antipodal"), gait, column[0], efficiencies, options.output)


if __name__ == "__main__":
    main()
