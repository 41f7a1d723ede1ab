"""Figures of maps: admissible paths (7), velocity map (8), static friction (9), distance, work and
efficiency (11, 12)."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from matplotlib import colormaps
from matplotlib.cm import ScalarMappable
from matplotlib.colors import ListedColormap, Normalize
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from colloc.mechanics.chain import Chain
from colloc.mechanics.contact import SMOOTHING, near_contacts
from colloc.pictures import style
from scripts import panel_marks
from scripts.models.ellipses import ellipse_angles
from scripts.paper.figures_bodies import draw_cases
from scripts.paper.study import Arrays

_MEASURES = (("distance", "d"), ("work", "W"), ("efficiency", r"$\lambda = d/W$"))


def _admissible_square(nodes: np.ndarray) -> np.ndarray:
    a1, a2 = np.meshgrid(nodes, nodes, indexing="ij")
    angles = np.stack([a1.ravel(), a2.ravel()])
    excess = np.max([each.excess(angles)[0] for each in near_contacts(Chain())], axis=0)
    return (excess <= SMOOTHING).reshape(a1.shape)


def _label_angles(axes: Any) -> None:
    ticks, labels = [-np.pi, 0, np.pi], [r"$-\pi$", "0", r"$\pi$"]
    axes.set(xticks=ticks, xticklabels=labels, yticks=ticks, yticklabels=labels)
    axes.set_xlabel(r"$\Delta\theta_1$", labelpad=-2)
    axes.set_ylabel(r"$\Delta\theta_2$", labelpad=-4)


def figure_7(made: Arrays, folder: Path) -> list[Path]:
    """Non-self-intersecting shapes, and the ellipses of the local maxima of the efficiency."""
    figure, axes = style.subplots(figsize=(6.2, 4.4))
    nodes = np.linspace(-np.pi, np.pi, 401)
    axes.contourf(nodes, nodes, _admissible_square(nodes).T, levels=[0.5, 1.5], colors=["#e4edf2"])
    t = np.linspace(0, 1, 400)
    colours = (style.BLUE, style.VERMILION, style.PURPLE, style.GREEN, style.ORANGE)
    for gait, efficiency, colour in zip(made["gaits"], made["efficiency"], colours, strict=False):
        a = ellipse_angles(gait[:, None], t)[0][:, 0]
        axes.plot(*a, color=colour, label=f"$A_0$ = {abs(gait[0]):.2f}: {efficiency:.4f}")
    axes.plot([-np.pi, np.pi], [np.pi, -np.pi], ":", color="0.5", lw=0.8)
    body = Chain()
    for shape in ((2.094, 2.094), (np.pi, 1.57), (1.57, np.pi), (0, 0), (1.4, -1.4)):
        x, y = body.joints(np.array(shape)[:, None])
        x, y = 0.7 * (x[:, 0] - x.mean()) + shape[0], 0.7 * (y[:, 0] - y.mean()) + shape[1]
        axes.plot(x, y, color=style.BLACK, lw=1.5)
    _label_angles(axes)
    axes.set_aspect("equal")
    axes.set_title("admissible shapes (shaded), locally most efficient ellipses")
    axes.legend(loc="upper left", bbox_to_anchor=(1.02, 1), title="efficiency")
    return style.save(figure, folder / "figure-07-paths")


def figure_8(made: Arrays, folder: Path) -> list[Path]:
    """Slices of the velocity map on both faces."""
    values = made["values"]
    n = values.shape[1]
    angles = 2 * np.pi * np.arange(n) / n - np.pi
    n_ratio = values.shape[3] - 2
    ratios = np.linspace(-1, 1, n_ratio)
    chosen = [round(f * (n_ratio - 1)) for f in (0, 0.25, 0.5, 0.75, 1)]
    inside = _admissible_square(angles)
    figure = Figure(figsize=(9.5, 6.4))
    figure.set_layout_engine("none")
    names = (r"$\dot x_0$", r"$\dot y_0$", r"$\dot\theta_0$")
    a1, a2 = np.meshgrid(angles, angles, indexing="ij")
    for face in range(2):
        for component in range(3):
            axes: Any = figure.add_axes(
                (0.0 + 0.33 * component, 0.52 - 0.5 * face, 0.25, 0.43), projection="3d"
            )
            field = values[face, :, :, 1:-1, component]
            shown = np.where(inside[:, :, None], field, np.nan)
            low, high = np.nanmin(shown[:, :, chosen]), np.nanmax(shown[:, :, chosen])
            colours = colormaps[style.SEQUENTIAL]((shown - low) / (high - low))
            colours[np.isnan(shown)] = (1, 1, 1, 0)
            for k in chosen:
                axes.plot_surface(
                    a1, a2, np.full_like(a1, ratios[k]), facecolors=colours[:, :, k], rstride=1,
                    cstride=1,
                    shade=False, linewidth=0, antialiased=False, rasterized=True,
                )  # fmt: skip
            _label_angles(axes)
            axes.set_zlabel(rf"$\dot{{\Delta\theta}}_{2 - face}$", labelpad=-2)
            axes.set_zticks([-1, 0, 1])
            axes.patch.set_visible(False)  # or it covers the colour bar beside it
            axes.set_box_aspect((1, 1, 1.5))
            axes.set_title(rf"{names[component]}, $\dot{{\Delta\theta}}_{1 + face} = 1$", y=1.05)
            mappable = ScalarMappable(Normalize(low, high), style.SEQUENTIAL)
            bar = figure.add_axes((0.268 + 0.33 * component, 0.58 - 0.5 * face, 0.008, 0.3))
            figure.colorbar(mappable, cax=bar)
    return style.save(figure, folder / "figure-08-velocity-map")


def figure_9(made: Arrays, folder: Path) -> list[Path]:
    """Where a link is slower than 1e-3: slices of both spaces, and the worked cases."""
    figure = Figure(figsize=(10, 6.6))
    grid = figure.add_gridspec(4, 6, height_ratios=(1, 1, 0.12, 1.5))
    nodes, ratios = made["angles"], made["ratios"]
    chosen = np.unique(
        np.round(np.interp((-1, -0.5, -0.05, 0, 0.05, 0.5), ratios, np.arange(ratios.size))).astype(
            int
        )
    )
    colours = [style.SKY, style.ORANGE, style.VERMILION]
    inside = _admissible_square(nodes)
    for face in range(2):
        for column, k in enumerate(chosen[:6]):
            axes = figure.add_subplot(grid[face, column])
            axes.contourf(nodes, nodes, inside.T, levels=[0.5, 1.5], colors=["#eef2f4"])
            held = (made[f"speed_{face}"][:, :, k] < made["threshold"]) & inside
            link = made[f"link_{face}"][:, :, k]
            axes.pcolormesh(
                nodes,
                nodes,
                np.where(held, link, np.nan).T,
                cmap=ListedColormap(colours),
                vmin=-0.5,
                vmax=2.5,
            )
            _label_angles(axes)
            axes.set_aspect("equal")
            axes.set_title(rf"$\dot{{\Delta\theta}}_{2 - face} = {ratios[k]:g}$", fontsize=8)
            if column == 0:
                panel_marks.letter(axes, "AB"[face])
    for index, colour in enumerate(colours):
        figure.text(
            0.3 + 0.16 * index,
            0.385,
            f"link {index + 1} slow",
            color=colour,
            fontsize=9,
            fontweight="bold",
        )
    below = grid[3, :].subgridspec(1, 4)
    draw_cases([figure.add_subplot(below[0, i]) for i in range(4)], made, "worked", "CDEF")
    return style.save(figure, folder / "figure-09-static-friction")


def _filled(axes: Any, x: np.ndarray, y: np.ndarray, values: np.ndarray, levels: int = 20) -> Any:
    return axes.contourf(x, y, values.T, levels=levels, cmap=style.SEQUENTIAL)


def figure_11(made: Arrays, found: Arrays, folder: Path) -> list[Path]:
    """Distance, work and efficiency at A0 = 0."""
    figure, axes = style.subplots(1, 3, figsize=(9.5, 3.1))
    for a, (key, name), text in zip(axes, _MEASURES, "ABC", strict=True):
        drawn = _filled(a, made["A1"], made["B1"], made[key])
        figure.colorbar(drawn, ax=a, shrink=0.85)
        a.set(
            xlabel=r"$A_1$", ylabel=r"$B_1$", title=f"{key}, {name}", xlim=(0, np.pi), ylim=(0, 2.3)
        )
        a.plot([0, 2.2], [0, 2.2], ":", color="white", lw=0.8)
        a.set_aspect("equal")
        panel_marks.letter(a, text)
    for gait, label in zip(found["gaits"], ("D", "", "", ""), strict=False):
        if abs(gait[0]) < 0.05:
            axes[2].plot(gait[1], gait[2], "*", color=style.VERMILION, ms=8, clip_on=False)
            axes[2].annotate(
                label,
                gait[1:],
                xytext=(-10, -12),
                textcoords="offset points",
                color="white",
                fontweight="bold",
            )
    return style.save(figure, folder / "figure-11-no-offset")


def figure_12_maps(made: Arrays, found: Arrays, folder: Path) -> list[Path]:
    """Distance, work and efficiency for various A0: slices, the other half being the mirror
    image."""
    wanted = (0.0, 0.55, 1.1, 1.65, 2.2, 2.59)
    slices = [int(np.argmin(np.abs(made["A0"] - a))) for a in wanted]
    margins = {
        "left": 0.05,
        "right": 0.92,
        "bottom": 0.1,
        "top": 0.93,
        "hspace": 0.25,
        "wspace": 0.1,
    }
    figure, axes = style.subplots(
        3, len(slices), figsize=(11, 4.8), sharex=True, sharey=True, gridspec_kw=margins
    )
    figure.set_layout_engine("none")  # many axes of equal scale collapse under it
    for row, ((key, name), text) in enumerate(zip(_MEASURES, "ABC", strict=True)):
        field = made[f"{key}_direct"]
        top = float(np.nanmax(field[slices]))
        for a, k in zip(axes[row], slices, strict=True):
            drawn = a.contourf(
                made["A1"],
                made["B1"],
                field[k].T,
                levels=np.linspace(0, top, 21),
                cmap=style.SEQUENTIAL,
            )
            a.set(xlim=(0, np.pi), ylim=(0, 2.3))
            a.set_aspect("equal")
            if row == 0:
                a.set_title(f"$A_0$ = {made['A0'][k]:.2f}")
            if row == 2:
                a.set_xlabel(r"$A_1$")
                near = np.abs(np.abs(found["gaits"][:, 0]) - made["A0"][k]) < 0.06
                a.plot(*found["gaits"][near, 1:].T, "*", color=style.VERMILION, ms=8, clip_on=False)
        axes[row, 0].set_ylabel(r"$B_1$")
        panel_marks.letter(axes[row, 0], text)
        figure.colorbar(
            drawn, ax=axes[row], label=name, fraction=0.02, pad=0.01, ticks=MaxNLocator(4)
        )
    return style.save(figure, folder / "figure-12-maps-with-offset")
