"""One self-contained HTML page about a result: no network, no other file; everything from the file
is escaped."""

from __future__ import annotations

import json
import math
import re
from io import StringIO
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup, escape

from colloc.bounds.optimality_gap import gap_line, upper_bound
from colloc.gaits.objective import EFFICIENCY
from colloc.gaits.problem_file import Reference, problem_file_text
from colloc.mechanics.bodies import Body
from colloc.mechanics.inertia import GRAVITY
from colloc.pictures.motion_frames import Frames, foot_kinds, foot_words, frames
from colloc.pictures.publication import COLUMN, Panel, draw_mesh, mesh_errors, panels
from colloc.pictures.robot_figure import robot_panels
from colloc.pictures.style import INK, styled
from colloc.results.robot import SLOW_ENOUGH, Robot
from colloc.results.solution import SOLVED, Solution
from colloc.system.errors import NotConvergedError, ProblemError
from colloc.system.replaced_file import replaced_file

_MOST_PLANES = 6
_POLICY = "default-src 'none'; style-src 'unsafe-inline'; script-src 'unsafe-inline'"
"""The page may run its own script and nothing else: it can fetch nothing, whatever the file
held."""
_ANY_FLOOR = 0.5
"""Friction of a floor, over the stated one, for which a period is told."""
PLAIN = {
    "KKT error": "To first order, no small change of the gait within its class is better.",
    "second order": "To second order none is either: the gait is a best one, and no saddle between "
    "better ones.",
    "constraint violation": "Every condition of the problem is met at the solver's own points.",
    "balance at nodes": "At these points no net force or torque acts on the body.",
    "balance in replay": "Nor does any act at all the instants in between.",
    "closure": "The body ends a cycle in the shape in which it began.",
    "net rotation": "It ends the cycle pointing the same way, so that it crawls straight on.",
    "joint limits": "No joint bends further than it may, at any instant.",
    "joint speed": "No joint turns faster than it may, at any instant.",
    "tangent angle": "The body bends no further from its own direction than it may, so that it "
    "cannot cross itself.",
    "self-contact": "No part of the body passes through another, at any instant.",
    "stability": "After a push the body comes back to this motion, period by period.",
    "statics": "How far the weights it is given press beside its centre of mass; a real body "
    "shifts its weight by that.",
    "actuators": "No joint has to do more than it can, at any instant.",
    "replay gap": "An independent replay of the motion finds the same value.",
    "replay error": "The replay itself is as exact as was asked for.",
    "work = dissipation": "All work of what bends the body goes into friction and, on a slope, the "
    "climb: energy is conserved.",
    "mesh error": "More time steps would hardly change the result.",
    "delta influence": "Friction is smoothed a little at rest; that hardly changes the result.",
    "direction": "The body goes where it was asked to go.",
    "one motion": "Friction leaves the body no choice of another motion, or none that changes the "
    "result.",
}
"""What a check means for a reader who knows nothing of optimisation, by its name."""
TURNING = {
    "net rotation": "It ends the cycle turned by the angle that was asked for: it crawls in a "
    "circle."
}
"""The same for gaits that are asked to turn."""


class Drawn(NamedTuple):
    """A panel as SVG, and where its axes lie: left, right, top, bottom as percent, and limits of
    both axes."""

    caption: str
    svg: Markup
    sides: tuple[float, float, float, float]
    limits: tuple[float, float, float, float]
    joints: tuple[int, int] | None
    has_phase: bool


def environment() -> Environment:
    """Templates of this package; they escape whatever is put into them."""
    made = Environment(
        loader=PackageLoader("colloc.pictures", "assets"), autoescape=True,
        undefined=StrictUndefined, trim_blocks=True,
        lstrip_blocks=True,
    )  # fmt: skip
    made.policies["json.dumps_kwargs"] = {"separators": (",", ":")}
    return made


