"""Self-contained HTML page about a result; everything from the file is escaped."""

from __future__ import annotations

import json
import math
import re
from io import StringIO
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from markupsafe import Markup, escape

from colloc.bounds.optimality_gap import gap_line, upper_bound
from colloc.gaits.problem_file import Reference, problem_file_text
from colloc.mechanics.bodies import Body
from colloc.mechanics.contact import link_width
from colloc.mechanics.inertia import GRAVITY
from colloc.pictures.families import robot_panels
from colloc.pictures.motion_frames import Frames, foot_kinds, foot_words, frames
from colloc.pictures.publication import COLUMN, Panel, draw_mesh, mesh_errors, panels
from colloc.pictures.style import INK, styled
from colloc.pictures.templates import render
from colloc.results.body_marks import hinges
from colloc.results.robot import SLOW_ENOUGH, Robot
from colloc.results.solution import SOLVED, Solution
from colloc.system.arguments import checked_arguments
from colloc.system.errors import NotConvergedError, ProblemError
from colloc.system.files import write_text

_MOST_PLANES = 6
_ANY_FLOOR = 0.5  # share of the stated friction for which a period is stated


class Drawn(NamedTuple):
    """A panel as SVG; left, right, top and bottom of its axes [percent], and limits of both."""

    caption: str
    svg: Markup
    sides: tuple[float, float, float, float]
    limits: tuple[float, float, float, float]
    joints: tuple[int, int] | None
    has_phase: bool


def report_page(
    solution: Solution,
    reference: Reference | None = None,
    gap: str = "",
    *,
    robot: Robot | None = None,
) -> str:
    """The page with what exists; `gap` is a sentence about the upper bound, `robot` a section."""
    problem, body, errors = solution.problem, solution.problem.body, mesh_errors(solution)
    drawn = panels(solution) | {
        "mesh": Panel(COLUMN, 2.4, lambda x: draw_mesh(x, solution, errors))
    }
    planes = [name for name in drawn if name.startswith("shape-")][:_MOST_PLANES]
    captions = {
        "angles": f"{body.defaults.quantity}s",
        "speeds": "sliding speeds (near δ: sticking)",
        "power": "power against friction; ticks: mesh",
    }
    replayed = solution.certificate.replayed
    return render(
        "report.html",
        solution=solution,
        problem=problem,
        certificate=solution.certificate,
        solved=solution.status == SOLVED,
        pace=_pace(solution),
        dry=_dry(solution),
        floor=_floor(solution),
        gap=gap.strip(),
        reference=reference.verdict(solution.certificate.efficiency)
        if reference and replayed
        else "",
        degrees=math.degrees,
        fields={name: json.dumps(value) for name, value in problem.to_dict().items()},
        source=solution.source or problem_file_text(problem),
        motion=motion_data(frames(solution), body),
        errors=float(errors.sum()),
        gait_pictures=[
            *(
                _picture(
                    drawn[name], f"{body.defaults.coordinate}s {j + 1} and {j + 2}", (j, j + 1)
                )
                for j, name in enumerate(planes)
            ),
            *(_picture(drawn[name], text, has_phase=True) for name, text in captions.items()),
        ],
        convergence_pictures=[
            _picture(drawn["convergence"], f"{problem.objective.name} at each level"),
            _picture(drawn["mesh"], f"mesh: error of {solution.mesh.n} intervals"),
        ],
        robot=robot,
        robot_pictures=[
            _picture(panel, f"{what} of the joints")
            for what, panel in (robot_panels(robot) if robot else {}).items()
        ],
    )


@checked_arguments
def write_report(
    solution: Solution,
    path: Path,
    reference: Reference | None = None,
    known: Path | None = None,
    *,
    robot: Robot | None = None,
) -> Path:
    """Write the page; `known` is the folder of upper bounds, by default that of the page."""
    gap = ""
    if solution.certificate.replayed:
        bound = upper_bound(solution.problem, known or path.parent, compute=False)
        gap = gap_line(solution.problem, solution.certificate.efficiency, bound)
    write_text(path, report_page(solution, reference, gap, robot=robot))
    return path


