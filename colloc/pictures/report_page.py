"""A result as a self-contained HTML page, and as a small card with a film for notebooks; everything
from the file is escaped."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Mapping
from contextlib import suppress
from io import StringIO
from pathlib import Path
from typing import Any

import numpy as np
from markupsafe import Markup, escape

from colloc.bounds.optimality_gap import gap_line, upper_bound
from colloc.gaits.problem_file import Reference, problem_file_text
from colloc.mechanics.bodies import Body
from colloc.mechanics.chain import Chain
from colloc.mechanics.contact import link_width
from colloc.mechanics.floor_contact import FOOT, PAD, WHEEL
from colloc.mechanics.friction import Friction
from colloc.mechanics.inertia import GRAVITY
from colloc.pictures import render
from colloc.pictures.figure import (
    COLUMN,
    Panel,
    draw_front,
    draw_gaits,
    mesh_errors,
    panels,
    robot_panels,
)
from colloc.pictures.movie import Frames, frames
from colloc.pictures.style import INK, figure_style
from colloc.results.comparison import compare, verdict
from colloc.results.motion import foot_kinds, hinges
from colloc.results.robot import SLOW_ENOUGH, UNKNOWN, RobotSheet, in_si
from colloc.results.solution import Solution
from colloc.studies.families import ParetoFront
from colloc.system.arguments import checked_arguments
from colloc.system.files import write_text

_MOST_PLANES, _MOST_PLAYED = 6, 8
_FILM, _FILM_FRAMES, _FILM_PERIODS = (320, 200), 24, 2  # largest size [pixels] of that of a card
_FOOT_WORDS = {
    FOOT: "Squares: feet.",
    WHEEL: "Green bars: wheels, along their rolling direction.",
    PAD: "Orange bars: pads.",
}


def _foot_words(body: Body) -> str:
    words = dict.fromkeys(_FOOT_WORDS[kind] for kind in foot_kinds(body))
    return " ".join([*words, "Filled: it holds."] if words else [])


def report_page(
    solution: Solution,
    reference: Reference | None = None,
    gap: str = "",
    *,
    robot: RobotSheet | None = None,
    front: ParetoFront | None = None,
    beside: Solution | None = None,
) -> str:
    """The page with what exists; `gap` is a sentence about the upper bound, `robot`, `front` and
    another result `beside` this one are sections."""
    problem, certificate = solution.problem, solution.certificate
    names, replayed = problem.body.defaults, certificate.replayed
    drawn, slow, dry, floor = panels(solution), 0.0, "", list[list[str]]()
    if not problem.froude:
        with suppress(*UNKNOWN):
            slow = solution.slow_enough(SLOW_ENOUGH)
    with suppress(*UNKNOWN):
        dry = "" if certificate.dry else str(solution.dry())
    with suppress(*UNKNOWN):
        slopes = solution.sensitivity()
        floor = [
            [each.name, f"{each.now:.4g}", *slopes.beside(each)] for each in slopes.of_first_order
        ]
    planes = [name for name in drawn if name.startswith("shape-")][:_MOST_PLANES]
    courses = {
        "angles": f"{names.quantity}s",
        "speeds": "sliding speeds (near δ: sticking)",
        "power": "power against friction; ticks: mesh",
    }
    return render(
        "report.html",
        solution=solution,
        problem=problem,
        certificate=certificate,
        si=in_si(solution),
        slow=slow,
        gravity=GRAVITY,
        dry=dry,
        floor=floor,
        gap=gap.strip(),
        reference=reference.verdict(certificate.efficiency) if reference and replayed else "",
        degrees=math.degrees,
        fields={name: json.dumps(value) for name, value in problem.to_dict().items()},
        source=solution.source or problem_file_text(problem),
        motion=_motion_data(frames(solution), problem.body),
        beside=[
            *([_comparison_section(solution, beside)] if beside else []),
            *([_front_section(front)] if front else []),
        ],
        toy=_toy(problem.body, problem.law),
        errors=float(mesh_errors(solution).sum()),
        gait_pictures=[
            *(
                _picture(drawn[name], f"{names.coordinate}s {j + 1} and {j + 2}", (j, j + 1))
                for j, name in enumerate(planes)
            ),
            *(_picture(drawn[name], text, has_phase=True) for name, text in courses.items()),
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
    **sections: Any,
) -> Path:
    """Write the page; `known` is the folder of upper bounds, by default that of the page."""
    gap = ""
    if solution.certificate.replayed:
        bound = upper_bound(solution.problem, known or path.parent, compute=False)
        gap = gap_line(solution.problem, solution.certificate.efficiency, bound)
    write_text(path, report_page(solution, reference, gap, **sections))
    return path


def _picture(
    panel: Panel, caption: str, joints: tuple[int, int] | None = None, has_phase: bool = False
) -> dict[str, Any]:
    """A panel as SVG with text colour and font of the page; of a file it has only numbers. Left,
    right, top and bottom of its axes [percent], and limits of both."""
    text, figure = StringIO(), panel.figure()
    without = dict.fromkeys(("Creator", "Date", "Format", "Type"))
    with figure_style():
        figure.savefig(text, format="svg", transparent=True, metadata=without)
    svg = text.getvalue()
    svg = svg[svg.index("<svg") :]
    # styles would be those of the whole page, and names are the same in every panel
    svg = re.sub(r'(?s)<style.*?</style>| xmlns(:\w+)?="[^"]*"|(?<=<g) id="[^"]*"', "", svg)
    label = f'role="img" aria-label="{escape(caption)}"'  # may hold a backslash
    svg = re.sub(
        r'<svg [^>]*viewBox="([^"]*)"[^>]*>', lambda x: f'<svg viewBox="{x[1]}" {label}>', svg
    )
    # hundredths of a point
    svg = re.sub(r' d="[^"]*"', lambda path: re.sub(r"(\.\d\d)\d+", r"\1", path[0]), svg)
    axes = figure.axes[0]
    (left, low), (right, high) = (100 * axes.get_position().get_points()).round(2).tolist()
    return {
        "caption": caption,
        "svg": Markup(svg.replace(INK, "currentColor")),
        "sides": (left, right, round(100 - high, 2), round(100 - low, 2)),
        "limits": (*axes.get_xlim(), *axes.get_ylim()),
        "joints": joints,
        "has_phase": has_phase,
    }


def _toy(body: Body, law: Any) -> dict[str, Any] | None:
    """The body under the sliders of a page; None but for a chain up to eight links that lies
    flat."""
    fits = type(body) is Chain and not body.feet and body.n_link <= _MOST_PLAYED
    if not fits or type(law) is not Friction:
        return None
    return {"lengths": body.lengths, "weights": body.weight_column()[:, 0].tolist()}  # type: ignore[attr-defined]


def _motion_data(frames: Frames, body: Body) -> dict[str, Any]:
    motion, (low, high) = frames.motion, frames.window
    steps = (0.1, 0.2, 0.5, 1, 2, 5, 10, 1e9)
    wide, tall = high - low
    (x, y), (arrow_x, arrow_y), (force_x, force_y) = frames.ends, frames.arrow_base, frames.arrow
    rows: dict[str, Any] = {
        "t": motion.t, "angles": motion.angles, "x": x, "y": y, "centre": motion.centre,
        "arrowX": arrow_x, "arrowY": arrow_y, "window": [low[0], high[0], low[1], high[1]],
        "feet": frames.feet,
    }  # fmt: skip
    before = [np.array([np.exp(1j * b.rotation), b.shift]).view(float) for b in frames.before]
    return {name: np.round(row, 4).tolist() for name, row in rows.items()} | {
        "forceX": np.round(force_x, 3).tolist(),
        "forceY": np.round(force_y, 3).tolist(),
        "holding": frames.holding.astype(int).tolist(),
        "footKinds": foot_kinds(body),
        "footWords": _foot_words(body),
        "hinges": hinges(body).indices(len(x))[:2],
        "width": link_width(body),
        "before": [each.round(6).tolist() for each in before],
        "arrowScale": frames.arrow_scale,
        "grid": next(step for step in steps if max(wide, tall) / step < 16),
        "shape": float(np.clip(wide / tall, 1.2, 4.0)),
    }


def _front_section(front: ParetoFront) -> dict[str, Any]:
    points, (names, values) = front.points, front.in_units
    why, rows = {gap.after: gap.why for gap in front.gaps}, list[tuple[str, ...]]()
    for k, (point, numbers) in enumerate(zip(points, values, strict=True)):
        swings = ", ".join(f"{math.degrees(swing):.0f}" for swing in point.swings)
        rows.append((f"{k:02d}", *(f"{x:.5g}" for x in numbers), swings, point.status))
        if k in why:
            rows.append((f"no gait found between: {why[k]}",))
    drawn = [_picture(Panel(COLUMN, 3.2, lambda axes: draw_front(axes, front)), "the front")]
    if front.problem.body.n_joint > 1:
        gaits = Panel(COLUMN, 3.2, lambda axes: draw_gaits(axes, points))
        drawn.append(_picture(gaits, "their gaits"))
    return {
        "title": front.title[:1].upper() + front.title[1:],
        "pictures": drawn,
        "head": ("gait", *names, "joints move by [deg]", "status"),
        "rows": rows,
        "films": _films({f"{k:02d}": point for k, point in enumerate(points)}),
        "note": front.narrow,
    }


def _comparison_section(solution: Solution, other: Solution) -> dict[str, Any]:
    both, (rows, changes) = (solution, other), compare(solution, other)
    _, sentence = verdict(solution, other)
    names = [each.problem.name for each in both]
    if names[0] == names[1]:
        names = [f"{name} ({k})" for k, name in enumerate(names, 1)]
    drawn = []
    if all(each.problem.body.n_joint > 1 for each in both):
        plane = Panel(COLUMN, 3.2, lambda axes: draw_gaits(axes, both))
        drawn = [_picture(plane, f"{names[0]} (light), {names[1]} (dark)")]
    courses = (panels(each)["angles"] for each in both)
    drawn += [_picture(panel, name) for panel, name in zip(courses, names, strict=True)]
    return {
        "title": f"Beside {names[1]}",
        "pictures": drawn,
        "head": ("", *names),
        "rows": [*rows, *((f"problem: {name}", *values) for name, *values in changes)],
        "films": _films(dict(zip(names, both, strict=True))),
        "note": sentence[:1].upper() + sentence[1:],
    }


def _films(solutions: Mapping[str, Solution]) -> list[tuple[str, Markup]]:
    films = {name: _film(each) for name, each in solutions.items()}
    scale = min(min(_FILM / np.ptp(each.window, axis=0)) for each in films.values())
    cards = (_card(each, films[x], scale, film_alone=True) for x, each in solutions.items())
    return list(zip(solutions, map(Markup, cards), strict=True))


def solution_card(solution: Solution) -> str:
    """A card with two cycles from above, as points of an animated SVG, and the numbers."""
    film = _film(solution)
    return _card(solution, film, min(_FILM / np.ptp(film.window, axis=0)))


def _film(solution: Solution) -> Frames:
    return frames(solution, _FILM_FRAMES + 1, arrows=1, periods=_FILM_PERIODS)


def _card(solution: Solution, film: Frames, scale: float, *, film_alone: bool = False) -> str:
    body, (low, high) = solution.problem.body, film.window
    points = np.linspace(0, len(film.ends[0]) - 1, min(30, len(film.ends[0]))).round().astype(int)

    def texts(places):
        once = places[..., :-1]
        moved = [before.of(once.reshape(2, -1)).reshape(once.shape) for before in film.before]
        x, y = np.concatenate(moved, axis=-1)
        pixels = np.stack([scale * (x - low[0]), scale * (high[1] - y)])
        return [" ".join(f"{x:.1f},{y:.1f}" for x, y in at.T) for at in np.moveaxis(pixels, -1, 0)]

    slides = np.tile(~film.holding[:, :-1], _FILM_PERIODS).astype(int)
    feet = zip(foot_kinds(body), np.moveaxis(film.feet, 2, 0), slides, strict=True)
    return render(
        "card.html",
        solution=solution,
        film_alone=film_alone,
        foot_words=_foot_words(body),
        size=np.ceil(scale * (high - low)).astype(int),
        width=max(scale * link_width(body), 4.0),
        spine=texts(film.ends[:, points]),
        track=" ".join(texts(film.motion.centre[:, None])),
        feet=[{"kind": kind, "frames": texts(at), "slides": row} for kind, at, row in feet],
    )
