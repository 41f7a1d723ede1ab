"""Gaits of several classes, one below the other: the body over a period, and its joint angles."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from matplotlib.figure import Figure

from colloc.gaits.path_samples import Gait
from colloc.gaits.problem import Problem
from colloc.mechanics.chain import Chain
from colloc.pictures.figure import draw_angles, draw_body, draw_shape_path
from colloc.pictures.motion_frames import turned
from colloc.pictures.style import INK, snapshot_colours, styled


class GaitPanel(NamedTuple):
    """A gait and what to write above it."""

    title: str
    gait: Gait


_SNAPSHOTS = 7
_SMALL, _SEEN = 0.3, 0.6
"""Bends [rad] that are too small to be seen, and how large the largest of them is drawn."""
_NEAR = 1.0
"""Gaits that keep so near [rad] to a straight or folded shape are shown by their angles from it."""
_PALE, _GAP, _BAR = "#d9dde0", 0.12, 0.1


def nearest_rest(angles: np.ndarray) -> np.ndarray:
    """The straight or folded shape nearest to the mean of some shapes, ``(n_joint, 1)``."""
    mean = angles.mean(axis=1, keepdims=True)
    return np.where(np.abs(mean) > 0.5 * np.pi, np.sign(mean) * np.pi, 0.0)


def magnified(angles: np.ndarray) -> tuple[np.ndarray, int]:
    """Joint angles that can be seen, and by what their distance from the nearest straight or folded shape was multiplied.

    Parameters
    ----------
    angles : (n_joint, n_time)
    """
    rest = nearest_rest(angles)
    largest = float(np.abs(angles - rest).max())
    factor = 1 if largest > _SMALL else round(_SEEN / largest)
    return rest + factor * (angles - rest), factor


def draw_bodies(axes: Any, body: Chain, gait: Gait) -> int:
    """Bodies at equal steps of a period, each over the first one, their mean direction kept; what bends are multiplied by."""
    angles, factor = magnified(gait.angles(np.linspace(0.0, 1.0, _SNAPSHOTS)))
    tangents = np.concatenate([np.zeros((1, angles.shape[1])), np.cumsum(angles, axis=0)])
    x, y = turned(np.stack(body.outline(angles)), -np.average(tangents, axis=0, weights=body.lengths))
    x, y = x - 0.5 * (x.min(axis=0) + x.max(axis=0)), y - y.mean(axis=0)
    apart = float(np.ptp(x, axis=0).max()) + _GAP
    for k, colour in enumerate(snapshot_colours(_SNAPSHOTS)):
        axes.plot(x[:, 0] + apart * k, y[:, 0], color=_PALE, lw=2.0, solid_capstyle="round")
        draw_body(axes, np.stack([x[:, k] + apart * k, y[:, k]]), colour, body)
    low, left = float(y.min()) - _GAP, float(x[:, 0].min())
    axes.plot([left, left + _BAR], [low, low], color=INK, lw=1.2)
    axes.set(aspect="equal", xlim=(-0.55 * apart, (_SNAPSHOTS - 0.45) * apart), ylim=(low - 0.04, float(y.max()) + 0.06))
    axes.set_anchor("W")
    axes.set_axis_off()
    return factor


def gait_figure(panels: list[GaitPanel], body: Chain) -> Figure:
    """A row a gait: bodies light to dark, with a bar of 0.1 body lengths, and beside them the path or all joint angles."""
    planar = body.n_joint == 2
    with styled():
        figure = Figure(figsize=(11.0, (2.1 if planar else 1.75) * len(panels)))
        grid = figure.add_gridspec(len(panels), 2, width_ratios=(3.4 if planar else 2.6, 1))
        for row, panel in enumerate(panels):
            bodies, beside = figure.add_subplot(grid[row, 0]), figure.add_subplot(grid[row, 1])
            factor = draw_bodies(bodies, body, panel.gait)
            bodies.set_title(panel.title + (f"; bends drawn {factor} times as large" if factor > 1 else ""))
            t = np.linspace(0.0, 1.0, 1201)
            angles = panel.gait.angles(t)
            if planar:
                draw_shape_path(beside, Problem("shown", body=body, joint_limit=np.pi), angles)
                continue
            rest = nearest_rest(angles)
            near = rest.any() and np.abs(angles - rest).max() < _NEAR
            draw_angles(beside, t, angles - rest if near else angles, body)
            if near:
                beside.set_ylabel("joint angle ∓ π  [rad]")
    return figure
