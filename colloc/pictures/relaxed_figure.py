"""Panels about a relaxed gait and the finite ones near it."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes

from colloc.gaits.problem import Problem
from colloc.gaits.relaxed import Mixture
from colloc.pictures.figure import draw_allowed, set_log
from colloc.pictures.style import BLUE, GREY, ORANGE, VERMILION
from colloc.results.relaxation import Relaxation

_LOOP = 0.25
"""Length [rad] of the directions of a mixture together, as drawn."""
_LOOPS = 24
_USED = 1e-4
"""Share of a piece's time from which a direction counts as mixed in."""


def draw_mixture(axes: Axes, problem: Problem, gait: Mixture) -> None:
    """The mean shape of a relaxed gait in the plane of its first two joints; where it mixes, the directions as small loops."""
    draw_allowed(axes, problem.body, problem.joint_limit)
    whole = gait.whole
    shapes, shares = whole.shapes[:2], whole.shares
    axes.plot(*shapes, color=BLUE, lw=1.6, label="mean shape")
    axes.plot(*shapes[:, :1], "o", color=VERMILION, ms=5)
    mixed = np.flatnonzero((shares > _USED).sum(axis=1) > 1)
    for piece in mixed[:: max(1, mixed.size // _LOOPS)]:
        steps = (_LOOP * shares[piece, :, None] * whole.directions[piece])[:, :2]
        steps = steps[np.argsort(np.arctan2(steps[:, 1], steps[:, 0]))]
        corners = np.concatenate([np.zeros((1, 2)), np.cumsum(steps, axis=0)])
        corners += shapes[:, piece + 1] - corners.mean(axis=0)
        axes.plot(*corners.T, color=ORANGE, lw=0.9, label="directions mixed" if piece == mixed[0] else None)
    limit = 1.02 * np.pi
    axes.set(xlim=(-limit, limit), ylim=(-limit, limit), aspect="equal")
    what = problem.body.quantity
    axes.set(xlabel=f"{what} 1  [rad]", ylabel=f"{what} 2  [rad]")
    axes.legend(loc="lower left")


def draw_realised(axes: Axes, relaxed: Relaxation) -> None:
    """What finite gaits lose to the relaxed one, against the number of repeats."""
    repeats = np.array([r.repeats for r in relaxed.realised])
    lost = np.array([relaxed.certificate.efficiency - r.certificate.efficiency for r in relaxed.realised])
    axes.plot(repeats, lost, "o-", color=BLUE, label="finite gaits")
    if lost[-1] > 0:
        axes.plot(repeats, lost[-1] * repeats[-1] / repeats, "--", color=GREY, label="like 1/m")
    for r, y in zip(relaxed.realised, lost, strict=True):
        axes.annotate(
            f"{r.corners} corners\n{r.certificate.efficiency:.4f}",
            (r.repeats, y),
            (4, 4),
            textcoords="offset points",
            fontsize=7,
        )
    positive = lost[lost > 0]
    if positive.size:
        set_log(axes, "y", (0.4 * float(positive.min()), 3 * float(positive.max())))
    axes.set_xscale("log", base=2)
    axes.set_xlim(0.8 * repeats[0], 2.0 * repeats[-1])
    axes.set_xticks(repeats, [str(m) for m in repeats])
    axes.set(xlabel="repeats m of the directions on a piece", ylabel="relaxed less realised")
    axes.legend(loc="lower left")


def draw_shares(axes: Axes, gait: Mixture) -> None:
    """Share of the time that the directions of a mixture take over the period, the largest first."""
    shares = np.sort(gait.whole.shares, axis=1)[:, ::-1]
    for k, share in enumerate(shares.T):
        axes.stairs(
            share, gait.phases, color=(BLUE, ORANGE, VERMILION, GREY)[min(k, 3)], lw=1.2, label=f"{k + 1}", baseline=None
        )
    axes.set(xlim=(0, 1), ylim=(0, 1.05), xlabel="phase t", ylabel="share of the time")
    axes.legend(loc="center right", title="direction")
