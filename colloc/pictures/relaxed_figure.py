"""Panels about a relaxed solution, and the figure of them all."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from colloc.gaits.mixture import Mixture
from colloc.gaits.problem import Problem
from colloc.pictures.figure import draw_allowed, draw_filmstrip, draw_lab, set_log
from colloc.pictures.style import BLUE, GREY, INK, ORANGE, VERMILION, styled
from colloc.results.relaxed_solution import RelaxedSolution
from colloc.results.solution import SOLVED

_LOOP = 0.25
"""Length [rad] of the directions of a mixture together, as drawn."""
_LOOPS = 24
_USED = 1e-4
"""Share of a piece's time from which a direction counts as mixed in."""


def draw_mixture(axes: Axes, problem: Problem, gait: Mixture, first: int = 0, second: int = 1) -> None:
    """The mean shape of a relaxed gait in the plane of two joint angles; where it mixes, the directions as small loops."""
    draw_allowed(axes, problem.body, problem.joint_limit)
    whole = gait.whole
    shapes = whole.shapes[[first, second]]
    axes.plot(*shapes, color=BLUE, lw=1.6, label="mean shape")
    axes.plot(*shapes[:, :1], "o", color=VERMILION, ms=5)
    shares = whole.durations / np.maximum(whole.durations.sum(axis=1, keepdims=True), 1e-300)
    mixed = np.flatnonzero((shares > _USED).sum(axis=1) > 1)
    for piece in mixed[:: max(1, mixed.size // _LOOPS)]:
        steps = (_LOOP * shares[piece, :, None] * whole.directions[piece])[:, [first, second]]
        steps = steps[np.argsort(np.arctan2(steps[:, 1], steps[:, 0]))]
        corners = np.concatenate([np.zeros((1, 2)), np.cumsum(steps, axis=0)])
        corners += shapes[:, piece + 1] - corners.mean(axis=0)
        axes.plot(*corners.T, color=ORANGE, lw=0.9, label="directions mixed" if piece == mixed[0] else None)
    limit = 1.02 * np.pi
    axes.set(xlim=(-limit, limit), ylim=(-limit, limit), aspect="equal")
    axes.set(xlabel=f"joint angle {first + 1}  [rad]", ylabel=f"joint angle {second + 1}  [rad]")
    axes.legend(loc="lower left")


def draw_realised(axes: Axes, solution: RelaxedSolution) -> None:
    """What finite gaits lose to the relaxed one, against the number of repeats."""
    repeats = np.array([r.repeats for r in solution.realised])
    lost = np.array([solution.certificate.efficiency - r.certificate.efficiency for r in solution.realised])
    axes.plot(repeats, lost, "o-", color=BLUE, label="finite gaits")
    if lost[-1] > 0:
        axes.plot(repeats, lost[-1] * repeats[-1] / repeats, "--", color=GREY, label="like 1/m")
    for r, y in zip(solution.realised, lost, strict=True):
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
    whole = gait.whole
    shares = np.sort(whole.durations / np.maximum(whole.durations.sum(axis=1, keepdims=True), 1e-300), axis=1)[:, ::-1]
    for k, share in enumerate(shares.T):
        axes.stairs(
            share, gait.phases, color=(BLUE, ORANGE, VERMILION, GREY)[min(k, 3)], lw=1.2, label=f"{k + 1}", baseline=None
        )
    axes.set(xlim=(0, 1), ylim=(0, 1.05), xlabel="phase t", ylabel="share of the time")
    axes.legend(loc="center right", title="direction")


def relaxed_figure(solution: RelaxedSolution) -> Figure:
    """Filmstrip and lab paths of the best finite gait, the mixture in shape space and time, and what finite gaits lose."""
    problem, mu, best = solution.problem, solution.problem.friction, solution.best
    verdict = "" if solution.status == SOLVED else f"   —   {solution.status.upper()}"
    headline = (
        f"{problem.name}: efficiency d/W = {best.certificate.efficiency:.5f} with {best.corners} corners, relaxed "
        f"{solution.certificate.efficiency:.5f}   {mu.label},  "
        f"δ = {problem.delta:.0e}{verdict}\nclass: {problem.gait.describe()}"
    )
    with styled():
        figure = Figure(figsize=(11, 8.2))
        figure.set_layout_engine("none")  # the places are known
        figure.text(0.015, 0.985, headline, fontsize=11, va="top", color=INK if solution.status == SOLVED else VERMILION)
        strip = figure.add_axes((0.015, 0.76, 0.97, 0.135))
        draw_filmstrip(strip, solution)
        figure.text(0.015, 0.905, "one period of the finite gait: phase, and below it how far the centre has come (disc: head)")
        grid = figure.add_gridspec(
            2, 2, left=0.075, right=0.985, bottom=0.06, top=0.685, wspace=0.2, hspace=0.33, width_ratios=(2, 1.15),
            height_ratios=(1.5, 1),
        )  # fmt: skip
        lab, plane, shares, realised = (figure.add_subplot(grid[k]) for k in range(4))
        draw_lab(lab, solution)
        draw_mixture(plane, problem, solution.relaxed)
        draw_shares(shares, solution.relaxed)
        draw_realised(realised, solution)
        titles = ("in the lab (black: at the end)", "shape space", "the mixture", "finite gaits")
        for axes, title in zip((lab, plane, shares, realised), titles, strict=True):
            axes.set_title(title)
    return figure
