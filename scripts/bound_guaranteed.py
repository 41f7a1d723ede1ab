"""Guarantee an upper bound for the isotropic three-link body; writes what was proved as JSON.

python -m scripts.bound_guaranteed --target 0.55 --seconds 300 [--limit 3.14159265] [--out results]
"""

from __future__ import annotations

import argparse
import json
from dataclasses import asdict
from pathlib import Path

import numpy as np

from colloc.bounds.guaranteed import certify
from colloc.bounds.sampled import Budget, efficiency_bound
from colloc.mechanics.body import Chain
from colloc.mechanics.friction import Friction

BUDGET = Budget(intervals=12, first=12, harmonics=(1,), shapes=24)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--target", type=float, required=True)
    parser.add_argument("--seconds", type=float, default=300.0)
    parser.add_argument("--limit", type=float, default=float(np.pi))
    parser.add_argument("--out", type=Path, default=Path("results"))
    arguments = parser.parse_args()
    body, friction = Chain(), Friction()
    bound = efficiency_bound(body, friction, arguments.limit, budget=BUDGET, cache=arguments.out / "bounds.sqlite")
    print(f"sampled {bound.sampled:.5f} on {bound.samples} motions in {bound.seconds:.0f} s", flush=True)
    certificate = certify(body, friction, bound, arguments.target, seconds=arguments.seconds, deepest=10)
    print(certificate)
    name = f"guaranteed-{arguments.limit:.4f}-{arguments.target:g}.json"
    (arguments.out / name).write_text(json.dumps({"sampled": bound.sampled} | asdict(certificate), indent=1))


if __name__ == "__main__":
    main()
