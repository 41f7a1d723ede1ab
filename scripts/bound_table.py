"""Upper bounds, best small gaits and gaps for six coefficient sets and three joint limits.

python -m scripts.bound_table [--out results] [--limits 3.14159265 3.0 2.5] [--seconds INF]

Resumable: bounds and small gaits are kept in the folder's `bounds.sqlite` and `small_gaits.sqlite` as they come; a repeated run
takes up where the last one stopped, and writes `bound_table.md` from what there is.
"""

from __future__ import annotations

import argparse
import time
from pathlib import Path

import numpy as np

from colloc.bounds.infinitesimal import best_small_gait
from colloc.bounds.sampled import Bound, Budget, efficiency_bound, known_bound
from colloc.mechanics.body import Chain
from colloc.mechanics.friction import Friction
from colloc.system.row_file import cached, hash_of
from scripts.certified_gaits import best_efficiency

COEFFICIENTS = ((1, 1, 1), (1.7, 1, 1.3), (10, 1, 1), (0.5, 1, 5), (1, 1, 3), (3, 1, 1))
"""(mu_t, mu_f, mu_b)"""
BUDGET = Budget(intervals=8, shapes=16, directions=36, rounds=30, starts=100, tolerance=2e-3)
HEAD = """# Upper bounds on the efficiency of every gait of three equal links

`python -m scripts.bound_table`. Joint angles within the limit, links 1 and 3 not crossing. *Bound*: largest ratio met
anywhere, after climbs between the samples found nothing that exceeds the program's value by 0.002 ("converged"); it
is a sampled value, not a proof. *Program*: value of the last program (no potential of this space does better on its
samples). *Small gait*: efficiency of the best infinitesimal gait found, so a lower end for the best possible gait; *at* its
shape. *Gait*: efficiency of the best certified gait of finite size that random starts with one harmonic and the table of
classes left under results/ and that keeps the limit. *Gap*: from the better of the two to the smallest valid bound; a bound
for a larger limit holds for a smaller one. Angles in rad, delta = 1e-6 at unit shape speed (gaits: 1e-4), CPU seconds on a
loaded machine.

| mu_t, mu_f, mu_b | limit | 1/min(mu) | bound | program | converged | small gait | at | gait | gap | motions | CPU s |
|---|---|---|---|---|---|---|---|---|---|---|---|
"""


def row(mu: tuple[float, ...], limit: float, bound: Bound, least: float, gait: dict, found: float) -> str:
    """A line of the table; `least` is the smallest bound valid for this limit, `found` the best certified gait or NaN."""
    place = "({:.3f}, {:.3f})".format(*gait["angles"])
    done, known = "yes" if bound.converged else "no", "" if np.isnan(found) else f"{found:.4f}"
    gap = least - np.nanmax([gait["efficiency"], found])
    return (
        f"| {mu[0]:g}, {mu[1]:g}, {mu[2]:g} | {limit:.4g} | {1 / min(mu):g} | {bound.sampled:.4f} | {bound.floor:.4f} | {done} "
        f"| {gait['efficiency']:.4f} | {place} | {known} | {gap:.4f} | {bound.samples} | {bound.seconds:.0f} |"
    )


def small(friction: Friction, limit: float, cache: Path) -> dict:
    """The best small gait, from the cache if it is there."""
    key = hash_of({"version": 1, "mu": [friction.mu_t, friction.mu_f, friction.mu_b], "limit": limit})

    def found() -> dict:
        gait, angles = best_small_gait(Chain(), friction, limit)
        rates = gait.rates.tolist()
        return {"efficiency": gait.efficiency, "angles": angles.tolist(), "heading": gait.heading, "rates": rates}

    return cached(cache, key, found)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, default=Path("results"))
    parser.add_argument("--limits", type=float, nargs="+", default=[float(np.pi), 3.0, 2.5])
    parser.add_argument("--seconds", type=float, default=np.inf, help="begin no new bound after so much processor time")
    arguments = parser.parse_args()
    rows: list[str] = []
    least = dict.fromkeys(COEFFICIENTS, np.inf)
    for limit in sorted(arguments.limits, reverse=True):
        for mu in COEFFICIENTS:
            friction, cache = Friction(*map(float, mu)), arguments.out / "bounds.sqlite"
            if time.process_time() < arguments.seconds:
                bound = efficiency_bound(Chain(), friction, limit, budget=BUDGET, cache=cache)
            else:
                known = known_bound(Chain(), friction, limit, budget=BUDGET, cache=cache)
                if known is None:
                    continue
                bound = known
            least[mu] = min(least[mu], bound.sampled)
            smallest = small(friction, limit, arguments.out / "small_gaits.sqlite")
            rows.append(row(mu, limit, bound, least[mu], smallest, best_efficiency(mu, limit, arguments.out)))
            print(rows[-1], flush=True)
    (arguments.out / "bound_table.md").write_text(HEAD + "\n".join(rows) + "\n")


if __name__ == "__main__":
    main()
