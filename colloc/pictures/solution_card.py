"""A solution as a small HTML card: what a notebook shows of it, a film and the numbers."""

from __future__ import annotations

from collections.abc import Iterable
from html import escape

import numpy as np

from colloc.gaits.objective import EFFICIENCY
from colloc.mechanics.feet import FOOT, WHEEL
from colloc.pictures.motion_frames import foot_kinds, foot_words, frames
from colloc.results.solution import Solution

_FRAMES, _PERIODS, _SECONDS = 24, 2, 3.0
"""Of the film: frames and seconds a period."""
_POINTS = 30
"""That draw a body, at most."""
_WIDTH, _TALLEST = 320, 200
"""Of the film [pixels]."""


def solution_card(solution: Solution) -> str:
    """Verdict, film, numbers and checks as HTML; all text is escaped."""
    checks = solution.certificate.checks if solution.certificate.replayed else ()
    failed = sum(not check.passed for check in checks)
    tally = f"{len(checks)} checks, {'all hold' if failed == 0 else f'{failed} failed'}"
    listed = _table(
        (
            f"{'✓' if check.passed else '✗'} {check.name}",
            f"{check.value:.1e} (≤ {check.threshold:.0e})",
        )
        for check in checks
    )
    parts = [
        f"<div><b>{escape(solution.problem.name)}</b> {escape(solution.status)}</div>",
        f"<div>{escape(solution.message)}</div>" if solution.message else "",
        film(solution),
        f"<div>{foot_words(foot_kinds(solution.problem.body))}</div>",
        _table(_facts(solution)),
        f"<div>δ = {solution.answer.delta:.0e}; {escape(solution.standing[0])}</div>",
        f"<details{' open' if failed else ''}><summary>{tally}</summary>{listed}</details>"
        if checks
        else "",
    ]
    return f"<div>{''.join(parts)}</div>"


def film(solution: Solution) -> str:
    """Two periods from above as an SVG that moves by itself, in the colour of the text around it;
    feet that hold are filled."""
    shown = frames(solution, _FRAMES + 1, arrows=1, periods=_PERIODS)
    chosen = (
        np.linspace(0, shown.ends.shape[1] - 1, min(_POINTS, shown.ends.shape[1]))
        .round()
        .astype(int)
    )
    low, high = shown.window
    scale = min(_WIDTH / (high - low)[0], _TALLEST / (high - low)[1])
    size = np.ceil(scale * (high - low)).astype(int)

    def pixels(points: np.ndarray) -> np.ndarray:
        """Of all periods in a row, ``(2, ..., n_time)``; y points down."""
        flat = points.reshape(2, -1, points.shape[-1])[..., :-1]
        moved = [before.of(flat.reshape(2, -1)).reshape(flat.shape) for before in shown.before]
        x, y = np.concatenate(moved, axis=-1)
        return np.stack([scale * (x - low[0]), scale * (high[1] - y)])

    clock = f'dur="{_PERIODS * _SECONDS:g}s" repeatCount="indefinite"'
    width = max(scale * solution.problem.body.drawn_width, 4.0)
    body, centre = pixels(shown.ends[:, chosen]), pixels(shown.centre[:, None])
    line = 'fill="none" stroke="currentColor" stroke-linecap="round" stroke-linejoin="round"'
    drawn = [
        f'<polyline points="{_points(body[..., 0])}" {line} stroke-width="{width:.1f}" '
        f'opacity="0.15"/>',
        f'<polyline points="{_points(centre[:, 0])}" {line} stroke-width="1" opacity="0.4"/>',
        _line(body, clock, f'{line} stroke-width="{width:.1f}"'),
        _disc(body[:, -1], clock, f'r="{0.8 * width + 2:.1f}" fill="currentColor"'),
    ]
    for number, (kind, holds) in enumerate(
        zip(foot_kinds(solution.problem.body), shown.holding[:, :-1], strict=True)
    ):
        foot, colour = pixels(shown.feet[:, :, number]), "#009e73" if kind == WHEEL else "#d55e00"
        slides = ";".join("0" if held else "1" for held in np.tile(holds, _PERIODS))
        hollow = (
            f'<animate attributeName="stroke-opacity" calcMode="discrete" values="{slides}" '
            f"{clock}/>"
        )
        drawn.append(
            _line(foot, clock, f'stroke="{colour}" stroke-width="8" stroke-linecap="square"')
        )
        cap = "square" if kind == FOOT else "butt"
        drawn.append(
            _line(foot, clock, f'stroke="white" stroke-width="4.4" stroke-linecap="{cap}"', hollow)
        )
    return (
        f'<svg width="{size[0]}" height="{size[1]}" viewBox="0 0 {size[0]} {size[1]}" role="img" '
        f'style="max-width:100%" '
        f'aria-label="{escape(solution.problem.name)} as it moves, two '
        f'periods">{"".join(drawn)}</svg>'
    )


def _points(places: np.ndarray) -> str:
    return " ".join(f"{x:.1f},{y:.1f}" for x, y in places.T)


def _line(places: np.ndarray, clock: str, look: str, inside: str = "") -> str:
    """A line that runs through places, ``(2, n_point, n_time)``."""
    moves = (
        f'<animate attributeName="points" '
        f'values="{";".join(map(_points, np.moveaxis(places, -1, 0)))}" {clock}/>'
    )
    return f'<polyline points="{_points(places[..., 0])}" {look}>{moves}{inside}</polyline>'


def _disc(places: np.ndarray, clock: str, look: str) -> str:
    """A circle whose centre runs through places, ``(2, n_time)``."""
    moves = "".join(
        f'<animate attributeName="{name}" values="{";".join(f"{value:.1f}" for value in row)}" '
        f"{clock}/>"
        for name, row in zip(("cx", "cy"), places, strict=True)
    )
    return f'<circle cx="{places[0, 0]:.1f}" cy="{places[1, 0]:.1f}" {look}>{moves}</circle>'


def _facts(solution: Solution) -> list[tuple[str, str]]:
    """Names and values."""
    certificate, best = solution.certificate, solution.problem.objective
    if not certificate.replayed:
        return [(f"{best.name} (not replayed)", f"{solution.value:.5f}")]
    own = [] if best == EFFICIENCY else [(EFFICIENCY.label, f"{certificate.efficiency:.5f}")]
    return [
        (best.label, f"{certificate.value:.5f} ± {certificate.value_error:.0e}"),
        (
            "for δ → 0",
            f"{certificate.value_at_zero_delta:.5f} ± {certificate.value_error_at_zero_delta:.0e}",
        ),
        *own,
        ("distance d", f"{certificate.distance:.5f}"),
        ("work W", f"{certificate.work:.5f}"),
        *([("course", solution.turning)] if solution.turning else []),
    ]


def _table(rows: Iterable[tuple[str, str]]) -> str:
    lines = (
        f'<tr><td style="text-align:left">{escape(key)}</td><td>{escape(value)}</td></tr>'
        for key, value in rows
    )
    return f"<table><tbody>{''.join(lines)}</tbody></table>"
