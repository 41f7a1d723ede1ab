"""The pictures of docs/concepts.md: python -m scripts.concepts [FOLDER]

Each is drawn by one function into the axes it is given. Gaits and numbers are solved or replayed
when the pictures are made.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Arc

import colloc
from colloc.pictures.style import (
    BLUE,
    GREEN,
    GREY,
    INK,
    ORANGE,
    VERMILION,
    Picture,
    figure_style,
    save,
)
from colloc.results.motion import lab_outline
from colloc.results.solution import Solution
from scripts.program import command_line

ROOT = Path(__file__).resolve().parents[1]
CLASSES = {
    "three_link": ("one harmonic", BLUE),
    "three_link_two_harmonics": ("two harmonics", VERMILION),
    "three_link_spline": ("spline of 24 knots", GREEN),
}
"""Problem files, and the class of gaits and colour of each."""
SIZES = np.geomspace(0.003, 0.6, 25)
DELTAS = {1e-6: BLUE, 1e-4: GREEN, 1e-3: ORANGE, 1e-2: VERMILION}
_ANGLE = 2.2


def draw_chain(ax: Axes, ends: np.ndarray, colour: str = INK) -> None:
    """Links between the points ``ends`` (2, n_link + 1), from tail to head; the disc is the
    head."""
    ax.plot(*ends, color=colour, lw=3, solid_capstyle="round", zorder=2)
    ax.plot(*ends[:, 1:-1], "o", color="white", mec=colour, ms=6, zorder=3)
    ax.plot(*ends[:, -1:], "o", color=colour, ms=9, zorder=3)


def body_and_friction(ax: Axes) -> None:
    """A body of three links with its joint angles, and the three ways in which a link can slide."""
    angles = np.array([0.9, -0.7])
    ends = np.stack(colloc.Chain().outline(angles[:, None]))[:, :, 0]
    draw_chain(ax, ends)
    for joint, angle in enumerate(angles):
        behind, at = ends[:, joint], ends[:, joint + 1]
        ahead = at - behind
        heading = np.degrees(np.arctan2(ahead[1], ahead[0]))
        ax.plot(*np.stack([at, at + 0.55 * ahead], axis=1), color=GREY, lw=1, ls=":")
        low, high = sorted((heading, heading + np.degrees(angle)))
        ax.add_patch(Arc(tuple(at), 0.24, 0.24, theta1=low, theta2=high, color=BLUE, lw=1.5))
        middle = np.radians(0.5 * (low + high))
        x, y = at + 0.17 * np.array([np.cos(middle), np.sin(middle)])
        ax.text(x, y, f"$q_{joint + 1}$", color=BLUE, ha="center", va="center")
    ax.text(ends[0, 0] - 0.03, ends[1, 0], "tail", ha="right", va="center", color=GREY)
    ax.text(ends[0, -1] + 0.04, ends[1, -1], "head", ha="left", va="center", color=GREY)
    left, y = float(ends[0, -1]) + 0.45, float(ends[1].mean())
    draw_chain(ax, np.array([[left, left + 1 / 3], [y, y]]))
    x, arrow = left + 1 / 6, {"arrowstyle": "->", "color": ORANGE, "lw": 2}
    for dx, dy, label in (
        (0.36, 0, "forwards: $\\mu_f$"),
        (-0.36, 0, "backwards: $\\mu_b$"),
        (0, 0.19, "sideways: $\\mu_t$"),
        (0, -0.19, ""),
    ):
        ax.annotate("", (x + dx, y + dy), (x + 0.58 * dx, y), arrowprops=arrow)
        place: Any = {"ha": "center", "va": "bottom" if dy else "top", "color": ORANGE}
        ax.text(x + dx, y + (dy + 0.02 if dy else -0.05), label, **place)
    ax.set(aspect="equal", xlim=(ends[0, 0] - 0.12, left + 0.72), ylim=(y - 0.3, y + 0.34))
    ax.set_axis_off()


def gaits_in_shape_space(ax: Axes, solutions: dict[str, Solution]) -> None:
    """The best gait of each class as a closed path in the plane of both joint angles."""
    t = np.linspace(0, 1, 801)
    for name, solution in solutions.items():
        label, colour = CLASSES[name]
        angles = solution.gait(t)[0]
        ax.plot(*angles, color=colour, label=f"{label}: d/W {solution.measured.efficiency:.3f}")
    ax.set(xlabel="joint angle $q_1$ [rad]", ylabel="joint angle $q_2$ [rad]", aspect="equal")
    ax.legend(loc="lower left", fontsize="small")


def bodies_of_a_gait(ax: Axes, solution: Solution, count: int = 6) -> None:
    """One cycle as bodies, evenly spaced in time, each in the place of its own that its column
    gives it."""
    motion = solution.sample(np.linspace(0, 1, count))
    ends = lab_outline(solution.problem.body, motion)
    for k in range(count):
        row = np.array([[0.0], [-0.62 * k]])
        draw_chain(ax, ends[:, :, k] + row, GREY if k in (0, count - 1) else INK)
        y = motion.centre[1, k] + row[1, 0]
        ax.plot(motion.centre[0, k], y, "o", color=ORANGE, ms=5, zorder=4)
        ax.text(ends[0].min() - 0.06, y, f"t = {k / (count - 1):.1f}", ha="right", va="center")
    for x in motion.centre[0, [0, -1]]:
        ax.axvline(x, color=ORANGE, lw=0.8, ls="--", zorder=1)
    ax.set_title(f"d = {solution.measured.distance:.3f} body lengths")
    ax.set_aspect("equal")
    ax.margins(0.12, 0.05)
    ax.set_axis_off()


def smoothed_friction(ax: Axes) -> None:
    """Friction against the speed of sliding, for three values of delta; below its delta each is
    drag."""
    speed = np.linspace(-0.05, 0.05, 1001)
    for delta, colour in ((1e-2, VERMILION), (1e-3, ORANGE), (1e-4, BLUE)):
        ax.plot(speed, -speed / np.hypot(speed, delta), color=colour, label=f"δ = {delta:g}")
    ax.set(xlabel="speed of sliding [body lengths per cycle]", ylabel="friction / (μ x weight)")
    ax.legend()


def size_and_delta(ax: Axes) -> None:
    """Efficiency of triangles of one shape and many sizes, at four values of delta: a smaller one
    moves more slowly."""
    c, efficiency = _ANGLE, dict[float, list[float]]()
    for size in SIZES:  # one joint moves by it, then the other, then both back
        path = colloc.Corners(np.array([[c + size, c, c], [-c, -c, -c - size]]))
        how: Any = {"breaks": path.corner_phases, "tolerance": 1e-4}
        for delta in DELTAS:
            replay = colloc.replay(colloc.Chain(), colloc.Friction(), path, delta, **how)
            efficiency.setdefault(delta, []).append(replay.efficiency)
    for delta, colour in DELTAS.items():
        ax.semilogx(SIZES, efficiency[delta], color=colour, label=f"δ = {delta:g}")
    ax.axhline(0.4, color=GREY, lw=0.8, ls="--")
    ax.text(SIZES[-1], 0.405, "dry friction, size to 0: 2/5", ha="right", va="bottom", color=GREY)
    ax.set(xlabel="side of the triangle [rad]", ylabel="efficiency d/W", ylim=(0, 0.46))
    ax.legend(loc="lower right")


def main() -> None:
    folder = command_line(__doc__, ("folder", ROOT / "results/curated/concepts")).folder
    folder.mkdir(parents=True, exist_ok=True)
    solutions = {name: colloc.solve(ROOT / "problems" / f"{name}.py") for name in CLASSES}
    sizes = {"body": (6.6, 2.3), "gait": (6.6, 4.4), "delta": (4.6, 2.8), "size": (5, 3.2)}
    with figure_style():
        figures = {name: Picture(figsize=size) for name, size in sizes.items()}
        body_and_friction(figures["body"].subplots())
        left, right = figures["gait"].subplots(1, 2, width_ratios=(1, 2))
        bodies_of_a_gait(left, solutions["three_link"])
        gaits_in_shape_space(right, solutions)
        smoothed_friction(figures["delta"].subplots())
        size_and_delta(figures["size"].subplots())
    for name, figure in figures.items():
        print(*save(figure, folder / name, ("png",)))


if __name__ == "__main__":
    main()
