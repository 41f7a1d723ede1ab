"""A front of two objectives: what every gait achieves, and the gaits themselves."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from colloc.pictures.style import BLUE, VERMILION, snapshot_colours, styled
from colloc.studies.pareto import ParetoFront

_PHASES = np.linspace(0.0, 1.0, 1001)


def front_figure(front: ParetoFront) -> Figure:
    """Left the front, right the paths of its gaits in the plane of the first two joints, in the
    same colours."""
    planar = front.problem.body.n_joint > 1
    with styled():
        figure = Figure(figsize=(7.2 if planar else 3.8, 3.4))
        axes, *plane = figure.subplots(1, 1 + planar, squeeze=False)[0]
        draw_front(axes, front)
        for panel in plane:
            _draw_paths(panel, front)
    return figure


def draw_front(axes: Axes, front: ParetoFront) -> Axes:
    """The two objectives of every gait, with a line that breaks off at gaps; returns the axes."""
    first, second = front.objectives
    values = front.values
    after = [gap.after + 1 for gap in front.gaps]
    whole = np.insert(values, after, np.nan, axis=0)
    axes.plot(whole[:, 1], whole[:, 0], "-", color=BLUE, lw=0.8, zorder=1)
    for k in after:
        label = "nothing found between" if k == after[0] else None
        ends = values[k - 1 : k + 1].T[::-1]
        axes.plot(*ends, ":", color=VERMILION, lw=0.8, zorder=1, label=label)
    axes.scatter(values[:, 1], values[:, 0], c=snapshot_colours(len(front.points)), s=28, zorder=2)
    axes.set(xlabel=second.label, ylabel=first.label)
    axes.set_title(front.problem.name)
    if after:
        axes.legend()
    return axes


def _draw_paths(axes: Axes, front: ParetoFront) -> None:
    last = front.points[-1].gait.angles(_PHASES)
    for point, colour in zip(front.points, snapshot_colours(len(front.points)), strict=True):
        path = point.gait.angles(_PHASES)
        # a mirror image is the same gait
        mirror = np.abs(path + last).sum() < np.abs(path - last).sum()
        axes.plot(*(-path if mirror else path)[:2], color=colour, lw=1.0)
    what = front.problem.body.quantity
    axes.set(xlabel=f"{what} 1  [rad]", ylabel=f"{what} 2  [rad]", aspect="equal")
