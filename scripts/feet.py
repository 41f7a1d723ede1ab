"""How efficiently chains crawl on feet and wheels: python -m scripts.feet [--starts 16] [--output results]

The best gait found by the usual search, of chains of equal links that lie on the floor, stand on one to three feet a link, or
on a wheel each that rolls at a fiftieth of its friction sideways; and what bounds all gaits of three links. A table, feet.md.
"""

from __future__ import annotations

import argparse
import warnings
from pathlib import Path

from colloc.bounds.infinitesimal import best_small_gait
from colloc.bounds.sampled import efficiency_bound
from colloc.gaits.harmonic import Harmonic
from colloc.gaits.problem import Problem
from colloc.mechanics.chain import Chain
from colloc.mechanics.feet import Wheel
from colloc.mechanics.friction import Friction
from colloc.search.solve import solve
from colloc.system.errors import CollocError

STANDS = (0, 1, 2, 3)
SCENES = (
    (2, Friction(1, 1, 3), 1),
    (3, Friction(), 1),
    (3, Friction(), 2),
    (3, Friction(), 3),
    (3, Friction(2, 1, 1), 1),
    (3, Friction(2, 1, 1), 2),
    (4, Friction(), 1),
    (4, Friction(), 2),
    (4, Friction(2, 1, 1), 1),
    (5, Friction(), 1),
    (5, Friction(), 2),
    (5, Friction(2, 1, 1), 1),
)
HEAD = ("links", "friction", "harmonics", "line", "1 foot a link", "2 feet", "3 feet")


def best(body: Chain, friction: Friction, harmonics: int, starts: int) -> str:
    """Efficiency of the best gait found, and the distance of a period; in brackets if the certificate fails."""
    problem = Problem("feet", body=body, friction=friction, gait=Harmonic(harmonics))
    try:
        with warnings.catch_warnings(action="ignore"):
            found = solve(problem, starts)
    except CollocError:
        return "none"
    text = f"{found.certificate.efficiency:.4f} ({found.certificate.distance:.3f})"
    return text if found.certificate.passed else f"[{text}]"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--starts", type=int, default=16, metavar="N", help="of every search")
    parser.add_argument("--output", type=Path, default=Path("results"), metavar="FOLDER")
    options = parser.parse_args()
    lines = [f"d/W at delta 1e-4 (distance of a period), by `python -m scripts.feet --starts {options.starts}`.", ""]
    lines += [f"| {' | '.join(HEAD)} |", "|---" * len(HEAD) + "|"]
    for links, friction, harmonics in SCENES:
        cells = [best(Chain((1 / links,) * links, feet=feet), friction, harmonics, options.starts) for feet in STANDS]
        lines.append(f"| {links} | {friction.label} | {harmonics} | {' | '.join(cells)} |")
        print(lines[-1], flush=True)
    lines += ["", "| links on a wheel each, (1, 0.02, 0.02) | one harmonic |", "|---|---|"]
    for links in (3, 4, 5):
        wheels = tuple(Wheel(link) for link in range(links))
        lines.append(f"| {links} | {best(Chain((1 / links,) * links, feet=wheels), Friction(), 1, options.starts)} |")
        print(lines[-1], flush=True)
    lines += ["", "| links, (1, 1, 1) | feet a link | best small gait | every gait (samples) |", "|---|---|---|---|"]
    for feet in (2, 3):
        body = Chain(feet=feet)
        small, bound = best_small_gait(body, Friction())[0].efficiency, efficiency_bound(body, Friction())
        lines.append(
            f"| {body.n_link} | {feet} | {small:.4f} | {bound.sampled:.4f}{'' if bound.converged else ' (not converged)'} |"
        )
        print(lines[-1], flush=True)
    options.output.mkdir(parents=True, exist_ok=True)
    (options.output / "feet.md").write_text("\n".join(lines) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
