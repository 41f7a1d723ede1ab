"""Gaits of several classes side by side: each path in the plane of the joint angles, and the body along it."""

from __future__ import annotations

from pathlib import Path
from typing import Any, NamedTuple

import matplotlib
import numpy as np
from matplotlib.figure import Figure

from colloc.gaits.path_samples import Gait
from colloc.mechanics.body import Chain
from colloc.pictures.figure import draw_allowed
from colloc.pictures.style import GREY, VERMILION, save, styled


class GaitPanel(NamedTuple):
    """A gait and what to write above it."""

    title: str
    gait: Gait


_SNAPSHOTS = 6


def _draw_path(axes: Any, gait: Gait, limits: tuple[np.ndarray, float]) -> None:
    angles = gait.angles(np.linspace(0.0, 1.0, 2001))
    axes.plot(*angles, color=GREY, lw=1.5, zorder=1)
    t = np.arange(_SNAPSHOTS) / _SNAPSHOTS
    axes.scatter(*gait.angles(t), c=t, cmap="viridis", s=18, zorder=2)
    centre, half = limits
    axes.set(xlim=(centre[0] - half, centre[0] + half), ylim=(centre[1] - half, centre[1] + half), aspect="equal")


def _draw_bodies(axes: Any, body: Chain, gait: Gait, bar: bool = False) -> None:
    """Bodies side by side, each over the first one in grey, so that small motions show; with a bar of 0.1 body lengths."""
    t = np.arange(_SNAPSHOTS) / _SNAPSHOTS
    x, y = body.joints(gait.angles(t))
    x, y = x - x.mean(axis=0), y - y.mean(axis=0)
    apart = 1.15 * float(np.ptp(x, axis=0).max()) + 0.05
    if bar:
        low = y.min() - 0.12 * apart
        axes.plot(x.min() + np.array([0.0, 0.1]), [low, low], color="black", lw=1.0, clip_on=False)
    for k, colour in enumerate(matplotlib.colormaps["viridis"](0.9 * t)):
        axes.plot(x[:, 0] + apart * k, y[:, 0], color="#d5dade", lw=1.6, solid_capstyle="round", clip_on=False)
        axes.plot(x[:, k] + apart * k, y[:, k], color=colour, lw=2.0, solid_capstyle="round", clip_on=False)
        axes.plot(x[-1:, k] + apart * k, y[-1:, k], "o", color=colour, ms=3.5, clip_on=False)
    axes.set_aspect("equal")
    axes.set_axis_off()


def gait_panels(panels: list[GaitPanel], body: Chain | None = None) -> Figure:
    """A figure of paths over the admissible shapes; where a path is small, an inset of it; bodies below."""
    body = body or Chain()
    columns = min(4, len(panels))
    rows = -(-len(panels) // columns)
    with styled():
        figure = Figure(figsize=(3.1 * columns, 4.2 * rows))
        grid = figure.add_gridspec(2 * rows, columns, height_ratios=[3.0, 0.9] * rows)
        for k, panel in enumerate(panels):
            row, column = divmod(k, columns)
            axes = figure.add_subplot(grid[2 * row, column])
            draw_allowed(axes, body, np.pi)
            _draw_path(axes, panel.gait, (np.zeros(2), 1.02 * np.pi))
            axes.set_title(panel.title, fontsize=8)
            axes.set_xticks(np.pi * np.array([-1, 0, 1]), ["-π", "0", "π"])
            axes.set_yticks(np.pi * np.array([-1, 0, 1]), ["-π", "0", "π"])
            if row == rows - 1 or k + columns >= len(panels):
                axes.set_xlabel("joint angle 1")
            if column == 0:
                axes.set_ylabel("joint angle 2")
            angles = panel.gait.angles(np.linspace(0.0, 1.0, 401))
            low, high = angles.min(axis=1), angles.max(axis=1)
            if (high - low).max() < 1.5:
                inset = axes.inset_axes((0.16, 0.5, 0.44, 0.44))
                _draw_path(inset, panel.gait, (0.5 * (low + high), 0.6 * float((high - low).max())))
                inset.tick_params(labelsize=5)
                for spine in inset.spines.values():
                    spine.set_visible(True)
                    spine.set_color(VERMILION)
            _draw_bodies(figure.add_subplot(grid[2 * row + 1, column]), body, panel.gait)
    return figure


def body_strips(panels: list[GaitPanel], body: Chain) -> Figure:
    """A figure of bodies of any number of links along their gaits, equal steps in phase, two gaits a row.

    Every gait has its own scale, which a bar of 0.1 body lengths shows.
    """
    columns = min(2, len(panels))
    rows = -(-len(panels) // columns)
    with styled():
        figure = Figure(figsize=(5.6 * columns, 1.5 * rows))
        for k, panel in enumerate(panels):
            axes = figure.add_subplot(rows, columns, k + 1)
            _draw_bodies(axes, body, panel.gait, bar=True)
            axes.set_title(panel.title, fontsize=8)
    return figure


def save_body_strips(panels: list[GaitPanel], body: Chain, path: Path) -> None:
    """Save `body_strips` as PNG and PDF."""
    save(body_strips(panels, body), path.with_suffix(""))


def save_gait_panels(panels: list[GaitPanel], path: Path) -> None:
    """Save `gait_panels` as PNG and PDF."""
    save(gait_panels(panels), path.with_suffix(""))
