"""One self-contained HTML page about a result: no network, no other file; everything from the file is escaped."""

from __future__ import annotations

import json
from importlib import resources

import numpy as np

from colloc.gaits.problem import Reference
from colloc.pictures.motion_frames import Frames, frames
from colloc.pictures.report_charts import angles_chart, convergence_chart, mesh_chart, plane_charts, power_chart, speeds_chart
from colloc.results.markup import Markup, element, table
from colloc.results.solution import SOLVED, Solution

_PHASES = 601
_STAGE_WIDTH, _STAGE_HEIGHTS = 1040, (240, 560)
_POLICY = "default-src 'none'; style-src 'unsafe-inline'; script-src 'unsafe-inline'"
"""The page may run its own script and nothing else: it can fetch nothing, whatever the file held."""


def asset(name: str) -> str:
    """Text of a file in colloc/pictures/assets."""
    return resources.files("colloc.pictures").joinpath("assets", name).read_text(encoding="utf-8")


def json_block(identity: str, value: object) -> Markup:
    """Data for the page's script; no text in it can end the block."""
    text = json.dumps(value, separators=(",", ":")).replace("<", "\\u003c").replace(">", "\\u003e").replace("&", "\\u0026")
    return element("script", Markup(text), id=identity, type="application/json")


def report_page(solution: Solution, reference: Reference | None = None, gap: str = "") -> str:
    """The page as a string.

    Parameters
    ----------
    solution : Solution
        Also one that failed; what does not exist is left out.
    reference : Reference, optional
        The value to hold the result against.
    gap : str
        A sentence about the upper bound.
    """
    parts: list[Markup | None] = [_summary(solution, reference, gap)]
    if solution.levels:
        parts += [_animation(frames(solution)), _certificate(solution), _charts(solution), _convergence(solution)]
    parts += [_problem(solution), _reproduce(solution)]
    title = f"{solution.problem.name} · colloc"
    head = element(
        "head",
        element("meta", charset="utf-8"),
        Markup(f'<meta http-equiv="Content-Security-Policy" content="{_POLICY}" />'),
        element("meta", name="viewport", content="width=device-width, initial-scale=1"),
        element("title", title),
        element("style", Markup(asset("report.css"))),
    )
    footer = element("footer", f"made by colloc {solution.versions.get('colloc', '')} from one result file")
    script = element("script", Markup(asset("report.js"))) if solution.levels else None
    body = element("body", element("main", parts, footer), script)
    return "<!DOCTYPE html>\n" + element("html", head, body, lang="en")


def _summary(solution: Solution, reference: Reference | None, gap: str) -> Markup:
    problem, certificate = solution.problem, solution.certificate
    good = solution.status == SOLVED
    badge = element("span", "✓ certified" if good else f"✗ {solution.status}", class_=f"badge {'good' if good else 'bad'}")
    facts: list[tuple[str, str]] = []
    if certificate.replayed:
        facts = [
            (f"{certificate.efficiency:.5f}", f"efficiency d/W, ± {certificate.efficiency_error:.0e}, replayed"),
            (f"{certificate.efficiency_at_zero_delta:.5f}", f"for δ → 0, same gait, ± {certificate.error_at_zero_delta:.0e}"),
            (f"{certificate.distance:.5f}", "distance d a period [body lengths]"),
            (f"{certificate.work:.5f}", "work W a period [weight × length]"),
        ]
    elif solution.levels:
        facts = [(f"{solution.efficiency:.5f}", "efficiency of the last level, not replayed")]
    friction = problem.friction
    facts += [
        (f"{problem.body.n_link}", "links"),
        (f"{friction.mu_t:g}, {friction.mu_f:g}, {friction.mu_b:g}", "friction μt, μf, μb"),
    ]
    if solution.levels:
        facts.append((f"{solution.last.delta:.0e}", "regularisation δ"))
    lines = [gap.strip()] if gap else []
    if reference is not None and certificate.replayed:
        agree = "agrees with" if abs(certificate.efficiency - reference.efficiency) <= reference.tolerance else "DIFFERS from"
        lines.append(f"{agree} {reference.efficiency:g} ± {reference.tolerance:g}: {reference.source}")
    return element(
        "section",
        element("h1", problem.name),
        badge,
        element("p", solution.message, class_="message") if solution.message else None,
        element(
            "div", [element("div", element("b", v), element("span", name), class_="fact") for v, name in facts], class_="facts"
        ),
        [_note(line) for line in lines],
    )


def _fact(value: str, name: str) -> Markup:
    return element("div", element("b", value), element("span", name), class_="fact")


def _note(text: str) -> Markup:
    return element("p", text, class_="note-line")


def _scrolled(table_: Markup) -> Markup:
    return element("div", table_, class_="scroll")


def _rounded(rows: np.ndarray, digits: int = 4) -> list:
    return np.round(rows, digits).tolist()


def motion_data(shown: Frames) -> dict:
    """What report.js draws: rows over time, the window that holds all of it, the length of the arrows."""
    last = (shown.periods - 1) * shown.step
    reach = np.concatenate([shown.ends.reshape(2, -1), shown.ends.reshape(2, -1) + last[:, None]], axis=1)
    low, high = reach.min(axis=1) - 0.12, reach.max(axis=1) + 0.12
    strongest = max(float(np.hypot(*shown.arrow).max()), 1e-300)
    grid = next(step for step in (0.1, 0.2, 0.5, 1, 2, 5, 10, 1e9) if (high - low).max() / step < 16)
    return {
        "t": _rounded(shown.t),
        "periods": shown.periods,
        "step": _rounded(shown.step, 6),
        "angles": _rounded(shown.angles),
        "x": _rounded(shown.ends[0]),
        "y": _rounded(shown.ends[1]),
        "centre": _rounded(shown.centre),
        "arrowX": _rounded(shown.arrow_base[0]),
        "arrowY": _rounded(shown.arrow_base[1]),
        "forceX": _rounded(shown.arrow[0], 3),
        "forceY": _rounded(shown.arrow[1], 3),
        "arrowScale": 0.12 / strongest,
        "window": _rounded(np.array([low[0], high[0], low[1], high[1]])),
        "grid": grid,
    }


