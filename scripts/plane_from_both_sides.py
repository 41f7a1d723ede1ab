"""The friction plane of three links from both sides: the best gait that is known, and a bound for every gait.

python -m scripts.plane_from_both_sides [--seconds 600] [--starts 1]

Joints within 2.5. Computes what is missing of a grid of laws and keeps it, as `scripts.frontier` does and where it does (a run
may be stopped and taken up again), then writes plane_from_both_sides.png and .md in results/curated.
"""

from __future__ import annotations

import argparse
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.colors import LogNorm

from colloc.pictures.style import SEQUENTIAL, save, styled, subplots
from scripts.frontier import compute_missing
from scripts.frontier_rows import Row, best_held, read, smallest_bound
from scripts.panel_marks import letter

MU_T, MU_B = (0.3, 1.0, 3.0, 10.0), (1.0, 1.7, 3.0)
"""Over mu_f; exchanging head and tail exchanges mu_f and mu_b, so mu_b >= mu_f is all there is."""
LIMIT = 2.5
OUT = Path("results/curated")
HEAD = """# The friction plane of three equal links from both sides

`python -m scripts.plane_from_both_sides`, joints within 2.5, mu_f = 1. *Gait*: the best certified finite gait that
travels through shapes, at delta = 1e-5, and its distance a period [body lengths]; *relaxed*: what finite gaits near
it tend to for delta -> 0 (a star: its own certificate fails a check); *small*: the best gait of no size at one shape;
*bound*: sampled, with the number of its unknowns (in brackets the program's value where climbs still found more than
is tolerated); *gap*: from the better of relaxed and small to the bound, relative. Where nothing else is kept: one
start (at mu_t = 0.3 and at (3, 1.7) four, by `--starts 4`) and two neighbours a gait, and 12 knot intervals a bound
(8 where it has 135 unknowns), so both sides can still move. An empty place is not computed.

| mu_t | mu_b | gait | distance | relaxed | small | bound | unknowns | gap |
|---|---|---|---|---|---|---|---|---|
"""


def rows() -> list[Row]:
    """From equal coefficients outwards, so that every gait has neighbours to begin from."""
    laws = sorted(product(MU_T, MU_B), key=lambda mu: np.abs(np.log(mu)).sum())
    return [Row((t, 1.0, b), LIMIT, 3, 0.0) for t, b in laws]


def value(row: Row, known: dict) -> float:
    """The best efficiency known, for delta -> 0."""
    ends = best_held(row, "gait", known).get("relaxed", np.nan), best_held(row, "small", known).get("efficiency", np.nan)
    return float(np.nanmax(ends)) if np.isfinite(ends).any() else np.nan


def line(row: Row, known: dict) -> str:
    """A row of the table."""
    gait, small = (best_held(row, part, known) for part in ("gait", "small"))
    bound = known.get(f"{row.name} bound", {})
    least = smallest_bound(row, known)

    def cell(of: dict, key: str, form: str, mark: str = "") -> str:
        return f"{of[key]:{form}}{mark}" if key in of else ""

    program = "" if bound.get("converged", True) else f" ({bound['floor']:.4f})"
    cells = [
        f"{row.mu[0]:g}", f"{row.mu[2]:g}", cell(gait, "efficiency", ".4f", "" if gait.get("passed") else " (not certified)"),
        cell(gait, "distance", ".3f"), cell(gait, "relaxed", ".4f", "" if gait.get("sharp") else "*"),
        cell(small, "efficiency", ".4f"),
        f"{least:.4f}{program}", cell(bound, "unknowns", "d"),
        f"{100 * (1 - value(row, known) / least):.1f} %",
    ]  # fmt: skip
    return f"| {' | '.join(cells)} |"


def figure_of(values: np.ndarray, bounds: np.ndarray) -> Any:
    """Three panels: value, bound and the gap between them, ``(mu_t, mu_b)`` each."""
    gaps = 100 * (1 - values / bounds)
    with styled():
        figure, panels = subplots(1, 3, figsize=(11.4, 3.6))
        norm = LogNorm(np.nanmin(values), np.nanmax(bounds))
        shown: tuple[tuple[str, np.ndarray, dict[str, Any], str], ...] = (
            ("best gait known", values, {"norm": norm}, "{:.3f}"),
            ("bound for every gait", bounds, {"norm": norm}, "{:.3f}"),
            ("gap", gaps, {"vmin": 0.0}, "{:.1f} %"),
        )
        for name, axes, (title, table, scale, form) in zip("abc", panels, shown, strict=True):
            drawn = axes.pcolormesh(table.T, cmap=SEQUENTIAL, **scale)
            for i, j in np.ndindex(*table.shape):
                if np.isfinite(table[i, j]):
                    light = drawn.cmap(drawn.norm(table[i, j]))[:3] @ np.array([0.3, 0.6, 0.1]) > 0.5
                    colour = "black" if light else "white"
                    axes.text(i + 0.5, j + 0.5, form.format(table[i, j]), ha="center", va="center", fontsize=8, color=colour)
            axes.set_xticks(np.arange(len(MU_T)) + 0.5, [f"{t:g}" for t in MU_T])
            axes.set_yticks(np.arange(len(MU_B)) + 0.5, [f"{b:g}" for b in MU_B])
            axes.set(xlabel=r"$\mu_t/\mu_f$", ylabel=r"$\mu_b/\mu_f$", title=title)
            letter(axes, name)
    return figure


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seconds", type=float, default=np.inf, help="of processor time, after which nothing else is begun")
    parser.add_argument("--starts", type=int, default=1, help="of relaxed gaits, beside those of two neighbours")
    parser.add_argument("--parts", nargs="+", default=["gait", "bound"], choices=["gait", "bound", "small"])
    options = parser.parse_args()
    for part in options.parts:
        compute_missing(rows(), [part], options.starts, options.seconds)
    known = read()
    lines = [line(row, known) for row in sorted(rows())]
    (OUT / "plane_from_both_sides.md").write_text(HEAD + "\n".join(lines) + "\n", encoding="utf-8")
    table = {row.mu: (value(row, known), smallest_bound(row, known)) for row in rows()}
    values, bounds = (np.array([[table[t, 1.0, b][side] for b in MU_B] for t in MU_T]) for side in (0, 1))
    print(*save(figure_of(values, bounds), OUT / "plane_from_both_sides", ("png",)), sep="\n")


if __name__ == "__main__":
    main()
