"""What inertia does to a gait, and the best gait for each pace: python -m scripts.pace [--output
results]

Three equal links under equal friction: the best slow gait played at Froude numbers L/(g T^2) from
0.001 to 1, and the best gait for each of them, certified. A table, pace.md, and a figure, pace.png,
with the gaits along it.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from colloc.gaits.harmonic import Harmonic
from colloc.gaits.problem import Problem
from colloc.pictures.figure import draw_gait
from colloc.pictures.style import BLUE, GREY, Picture, save, styled
from colloc.results.solution import Solution
from colloc.search.solve import solve
from colloc.verification.differential_motion import inertial_motion
from scripts.program import command_line

FROUDE = tuple(float(f"{froude:.3g}") for froude in np.geomspace(1e-3, 1.0, 13))
DRAWN = (0, 4, 8, 12)
SLOW = Problem("pace", gait=Harmonic(1))
STARTS = 8
"""Of every search, beside the best gait of the pace before."""


def main() -> None:
    folder = command_line(__doc__, output=Path("results")).output
    slow = solve(SLOW)
    best, played = [slow], []
    lines = [
        "d/W of three equal links, friction (1, 1, 1), one harmonic, at delta 1e-4, by `python -m "
        "scripts.pace`.",
        "",
    ]
    lines += [
        "| Fr | s a period of a body of 1 m | slow gait played so fast | best gait for this pace | "
        "the same, slowly |"
    ]
    lines += ["|---" * 5 + "|"]
    for froude in FROUDE:
        fast = inertial_motion(SLOW.body, SLOW.law, slow.gait, SLOW.delta, froude)
        played.append(fast.efficiency)
        found = solve(SLOW.with_(froude=froude, guess=best[-1].gait), STARTS)
        best.append(found)
        value = f"{found.efficiency:.4f}" if found.success else f"[{found.efficiency:.4f}]"
        seconds = (9.81 * froude) ** -0.5
        lines.append(
            f"| {froude:g} | {seconds:.2f} | {fast.efficiency:.4f} | {value} | "
            f"{found.played_slowly:.4f} |"
        )
        print(lines[-1], flush=True)
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "pace.md").write_text("\n".join(lines) + "\n", encoding="utf-8")
    save(figure(slow, played, best[1:]), folder / "pace", ("png",))


def figure(slow: Solution, played: list[float], best: list[Solution]) -> Picture:
    """Efficiencies against the Froude number, and below some of the gaits."""
    with styled():
        made = Picture(figsize=(7.2, 5.2))
        grid = made.add_gridspec(2, len(DRAWN), height_ratios=(2, 1))
        axes = made.add_subplot(grid[0, :])
        axes.semilogx(
            FROUDE,
            [found.efficiency for found in best],
            "o-",
            color=BLUE,
            label="the best gait for each pace",
        )
        axes.semilogx(FROUDE, played, "s--", color=GREY, label="the best slow gait, played so fast")
        axes.axhline(slow.efficiency, color=GREY, linewidth=0.8, linestyle=":", label="slow")
        axes.set_xlabel("Froude number L / (g T²), over the coefficient of friction")
        axes.set_ylabel("efficiency d/W")
        axes.set_ylim(bottom=0.0)
        axes.legend()
        for column, k in enumerate(DRAWN):
            below = made.add_subplot(grid[1, column])
            draw_gait(below, best[k])
            below.set_title(f"Fr = {FROUDE[k]:g}")
    return made


if __name__ == "__main__":
    main()
