"""Figures of a solution. The only modules that name matplotlib are called figures."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure

from colloc.gaits.problem import Problem
from colloc.mechanics.balance import instant
from colloc.mechanics.body import Chain
from colloc.mechanics.contact import crossing_depth
from colloc.pictures.motion_frames import link_ends
from colloc.results.solution import Solution
from colloc.system.replaced_file import replaced_file

BLUE, ORANGE, GREEN, RED, PURPLE, SKY, GREY = "#0072B2", "#E69F00", "#009E73", "#D55E00", "#CC79A7", "#56B4E9", "#777777"
"""Okabe-Ito colours, distinguishable with any colour vision."""

STYLE: Any = {
    "font.size": 9,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.titlesize": 10,
    "axes.titlelocation": "left",
    "legend.frameon": False,
    "pdf.fonttype": 42,
    "savefig.dpi": 160,
}


def draw_filmstrip(axes: Axes, solution: Solution, count: int = 11) -> None:
    """The body over one period at equal time steps, side by side; below, how far its centre of mass has come."""
    t = np.linspace(0.0, 1.0, count)
    motion = solution.sample(t)
    ends = link_ends(solution.problem.body, motion.angles, motion.theta, motion.tail) - motion.centre[:, None, :]
    spacing = 1.2 * max(float(np.ptp(ends[0], axis=0).max()), 0.35)
    low = float(ends[1].min() + min(motion.centre[1].min(), 0.0)) - 0.16
    colours = matplotlib.colormaps["cividis_r"](np.linspace(0.15, 1.0, count))
    for k in range(count):
        x = ends[0, :, k] + k * spacing
        y = ends[1, :, k] + motion.centre[1, k]
        axes.plot(x, y, "-", color=colours[k], lw=2.4, solid_capstyle="round")
        axes.plot(x[1:-1], y[1:-1], "o", color="white", mec=colours[k], ms=3.5)
        axes.plot(x[-1:], y[-1:], "o", color=colours[k], ms=5)
        axes.plot(k * spacing, motion.centre[1, k], "+", color=RED, ms=6)
        axes.text(k * spacing, low + 0.09, f"{t[k]:.1f}", ha="center", va="top", fontsize=7, color=GREY)
    scale = (count - 1) * spacing / max(abs(motion.centre[0, -1]), 1e-12)
    axes.plot([0, (count - 1) * spacing], [low, low], color=GREY, lw=0.8)
    axes.plot(scale * motion.centre[0], np.full(count, low), "|", color=RED, ms=9)
    axes.text(0, low - 0.03, "centre at x = 0", fontsize=7, va="top", ha="left", color=RED)
    axes.text(
        (count - 1) * spacing, low - 0.03, f"x = d = {solution.distance:.4f}", fontsize=7, va="top", ha="right", color=RED
    )
    axes.set_aspect("equal")
    axes.set_axis_off()


def draw_lab(axes: Axes, solution: Solution) -> None:
    """The body in the lab at the ends of a period, with the paths of its ends and its centre of mass."""
    fine = solution.sample(np.linspace(0.0, 1.0, 601))
    ends = link_ends(solution.problem.body, fine.angles, fine.theta, fine.tail)
    axes.plot(*ends[:, 0], color=BLUE, lw=0.9, label="tail")
    axes.plot(*ends[:, -1], color=ORANGE, lw=0.9, label="head")
    axes.plot(*fine.centre, color=RED, lw=1.2, label="centre of mass")
    for k, shade in ((0, "#b0b0b0"), (-1, "black")):
        axes.plot(*ends[:, :, k], "-", color=shade, lw=2.4, solid_capstyle="round")
        axes.plot(*ends[:, -1:, k], "o", color=shade, ms=5)
        axes.plot(*fine.centre[:, [k]], "+", color=RED, ms=7)
    axes.set_aspect("equal", "datalim")
    axes.set(xlabel="x  [body length]", ylabel="y  [body length]")
    axes.legend(loc="upper right", fontsize=7, handlelength=1.2)


def draw_allowed(axes: Axes, body: Chain, joint_limit: float) -> None:
    """Grey over the pairs of joint angles that joint limits or links do not allow."""
    grid = np.linspace(-np.pi, np.pi, 181)
    a, b = np.meshgrid(grid, grid)
    allowed = crossing_depth(body, np.stack([a.ravel(), b.ravel()])) < 1e-9
    allowed &= np.maximum(abs(a), abs(b)).ravel() <= joint_limit + 1e-9
    shade = np.where(allowed.reshape(a.shape), np.nan, 1.0)
    axes.pcolormesh(grid, grid, shade, cmap="Greys", vmin=0, vmax=2.5, rasterized=True, shading="nearest")


def draw_angles(axes: Axes, t: np.ndarray, angles: np.ndarray) -> None:
    """Joint angles over a period."""
    for j, joint in enumerate(angles):
        axes.plot(t, joint, lw=1.4, color=matplotlib.colormaps["viridis"](0.9 * j / max(len(angles) - 1, 1)))
        axes.annotate(f"{j + 1}", (1.0, joint[-1]), xytext=(3, 0), textcoords="offset points", fontsize=7, va="center")
    axes.set(xlim=(0, 1), xlabel="phase t", ylabel="joint angle  [rad]")


def draw_shape_path(
    axes: Axes, problem: Problem, angles: np.ndarray, first: int = 0, second: int = 1, *, legend: bool = True
) -> None:
    """The gait in the plane of two joint angles, over the shapes that joint limits and links allow."""
    if problem.body.n_joint == 2:
        draw_allowed(axes, problem.body, problem.joint_limit)
    q = angles[[first, second]]
    segments = np.stack([q[:, :-1].T, q[:, 1:].T], axis=1)
    lines = LineCollection(list(segments), cmap="cividis_r", lw=2.2, capstyle="round")
    lines.set_array(np.linspace(0, 1, segments.shape[0]))
    axes.add_collection(lines)
    axes.plot(*q[:, 0], "o", color=RED, ms=5, label="t = 0")
    at = angles.shape[1] // 12
    axes.annotate(
        "", (q[0, at + 2], q[1, at + 2]), (q[0, at], q[1, at]), arrowprops={"arrowstyle": "-|>", "color": RED, "lw": 1.4}
    )
    ticks = np.pi * np.array([-1, -0.5, 0, 0.5, 1])
    labels = ["-π", "-π/2", "0", "π/2", "π"]
    axes.set_xticks(ticks, labels)
    axes.set_yticks(ticks, labels)
    axes.set(xlim=(-np.pi * 1.02, np.pi * 1.02), ylim=(-np.pi * 1.02, np.pi * 1.02), aspect="equal")
    axes.set(xlabel=f"joint angle {first + 1}  [rad]", ylabel=f"joint angle {second + 1}  [rad]")
    if legend:
        axes.legend(loc="lower left", handletextpad=0.2)


def draw_speeds(axes: Axes, solution: Solution, t: np.ndarray) -> None:
    """Speeds of the link midpoints over a period, on a logarithmic scale that shows stick, and delta."""
    problem, motion = solution.problem, solution.sample(t)
    link = instant(problem.body, problem.friction, motion.angles, motion.rates, motion.z, solution.delta_per_period).velocity
    speed = np.hypot(link.vs, link.vn)
    for i, colour in zip(range(problem.body.n_link), [BLUE, ORANGE, GREEN, RED, PURPLE, SKY] * 2, strict=False):
        axes.semilogy(t, speed[i], color=colour, lw=1.4, label=f"link {i + 1}")
    axes.axhline(solution.delta_per_period, color=GREY, lw=1, ls=":")
    axes.text(1.0, solution.delta_per_period, "δ ", color=GREY, ha="right", va="bottom")
    axes.set(xlim=(0, 1), ylabel="midpoint speed  [1/period]", xlabel="phase t")
    axes.legend(loc="lower left", ncols=min(3, problem.body.n_link), handlelength=1.2, columnspacing=1)


def draw_power(axes: Axes, solution: Solution, t: np.ndarray) -> None:
    """Power against friction over a period, with the mesh below."""
    motion = solution.sample(t)
    axes.plot(t, solution.power(motion), color=BLUE, lw=1.5)
    axes.set(xlim=(0, 1), xlabel="phase t", ylabel="power  [weight·length/period]")
    axes.set_ylim(bottom=0)
    edges = solution.last.edges
    axes.plot(edges, np.zeros_like(edges), "|", color=GREY, ms=7, clip_on=False)


def solution_figure(solution: Solution) -> Figure:
    """Filmstrip, lab paths, path in the joint plane, speeds and power of a solution."""
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(11, 8.2), layout="constrained")
        grid = figure.add_gridspec(3, 3, height_ratios=(0.75, 1.25, 0.9))
        t = np.linspace(0.0, 1.0, 1201)
        strip = figure.add_subplot(grid[0, :])
        draw_filmstrip(strip, solution)
        strip.set_title("one period, frame by frame (phase below; the dot is the head)")
        lab = figure.add_subplot(grid[1, :2])
        draw_lab(lab, solution)
        lab.set_title("in the lab, from t = 0 (grey) to t = 1 (black)")
        plane = figure.add_subplot(grid[1, 2])
        if solution.problem.body.n_joint == 1:  # there is no plane of two joints
            draw_angles(plane, t, solution.gait.angles(t))
            plane.set_title("the joint's angle")
        else:
            draw_shape_path(plane, solution.problem, solution.gait.angles(t))
            plane.set_title("gait in shape space (grey: not allowed)")
        speeds = figure.add_subplot(grid[2, :2])
        draw_speeds(speeds, solution, t)
        speeds.set_title("speeds of the links; near δ they stick")
        draw_power(figure.add_subplot(grid[2, 2]), solution, t)
        figure.axes[-1].set_title(f"W = {solution.work:.4f} per period (ticks: mesh)")
        mu = solution.problem.friction
        verdict = "" if solution.status == "solved" else f"   —   {solution.status.upper()}"
        figure.suptitle(
            f"{solution.problem.name}: efficiency d/W = {solution.efficiency:.5f}   "
            f"(μt, μf, μb) = ({mu.mu_t:g}, {mu.mu_f:g}, {mu.mu_b:g}),  δ = {solution.last.delta:.0e}{verdict}\n"
            f"class: {solution.problem.gait.describe()}",
            x=0.01,
            ha="left",
            color="black" if solution.status == "solved" else RED,
        )
    return figure


def save_figure(figure: Figure, path: Path) -> None:
    """Save as PNG and PDF beside each other, whatever suffix `path` has; raises StoreError if they cannot be written."""
    with matplotlib.rc_context(STYLE):
        for kind in ("png", "pdf"):
            with replaced_file(path.with_suffix(f".{kind}")) as temporary:
                figure.savefig(temporary, format=kind)
            figure.set_layout_engine("none")  # what the first saving laid out holds for the second
