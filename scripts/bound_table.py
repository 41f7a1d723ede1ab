"""Upper bounds for the six coefficient sets and three joint limits, kept in a cache and printed as a table.

python scripts/bound_table.py [--out results] [--limits 3.14159265 3.0 2.5]
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np

from colloc.body import Chain
from colloc.bound import Budget, efficiency_bound
from colloc.friction import Friction

COEFFICIENTS = ((1, 1, 1), (1.7, 1, 1.3), (10, 1, 1), (0.5, 1, 5), (1, 1, 3), (3, 1, 1))
"""(mu_t, mu_f, mu_b)"""


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=Path("results"))
    parser.add_argument("--limits", type=float, nargs="+", default=[float(np.pi), 3.0, 2.5])
    parser.add_argument("--shapes", type=int, default=24)
    parser.add_argument("--directions", type=int, default=24)
    parser.add_argument("--refinements", type=int, default=3)
    parser.add_argument("--intervals", type=int, nargs="+", default=[8])
    arguments = parser.parse_args()
    print("mu_t  mu_f  mu_b  limit   1/min(mu)  sampled  floor    at angles        rates            motions  seconds")
    for limit in arguments.limits:
        for mu in COEFFICIENTS:
            friction = Friction(*map(float, mu))
            budget = Budget(
                intervals=tuple(arguments.intervals),
                shapes=arguments.shapes,
                directions=arguments.directions,
                refinements=arguments.refinements,
                linear_rounds=10,
            )
            bound = efficiency_bound(Chain(), friction, limit, budget=budget, cache=arguments.out / "bounds.json")
            place = "({:.3f}, {:.3f})  ({:.3f}, {:.3f})".format(*bound.angles, *bound.rates)
            print(
                f"{mu[0]:<5} {mu[1]:<5} {mu[2]:<5} {limit:<7.4f} {1 / friction.smallest:<10.4f} {bound.sampled:<8.4f} "
                f"{bound.floor:<8.4f} {place}  {bound.samples:<8} {bound.seconds:.1f}",
                flush=True,
            )


if __name__ == "__main__":
    main()
