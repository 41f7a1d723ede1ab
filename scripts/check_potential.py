"""What kept potentials say: python -m scripts.check_potential [FILE] [--seed 0] [--shapes 60] [--directions 120]

A sampled bound is a potential over shape and heading; `results/curated/potentials.json` keeps the best that are known, for
three equal links. The largest ratio of gain to power is looked for on lattices and by climbs that know nothing of how it
was found.
"""

from __future__ import annotations

import argparse
import json
import time
from pathlib import Path
from typing import NamedTuple

import numpy as np

from colloc.bounds.coulomb_motion import swaps_ends
from colloc.bounds.potential import PotentialSpace
from colloc.bounds.recheck import largest_ratio
from colloc.bounds.sampling import Domain
from colloc.mechanics.chain import Chain
from colloc.mechanics.friction import Friction
from colloc.numerics.spline import TensorSpline

KEPT = Path("results/curated/potentials.json")


class Kept(NamedTuple):
    """A potential for three equal links, and the value of the program that it was the optimum of."""

    domain: Domain
    space: PotentialSpace
    free: np.ndarray
    program: float


def potentials(path: Path = KEPT) -> list[Kept]:
    """Those in a file."""
    found = []
    for kept in json.loads(path.read_text()):
        domain = Domain(Chain(), Friction(*kept["mu"]), kept["joint_limit"])
        spline = TensorSpline(2, domain.joint_limit, len(kept["graded"]) + 1, tuple(kept["graded"]))
        space = PotentialSpace(spline, tuple(kept["harmonics"]), swaps_ends(domain.body))
        found.append(Kept(domain, space, np.array(kept["coefficients"]), kept["program"]))
    return found


def keep(found: Kept, path: Path = KEPT) -> None:
    """Add one to a file."""
    mu, spline = found.domain.friction, found.space.spline
    row = {
        "mu": [mu.mu_t, mu.mu_f, mu.mu_b],
        "joint_limit": found.domain.joint_limit,
        "harmonics": list(found.space.harmonics),
        "graded": spline.knots[1:-1].tolist(),
        "program": found.program,
        "coefficients": found.free.tolist(),
    }
    path.write_text(json.dumps([*json.loads(path.read_text()), row]))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("file", nargs="?", type=Path, default=KEPT)
    for name, usual in (("seed", 0), ("shapes", 60), ("directions", 120), ("starts", 1000)):
        parser.add_argument(f"--{name}", type=int, default=usual)
    options = parser.parse_args()
    settings = {name: getattr(options, name) for name in ("seed", "shapes", "directions", "starts")}
    for domain, space, free, program in potentials(options.file):
        begin, mu = time.process_time(), domain.friction
        top, at = largest_ratio(domain, space, free, **settings)
        print(
            f"mu {mu.mu_t:g}, {mu.mu_f:g}, {mu.mu_b:g}, limit {domain.joint_limit:.4f}, {space.size} unknowns, program "
            f"{program:.5f}: largest ratio {top:.5f} at angles {at.angles[:, 0].round(4)}, rates {at.rates[:, 0].round(4)}; "
            f"{time.process_time() - begin:.0f} s of processor time"
        )


if __name__ == "__main__":
    main()
