"""A zoo of random problems of the kind that people have, solved with default settings and no guess.

    python -m benchmarks.zoo --problems 100

Bodies of 3 to 6 links, equal or not; mu_t from 0.3 to 10, mu_b equal to mu_f or up to 5 times it; 1 to 4 harmonics, free paths
and polygons; every symmetry that the body has; joints within pi, 2.5 or 2. For each: whether it is solved, its efficiency over
the best ever found for that problem (kept in benchmarks/zoo_best.json, which a better answer updates), and the processor time.
Failures are printed with the reason.
"""

from __future__ import annotations

import argparse
import json
import time
from pathlib import Path

import numpy as np

from colloc import Chain, FreePath, Friction, Harmonic, Polygon, Problem
from colloc.results.solution import SOLVED
from colloc.search.global_search import STARTS
from colloc.search.optimise import best_gait

BEST = Path(__file__).with_name("zoo_best.json")
GOOD = 0.99
SEED = 21


def zoo_problem(number: int) -> Problem:
    """Problem `number` of the zoo; it depends on that number alone."""
    rng = np.random.default_rng([SEED, number])
    links = int(rng.integers(3, 7))
    symmetric = rng.random() < 0.6
    lengths = np.full(links, 1.0) if rng.random() < 0.4 else rng.uniform(0.5, 1.5, links)
    if symmetric:
        lengths = lengths + lengths[::-1]
    lengths = lengths / lengths.sum()
    body = Chain((*lengths[:-1], 1.0 - lengths[:-1].sum()))
    mu_t, mu_b = float(np.exp(rng.uniform(np.log(0.3), np.log(10.0)))), float(rng.choice([1.0, rng.uniform(1.0, 5.0)]))
    symmetry = str(rng.choice(["none", "bilateral", "antipodal"] if body.symmetric else ["none", "antipodal"]))
    kind, limit = rng.random(), float(rng.choice([np.pi, 2.5, 2.0]))
    gait: Harmonic | FreePath | Polygon
    if kind < 0.7:
        gait = Harmonic(int(rng.integers(1, 5)), symmetry)
    elif kind < 0.85:
        gait = FreePath(float(rng.choice([1.0, 2.0, 4.0])), symmetry)
    else:
        gait = Polygon(2 * int(rng.integers(2, 5)), symmetry)
    return Problem(f"zoo-{number}", body=body, friction=Friction(mu_t, 1.0, mu_b), gait=gait, joint_limit=limit)


def described(problem: Problem) -> str:
    """In one line."""
    law = problem.friction.label
    return f"{problem.body.describe()}, {law} {problem.gait.describe()}, within {problem.joint_limit:.2f}"


def main() -> None:
    """Run the zoo and print what came out."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--problems", type=int, default=100, metavar="N")
    parser.add_argument("--first", type=int, default=0, metavar="K", help="begin with this one")
    parser.add_argument("--starts", type=int, default=STARTS, metavar="N", help="more look for better answers")
    options = parser.parse_args()
    best = json.loads(BEST.read_text(encoding="utf-8")) if BEST.exists() else {}
    solved, quality, seconds = [], [], []
    for number in range(options.first, options.first + options.problems):
        problem = zoo_problem(number)
        begin = time.process_time()
        try:
            solution = best_gait(problem, options.starts)
            status, efficiency, message = solution.status, solution.efficiency, solution.message
        except Exception as error:  # whatever goes wrong is what this is looking for
            status, efficiency, message = "error", np.nan, f"{type(error).__name__}: {error}"
        seconds.append(time.process_time() - begin)
        solved.append(status == SOLVED)
        if status == SOLVED and efficiency > best.get(problem.name, 0.0):
            best[problem.name] = efficiency
            BEST.write_text(json.dumps(best, indent=1, sort_keys=True) + "\n", encoding="utf-8")
        quality.append(efficiency / best[problem.name] if solved[-1] else 0.0)
        line = f"{number:4d} {status:18s} {efficiency:9.6f} {quality[-1]:7.4f} {seconds[-1]:7.2f} s  {described(problem)}"
        print(line + (f"\n     {message}" if message else ""), flush=True)
    n = len(solved)
    print(f"{sum(solved)} of {n} solved; {sum(q > GOOD for q in quality)} within 1 % of the best known")
    print(f"processor time: median {np.median(seconds):.2f} s, largest {max(seconds):.2f} s")


if __name__ == "__main__":
    main()
