"""Optimised against prescribed concertina crawlers, epsilon falling: python -m scripts.optimise_crawlers [epsilon ...].

Both may use tangent angles up to 1.5 rad within the same region, and both are replayed at the delta that belongs to epsilon.
The optimum is that at a softer delta; every one starts from the optimum at the epsilon before, so delta falls along.
"""

import argparse
import time
from pathlib import Path

import numpy as np

from colloc.gaits.paths import Corners
from colloc.mechanics.friction import Friction
from colloc.search.optimise import maximise_efficiency
from colloc.smooth.concertina import Concertina
from colloc.smooth.crawler_body import CrawlerBody
from colloc.verification.replay import Replay, replay
from problems import crawler
from scripts.figures_smooth import crawler_comparison
from scripts.models.epsilon_study import Crawler, delta_for

EPSILONS, ANGLE, SOFTER, ACCURACY = (0.1, 0.05, 0.02, 0.01), 1.5, 16, 1e-4


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
    print(f"{'epsilon':>8} {'prescribed':>11} {'+-':>8} {'optimised':>11} {'+-':>8} {'loss ratio':>10} {'CPU s':>8}  optimum")
    for epsilon in options.epsilons:
        body, delta = CrawlerBody(epsilon), delta_for(epsilon)
        prescribed = Crawler(Concertina(epsilon=epsilon, amplitude=ANGLE), Friction(), delta).measured_period(intervals=2)
        clock, soft = time.process_time(), SOFTER * delta / gait.length
        stated = crawler.PROBLEM.with_(body=body, guess=gait, delta=soft, delta_start=soft, joint_limit=ANGLE)
        found = maximise_efficiency(stated)
        seconds, gait = time.process_time() - clock, found.gait
        best = replayed(body, gait, delta)
        ratio = (1 / best.efficiency - 1) / (1 / prescribed.efficiency - 1)
        print(
            f"{epsilon:8.3g} {prescribed.efficiency:11.7f} {prescribed.errors['efficiency']:8.1e} {best.efficiency:11.7f} "
            f"{best.efficiency * best.error:8.1e} {ratio:10.4f} {seconds:8.1f}  {found.status} at delta = "
            f"{found.delta_per_period:.1e} {found.message}",
            flush=True,
        )
        rows.append((epsilon, prescribed.efficiency, best.efficiency))
    column = np.array(rows).T
    efficiencies = {"prescribed": column[1], "optimised": column[2]}
    crawler_comparison(body, Corners(body.concertina(ANGLE), "antipodal"), gait, column[0], efficiencies, options.output)


if __name__ == "__main__":
    main()