def report_page(
    solution: Solution,
    reference: Reference | None = None,
    gap: str = "",
    *,
    robot: Robot | None = None,
) -> str:
    """The page as a string, also of a solution that failed: what does not exist is left out. The
    reference is the value to hold the result against, `gap` a sentence about the upper bound;
    `robot` gets a section of its own."""
    found: dict[str, Any] = {}
    errors = mesh_errors(solution)
    drawn = {
        name: panel for name, panel in panels(solution).items() if name not in ("filmstrip", "lab")
    }
    drawn["mesh"] = Panel(COLUMN, 2.4, lambda axes: draw_mesh(axes, solution, errors))
    planes = [name for name in drawn if name.startswith("shape-")][:_MOST_PLANES]
    body = solution.problem.body
    captions = {
        "angles": f"{body.quantity}s",
        "speeds": "speeds along the body; what is near δ sticks",
    }
    captions["power"] = "power against friction; ticks: mesh"
    found["gait_pictures"] = [
        _picture(drawn[name], f"{body.coordinate}s {j + 1} and {j + 2}", joints=(j, j + 1))
        for j, name in enumerate(planes)
    ]
    found["gait_pictures"] += [
        _picture(drawn[name], text, has_phase=True) for name, text in captions.items()
    ]
    found["convergence_pictures"] = [
        _picture(drawn["convergence"], f"{solution.problem.objective.name} at each level"),
        _picture(drawn["mesh"], f"mesh: error of {solution.mesh.n} intervals"),
    ]
    found |= {"robot": robot, "robot_pictures": []}
    if robot is not None:
        found["robot_pictures"] = [
            _picture(panel, f"{what} of the joints") for what, panel in robot_panels(robot).items()
        ]
    found |= {"motion": motion_data(frames(solution), body), "errors": float(errors.sum())}
    return (
        environment()
        .get_template("report.html")
        .render(
            solution=solution,
            problem=solution.problem,
            certificate=solution.certificate,
            solved=solution.status == SOLVED,
            headline=_headline(solution),
            pace=_pace(solution),
            dry=_dry(solution),
            floor=_floor(solution),
            gap=gap.strip(),
            reference=reference.verdict(solution.certificate.efficiency)
            if reference and solution.certificate.replayed
            else "",
            plain=PLAIN | TURNING if solution.problem.rotation else PLAIN,
            policy=_POLICY,
            degrees=math.degrees,
            fields={name: json.dumps(value) for name, value in solution.problem.to_dict().items()},
            commands=_commands(solution),
            source=solution.source or problem_file_text(solution.problem),
            **found,
        )
    )


def write_report(
    solution: Solution,
    path: Path,
    reference: Reference | None = None,
    known: Path | None = None,
    *,
    robot: Robot | None = None,
) -> Path:
    """Write the page; `known` is the folder where upper bounds are kept, by default that of the
    page. With a `robot` (`Solution.robot`) the page has its sheet."""
    gap = ""
    if solution.certificate.replayed:
        bound = upper_bound(solution.problem, known or path.parent, compute=False)
        gap = gap_line(solution.problem, solution.certificate.efficiency, bound)
    with replaced_file(path) as temporary:
        Path(temporary).write_text(
            report_page(solution, reference, gap, robot=robot), encoding="utf-8"
        )
    return path


def _headline(solution: Solution) -> str:
    measured = solution.measured
    best = solution.problem.objective
    other = "" if best == EFFICIENCY else f"; {best.name} {measured.value:.3g}"
    turns = f" and {solution.turning}" if solution.turning else ""
    moves = f"moves {measured.distance:.2g} body lengths a cycle{turns}"
    return f"{moves}; {measured.efficiency:.2g} body lengths per unit of work{other}"


def _pace(solution: Solution) -> str:
    """How slow is slow enough, where that is known."""
    if solution.problem.froude:
        return ""  # the answer is for its own pace
    try:
        froude = solution.slow_enough(SLOW_ENOUGH)
    except (ProblemError, NotConvergedError):
        return ""
    period = math.sqrt(1 / (GRAVITY * _ANY_FLOOR * froude))
    return (
        f"changes {100 * SLOW_ENOUGH:g} % or less up to a Froude number L/(gT²) of {froude:.2g}: a "
        f"robot of 1 m on a "
        f"floor with {_ANY_FLOOR:g} of this friction, from {period:.2g} s a period"
    )


def _dry(solution: Solution) -> str:
    """Bounds of the efficiency under dry friction, where there are any: those of the certificate,
    or made now."""
    if solution.certificate.dry is not None:
        return "d/W between {:.8f} and {:.8f}".format(*solution.certificate.dry)
    try:
        return str(solution.dry())
    except (ProblemError, NotConvergedError):
        return ""


