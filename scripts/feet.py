"""How efficiently chains crawl on feet and wheels: python -m scripts.feet [--starts 16] [--output
results]

The best gait found by the usual search, of chains of equal links that lie on the floor, stand on
one to three feet a link, or on a wheel each that rolls at a fiftieth of its friction sideways; and
what bounds all gaits of three links. Each class begins with the best gait of the class before it. A
table, feet.md.
"""

from __future__ import annotations

import argparse
import warnings
from contextlib import suppress
from pathlib import Path

from colloc.bounds.sampled import efficiency_bound
from colloc.gaits.harmonic import Harmonic
from colloc.gaits.problem import Problem
from colloc.mechanics.chain import Chain
from colloc.mechanics.floor_contact import Wheel
from colloc.mechanics.friction import Friction
from colloc.search.solve import solve
from colloc.system.errors import CollocError, ProblemError
from research.small_gaits import best_small_gait

STANDS = {"line": 0, "1 foot a link": 1, "2 feet": 2, "3 feet": 3}
CLASSES = (Harmonic(1), Harmonic(2), Harmonic(3))
LEVEL = Friction(), Friction(mu_t=2, mu_f=1, mu_b=1)


def column(body: Chain, friction: Friction, starts: int) -> list[str]:
    """Efficiency and distance of the best gait found of each class, in brackets if its certificate
    fails. More harmonics can do what fewer do."""
    cells, known, most, plain = (
        list[str](),
        None,
        0.0,
        Problem("feet", body=body, friction=friction),
    )
    for kind in CLASSES if body.n_joint > 1 else CLASSES[:1]:
        cells.append(cells[-1] if cells else "none")
        with warnings.catch_warnings(action="ignore"), suppress(CollocError):
            problem = plain.with_(gait=kind)
            with suppress(ProblemError):  # where it is too small for the class
                problem = problem if known is None else problem.with_(guess=known)
            found = solve(problem, starts)
            best, known = found.shrunk or found, found.gait  # whatever its size
            text, passed = (
                f"{best.certificate.efficiency:.4f} ({best.certificate.distance:.3f})",
                best.certificate.passed,
            )
            if passed and best.value > most:
                cells[-1], most = text, best.value
            elif cells[-1] == "none":
                cells[-1] = f"[{text}]"
    return cells


def table(columns: dict[str, list[str]], links: int, friction: str) -> list[str]:
    """The rows of one body and friction, a class each."""
    names = ("1 harmonic", "2 harmonics", "3 harmonics")
    return [
        f"| {links} | {friction} | {' | '.join(row)} |"
        for row in zip(names, *columns.values(), strict=False)
    ]


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--starts", type=int, default=16, metavar="N", help="of every search")
    parser.add_argument("--output", type=Path, default=Path("results"), metavar="FOLDER")
    options = parser.parse_args()
    lines = [
        f"d/W at delta 1e-4 (distance of a period), by `python -m scripts.feet --starts "
        f"{options.starts}`.",
        "",
    ]
    head = ("links", "friction", "class", *STANDS)
    lines += [f"| {' | '.join(head)} |", "|---" * len(head) + "|"]
    for links in (2, 3, 4, 5):
        for friction in LEVEL if links > 2 else (Friction(mu_t=1, mu_f=1, mu_b=3),):
            chains = {
                stand: Chain((1 / links,) * links, feet=feet) for stand, feet in STANDS.items()
            }
            columns = {
                stand: column(chain, friction, options.starts) for stand, chain in chains.items()
            }
            lines += table(columns, links, friction.label)
            print(*lines[-4:], sep="\n", flush=True)
    lines += ["", "| links | on | class | a wheel a link, (1, 0.02, 0.02) |", "|---|---|---|---|"]
    for links in (3, 4, 5):
        chain = Chain((1 / links,) * links, feet=tuple(Wheel(link) for link in range(links)))
        lines += table({"wheels": column(chain, Friction(), options.starts)}, links, "wheels")
        print(*lines[-4:], sep="\n", flush=True)
    lines += [
        "",
        "| links, (1, 1, 1) | feet a link | best small gait | every gait (samples) |",
        "|---|---|---|---|",
    ]
    for feet in (2, 3):
        body = Chain(feet=feet)
        small, bound = (
            best_small_gait(body, Friction())[0].efficiency,
            efficiency_bound(body, Friction()),
        )
        lines.append(
            f"| {body.n_link} | {feet} | {small:.4f} | "
            f"{bound.sampled:.4f}{'' if bound.converged else ' (not converged)'} |"
        )
        print(lines[-1], flush=True)
    options.output.mkdir(parents=True, exist_ok=True)
    (options.output / "feet.md").write_text("\n".join(lines) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
