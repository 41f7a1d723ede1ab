"""Panels about a solution, without titles."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.ticker import LogLocator, MaxNLocator, NullLocator

from colloc.gaits.limits import Limit, under_one_limit
from colloc.gaits.problem import Problem
from colloc.mechanics.bodies import Body
from colloc.mechanics.contact import crossing_depth, link_width
from colloc.mechanics.floor_contact import FOOT, WHEEL
from colloc.pictures.motion_frames import foot_kinds, lab_feet, lab_outline
from colloc.pictures.style import (
    BLUE,
    GREEN,
    GREY,
    INK,
    ORANGE,
    PHASE,
    SEQUENTIAL,
    SERIES,
    VERMILION,
    snapshot_colours,
)
from colloc.results.body_marks import hinges, part_speeds
from colloc.results.solution import Solution

_GAP, _NARROWEST, _MARGIN = 0.2, 0.3, 0.08  # around snapshots [body lengths]
_FLAT, _SEEN = 0.12, 0.3  # flatter motions are drawn of this height [body lengths]
_SMALL = 1.6  # extent [rad] below which a path in shape space is magnified
_MOST_PERIODS = 3  # drawn in the lab
_NAMED = 5  # lines that a legend names if there are too many
_CELLS = 180
_ROUND = 9  # vertices of the round end of a link
_EXPONENT = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


class FootMarks:
    """Marks of given sizes [points] for feet (squares), wheels and pads (bars), hollow while they
    slide; kinds as `colloc.mechanics.floor_contact.Foot.kind`."""

    def __init__(self, axes: Axes, kinds: Sequence[str], size: float) -> None:
        self._kinds, self._marks = np.array(kinds), {}
        for kind in dict.fromkeys(kinds):
            look: Any = {"zorder": 3} | ({"marker": "s", "ls": ""} if kind == FOOT else {})
            colour, small = GREEN if kind == WHEEL else VERMILION, 0.55 * size
            self._marks[kind] = (
                *axes.plot([], [], c=colour, ms=size, lw=size, solid_capstyle="projecting", **look),
                *axes.plot([], [], c="white", ms=small, lw=small, solid_capstyle="butt", **look),
            )

    def place(self, places: np.ndarray, held: np.ndarray) -> None:
        """Move the marks to both ends of the feet ``(2, 2, n_foot)``, of which some hold."""
        # no line from foot to foot
        apart = np.concatenate([places, np.full_like(places[:, :1], np.nan)], axis=1)
        for kind, (filled, hollow) in self._marks.items():
            of_kind = self._kinds == kind
            for line, chosen in ((filled, of_kind), (hollow, of_kind & ~held)):
                line.set_data(*apart[..., chosen].transpose(0, 2, 1).reshape(2, -1))

    def key(self) -> dict[str, Any]:
        """Legend texts and what they explain."""
        last = next(reversed(self._marks), "")
        words = {kind: f"{kind} (filled: holds)" if kind == last else kind for kind in self._marks}
        return {words[kind]: marks for kind, marks in self._marks.items()}


def draw_filmstrip(axes: Axes, solution: Solution, count: int = 11) -> None:
    """The body at equal steps of a period, with the phase and the displacement of its centre."""
    body, motion = solution.problem.body, solution.sample(np.linspace(0.0, 1.0, count))
    at = (body, motion.angles, motion.theta, motion.tail)
    x, y = lab_outline(*at)
    feet, held, rise = lab_feet(*at), solution.holding(motion), float(np.ptp(y))
    higher = max(1, round(_SEEN / rise)) if 0 < rise < _FLAT else 1
    y = higher * y
    room = np.maximum(np.ptp(x, axis=0), _NARROWEST) + _GAP
    middle = np.cumsum(room) - 0.5 * room
    shift = middle - 0.5 * (x.min(axis=0) + x.max(axis=0))
    low = float(y.min()) - _MARGIN
    for k, colour in enumerate(snapshot_colours(count)):
        draw_body(axes, np.stack([x[:, k] + shift[k], y[:, k]]), colour, body)
        marks = FootMarks(axes, foot_kinds(body), 4.5)
        marks.place(feet[..., k] * [[[1]], [[higher]]] + [[[shift[k]]], [[0]]], held[:, k])
        centre = motion.centre[:, k]
        axes.plot(centre[0] + shift[k], higher * centre[1], "+", color=VERMILION, ms=6)
        come = f"{round(float(centre[0]), 2) + 0.0:.2f}".replace("-", "−")
        for text, colour, line in ((f"{motion.t[k]:.2g}", GREY, -3), (come, VERMILION, -13)):
            axes.annotate(
                text, (middle[k], low), (0, line), xycoords="data", textcoords="offset points",
                ha="center", va="top", fontsize=7, color=colour,
            )  # fmt: skip
    axes.set(xlim=(0, float(room.sum())), ylim=(low, float(y.max()) + _MARGIN), aspect="equal")
    axes.set_axis_off()
    if higher > 1:
        axes.annotate(
            f"heights drawn {higher} times as large", (0, 1), (4, 4), xycoords="axes fraction",
            textcoords="offset points", color=GREY, fontsize=7,
        )  # fmt: skip


def strips(ends: np.ndarray, width: float) -> np.ndarray:
    """Round-ended polygons ``(n_part, n_vertex, 2)`` around the parts of an outline."""
    along = np.arctan2(*np.diff(ends)[::-1])[:, None]
    half_turn = np.linspace(-0.5 * np.pi, 0.5 * np.pi, _ROUND)
    rims = [
        end[:, :, None] + 0.5 * width * np.stack([np.cos(along + turn), np.sin(along + turn)])
        for end, turn in ((ends[:, 1:], half_turn), (ends[:, :-1], half_turn + np.pi))
    ]
    return np.concatenate(rims, axis=2).transpose(1, 2, 0)


def draw_body(axes: Axes, ends: np.ndarray, colour: str | np.ndarray, body: Body) -> None:
    """A body with an outline ``(2, n_point)``: hollow joints, the head a disc."""
    if width := link_width(body):
        links = list(strips(ends, width))
        axes.add_collection(PolyCollection(links, facecolors=[colour], edgecolors="white", lw=0.2))
    else:
        axes.plot(*ends, "-", color=colour, lw=2.4, solid_capstyle="round", solid_joinstyle="round")
    axes.plot(*ends[:, hinges(body)], "o", color="white", mec=colour, ms=3.5)
    axes.plot(*ends[:, -1:], "o", color=colour, ms=5)


def draw_lab(axes: Axes, solution: Solution) -> None:
    """Paths of tail, head and centre of mass, over the periods that separate the first body from
    the last one; of one period with one body if these are too many."""
    body, start = solution.problem.body, solution.sample(0.0)
    begin = lab_outline(body, start.angles, start.theta, start.tail)[:, :, 0]
    step = solution.sample(1.0).centre[:, 0] - start.centre[:, 0]
    needed = 1.05 * float(np.ptp(step @ begin)) / max(float(np.hypot(*step)) ** 2, 1e-300)
    apart = needed <= _MOST_PERIODS
    periods = max(1, int(np.ceil(needed))) if apart else 1
    fine = solution.sample(np.linspace(0.0, periods, 600 * periods + 1))
    at = (body, fine.angles, fine.theta, fine.tail)
    ends, feet, held = lab_outline(*at), lab_feet(*at), solution.holding(fine)
    for path, colour, name in (
        (ends[:, 0], BLUE, "tail"),
        (ends[:, -1], ORANGE, "head"),
        (fine.centre, VERMILION, "centre"),
    ):
        axes.plot(*path, color=colour, lw=1.1, label=name)
    for k, shade in ((0, GREY), (-1, INK))[0 if apart else 1 :]:
        draw_body(axes, ends[:, :, k], shade, body)
        marks = FootMarks(axes, foot_kinds(body), 6.0)
        marks.place(feet[..., k], held[:, k])
        axes.plot(*fine.centre[:, [k]], "+", color=VERMILION, ms=7)
    axes.set_aspect("equal", "datalim")
    counted = f"{periods} period{'s' if periods > 1 else ''}"
    axes.set(xlabel=f"x  [body lengths],  {counted}", ylabel="y  [body lengths]")
    draw_key(axes, more=marks.key())


def forbidden(
    body: Body, joint_limit: Limit, first: int = 0, second: int = 1
) -> tuple[np.ndarray, np.ndarray]:
    """Grid ``(n,)`` of two shape coordinates, and ``(n, n)`` values that are positive where a pair
    is infeasible for any values of the others; rows are the second coordinate."""
    grid = np.linspace(-np.pi, np.pi, _CELLS + 1)
    a, b = np.meshgrid(grid, grid)
    shapes = np.zeros((body.n_joint, a.size))
    shapes[[first, second]] = a.ravel(), b.ravel()
    stretched, limit = under_one_limit(shapes, joint_limit)
    if body.n_joint == 2:
        beyond = body.bounded_angles.largest(stretched) - limit
        excess = np.maximum(beyond, crossing_depth(body, shapes))
    else:
        by_others = np.delete(body.bounded_angles.rows, [first, second], axis=1).any(axis=1)
        excess = (
            np.abs(body.bounded_angles.rows[~by_others] @ stretched).max(axis=0, initial=0.0)
            - limit
        )
    return grid, np.maximum(excess, 0.0).reshape(a.shape)


def draw_allowed(
    axes: Axes, body: Body, joint_limit: Limit, first: int = 0, second: int = 1
) -> None:
    grid, excess = forbidden(body, joint_limit, first, second)
    if excess.max() > 1e-9:
        axes.contourf(grid, grid, excess, levels=[1e-9, 10.0], colors=[GREY], alpha=0.4)


def draw_angles(axes: Axes, t: np.ndarray, angles: np.ndarray, body: Body) -> None:
    draw_series(axes, t, angles)
    axes.set(xlim=(0, 1), xlabel="phase t", ylabel=f"{body.defaults.quantity}  [rad]")
    draw_key(axes, body.defaults.coordinate)


def draw_shape_path(
    axes: Axes, problem: Problem, angles: np.ndarray, first: int = 0, second: int = 1
) -> None:
    """Path in the plane of two joint angles, light to dark, its start a disc; grey: infeasible."""
    draw_allowed(axes, problem.body, problem.joint_limit, first, second)
    q = angles[[first, second]]
    colours = colormaps[PHASE](np.linspace(0.1, 0.8, 200))  # visible on white and on black
    pieces = np.array_split(np.arange(q.shape[1] - 1), min(200, q.shape[1] - 1))
    lines = [q[:, piece[0] : piece[-1] + 2].T for piece in pieces]
    axes.add_collection(LineCollection(lines, colors=colours, lw=2.2, capstyle="round"))
    axes.plot(*q[:, 0], "o", color=VERMILION, ms=5)
    at = angles.shape[1] // 12
    arrow = {"arrowstyle": "-|>", "color": VERMILION, "lw": 1.4}
    axes.annotate("", (q[0, at + 2], q[1, at + 2]), (q[0, at], q[1, at]), arrowprops=arrow)
    middle, half = np.zeros(2), 1.02 * np.pi
    extent = float(np.ptp(angles, axis=1).max())
    if extent < _SMALL:
        middle, half = 0.5 * (q.min(axis=1) + q.max(axis=1)), 0.6 * max(extent, 0.05)
        axes.xaxis.set_major_locator(MaxNLocator(5))
        axes.yaxis.set_major_locator(MaxNLocator(5))
    else:
        ticks, labels = np.pi * np.array([-1, -0.5, 0, 0.5, 1]), ["−π", "−π/2", "0", "π/2", "π"]
        axes.set_xticks(ticks, labels)
        axes.set_yticks(ticks, labels)
    (x, y) = middle
    axes.set(xlim=(x - half, x + half), ylim=(y - half, y + half), aspect="equal")
    what = problem.body.defaults.quantity
    axes.set(xlabel=f"{what} {first + 1}  [rad]", ylabel=f"{what} {second + 1}  [rad]")


def draw_speeds(axes: Axes, solution: Solution, t: np.ndarray) -> None:
    """Sliding speeds over a period on a logarithmic scale, with delta: below it, sticking."""
    problem, motion, delta = solution.problem, solution.sample(t), solution.delta_per_period
    part, speed = part_speeds(problem.body, motion.angles, motion.rates, motion.z)
    speed = np.maximum(speed, 0.1 * delta)
    draw_series(axes, t, speed)
    axes.axhline(delta, color=GREY, lw=1, ls=":")
    axes.annotate("δ", (1.0, delta), (3, 0), textcoords="offset points", color=GREY, va="center")
    axes.set(xlim=(0, 1), ylabel=f"{part} speed  [1/period]", xlabel="phase t")
    set_log(axes, "y", (0.5 * float(min(speed.min(), delta)), 2 * float(speed.max())))
    draw_key(axes, part)


def draw_power(axes: Axes, solution: Solution, t: np.ndarray) -> None:
    """Power against friction over a period, with the mesh."""
    motion = solution.sample(t)
    axes.plot(t, solution.power(motion), color=BLUE, lw=1.5)
    axes.set(xlim=(0, 1), xlabel="phase t", ylabel="power  [weight·length/period]")
    axes.set_ylim(bottom=0)
    draw_mesh_ticks(axes, solution.answer.edges)


def draw_mesh_ticks(axes: Axes, edges: np.ndarray) -> None:
    at_axis = axes.get_xaxis_transform()
    axes.plot(edges, 0.0 * edges, "|", color=GREY, ms=7, transform=at_axis, clip_on=False)


def set_log(axes: Axes, which: str, limits: tuple[float, float]) -> None:
    """Logarithmic axis "x" or "y" with plain text labels, ten times as fast as typeset ones."""
    axes.set(**{f"{which}scale": "log", f"{which}lim": limits})
    axis = axes.xaxis if which == "x" else axes.yaxis
    axis.set_major_locator(LogLocator(numticks=6))
    axis.set_minor_locator(NullLocator())
    axis.set_major_formatter(lambda value, _: f"10{f'{np.log10(value):.0f}'.translate(_EXPONENT)}")


def draw_series(axes: Axes, t: np.ndarray, rows: np.ndarray) -> None:
    """A line for every joint or part; many are coloured from dark to light, and a few named."""
    count = len(rows)
    many = count > len(SERIES)
    colours = colormaps[SEQUENTIAL](np.linspace(0.0, 0.9, count)) if many else SERIES
    named = np.linspace(0, count - 1, _NAMED).round() if many else range(count)
    for j, row in enumerate(rows):
        axes.plot(t, row, lw=1.4, color=colours[j], label=f"{j + 1}" if j in named else None)


def draw_key(axes: Axes, of: str = "", more: Mapping[str, Any] | None = None) -> None:
    """Legend of the lines, and of more marks, in a row above the axes."""
    handles, labels = axes.get_legend_handles_labels()
    handles, labels = [*handles, *(more or {}).values()], [*labels, *(more or {})]
    if of:
        labels[0] = f"{of} {labels[0]}"
    axes.legend(
        handles, labels, loc="lower right", bbox_to_anchor=(1, 1), ncols=len(labels), fontsize=7,
        handlelength=1, columnspacing=0.8, handletextpad=0.8 if more else 0.3, borderpad=0,
        borderaxespad=0.3,
    )  # fmt: skip
