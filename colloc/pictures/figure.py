"""Figures of solutions, Pareto fronts, gaits that steer and robots, made of panels."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, MaxNLocator, NullLocator

from colloc.dynamics.control_problem import control_problem
from colloc.gaits.robot import Limit, under_one_limit
from colloc.mechanics.bodies import Body
from colloc.mechanics.contact import link_width
from colloc.mechanics.floor_contact import FOOT, WHEEL
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
    Picture,
    figure_style,
    save,
    snapshot_colours,
)
from colloc.results.motion import foot_kinds, hinges, lab_feet, lab_outline, part_speeds
from colloc.results.robot import drawn_units, in_si
from colloc.results.solution import Solution
from colloc.system.errors import ProblemError
from colloc.verification.mesh_error import mesh_error

if TYPE_CHECKING:
    from colloc.results.robot import RobotSheet
    from colloc.studies.families import ParetoFront, Steering

COLUMN, PAGE = 3.4, 7.0  # widths of a column and of two in journals [inches]
_T = np.linspace(0.0, 1.0, 1201)
_GAP, _NARROWEST, _MARGIN = 0.2, 0.3, 0.08  # around snapshots [body lengths]
_FLAT, _SEEN = 0.12, 0.3  # flatter motions are drawn of this height [body lengths]
_SMALL = 1.6  # extent [rad] below which a path in shape space is magnified
_MOST_PERIODS = 3  # drawn in the lab
_NAMED = 5  # lines that a legend names if there are too many
_TRACK, _DOTS = 6, 60  # periods of a track, and drawn points of each
_EXPONENT = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
_QUANTITIES = {"torque": "N·m", "speed": "rad/s", "power": "W"}


class Panel(NamedTuple):
    """Width and height of a picture [inches], and what draws it."""

    width: float
    height: float
    draw: Callable[[Axes], object]

    def figure(self) -> Figure:
        with figure_style(font_size=8):
            figure = Figure(figsize=(self.width, self.height))
            self.draw(figure.add_subplot())
        return figure


def _plot(
    drawings: Mapping[str, Callable[[Axes], object]],
    ax: Any,
    panel: str,
    size: tuple[float, float] = (0, 0),
    stacked: bool = False,
) -> Any:
    if ax is None:
        with figure_style():
            figure, rows = Picture(figsize=size), len(drawings) if stacked else 1
            grid = figure.subplots(rows, len(drawings) // rows, sharex=stacked, squeeze=False)
            for axes, draw in zip(grid.flat, drawings.values(), strict=True):
                draw(axes)
                if stacked:
                    axes.label_outer()
        return figure
    if not isinstance(ax, Axes):
        raise ProblemError(
            f"ax must be a matplotlib Axes to draw on, not {ax!r}; "
            f'plot().savefig("mine.png"), or .pdf, or .svg, writes a file.'
        )
    if panel not in drawings:
        raise ProblemError(f"there is no panel {panel!r}; there are {', '.join(drawings)}.")
    drawings[panel](ax)
    return ax


def panels(solution: Solution) -> dict[str, Panel]:

    def panel(width, height, draw, *more):
        return Panel(width, height, lambda axes: draw(axes, solution, *more))

    problem = solution.problem
    shapes = range(problem.body.n_joint - 1 if problem.gait.free else 0)
    return {
        "filmstrip": panel(PAGE, 1.9, draw_filmstrip, 6),
        "lab": panel(PAGE, 3.0, draw_lab),
        "angles": panel(COLUMN, 2.2, _draw_angles),
        "speeds": panel(COLUMN, 2.4, _draw_speeds),
        "power": panel(COLUMN, 2.4, _draw_power),
        "convergence": panel(COLUMN, 2.2, _draw_convergence),
        "mesh": panel(COLUMN, 2.2, _draw_mesh),
        **{f"shape-{j + 1}-{j + 2}": panel(COLUMN, 3.2, draw_shape_path, j) for j in shapes},
    }


def save_panels(solution: Solution, stem: Path) -> list[Path]:
    """Write ``STEM-PANEL.pdf`` and ``.png`` for every panel; returns the PDFs."""
    return [
        save(panel.figure(), stem.with_name(f"{stem.name}-{name}"), dpi=300)[-1]
        for name, panel in panels(solution).items()
    ]


def plot_solution(solution: Solution, ax: Axes | None = None, panel: str = "gait") -> Any:
    if ax is not None:
        by_name = {name: each.draw for name, each in panels(solution).items()}
        return _plot({"gait": lambda axes: draw_gait(axes, solution), **by_name}, ax, panel)
    problem, solved = solution.problem, solution.success
    more = [text for text in (problem.scene, solution.turning) if text]
    if si := in_si(solution):
        energy = f", {si['energy_J_per_m']:.3g} J/m" if "energy_J_per_m" in si else ""
        more = [f"{100 * si['speed_m_per_s']:.3g} cm/s{energy}, {si['period_s']:.3g} s a cycle"]
    headline = (
        f"{problem.name}: {problem.objective.label} = {solution.measured.value:.5f}   "
        f"{problem.law.label},  δ = {solution.answer.delta:.0e}"
        f"{'' if solved else f'   —   {solution.status.upper()}'}\n"
        f"class: {';  '.join([problem.gait.describe(), *more])}"
    )
    strip = "one cycle: phase, and below it the displacement of the centre (disc: head)"
    if si:
        strip = "one cycle: time [s], and below it the displacement of the centre [cm] (disc: head)"
    work = si.get("friction_work_per_cycle_J", solution.measured.work)
    drawn = (
        ("in the lab (black: at the end)", draw_lab),
        ("shape space (disc: t = 0)" if _is_planar(solution) else "shape", draw_gait),
        ("sliding speeds (near δ: sticking)", _draw_speeds),
        (f"W = {work:.4g}{' J' * bool(si)} against friction (ticks: mesh)", _draw_power),
    )
    with figure_style():
        figure = Picture(figsize=(11, 8.2), layout="none")  # type: ignore[arg-type]
        colour = INK if solved else VERMILION
        figure.text(0.015, 0.985, headline, fontsize=11, va="top", color=colour)
        draw_filmstrip(figure.add_axes((0.015, 0.76, 0.97, 0.135)), solution)
        figure.text(0.015, 0.905, strip)
        grid = figure.add_gridspec(
            2, 2, left=0.075, right=0.985, bottom=0.06, top=0.685, wspace=0.2, hspace=0.33,
            width_ratios=(2, 1), height_ratios=(1.35, 1),
        )  # fmt: skip
        for k, (title, draw) in enumerate(drawn):
            draw(axes := figure.add_subplot(grid[k]), solution)
            axes.set_title(title)
    return figure


class BodyMarks:
    """A body that can be moved: its links, hollow joints, a disc for the head, its centre of mass,
    and feet (squares), wheels and pads (bars), hollow while they slide.

    Sizes [points] are those of links, joints, head, centre and feet.
    """

    def __init__(
        self,
        axes: Axes,
        body: Body,
        colour: Any,
        sizes: tuple[float, float, float, float, float],
        centre: tuple[str, str] = ("+", VERMILION),
    ) -> None:
        link, joint, head, spot, foot = sizes

        def line(marker="", **look):
            return axes.plot([], [], marker=marker, ls="" if marker else "-", **look)[0]

        self._axes, self._hinges, self._width = axes, hinges(body), link_width(body)
        self._links: Any = PolyCollection([], fc=[colour], ec="white", lw=0.2, zorder=2)
        if self._width:
            axes.add_collection(self._links)
        else:
            look: Any = {"solid_capstyle": "round", "solid_joinstyle": "round"}
            self._links = line(color=colour, lw=link, **look)
        self._joints = line("o", color="white", mec=colour, ms=joint)
        self._head = line("o", color=colour, ms=head)
        self._centre = line(centre[0], color=centre[1], ms=spot)
        self._kinds, self._feet = np.array(foot_kinds(body)), dict[str, Any]()
        for kind in dict.fromkeys(foot_kinds(body)):
            square, shade = "s" * (kind == FOOT), GREEN if kind == WHEEL else VERMILION
            looks = ((shade, foot, "projecting"), ("white", 0.55 * foot, "butt"))
            self._feet[kind] = tuple(
                line(square, c=tone, ms=size, lw=size, solid_capstyle=ends, zorder=3)
                for tone, size, ends in looks
            )

    def place(self, points: Iterable[np.ndarray], held: np.ndarray) -> None:
        """Move it to an outline ``(2, n_point)``, a centre ``(2,)`` and both ends of the feet ``(2,
        2, n_foot)``, of which some hold."""
        ends, centre, feet = points
        if self._width:  # round-ended polygons
            along = np.arctan2(*np.diff(ends)[::-1])[:, None]
            half_turn = np.linspace(-0.5 * np.pi, 0.5 * np.pi, 9)
            rims = [
                end[:, :, None]
                + 0.5 * self._width * np.stack([np.cos(along + turn), np.sin(along + turn)])
                for end, turn in ((ends[:, 1:], half_turn), (ends[:, :-1], half_turn + np.pi))
            ]
            self._links.set_verts(list(np.concatenate(rims, axis=2).transpose(1, 2, 0)))
        else:
            self._links.set_data(*ends)
        self._axes.update_datalim(ends.T)
        self._joints.set_data(*ends[:, self._hinges])
        self._head.set_data(*ends[:, -1:])
        self._centre.set_data(*centre[:, None])
        # no line from foot to foot
        apart = np.concatenate([feet, np.full_like(feet[:, :1], np.nan)], axis=1)
        for kind, marks in self._feet.items():
            of_kind = self._kinds == kind
            for line, chosen in zip(marks, (of_kind, of_kind & ~held), strict=True):
                line.set_data(*apart[..., chosen].transpose(0, 2, 1).reshape(2, -1))

    def key(self) -> dict[str, Any]:
        last = next(reversed(self._feet), "")
        words = {kind: f"{kind} (filled: holds)" if kind == last else kind for kind in self._feet}
        return {words[kind]: marks for kind, marks in self._feet.items()}


def draw_filmstrip(axes: Axes, solution: Solution, count: int = 11) -> None:
    """The body at equal steps of a cycle, with the phase and the displacement of its centre."""
    body, motion = solution.problem.body, solution.sample(np.linspace(0.0, 1.0, count))
    ends, feet, held = lab_outline(body, motion), lab_feet(body, motion), solution.holding(motion)
    units = drawn_units(solution)
    rise = float(np.ptp(ends[1]))
    higher = max(1, round(_SEEN / rise)) if 0 < rise < _FLAT else 1
    x, y = ends[0], higher * ends[1]
    room = np.maximum(np.ptp(x, axis=0), _NARROWEST) + _GAP
    middle = np.cumsum(room) - 0.5 * room
    shift = middle - 0.5 * (x.min(axis=0) + x.max(axis=0))
    low = float(y.min()) - _MARGIN
    for k, colour in enumerate(snapshot_colours(count)):
        scale, place = np.array([1, higher]), np.array([shift[k], 0])
        at = (ends[:, :, k].T, motion.centre[:, k], feet[..., k].T)
        placed = [(scale * points + place).T for points in at]
        BodyMarks(axes, body, colour, (2.4, 3.5, 5, 6, 4.5)).place(placed, held[:, k])
        way = units.length * float(motion.centre[0, k])
        come = f"{round(way, 2) + 0.0:.{2 if units.length == 1 else 1}f}".replace("-", "−")
        phase = f"{units.time * motion.t[k]:.{2 if units.time == 1 else 3}g}"
        for text, shade, line in ((phase, GREY, -3), (come, VERMILION, -13)):
            axes.annotate(
                text, (middle[k], low), (0, line), xycoords="data", textcoords="offset points",
                ha="center", va="top", fontsize=7, color=shade,
            )  # fmt: skip
    axes.set(xlim=(0, float(room.sum())), ylim=(low, float(y.max()) + _MARGIN), aspect="equal")
    axes.set_axis_off()
    if higher > 1:
        axes.annotate(
            f"heights drawn {higher} times as large", (0, 1), (4, 4), xycoords="axes fraction",
            textcoords="offset points", color=GREY, fontsize=7,
        )  # fmt: skip


def draw_lab(axes: Axes, solution: Solution) -> None:
    """Paths of tail, head and centre of mass, over the periods that separate the first body from
    the last one; of one cycle with one body if these are too many."""
    body, ends = solution.problem.body, solution.sample(np.array([0.0, 1.0]))
    step = ends.centre[:, 1] - ends.centre[:, 0]
    needed = 1.05 * float(np.ptp(step @ lab_outline(body, ends)[:, :, 0]))
    needed /= max(float(np.hypot(*step)) ** 2, 1e-300)
    apart = needed <= _MOST_PERIODS
    periods = max(1, int(np.ceil(needed))) if apart else 1
    fine = solution.sample(np.linspace(0.0, periods, 600 * periods + 1))
    outline, feet, held = lab_outline(body, fine), lab_feet(body, fine), solution.holding(fine)
    for path, colour, name in (
        (outline[:, 0], BLUE, "tail"),
        (outline[:, -1], ORANGE, "head"),
        (fine.centre, VERMILION, "centre"),
    ):
        axes.plot(*path, color=colour, lw=1.1, label=name)
    for k, shade in ((0, GREY), (-1, INK))[0 if apart else 1 :]:
        marks = BodyMarks(axes, body, shade, (2.4, 3.5, 5, 7, 6))
        marks.place((outline[..., k], fine.centre[:, k], feet[..., k]), held[:, k])
    axes.autoscale_view()
    axes.set_aspect("equal", "datalim")
    counted = f"{periods} cycle{'s' if periods > 1 else ''}"
    units = drawn_units(solution)
    axes.set(xlabel=f"x  [{units.of_length}],  {counted}", ylabel=f"y  [{units.of_length}]")
    _label_in(units.length, axes.xaxis, axes.yaxis)
    _draw_key(axes, more=marks.key())


class _Ticks(MaxNLocator):
    def __init__(self, size: float) -> None:
        super().__init__(7, steps=[1, 2, 5, 10])
        self._size = size

    def tick_values(self, vmin: float, vmax: float) -> Any:
        ticks = super().tick_values(self._size * vmin, self._size * vmax)
        return np.array(ticks) / self._size


def _label_in(size: float, *axes: Any) -> None:
    for axis in axes if size != 1.0 else ():
        axis.set_major_locator(_Ticks(size))
        axis.set_major_formatter(lambda x, _: f"{round(size * x, 9):g}".replace("-", "−"))


def _is_planar(solution: Solution) -> bool:
    return solution.problem.body.n_joint == 2 and solution.problem.gait.free


def draw_gait(axes: Axes, solution: Solution) -> None:
    """Path in the plane of two shape coordinates, or coordinates over time if there are others."""
    (draw_shape_path if _is_planar(solution) else _draw_angles)(axes, solution)


def _draw_angles(axes: Axes, solution: Solution) -> None:
    names, units = solution.problem.body.defaults, drawn_units(solution)
    ylabel = f"{names.quantity}  [{units.of_angle}]"
    _draw_series(axes, _T, solution.gait.angles(_T), names.coordinate, units.of_time, ylabel)
    _label_in(units.time, axes.xaxis)
    _label_in(units.angle, axes.yaxis)


def forbidden(
    body: Body, joint_limit: Limit, first: int = 0, second: int = 1
) -> tuple[np.ndarray, np.ndarray]:
    """Grid ``(n,)`` of two shape coordinates, and ``(n, n)`` values that are positive where a pair
    is infeasible for any values of the others; rows are the second coordinate."""
    grid = np.linspace(-np.pi, np.pi, 181)
    a, b = np.meshgrid(grid, grid)
    shapes = np.zeros((body.n_joint, a.size))
    shapes[[first, second]] = a.ravel(), b.ravel()
    stretched, limit = under_one_limit(shapes, joint_limit)
    bounded = body.bounded_angles
    if body.n_joint == 2:
        crossing = (each.excess(shapes)[0] for each in body.contacts())
        excess = np.max([bounded.largest(stretched) - limit, *crossing], axis=0)
    else:
        rows = bounded.rows[~np.delete(bounded.rows, [first, second], axis=1).any(axis=1)]
        excess = np.abs(rows @ stretched).max(axis=0, initial=0.0) - limit
    return grid, excess.reshape(a.shape)


def draw_shape_path(axes: Axes, solution: Solution, first: int = 0) -> None:
    """Path in the plane of two consecutive joint angles, light to dark, its start a disc; grey:
    infeasible."""
    problem, second, angles = solution.problem, first + 1, solution.gait.angles(_T)
    grid, excess = forbidden(problem.body, problem.joint_limit, first, second)
    if excess.max() > 1e-9:
        axes.contourf(grid, grid, excess, levels=[1e-9, 10.0], colors=[GREY], alpha=0.4)
    q = angles[[first, second]]
    colours = colormaps[PHASE](np.linspace(0.1, 0.8, 200))  # visible on white and on black
    pieces = np.array_split(np.arange(_T.size - 1), 200)
    lines = [q[:, piece[0] : piece[-1] + 2].T for piece in pieces]
    axes.add_collection(LineCollection(lines, colors=colours, lw=2.2, capstyle="round"))
    axes.plot(*q[:, 0], "o", color=VERMILION, ms=5)
    at = _T.size // 12
    arrow = {"arrowstyle": "-|>", "color": VERMILION, "lw": 1.4}
    axes.annotate("", (q[0, at + 2], q[1, at + 2]), (q[0, at], q[1, at]), arrowprops=arrow)
    middle, half = np.zeros(2), 1.02 * np.pi
    extent = float(np.ptp(angles, axis=1).max())
    units, names = drawn_units(solution), ["−π", "−π/2", "0", "π/2", "π"]
    if units.angle != 1.0:
        names = ["−180", "−90", "0", "90", "180"]
    if extent < _SMALL:
        middle, half = 0.5 * (q.min(axis=1) + q.max(axis=1)), 0.6 * max(extent, 0.05)
        for axis in (axes.xaxis, axes.yaxis):
            axis.set_major_locator(MaxNLocator(5))
        _label_in(units.angle, axes.xaxis, axes.yaxis)
    else:
        for axis in (axes.xaxis, axes.yaxis):
            axis.set_ticks(np.pi * np.linspace(-1, 1, 5), names)
    (left, low), (right, high) = middle - half, middle + half
    axes.set(xlim=(left, right), ylim=(low, high), aspect="equal")
    what = problem.body.defaults.quantity
    xlabel, ylabel = (f"{what} {k + 1}  [{units.of_angle}]" for k in (first, second))
    axes.set(xlabel=xlabel, ylabel=ylabel)


def _draw_speeds(axes: Axes, solution: Solution) -> None:
    motion, delta = solution.sample(_T), solution.delta_per_period
    part, speed = part_speeds(solution.problem.body, motion)
    units = drawn_units(solution)
    delta *= units.speed
    speed = np.maximum(units.speed * speed, 0.1 * delta)
    _draw_series(axes, _T, speed, part, units.of_time, f"{part} speed  [{units.of_speed}]")
    _label_in(units.time, axes.xaxis)
    axes.axhline(delta, color=GREY, lw=1, ls=":")
    axes.annotate("δ", (1.0, delta), (3, 0), textcoords="offset points", color=GREY, va="center")
    _set_log(axes, "y", (0.5 * float(min(speed.min(), delta)), 2 * float(speed.max())))


def _draw_power(axes: Axes, solution: Solution) -> None:
    power, units = solution.power(solution.sample(_T)), drawn_units(solution)
    axes.plot(_T, power, color=BLUE, lw=1.5)
    axes.set(xlim=(0, 1), ylim=(0, 1.1 * float(power.max())))
    axes.set(xlabel=units.of_time, ylabel=f"power  [{units.of_power}]")
    _label_in(units.time, axes.xaxis)
    _label_in(units.power, axes.yaxis)
    _draw_mesh_ticks(axes, solution.answer.edges)


def _draw_convergence(axes: Axes, solution: Solution) -> None:
    steps = [(step.delta, step.value, step.optimal) for step in solution.history]
    deltas, values, good = np.array(steps).T
    good = good > 0
    axes.plot(deltas[good], values[good], "o-", color=BLUE, ms=4, lw=1.2)
    if good.any():
        axes.set_ylim(*axes.get_ylim())
    axes.plot(deltas[~good], values[~good], "x", color=VERMILION, ms=5)
    axes.set(xlabel="δ  [length/period]", ylabel=solution.problem.objective.label)
    axes.ticklabel_format(axis="y", useOffset=False)
    _set_log(axes, "x", (deltas.min() / 2, deltas.max() * 2))


def mesh_errors(solution: Solution) -> np.ndarray:
    """Estimated error of the objective from every mesh interval, ``(n,)``."""
    control = control_problem(solution.answer.problem)
    at = (solution.mesh, solution.gait, solution.delta_per_period)
    return np.abs(mesh_error(control, *at).value)


def _draw_mesh(axes: Axes, solution: Solution) -> None:
    edges, shown = solution.mesh.edges, np.maximum(mesh_errors(solution), 1e-12)
    tolerance, high = solution.problem.mesh_tolerance, float(shown.max())
    axes.stairs(shown, edges, color=ORANGE, lw=1.2, baseline=None)
    _draw_mesh_ticks(axes, edges)
    if tolerance > 0:
        axes.axhline(tolerance, color=GREY, lw=1, ls=":")
        high = max(high, tolerance)
    axes.set(xlim=(0, float(edges[-1])), xlabel="phase t", ylabel="error of an interval")
    _set_log(axes, "y", (max(0.5 * float(shown.min()), 1e-10 * high), 3 * high))


def plot_front(front: ParetoFront, ax: Axes | None = None) -> Any:
    """Both objectives of every gait; in a figure of its own also the paths of the gaits in the
    plane of the first two joints."""
    drawn: dict[str, Callable[[Axes], object]] = {"front": lambda axes: draw_front(axes, front)}
    if front.problem.body.n_joint > 1:
        drawn["gaits"] = lambda axes: draw_gaits(axes, front.points)
    return _plot(drawn, ax, "front", (7.2 if len(drawn) > 1 else 3.8, 3.4))


def draw_gaits(axes: Axes, points: Sequence[Solution]) -> None:
    last, what = points[-1].gait.angles(_T)[:2], points[-1].problem.body.defaults.quantity
    for point, colour in zip(points, snapshot_colours(len(points)), strict=True):
        path = point.gait.angles(_T)[:2]
        # a mirror image is the same gait
        mirror = np.abs(path + last).sum() < np.abs(path - last).sum()
        axes.plot(*(-path if mirror else path), color=colour, lw=1.0)
    axes.set(xlabel=f"{what} 1  [rad]", ylabel=f"{what} 2  [rad]", aspect="equal")


def draw_front(axes: Axes, front: ParetoFront) -> None:
    ((first, second), values), after = front.in_units, [gap.after + 1 for gap in front.gaps]
    whole = np.insert(values, after, np.nan, axis=0)
    axes.plot(whole[:, 1], whole[:, 0], "-", color=BLUE, lw=0.8, zorder=1)
    for k in after:
        label = "no gait found between" if k == after[0] else None
        ends = values[k - 1 : k + 1].T[::-1]
        axes.plot(*ends, ":", color=VERMILION, lw=0.8, zorder=1, label=label)
    axes.scatter(values[:, 1], values[:, 0], c=snapshot_colours(len(front.points)), s=28, zorder=2)
    axes.set(xlabel=second, ylabel=first)
    axes.set_title(front.problem.name)
    if after:
        axes.legend()


def plot_steering(family: Steering, ax: Axes | None = None, panel: str = "cost") -> Any:
    drawn = {
        "cost": lambda axes: _draw_cost(axes, family),
        "tracks": lambda axes: _draw_tracks(axes, family),
    }
    return _plot(drawn, ax, panel, (7.2, 3.4))


def _draw_cost(axes: Axes, family: Steering) -> None:
    turns, values = np.degrees(family.turns), family.efficiency
    axes.plot(turns, values, "-", color=BLUE, lw=0.8, zorder=1)
    axes.scatter(turns, values, c=snapshot_colours(len(turns)), s=28, zorder=2)
    failed = ~np.array([point.success for point in family.points])
    if failed.any():
        axes.plot(turns[failed], values[failed], "x", color=VERMILION, ms=9, label="not verified")
    if (spot := family.on_the_spot) is not None:
        label = "on the spot, with least work"
        axes.plot(np.degrees(spot.turns), spot.efficiency, "s", color=VERMILION, ms=4, label=label)
    axes.set(xlabel="turn of a cycle  [degrees, + left]", ylabel="efficiency, chord / W")
    axes.set_ylim(0, 1.1 * values.max())
    axes.set_title(family.problem.name)
    if axes.get_legend_handles_labels()[0]:
        axes.legend()


def _draw_tracks(axes: Axes, family: Steering) -> None:
    colours = snapshot_colours(len(family.points))
    tracks: Any = [*zip(family.points, colours, "o" * len(colours), strict=True)]
    if (spot := family.on_the_spot) is not None:
        tracks += [(point, VERMILION, "s") for point in spot.points]
    t = np.linspace(0.0, _TRACK, _TRACK * _DOTS + 1)
    for point, colour, mark in tracks:
        track = point.sample(t).centre  # all arcs set out along +x
        axes.plot(*track, color=colour, lw=1.0)
        axes.plot(*track[:, ::_DOTS], mark, color=colour, ms=3)
    what = f"x  [body lengths],  {_TRACK} cycles"
    axes.set(xlabel=what, ylabel="y  [body lengths]", aspect="equal")


def robot_panels(robot: RobotSheet) -> dict[str, Panel]:
    def panel(what, unit):
        t, rows = robot.columns["t"].values, robot.columns[f"joint_{what}s"].values
        labels = "time  [s],  one cycle", f"{what}  [{unit}]"
        return Panel(COLUMN, 2.2, lambda axes: _draw_series(axes, t, rows, "joint", *labels))

    return {what: panel(what, unit) for what, unit in _QUANTITIES.items()}


def plot_robot(robot: RobotSheet, ax: Axes | None = None, panel: str = "torque") -> Any:
    drawn = {name: each.draw for name, each in robot_panels(robot).items()}
    return _plot(drawn, ax, panel, (6.4, 6.4), stacked=True)


def _draw_mesh_ticks(axes: Axes, edges: np.ndarray) -> None:
    at_axis = axes.get_xaxis_transform()
    axes.plot(edges, 0.0 * edges, "|", color=GREY, ms=7, transform=at_axis, clip_on=False)


def _set_log(axes: Axes, which: str, limits: tuple[float, float]) -> None:
    """Logarithmic axis "x" or "y" with plain text labels, ten times as fast as typeset ones."""
    axes.set(**{f"{which}scale": "log", f"{which}lim": limits})
    axis = axes.xaxis if which == "x" else axes.yaxis
    axis.set_major_locator(LogLocator(numticks=6))
    axis.set_minor_locator(NullLocator())
    axis.set_major_formatter(lambda value, _: f"10{f'{np.log10(value):.0f}'.translate(_EXPONENT)}")


def _draw_series(
    axes: Axes, t: np.ndarray, rows: np.ndarray, of: str, xlabel: str, ylabel: str
) -> None:
    count = len(rows)
    many = count > len(SERIES)
    colours = colormaps[SEQUENTIAL](np.linspace(0.0, 0.9, count)) if many else SERIES
    named = np.linspace(0, count - 1, _NAMED).round() if many else range(count)
    for j, row in enumerate(rows):
        axes.plot(t, row, lw=1.4, color=colours[j], label=f"{j + 1}" if j in named else None)
    axes.set(xlim=(0, t[-1]), xlabel=xlabel, ylabel=ylabel)
    _draw_key(axes, of)


def _draw_key(axes: Axes, of: str = "", more: Mapping[str, Any] | None = None) -> None:
    handles, labels = axes.get_legend_handles_labels()
    handles, labels = [*handles, *(more or {}).values()], [*labels, *(more or {})]
    if of:
        labels[0] = f"{of} {labels[0]}"
    axes.legend(
        handles, labels, loc="lower right", bbox_to_anchor=(1, 1), ncols=len(labels), fontsize=7,
        handlelength=1, columnspacing=0.8, handletextpad=0.8 if more else 0.3, borderpad=0,
        borderaxespad=0.3,
    )  # fmt: skip