def _floor(solution: Solution) -> list[list[str]]:
    """Rows of what other friction, lengths, feet and limits do to the best value, where that is
    known."""
    try:
        found = solution.sensitivity()
    except (ProblemError, NotConvergedError):
        return []
    return [[effect.name, f"{effect.now:.4g}", *found.beside(effect)] for effect in found.seen]


def _commands(solution: Solution) -> str:
    p = solution.problem
    starts = f" --starts {solution.starts}" if solution.starts > 1 else ""
    return (
        f"# save the problem source above as {p.name}.py, then\n"
        f"colloc solve {p.name}.py --delta {p.delta:g} --delta-start {p.delta_start:g} --mesh "
        f"{p.intervals} "
        f"--mesh-tolerance {p.mesh_tolerance:g} --scheme {p.scheme} --formulation "
        f"'{p.formulation}'{starts}\n"
        f"colloc verify results/{p.name}.h5"
    )


def _picture(
    panel: Panel, caption: str, joints: tuple[int, int] | None = None, has_phase: bool = False
) -> Drawn:
    """The panel as SVG that takes its text colour and font from the page; nothing in it comes from
    a file but numbers."""
    text, figure = StringIO(), panel.figure()
    with styled():
        figure.savefig(
            text,
            format="svg",
            transparent=True,
            metadata=dict.fromkeys(("Creator", "Date", "Format", "Type")),
        )
    svg = text.getvalue()
    svg = svg[svg.index("<svg") :]
    svg = re.sub(r"<style.*?</style>", "", svg, flags=re.DOTALL)  # it would style the whole page
    svg = re.sub(r' xmlns(:\w+)?="[^"]*"', "", svg)
    svg = re.sub(r'<g id="[^"]*"', "<g", svg)  # the same in every panel
    svg = re.sub(
        r'<svg [^>]*viewBox="([^"]*)"[^>]*>',
        lambda svg: f'<svg viewBox="{svg[1]}" role="img" aria-label="{escape(caption)}">',
        svg,
    )
    # hundredths of a point
    svg = re.sub(r' d="[^"]*"', lambda path: re.sub(r"(\.\d\d)\d+", r"\1", path[0]), svg)
    svg = svg.replace(INK, "currentColor")
    axes = figure.axes[0]
    box = 100 * axes.get_position().get_points()
    (left, low), (right, high) = box.round(2).tolist()
    sides = (left, right, round(100 - high, 2), round(100 - low, 2))
    return Drawn(
        caption, Markup(svg), sides, (*axes.get_xlim(), *axes.get_ylim()), joints, has_phase
    )


def motion_data(shown: Frames, body: Body) -> dict[str, Any]:
    """What report.js draws: rows over time, the window that holds all of it, the length of the
    arrows."""
    low, high = shown.window
    grid = next(
        step for step in (0.1, 0.2, 0.5, 1, 2, 5, 10, 1e9) if (high - low).max() / step < 16
    )
    rows = {
        "t": shown.t, "angles": shown.angles, "x": shown.ends[0], "y": shown.ends[1],
        "centre": shown.centre,
        "arrowX": shown.arrow_base[0], "arrowY": shown.arrow_base[1], "window": np.array([low[0],
        high[0], low[1], high[1]]),
    }  # fmt: skip
    data: dict[str, Any] = {name: np.round(row, 4).tolist() for name, row in rows.items()}
    force = {
        "forceX": np.round(shown.arrow[0], 3).tolist(),
        "forceY": np.round(shown.arrow[1], 3).tolist(),
    }
    return data | force | {
        "holding": shown.holding.astype(int).tolist(),
        "feet": np.round(shown.feet, 4).tolist(), "footKinds": foot_kinds(body),
        "footWords": foot_words(foot_kinds(body)),
        "hinges": body.hinges.indices(len(shown.ends[0]))[:2], "width": body.drawn_width,
        "before": [np.array([np.exp(1j * b.rotation),
        b.shift]).view(float).round(6).tolist() for b in shown.before],
        "arrowScale": shown.arrow_scale, "grid": grid,
        "shape": float(np.clip((high[0] - low[0]) / (high[1] - low[1]), 1.2, 4.0)),
    }  # fmt: skip
