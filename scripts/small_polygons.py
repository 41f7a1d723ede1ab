"""How small gaits approach their limit: python -m scripts.small_polygons

Triangles in shape space, at the fold without symmetry and bilateral near (2.2, -2.2), for falling lower bounds on the length of
the path (`smallest_shape_speed` times 2 pi; delta at unit shape speed falls along, so that friction stays as dry). Beside the
best infinitesimal gaits at the same places (`colloc.bounds.infinitesimal`). Writes results/curated/small_polygons.md.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np

from colloc import Chain, Corners, Friction, Polygon, Problem
from colloc.bounds.infinitesimal import small_gait
from colloc.gaits.path_samples import path_length
from colloc.results.solution import SOLVED
from colloc.search.solve import solve
from scripts.link_gaps import LYING, gaps

SPEEDS = (0.1, 0.04, 0.02)
DELTA_PER_SPEED = 1e-3
PLACES = {"none": (3.0, -0.03), "bilateral": (2.2, -2.2)}
LIMITS = {"none": (np.pi, 0.0), "bilateral": (2.2, -2.2)}
OUTPUT = Path("results/curated/small_polygons.md")


def row(symmetry: str, speed: float) -> list[str]:
    """One certified triangle, as cells."""
    shape, length = np.array(PLACES[symmetry]), 1.1 * 2 * np.pi * speed
    guess = Corners(small_gait(Chain(), Friction(), shape).path(shape, length))
    delta = DELTA_PER_SPEED * speed
    stated = Problem("small", guess, gait=Polygon(3, symmetry), intervals=30, smallest_shape_speed=speed)
    solution = solve(stated.with_(delta=delta, delta_start=100 * delta), 1)
    certificate = solution.certificate
    if solution.status != SOLVED:
        return [symmetry, f"{2 * np.pi * speed:.3f}", f"{delta:.0e}", solution.status, *6 * [""]]
    least, lying = gaps(Chain(), solution.gait)
    gap = next(check.value for check in certificate.checks if check.name == "replay gap")
    return [
        symmetry,
        f"{2 * np.pi * speed:.3f}",
        f"{delta:.0e}",
        f"{path_length(solution.gait):.3f}",
        f"{certificate.efficiency:.4f}",
        f"{certificate.distance:.5f}",
        f"{certificate.work:.5f}",
        f"{gap:.0e}",
        *(f"{least:.3f}", f"{lying:.0%}"),
    ]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.parse_args()
    rows = [row(symmetry, speed) for symmetry in PLACES for speed in SPEEDS]
    limits = ", ".join(
        f"{small_gait(Chain(), Friction(), np.array(shape)).efficiency:.4f} ({symmetry}, at ({shape[0]:.3g}, {shape[1]:.3g}))"
        for symmetry, shape in LIMITS.items()
    )
    heads = ["symmetry", "length at least", "delta", "length", "d/W", "d", "W", "replay gap", "gap", "lying"]
    lines = [
        "# Small triangles, three equal links, isotropic friction",
        "",
        "Written by `python -m scripts.small_polygons`. Triangles in shape space, sides of at least 0.02 rad, each certified",
        f"by independent replay; delta at unit shape speed. Infinitesimal gaits reach {limits}.",
        "Links have no thickness: *gap* is the smallest distance between links that are not neighbours, and from the free end",
        f"of a link to its neighbour [body lengths], *lying* the share of the path on which it is below {LYING:g}, so that",
        "links lie on each other: at the fold most or all of the time. without_contact.md has the best gaits that keep apart.",
        "",
        "| " + " | ".join(heads) + " |",
        "|" + "---|" * len(heads),
        *("| " + " | ".join(cells) + " |" for cells in rows),
    ]
    OUTPUT.parent.mkdir(parents=True, exist_ok=True)
    OUTPUT.write_text("\n".join(lines) + "\n", encoding="utf-8")
    print("\n".join(lines))


if __name__ == "__main__":
    main()
