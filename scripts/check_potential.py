"""What kept potentials say: python -m scripts.check_potential [FILE] [--seed 0] [--shapes 60]
[--directions 120] [--random N]

A sampled bound is a potential over shape and heading; `results/curated/potentials.json` keeps the
best that are known, for three links. The largest ratio of gain to power is looked for on lattices
and by climbs that know nothing of how it was found, or at random motions: no ratio may exceed what
is guaranteed.
"""

from __future__ import annotations

import argparse
import json
import time
from functools import partial
from pathlib import Path
from typing import NamedTuple

import numpy as np

from colloc.bounds.motions import CoulombMotion, Domain, climb_from_lattice
from colloc.bounds.potential import PotentialSpace, TensorSpline
from colloc.laws.resistance import Elliptic
from colloc.mechanics.chain import Chain
from colloc.mechanics.friction import Friction

KEPT = Path("results/curated/potentials.json")
_AT_ONCE = 200_000
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
        domain = Domain(
            Chain(tuple(kept["lengths"])), LAWS[kept["law"]](*kept["mu"]), kept["joint_limit"]
        )
        spline = TensorSpline(2, domain.joint_limit, len(kept["graded"]) + 1, tuple(kept["graded"]))
        space = PotentialSpace(spline, tuple(kept["harmonics"]), domain.body.symmetric)
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
    parser.add_argument(
        "--lengths",
        type=float,
        nargs=3,
        default=list(Chain().lengths),
        metavar="L",
        help="of the links",
    )
    parser.add_argument(
        "--friction", type=float, nargs=3, default=[1.0, 1.0, 1.0], metavar=("MU_T", "MU_F", "MU_B")
    )
    parser.add_argument(
        "--law",
        choices=LAWS,
        default="Friction",
        help="Coulomb friction, or the associated elliptic law",
    )
    parser.add_argument("--limit", type=float, default=limit, help="of the joint angles")


def domain_of(options: argparse.Namespace) -> Domain:
    """What was asked for."""
    mu_t, mu_f, mu_b = options.friction
    return Domain(
        Chain(tuple(options.lengths)),
        LAWS[options.law](mu_t=mu_t, mu_f=mu_f, mu_b=mu_b),
        options.limit,
    )


def largest_ratio(
    domain: Domain, space: PotentialSpace, free: np.ndarray, **settings: int
) -> tuple[float, CoulombMotion]:
    """The largest ratio that `climb_from_lattice` finds, and its motion."""
    reached, summit = climb_from_lattice(domain, partial(space.largest_ratios, free), **settings)
    best = int(np.argmax(reached))
    return float(reached[best]), summit.take(np.array([best]))


def largest_random_ratio(kept: Kept, count: int, seed: int) -> float:
    """Largest ratio of so many random motions, of all shapes without crossing links and all
    directions alike."""
    rng, top, left = np.random.default_rng(seed), 0.0, count
    while left > 0:
        angles = rng.uniform(-kept.domain.joint_limit, kept.domain.joint_limit, (2, _AT_ONCE))
        angles = angles[:, kept.domain.holds(angles)][:, :left]
        way = rng.uniform(0.0, 2.0 * np.pi, angles[0].shape)
        motion, _ = kept.domain.motions(angles, np.stack([np.cos(way), np.sin(way)]))
        top, left = (
            max(top, kept.space.largest_ratios(kept.free, motion).max()),
            left - angles.shape[1],
        )
    return float(top)


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("file", nargs="?", type=Path, default=KEPT)
    for name, usual in (("seed", 0), ("shapes", 60), ("directions", 120), ("starts", 1000)):
        parser.add_argument(f"--{name}", type=int, default=usual)
    parser.add_argument("--random", type=int, metavar="N", help="so many random motions instead")
    options = parser.parse_args()
    settings = {name: getattr(options, name) for name in ("seed", "shapes", "directions", "starts")}
    for kept in potentials(options.file):
        domain, begin = kept.domain, time.process_time()
        lengths = ", ".join(f"{length:.4g}" for length in domain.body.lengths)
        if options.random:
            found = (
                f"{largest_random_ratio(kept, options.random, options.seed):.5f} of "
                f"{options.random} random motions"
            )
        else:
            top, at = largest_ratio(domain, kept.space, kept.free, **settings)
            found = (
                f"{top:.5f} at angles {at.angles[:, 0].round(4)}, rates {at.rates[:, 0].round(4)}"
            )
        print(
            f"links {lengths}, {domain.friction.label}, limit {domain.joint_limit:.4f}, "
            f"{kept.space.size} unknowns, program "
            f"{kept.program:.5f}: largest ratio {found}; {time.process_time() - begin:.0f} s of "
            f"processor time",
            flush=True,
        )


if __name__ == "__main__":
    main()
