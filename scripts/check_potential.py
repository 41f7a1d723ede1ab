"""What kept potentials say: python -m scripts.check_potential [FILE] [--seed 0] [--shapes 60]
[--directions 120] [--starts 1000]

A sampled bound is a potential over shape and heading; `results/curated/potentials.json` keeps the
best that are known, for three links. The largest ratio of gain to power is looked for on lattices
and by climbs that know nothing of how it was found: no ratio may exceed what is guaranteed.
"""

from __future__ import annotations

import argparse
import json
import time
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from colloc.bounds.motions import CoulombMotion, Domain, climb_from_lattice
from colloc.bounds.sampled import PotentialSpace, TensorSpline
from colloc.laws.resistance import Elliptic
from colloc.mechanics.chain import Chain
from colloc.mechanics.friction import Friction
from scripts.program import command_line

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
    three: Any = {"type": float, "nargs": 3}
    lengths, laws = list(Chain().lengths), "Coulomb friction, or the associated elliptic law"
    mu = ("MU_T", "MU_F", "MU_B")
    parser.add_argument("--lengths", **three, default=lengths, metavar="L", help="of the links")
    parser.add_argument("--friction", **three, default=[1.0, 1.0, 1.0], metavar=mu)
    parser.add_argument("--law", choices=LAWS, default="Friction", help=laws)
    parser.add_argument("--limit", type=float, default=limit, help="of the joint angles")


def domain_of(options: argparse.Namespace) -> Domain:
    """What was asked for."""
    law = LAWS[options.law](**dict(zip(("mu_t", "mu_f", "mu_b"), options.friction, strict=True)))
    return Domain(Chain(tuple(options.lengths)), law, options.limit)


def largest_ratio(
    domain: Domain, space: PotentialSpace, free: np.ndarray, **settings: int
) -> tuple[float, CoulombMotion]:
    """The largest ratio that `climb_from_lattice` finds, and its motion."""
    reached, summit = climb_from_lattice(domain, partial(space.largest_ratios, free), **settings)
    best = int(np.argmax(reached))
    return float(reached[best]), summit.take(np.array([best]))


def main() -> None:
    usual = {"seed": 0, "shapes": 60, "directions": 120, "starts": 1000}
    settings = vars(command_line(__doc__, ("file", KEPT), **usual))
    for kept in potentials(settings.pop("file")):
        domain, begin = kept.domain, time.process_time()
        lengths = ", ".join(f"{length:.4g}" for length in domain.body.lengths)
        top, at = largest_ratio(domain, kept.space, kept.free, **settings)
        print(
            f"links {lengths}, {domain.friction.label}, limit {domain.joint_limit:.4f}, "
            f"{kept.space.size} unknowns, program {kept.program:.5f}: largest ratio {top:.5f} at "
            f"angles {at.angles[:, 0].round(4)}, rates {at.rates[:, 0].round(4)}; "
            f"{time.process_time() - begin:.0f} s of processor time",
            flush=True,
        )


if __name__ == "__main__":
    main()
