"""The charts of a report: shape space, angles, speeds, power, convergence, mesh."""

from __future__ import annotations

import numpy as np

from colloc.gaits.problem import Problem
from colloc.mechanics.balance import instant
from colloc.mechanics.contact import crossing_depth
from colloc.results.chart import BLUE, COLOURS, ORANGE, VERMILION, Chart
from colloc.results.markup import Markup, element
from colloc.results.solution import Solution
from colloc.verification.mesh_error import mesh_error

_PI_TICKS = [(-np.pi, "−π"), (-np.pi / 2, "−π/2"), (0.0, "0"), (np.pi / 2, "π/2"), (np.pi, "π")]
_CELLS = 120
_FORBIDDEN = "#dcdcdc"
_PLANE, _SMALL, _MOST_PLANES = 320, 1.6, 6
"""Pixels of a plane; extent [rad] below which a path is also shown closer; planes shown at most."""


def plane_chart(problem: Problem, angles: np.ndarray, first: int, second: int, *, closer: bool = False) -> Markup:
    """The gait in the plane of two joint angles; grey shapes are not allowed. A dot follows the animation.

    Parameters
    ----------
    problem : Problem
    angles : (n_joint, n_time)
    first, second : int
        Joints, from 0.
    closer : bool
        Show a square around the path instead of the whole plane.
    """
    path = angles[[first, second]]
    middle, half = np.zeros(2), 1.03 * np.pi
    if closer:
        middle, half = 0.5 * (path.min(axis=1) + path.max(axis=1)), 0.6 * float(np.ptp(path, axis=1).max())
    x, y = ((float(m - half), float(m + half)) for m in middle)
    chart = Chart(
        x,
        y,
        f"joints {first + 1} and {second + 1}" + (", closer" if closer else ""),
        f"joint angle {first + 1} [rad]",
        f"joint angle {second + 1} [rad]",
        width=_PLANE,
        height=round(0.98 * _PLANE),
    )
    for wide, high in forbidden_rectangles(problem):
        if wide[0] < x[1] and wide[1] > x[0] and high[0] < y[1] and high[1] > y[0]:
            chart.rectangle((max(wide[0], x[0]), min(wide[1], x[1])), (max(high[0], y[0]), min(high[1], y[1])), _FORBIDDEN)
    chart.line(path[0], path[1], BLUE, width=2)
    chart.marks(path[0, :1], path[1, :1], BLUE, hollow=True)
    pixels = [*chart.px(np.array(x)), *chart.py(np.array(y))]
    box = ",".join(f"{value:.5g}" for value in [*pixels, *x, *y])
    chart.parts.append(element("circle", class_="dot", r=5, fill=VERMILION, data_box=box, data_first=first, data_second=second))
    return chart.svg() if closer else chart.svg(_PI_TICKS, _PI_TICKS)


def plane_charts(problem: Problem, angles: np.ndarray) -> list[Markup]:
    """The planes of neighbouring joints; a path that fills little of its plane is shown closer, too."""
    charts = []
    for j in range(min(len(angles) - 1, _MOST_PLANES)):
        charts.append(plane_chart(problem, angles, j, j + 1))
        if np.ptp(angles[j : j + 2], axis=1).max() < _SMALL:
            charts.append(plane_chart(problem, angles, j, j + 1, closer=True))
    return charts


def forbidden_rectangles(problem: Problem) -> list[tuple[tuple[float, float], tuple[float, float]]]:
    """Rectangles that cover the shapes of a plane of two joint angles beyond the joint limit, or with crossing links.

    Contact is only shown for bodies of two joints: with more, it depends on the others.
    """
    limit = problem.joint_limit
    edges = np.linspace(-np.pi, np.pi, _CELLS + 1)
    middle = 0.5 * (edges[1:] + edges[:-1])
    a, b = np.meshgrid(middle, middle)
    bad = np.maximum(abs(a), abs(b)) > limit
    if problem.body.n_joint == 2:
        bad |= (crossing_depth(problem.body, np.stack([a.ravel(), b.ravel()])) > 1e-9).reshape(a.shape)
    result = []
    for row in range(_CELLS):
        change = np.flatnonzero(np.diff(np.concatenate([[False], bad[row], [False]]).astype(int)))
        for start, stop in change.reshape(-1, 2):
            result.append(((edges[start], edges[stop]), (edges[row], edges[row + 1])))
    return result


