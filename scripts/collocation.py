"""The pictures of docs/collocation.md: python -m scripts.collocation [FOLDER]

The programs are those of examples/; nothing is solved here.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from colloc.pictures.style import BLUE, GREEN, ORANGE, VERMILION, figure_style, save
from scripts.program import command_line

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / "examples"))
import three_link_in_one_page as page  # noqa: E402
from three_link_lifted import lifted  # noqa: E402

DELTAS = {0.1: ORANGE, 0.03: GREEN, 0.01: BLUE, 0.001: VERMILION}
SHOWN = 3
"""Intervals of the Jacobian that are drawn."""


def balanced(delta: float) -> tuple[ca.DM, ca.DM, ca.DM]:
    """Angles, rates and tail velocity where two links of the best gait come to a stop, and
    around."""
    t = 2 * np.pi * np.linspace(0.06, 0.08, 401)
    a, b, c, d = 2.86 * np.cos(t), 1.30 * np.sin(t), -2.86 * np.sin(t), 1.30 * np.cos(t)
    q, r, z = ca.DM([a + b, b - a]), ca.DM([c + d, d - c]), ca.DM.zeros(3, len(t))
    for _ in range(3000):
        z = page.step.map(len(t))(q, r, z, delta)
    return q, r, z


def rows_at_one_instant(literal: Axes, lifted: Axes) -> None:
    """Force balance and a lifted row against a velocity of the tail, where a link rests."""
    motion = balanced(2e-4)
    k = np.array(page.sliding.map(motion[0].size2())(*motion, 2e-4)[1][0::3, :])
    link, instant = (int(i) for i in np.unravel_index(np.argmax(k), k.shape))
    steps = np.linspace(-0.1, 0.1, 801)
    for delta, colour in DELTAS.items():
        slow = delta / (2 * np.pi)
        q, r, z = (part[:, instant] for part in balanced(slow))
        v, k = page.sliding(q, r, z, slow)
        f, forces, rows = -k * v, [], []
        for step in steps:
            moved = z + ca.vertcat(step, 0, 0)
            v, k = page.sliding(q, r, moved, slow)
            forces.append(float(page.balance(q, r, moved, -k * v)[0][0]))
            rows.append(float((f / k + v)[3 * link]))
        literal.plot(steps, forces, color=colour, label=f"delta = {delta:g}")
        lifted.plot(steps, rows, color=colour)
    literal.set(xlabel="u less its balanced value", ylabel="force on the body, row (3)")
    lifted.set(xlabel="u less its balanced value", ylabel="f / k + v of a resting link, row (2')")
    literal.legend()


def jacobian(ax: Axes, friction: Any) -> None:
    """Non-zeros of the Jacobian in the equations of the first intervals."""
    opti = page.program(friction)[0]
    rows, columns = np.array(ca.jacobian(opti.g, opti.x).sparsity().get_triplet())
    kept, at = [0, 1, 2], 3
    for size, sites in ((3, page.n), (3, page.n), (3, page.N + 1), (9, page.n)):
        if at < opti.nx:
            some = SHOWN * page.S if sites == page.n else SHOWN + 1
            kept += range(at, at + size * some)
        at += size * sites
    outside = np.unique(rows[~np.isin(columns, kept)])
    equations = np.unique(rows[columns > 2])  # others bound the angles
    equations = equations[np.bincount(rows)[equations] > 1]  # or a force
    shown = np.setdiff1d(equations, outside)
    here = np.isin(rows, shown)
    ax.plot(np.searchsorted(kept, columns[here]), np.searchsorted(shown, rows[here]), ".", ms=2)
    ax.set(xlabel="variables", ylabel="rows", aspect="equal", title=friction.__name__)
    ax.invert_yaxis()


def main() -> None:
    folder = Path(command_line(__doc__, ("folder", str(ROOT / "docs/assets"))).folder)
    with figure_style():
        figure = Figure(figsize=(7.5, 3))
        rows_at_one_instant(*figure.subplots(1, 2))
        save(figure, folder / "collocation_balance", ("png",), dpi=110)
        figure = Figure(figsize=(7.5, 4))
        for ax, friction in zip(figure.subplots(1, 2), (page.literal, lifted), strict=True):
            jacobian(ax, friction)
        save(figure, folder / "collocation_jacobian", ("png",), dpi=110)


if __name__ == "__main__":
    main()
