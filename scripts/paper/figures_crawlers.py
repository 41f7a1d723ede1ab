"""Figure 13: concertina crawlers, their work and distance against epsilon, and the efficiency's
approach to its bound."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from colloc.pictures import style
from scripts import panel_marks
from scripts.paper.study import Arrays


def _stages(
    axes: Any, made: Arrays, name: str, chosen: list[int], title: str, drop: complex
) -> None:
    """Snapshots, each shifted by `drop` from the one before."""
    colours = style.snapshot_colours(len(chosen))
    for row, (k, colour) in enumerate(zip(chosen, colours, strict=True)):
        z = made[f"{name}/x"][:, k] + 1j * made[f"{name}/y"][:, k]
        shift = row * drop
        axes.plot(z.real + shift.real, z.imag + shift.imag, color=colour, lw=1.5)
        axes.text(
            z.real.min() + shift.real - 0.02,
            z.imag.mean() + shift.imag,
            f"{made[f'{name}/t'][k]:.2f}",
            fontsize=7,
            ha="right",
        )
    axes.set_title(title)
    panel_marks.bare(axes)


def _at(made: Arrays, name: str, times: tuple[float, ...]) -> list[int]:
    return [int(np.argmin(np.abs(made[f"{name}/t"] - t))) for t in times]


def figure_13(made: Arrays, folder: Path) -> list[Path]:
    """Snapshots, work and distance, efficiency, and the crawler with two bumps."""
    figure = Figure(figsize=(10, 6.2))
    grid = figure.add_gridspec(2, 3, width_ratios=(1.1, 1, 1.1))
    one, two = "isotropic", "transverse easiest"
    first = _at(made, one, (0, 1 / 12, 1 / 6, 1 / 4, 1 / 3, 5 / 12, 1 / 2))
    second = _at(made, one, (1 / 2, 2 / 3, 5 / 6, 1))
    for row, (chosen, text, title) in enumerate(
        ((first, "A", "first half-period"), (second, "B", "second half-period"))
    ):
        axes = figure.add_subplot(grid[row, 0])
        _stages(axes, made, one, chosen, title, -0.09j)
        panel_marks.letter(axes, text)
    epsilon = made["epsilon"]
    work = figure.add_subplot(grid[0, 1])
    for key, label, colour, marker in (
        ("W_outer", "work outside", style.VERMILION, "x"),
        ("W_inner", "work inside", style.BLUE, "s"),
        ("d", "distance", style.GREEN, "^"),
    ):
        work.loglog(
            epsilon, made[f"{one}/{key}"], marker + "-", color=colour, label=label, ms=4, lw=1
        )
    work.loglog(
        epsilon,
        made[f"{one}/W_inner"] + made[f"{one}/W_outer"],
        "o:",
        color=style.BLACK,
        label="total work",
        ms=3,
        lw=1,
    )
    work.loglog(epsilon, epsilon**2, "--", color="0.5", lw=0.8, label=r"$\epsilon^2$")
    work.set(xlabel=r"$\epsilon$")
    work.legend()
    panel_marks.letter(work, "C")
    efficiency = figure.add_subplot(grid[1, 1])
    for (name, label), colour, marker in zip(
        ((one, "isotropic"), ("forward easiest", r"$\mu_f$ smallest"), (two,
        r"$\mu_t$ smallest, two bumps")),
        (style.BLACK, style.ORANGE, style.SKY), "o^s", strict=True,
    ):  # fmt: skip
        values, errors = (
            made[f"{name}/efficiency"] / made[f"{name}/bound"],
            made[f"{name}/error_efficiency"],
        )
        efficiency.errorbar(
            epsilon,
            values,
            errors,
            fmt=marker + "-",
            color=colour,
            label=label,
            ms=4,
            lw=1,
            capsize=2,
        )
    efficiency.axhline(1, color="0.6", lw=0.7)
    efficiency.set(xlabel=r"$\epsilon$", ylabel=r"efficiency $\times \min(\mu)$", xscale="log")
    efficiency.legend()
    panel_marks.letter(efficiency, "D")
    axes = figure.add_subplot(grid[:, 2])
    # this crawler lies across its path, which goes along x
    _stages(
        axes,
        made,
        two,
        _at(made, two, (0, 0.25, 0.5, 0.75, 1)),
        "two bumps, moving sideways",
        0.25 + 0j,
    )
    panel_marks.letter(axes, "E")
    return style.save(figure, folder / "figure-13-crawlers")
