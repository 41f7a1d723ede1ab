"""What kept potentials say: python -m scripts.check_potential [FILE] [--seed 0] [--shapes 60] [--directions 120]

A sampled bound is a potential over shape and heading; `results/curated/potentials.json` keeps the best that are known, for
three links. The largest ratio of gain to power is looked for on lattices and by climbs that know nothing of how it
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
from colloc.laws.elliptic import Elliptic
from colloc.mechanics.chain import Chain
from colloc.mechanics.friction import Friction
from colloc.numerics.spline import TensorSpline

KEPT = Path("results/curated/potentials.json")
LAWS: dict[str, type[Friction]] = {law.__name__: law for law in (Friction, Elliptic)}


class Kept(NamedTuple):
    """A potential for three links, and the value of the program that it was the optimum of."""

    domain: Domain
    space: PotentialSpace
    free: np.ndarray
    program: float


def potentials(path: Path = KEPT) -> list[Kept]:
    """Those in a file."""
    found = []
    for kept in json.loads(path.read_text()):
        domain = Domain(Chain(tuple(kept["lengths"])), LAWS[kept["law"]](*kept["mu"]), kept["joint_limit"])
        spline = TensorSpline(2, domain.joint_limit, len(kept["graded"]) + 1, tuple(kept["graded"]))
        space = PotentialSpace(spline, tuple(kept["harmonics"]), swaps_ends(domain.body))
        found.append(Kept(domain, space, np.array(kept["coefficients"]), kept["program"]))
    return found


def keep(found: Kept, path: Path = KEPT) -> None:
    """Add one to a file."""
    mu, spline = found.domain.friction, found.space.spline
    row = {
        "lengths": list(found.domain.body.lengths),
        "law": type(mu).__name__,
        "mu": [mu.mu_t, mu.mu_f, mu.mu_b],
        "joint_limit": found.domain.joint_limit,
        "harmonics": list(found.space.harmonics),
        "graded": spline.knots[1:-1].tolist(),
        "program": found.program,
        "coefficients": found.free.tolist(),
    }
    path.write_text(json.dumps([*json.loads(path.read_text()), row]))


def add_domain(parser: argparse.ArgumentParser, limit: float) -> None:
    """Options that say which body, law and joint limit a bound is for; see `domain_of`."""
    parser.add_argument("--lengths", type=float, nargs=3, default=list(Chain().lengths), metavar="L", help="of the links")
    parser.add_argument("--friction", type=float, nargs=3, default=[1.0, 1.0, 1.0], metavar=("MU_T", "MU_F", "MU_B"))
    parser.add_argument("--law", choices=LAWS, default="Friction", help="Coulomb friction, or the associated elliptic law")
    parser.add_argument("--limit", type=float, default=limit, help="of the joint angles")


def domain_of(options: argparse.Namespace) -> Domain:
    """What was asked for."""
    return Domain(Chain(tuple(options.lengths)), LAWS[options.law](*options.friction), options.limit)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("file", nargs="?", type=Path, default=KEPT)
    for name, usual in (("seed", 0), ("shapes", 60), ("directions", 120), ("starts", 1000)):
        parser.add_argument(f"--{name}", type=int, default=usual)
    options = parser.parse_args()
    settings = {name: getattr(options, name) for name in ("seed", "shapes", "directions", "starts")}
    for domain, space, free, program in potentials(options.file):
        begin, mu = time.process_time(), domain.friction
        lengths = ", ".join(f"{length:.4g}" for length in domain.body.lengths)
        top, at = largest_ratio(domain, space, free, **settings)
        print(
            f"links {lengths}, {mu.label}, limit {domain.joint_limit:.4f}, {space.size} unknowns, program "
            f"{program:.5f}: largest ratio {top:.5f} at angles {at.angles[:, 0].round(4)}, rates {at.rates[:, 0].round(4)}; "
            f"{time.process_time() - begin:.0f} s of processor time"
        )


if __name__ == "__main__":
    main()
