"""Optimised against prescribed concertina crawlers, epsilon falling: python -m scripts.optimise_crawlers [epsilon ...].

Both may use tangent angles up to 1.5 rad within the same region, and both are replayed by the general smooth-body solver.
"""

import sys
import time
from pathlib import Path

import numpy as np

from colloc.bump_body import BumpBody
from colloc.bump_optimum import best_start, optimise_bump, prescribed_vertices
from colloc.concertina import Concertina
from colloc.epsilon_study import delta_for
from colloc.figures_smooth import crawler_comparison
from colloc.friction import Friction

EPSILONS, PIECES, ANGLE = [float(a) for a in sys.argv[1:]] or [0.1, 0.05, 0.02, 0.01], 12, 1.5
friction, starts, rows = Friction(), [], []
print(f"{'epsilon':>8} {'prescribed':>11} {'+-':>8} {'optimised':>11} {'+-':>8} {'loss ratio':>10} {'seconds':>8}")
for epsilon in EPSILONS:
    body, delta = BumpBody(epsilon, modes=4), delta_for(epsilon)
    prescribed = Concertina(epsilon=epsilon, amplitude=ANGLE, friction=friction, delta=delta).measured_period(intervals=2)
    clock = time.perf_counter()
    start = best_start(body, friction, [prescribed_vertices(body, ANGLE, PIECES), *starts], 16 * delta)
    found = optimise_bump(body, friction, start, 16 * delta, largest_angle=ANGLE, rounds=8, iterations=15)
    seconds = time.perf_counter() - clock
    starts = [found.vertices]
    replay = found.replay(delta=delta)
    ratio = (1 / replay.efficiency - 1) / (1 / prescribed.efficiency - 1)
    print(
        f"{epsilon:8.3g} {prescribed.efficiency:11.7f} {prescribed.errors['efficiency']:8.1e} {replay.efficiency:11.7f} "
        f"{replay.errors['efficiency']:8.1e} {ratio:10.4f} {seconds:8.1f}",
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
    Path("results/figures"),
)
