"""Guarantee an upper bound for a three-link body under associated friction; writes what was proved
as JSON.

python -m research.guarantee --target 0.47 [--limit 3.14159265] [--lengths L1 L2 L3]
    [--friction 2 1 1 --law Elliptic] [--seconds 1200] [--part 1 1] [--out results]

The potential is the kept one for that limit (`scripts.check_potential`), or one made anew. Seconds
are of processor time, of all threads (`OMP_NUM_THREADS`, else as many as there are processors).
`--part 2 4` does the second of four parts: the bound is proved if every part closes all its cells.
"""

from __future__ import annotations

import argparse
import json
import time
from dataclasses import asdict
from pathlib import Path

import numpy as np

from colloc.bounds.sampled import efficiency_bound
from research.guarantee.guaranteed import certify
from research.guarantee.potential_range import potential_space
from scripts.check_potential import add_domain, domain_of, potentials


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--target", type=float, required=True)
    parser.add_argument("--seconds", type=float, default=1200.0)
    add_domain(parser, float(np.pi))
    parser.add_argument("--part", type=int, nargs=2, default=[1, 1], metavar=("K", "N"))
    parser.add_argument("--out", type=Path, default=Path("results"))
    arguments = parser.parse_args()
    domain = domain_of(arguments)
    same = [
        each
        for each in potentials()
        if (each.domain.body, each.domain.friction) == (domain.body, domain.friction)
    ]
    kept = [each for each in same if abs(each.domain.joint_limit - domain.joint_limit) < 1e-8]
    if kept:
        space, free = kept[0].space, kept[0].free
    else:
        bound = efficiency_bound(
            domain.body, domain.friction, domain.joint_limit, cache=arguments.out / "bounds.sqlite"
        )
        print(
            f"sampled {bound.sampled:.5f} on {bound.samples} motions in {bound.seconds:.0f} s",
            flush=True,
        )
        space, free = potential_space(bound, domain.body), np.array(bound.coefficients)
    begin = time.perf_counter()
    part = (arguments.part[0], arguments.part[1])
    certificate = certify(
        domain, space, free, arguments.target, seconds=arguments.seconds, part=part
    )
    print(certificate, f"wall time {time.perf_counter() - begin:.0f} s")
    arguments.out.mkdir(parents=True, exist_ok=True)
    stated = {
        "lengths": arguments.lengths,
        "law": arguments.law,
        "mu": arguments.friction,
        "joint_limit": arguments.limit,
    }
    stated["arithmetic"] = "intervals"
    numbers = "-".join(
        f"{x:g}"
        for x in (
            *arguments.lengths,
            *arguments.friction,
            round(arguments.limit, 4),
            arguments.target,
        )
    )
    name = f"guaranteed-{arguments.law}-{numbers}-{part[0]}-of-{part[1]}.json"
    (arguments.out / name).write_text(
        json.dumps(stated | {"part": part} | asdict(certificate), indent=1) + "\n"
    )


if __name__ == "__main__":
    main()
