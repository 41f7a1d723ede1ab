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

import numpy as np

from colloc.bounds.coulomb_motion import swaps_ends
from colloc.bounds.potential import PotentialSpace
from colloc.bounds.recheck import largest_ratio
from colloc.bounds.sampling import Domain
from colloc.mechanics.body import Chain
from colloc.mechanics.friction import Friction
from colloc.numerics.spline import TensorSpline

KEPT = Path("results/curated/potentials.json")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("file", nargs="?", type=Path, default=KEPT)
    for name, usual in (("seed", 0), ("shapes", 60), ("directions", 120), ("starts", 1000)):
        parser.add_argument(f"--{name}", type=int, default=usual)
    options = parser.parse_args()
    body = Chain()
    for kept in json.loads(options.file.read_text()):
        spline = TensorSpline(2, kept["joint_limit"], len(kept["graded"]) + 1, tuple(kept["graded"]))
        space = PotentialSpace(spline, tuple(kept["harmonics"]), swaps_ends(body))
        domain, begin = Domain(body, Friction(*kept["mu"]), kept["joint_limit"]), time.process_time()
        settings = {name: getattr(options, name) for name in ("seed", "shapes", "directions", "starts")}
        top, at = largest_ratio(domain, space, np.array(kept["coefficients"]), **settings)
        print(
            f"mu {kept['mu']}, limit {kept['joint_limit']:.4f}, {space.size} unknowns, program {kept['program']:.5f}: largest "
            f"ratio {top:.5f} at angles {at.angles[:, 0].round(4)}, rates {at.rates[:, 0].round(4)}; "
            f"{time.process_time() - begin:.0f} s of processor time"
        )


if __name__ == "__main__":
    main()