def _pace(solution: Solution) -> str:
    """Pace up to which inertia does not matter, if that is known."""
    if solution.problem.froude:
        return ""
    try:
        froude = solution.slow_enough(SLOW_ENOUGH)
    except (ProblemError, NotConvergedError):
        return ""
    period = math.sqrt(1 / (GRAVITY * _ANY_FLOOR * froude))
    return (
        f"changes {100 * SLOW_ENOUGH:g} % or less up to a Froude number L/(gT²) of {froude:.2g}: a "
        f"robot of 1 m on a floor with {_ANY_FLOOR:g} of this friction, from {period:.2g} s a "
        f"period"
    )


def _dry(solution: Solution) -> str:
    """Bounds of the efficiency under dry friction, if there are any."""
    if solution.certificate.dry is not None:
        return "d/W between {:.8f} and {:.8f}".format(*solution.certificate.dry)
    try:
        return str(solution.dry())
    except (ProblemError, NotConvergedError):
        return ""


def _floor(solution: Solution) -> list[list[str]]:
    """Rows of the sensitivities of the best value, if they are known."""
    try:
        slopes = solution.sensitivity()
    except (ProblemError, NotConvergedError):
        return []
    return [[effect.name, f"{effect.now:.4g}", *slopes.beside(effect)] for effect in slopes.seen]


def _picture(
    panel: Panel, caption: str, joints: tuple[int, int] | None = None, has_phase: bool = False
) -> Drawn:
    """A panel as SVG with text colour and font of the page; of a file it has only numbers."""
    text, figure = StringIO(), panel.figure()
    without = dict.fromkeys(("Creator", "Date", "Format", "Type"))
    with styled():
        figure.savefig(text, format="svg", transparent=True, metadata=without)
    svg = text.getvalue()
    svg = svg[svg.index("<svg") :]
    svg = re.sub(r"<style.*?</style>", "", svg, flags=re.DOTALL)  # it would style the whole page
    svg = re.sub(r' xmlns(:\w+)?="[^"]*"', "", svg)
    svg = re.sub(r'<g id="[^"]*"', "<g", svg)  # the same in every panel
    label = f'role="img" aria-label="{escape(caption)}"'
    svg = re.sub(
        r'<svg [^>]*viewBox="([^"]*)"[^>]*>', lambda x: f'<svg viewBox="{x[1]}" {label}>', svg
    )
    # hundredths of a point
    svg = re.sub(r' d="[^"]*"', lambda path: re.sub(r"(\.\d\d)\d+", r"\1", path[0]), svg)
    svg = svg.replace(INK, "currentColor")
    axes = figure.axes[0]
    (left, low), (right, high) = (100 * axes.get_position().get_points()).round(2).tolist()
    sides = (left, right, round(100 - high, 2), round(100 - low, 2))
    limits = (*axes.get_xlim(), *axes.get_ylim())
    return Drawn(caption, Markup(svg), sides, limits, joints, has_phase)


def motion_data(shown: Frames, body: Body) -> dict[str, Any]:
    """Data that report.js draws."""
    low, high = shown.window
    steps = (0.1, 0.2, 0.5, 1, 2, 5, 10, 1e9)
    kinds, (wide, tall) = foot_kinds(body), high - low
    (x, y), (arrow_x, arrow_y), (force_x, force_y) = shown.ends, shown.arrow_base, shown.arrow
    window = np.array([low[0], high[0], low[1], high[1]])
    rows = {
        "t": shown.t, "angles": shown.angles, "x": x, "y": y, "centre": shown.centre,
        "arrowX": arrow_x, "arrowY": arrow_y, "window": window,
    }  # fmt: skip
    data: dict[str, Any] = {name: np.round(row, 4).tolist() for name, row in rows.items()}
    before = [np.array([np.exp(1j * b.rotation), b.shift]).view(float) for b in shown.before]
    return data | {
        "forceX": np.round(force_x, 3).tolist(),
        "forceY": np.round(force_y, 3).tolist(),
        "holding": shown.holding.astype(int).tolist(),
        "feet": np.round(shown.feet, 4).tolist(),
        "footKinds": kinds,
        "footWords": foot_words(kinds),
        "hinges": hinges(body).indices(len(x))[:2],
        "width": link_width(body),
        "before": [each.round(6).tolist() for each in before],
        "arrowScale": shown.arrow_scale,
        "grid": next(step for step in steps if max(wide, tall) / step < 16),
        "shape": float(np.clip(wide / tall, 1.2, 4.0)),
    }