def angles_chart(t: np.ndarray, angles: np.ndarray) -> Markup:
    """Joint angles over a period."""
    reach = 1.05 * max(float(np.abs(angles).max()), 0.1)
    chart = Chart((0.0, 1.0), (-reach, reach), "joint angles [rad]", "phase t")
    for j, colour in zip(range(len(angles)), COLOURS, strict=False):
        chart.line(t, angles[j], colour, f"{j + 1}")
    chart.cursor()
    return chart.svg()


def speeds_chart(solution: Solution, t: np.ndarray) -> Markup:
    """Speeds of the link midpoints, on a logarithmic scale that shows where links stick."""
    problem, motion, delta = solution.problem, solution.sample(t), solution.delta_per_period
    link = instant(problem.body, problem.friction, motion.angles, motion.rates, motion.z, delta).velocity
    speed = np.hypot(link.vs, link.vn)
    low = 10.0 ** np.floor(np.log10(0.3 * delta))
    chart = Chart(
        (0.0, 1.0), (low, 10 ** np.ceil(np.log10(speed.max()))), "speeds of the links [1/period]", "phase t", log_y=True
    )
    for i, colour in zip(range(len(speed)), COLOURS, strict=False):
        chart.line(t, np.maximum(speed[i], low), colour, f"{i + 1}")
    chart.level(delta, "δ: below it links stick")
    chart.cursor()
    return chart.svg()


def power_chart(solution: Solution, t: np.ndarray) -> Markup:
    """Power against friction, with the mesh on the axis."""
    power = solution.power(solution.sample(t))
    chart = Chart((0.0, 1.0), (0.0, 1.08 * float(power.max())), "power against friction [weight·length/period]", "phase t")
    chart.line(t, power, BLUE)
    chart.ticks_below(solution.last.edges)
    chart.cursor()
    return chart.svg()


def convergence_chart(solution: Solution) -> Markup:
    """Efficiency at every level against its delta; hollow marks did not converge."""
    levels = solution.levels
    delta = np.array([level.delta for level in levels])
    value = np.array([level.efficiency for level in levels])
    good = np.array([level.optimal for level in levels])
    shown = value[good] if good.any() else value[np.isfinite(value)]
    middle = float(np.median(shown)) if shown.size else 0.0
    spread = max(float(np.abs(shown - middle).max()) if shown.size else 0.0, 1e-3 * abs(middle), 1e-9)
    y = (middle - 1.2 * spread, middle + 1.2 * spread)
    x = (delta.min() / 2, delta.max() * 2)
    chart = Chart(x, y, "efficiency at each level", "δ", log_x=True)
    chart.line(delta[good], value[good], BLUE)
    chart.marks(delta[good], value[good], BLUE)
    outside = ~good & np.isfinite(value)
    chart.marks(delta[outside], np.clip(value[outside], *y), VERMILION, hollow=True)
    return chart.svg()


def mesh_chart(solution: Solution) -> tuple[Markup, float]:
    """Estimated error of each mesh interval against phase, and the sum of their magnitudes."""
    problem, mesh = solution.problem, solution.mesh
    errors = np.maximum(np.abs(mesh_error(problem, mesh, solution.gait, solution.delta_per_period).efficiency), 1e-12)
    tolerance = problem.mesh_tolerance
    high = 10.0 ** np.ceil(np.log10(max(float(errors.max()), tolerance) * 1.01))
    low = max(10.0 ** np.floor(np.log10(float(errors.min()))), high * 1e-10)
    title = f"mesh: error of {mesh.n} intervals"
    chart = Chart((0.0, float(mesh.edges[-1])), (low, high), title, "phase t", log_y=True)
    chart.line(np.repeat(mesh.edges, 2)[1:-1], np.repeat(errors, 2), ORANGE)
    chart.ticks_below(mesh.edges)
    if tolerance > 0:
        chart.level(tolerance, "allowed in all")
    return chart.svg(), float(errors.sum())
