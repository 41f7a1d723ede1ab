"""Where the law of friction leaves the motion open: python -m scripts.several_motions [--steps 60] [--output results]

For three equal links and some laws with unequal coefficients, all balanced velocities on a grid of shapes and rate directions:
a figure of the part with several, several_motions.png, and a table, several_motions.md.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np

from colloc.bounds.coulomb_motion import admissible, unit_directions
from colloc.mechanics.chain import Chain
from colloc.mechanics.friction import Friction
from colloc.mechanics.solution_branches import all_balanced_velocities
from colloc.pictures.style import save, styled, subplots

LAWS = ((3.0, 1.0, 1.0), (10.0, 1.0, 1.0), (100.0, 1.0, 1.0), (10.0, 1.0, 3.0), (1.0, 0.01, 100.0), (0.1, 1.0, 1.0))
DRAWN = LAWS[1:3]
DELTA = 1e-4
_PIECE = 50_000


def grid(steps: int) -> tuple[np.ndarray, np.ndarray]:
    """Joint angles off the lines of symmetry, and directions of rates with the larger one 1 in magnitude."""
    axis = np.pi * (2 * np.arange(steps) + 1 - steps) / steps
    rates = unit_directions(2, 2 * steps, half=False)
    return axis, rates / np.abs(rates).max(axis=0)


def several(law: tuple[float, float, float], steps: int) -> tuple[np.ndarray, np.ndarray, int]:
    """Number of motions and the largest difference of their velocities, ``(angle 1, angle 2, direction)``, NaN where links
    cross; and at how many instants the signs do not add up to one."""
    body, friction = Chain(), Friction(*law)
    axis, directions = grid(steps)
    angles = np.stack([a.ravel() for a in np.meshgrid(axis, axis, indexing="ij")])
    allowed = np.flatnonzero(admissible(body, angles))
    shape = (steps * steps, directions.shape[1])
    number, apart, incomplete = np.full(shape, np.nan), np.full(shape, np.nan), 0
    per_piece = max(1, _PIECE // directions.shape[1])
    for first in range(0, allowed.size, per_piece):
        part = allowed[first : first + per_piece]
        q = np.repeat(angles[:, part], directions.shape[1], axis=1)
        found = all_balanced_velocities(body, friction, q, np.tile(directions, part.size), DELTA)
        spread = (np.nanmax(found.z, axis=0) - np.nanmin(found.z, axis=0)).max(axis=0)
        number[part], apart[part] = found.number.reshape(part.size, -1), spread.reshape(part.size, -1)
        incomplete += int((~found.complete).sum())
    return number.reshape(steps, steps, -1), apart.reshape(steps, steps, -1), incomplete


def table(found: dict[tuple[float, float, float], tuple[np.ndarray, np.ndarray, int]]) -> str:
    lines = [
        "| friction (t, f, b) | several motions | most | largest difference | signs do not add up |",
        "|---|---|---|---|---|",
    ]
    for law, (number, apart, incomplete) in found.items():
        tried = np.isfinite(number)
        part, most = (number[tried] > 1).mean(), int(number[tried].max())
        stated = ", ".join(f"{value:g}" for value in law)
        lines.append(f"| ({stated}) | {100 * part:.3f} % | {most} | {apart[tried].max():.3f} | {incomplete} of {tried.sum()} |")
    return "\n".join(lines) + "\n"


def figure(found: dict[tuple[float, float, float], tuple[np.ndarray, np.ndarray, int]], steps: int, path: Path) -> None:
    """Over shapes (part of all directions) and over one angle and the direction (part of the other angle)."""
    axis, directions = grid(steps)
    heading = np.degrees(np.unwrap(np.arctan2(directions[1], directions[0])))
    with styled():
        drawn, axes = subplots(2, len(DRAWN), figsize=(7.6, 7.0))
        for column, law in enumerate(DRAWN):
            number = found[law][0]
            open_ones = np.where(np.isfinite(number), number > 1, np.nan)
            everywhere = np.isfinite(open_ones).any(axis=2)
            over_shapes = np.where(everywhere, 100 * np.nan_to_num(open_ones).mean(axis=2), np.nan)
            over_headings = 100 * np.nan_to_num(open_ones).sum(axis=1) / np.maximum(everywhere.sum(axis=1), 1)[:, None]
            for row, (y, values) in enumerate(((axis, over_shapes), (heading, over_headings))):
                image = axes[row, column].pcolormesh(axis, y, values.T, cmap="magma_r", shading="nearest", rasterized=True)
                drawn.colorbar(image, ax=axes[row, column], label=("% of directions", "% of angles 2")[row])
                label = ("joint angle 2 [rad]", "direction of the joint rates [deg]")[row]
                axes[row, column].set(xlabel="joint angle 1 [rad]", ylabel=label)
            axes[0, column].set_title("friction (t, f, b) = ({:g}, {:g}, {:g})".format(*law))
    save(drawn, path)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--steps", type=int, default=60, metavar="N", help="of every joint angle; twice as many directions")
    parser.add_argument("--output", type=Path, default=Path("results"), metavar="FOLDER")
    options = parser.parse_args()
    found = {law: several(law, options.steps) for law in LAWS}
    options.output.mkdir(parents=True, exist_ok=True)
    (options.output / "several_motions.md").write_text(table(found), encoding="utf-8")
    print(table(found))
    figure(found, options.steps, options.output / "several_motions")


if __name__ == "__main__":
    main()