def _animation(shown: Frames) -> Markup:
    def box(identity: str, words: str) -> Markup:
        return element("label", element("input", type="checkbox", id=identity, checked=True), " " + words)

    controls = element(
        "div",
        element("button", "❚❚ pause", id="play", type="button"),
        element("input", type="range", id="phase", min=0, max=1000, value=0, aria_label="phase"),
        element("output", "t = 0.000", id="phase-shown"),
        element("label", "speed ", element("input", type="range", id="rate", min=0.1, max=3, step=0.1, value=1)),
        box("arrows", "friction"),
        box("trails", "paths"),
        class_="controls",
    )
    data = motion_data(shown)
    left, right, low, high = data["window"]
    height = int(np.clip(_STAGE_WIDTH * (high - low) / (right - left), *_STAGE_HEIGHTS))
    periods = "one period" if shown.periods == 1 else f"{shown.periods} periods"
    return element(
        "section",
        element("h2", "Motion in the lab frame"),
        element("canvas", id="stage", width=_STAGE_WIDTH, height=height, class_="stage"),
        controls,
        element(
            "p",
            f"{periods}. The large disc is the head; orange arrows are friction per length on the links, the orange dot is the "
            "centre of mass. Blue and yellow lines: tail and head. Space plays and pauses.",
            class_="note-line",
        ),
        json_block("motion", data),
    )


def _certificate(solution: Solution) -> Markup:
    if not solution.certificate.replayed:
        return element(
            "section", element("h2", "Certificate"), element("p", "none: the solve did not converge.", class_="message")
        )
    rows = []
    for check in solution.certificate.checks:
        mark = element("td", "✓ holds" if check.passed else "✗ fails", class_="good" if check.passed else "bad")
        rows.append([check.name, mark, f"{check.value:.1e}", f"≤ {check.threshold:.0e}", check.meaning])
    instants = solution.certificate.instants
    return element(
        "section",
        element("h2", "Certificate"),
        _scrolled(table(rows, ["check", "", "measured", "allowed", "meaning"])),
        element(
            "p", f"From an independent replay of the gait on {instants} instants; colloc verify repeats it.", class_="note-line"
        ),
    )


def _charts(solution: Solution) -> Markup:
    t = np.linspace(0.0, 1.0, _PHASES)
    angles = solution.sample(t).angles
    n = len(angles)
    planes = plane_charts(solution.problem, angles)
    note = "Grey: beyond the joint limit" + (", or links would cross." if n == 2 else " (contact depends on the other joints).")
    return element(
        "section",
        element("h2", "Gait"),
        element("div", planes, class_="charts planes") if planes else None,
        element("div", angles_chart(t, angles), speeds_chart(solution, t), power_chart(solution, t), class_="charts"),
        _note(f"{note} Ticks on the time axis of the power: mesh."),
    )


def _convergence(solution: Solution) -> Markup:
    rows = []
    for level in solution.levels:
        mark = element("td", "✓" if level.optimal else f"✗ {level.status}", class_="good" if level.optimal else "bad")
        cells = [f"{level.edges.size - 1}", f"{level.efficiency:.6f}", f"{level.distance:.5f}", f"{level.work:.5f}"]
        rows.append(
            [f"{level.delta:.1e}", mark, *cells, f"{level.iterations}", f"{level.kkt_error:.0e}", f"{level.seconds:.2f}"]
        )
    header: list[object] = ["δ", "", "mesh", "efficiency", "d", "W", "iterations", "KKT error", "seconds"]
    drawn, total = mesh_chart(solution)
    tolerance = solution.problem.mesh_tolerance
    allowed = f", allowed {tolerance:.0e}" if tolerance > 0 else ", no refinement asked for"
    return element(
        "section",
        element("h2", "Convergence"),
        element("div", convergence_chart(solution), drawn, class_="charts"),
        element(
            "p",
            f"Estimated error of the collocated efficiency, summed over the mesh: {total:.1e}{allowed}.",
            class_="note-line",
        ),
        _scrolled(table(rows, header)),
        _note(f"{solution.seconds:.1f} s in all."),
    )


def _problem(solution: Solution) -> Markup:
    rows = [[name, element("td", json.dumps(value), class_="wide")] for name, value in solution.problem.to_dict().items()]
    source = element("pre", element("code", solution.source)) if solution.source else element("p", "stated in a program")
    return element(
        "section",
        element("h2", "Problem"),
        source,
        element("details", element("summary", "all fields, as solved"), _scrolled(table(rows))),
    )


def _reproduce(solution: Solution) -> Markup:
    p = solution.problem
    formulation = "" if p.formulation is None else f" --formulation {p.formulation}"
    commands = [
        f"# save the problem source above as {p.name}.py, then",
        f"colloc solve {p.name}.py --delta {p.delta:g} --delta-start {p.delta_start:g} --mesh {p.intervals} "
        f"--mesh-tolerance {p.mesh_tolerance:g} --scheme {p.scheme}{formulation}",
        f"colloc verify results/{p.name}.h5",
    ]
    versions = [[name, version] for name, version in solution.versions.items()]
    return element(
        "section",
        element("h2", "How to reproduce"),
        element("pre", element("code", "\n".join(commands))),
        _scrolled(table(versions, ["package", "version"])),
        _note(f"Problem hash {p.hash}"),
    )
