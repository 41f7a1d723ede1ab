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
_POINTS = 30  # that draw a body, at most
_WIDTH, _TALLEST = 320, 200  # of the film [pixels]
_CLOCK = f'dur="{_PERIODS * _SECONDS:g}s" repeatCount="indefinite"'


def solution_card(solution: Solution) -> str:
    """Verdict, film, numbers and checks as HTML; all text is escaped."""
    checks = solution.certificate.checks if solution.certificate.replayed else ()
    failed = sum(not check.passed for check in checks)
    kinds = foot_kinds(solution.problem.body)
    parts = [
        f"<div><b>{escape(solution.problem.name)}</b> {escape(solution.status)}</div>",
        f"<div>{escape(solution.message)}</div>" if solution.message else "",
        film(solution),
        f"<div>{foot_words(kinds)}</div>",
        _table(_facts(solution)),
        f"<div>δ = {solution.answer.delta:.0e}; {escape(solution.standing[0])}</div>",
    ]
    if checks:
        tally = f"{len(checks)} checks, {'all hold' if failed == 0 else f'{failed} failed'}"
        rows = (
            (f"{'✓' if x.passed else '✗'} {x.name}", f"{x.value:.1e} (≤ {x.threshold:.0e})")
            for x in checks
        )
        state = " open" if failed else ""
        parts.append(f"<details{state}><summary>{tally}</summary>{_table(rows)}</details>")
    return f"<div>{''.join(parts)}</div>"


def film(solution: Solution) -> str:
    """Two periods from above as an SVG that moves by itself, in the colour of the text around it;
    feet that hold are filled."""
    shown, body = frames(solution, _FRAMES + 1, arrows=1, periods=_PERIODS), solution.problem.body
    count = shown.ends.shape[1]
    points = np.linspace(0, count - 1, min(_POINTS, count)).round().astype(int)
    low, high = shown.window
    scale = min(_WIDTH / (high - low)[0], _TALLEST / (high - low)[1])
    wide, tall = np.ceil(scale * (high - low)).astype(int)

    def pixels(places: np.ndarray) -> np.ndarray:
        """All periods in a row, ``(2, n_point, n_time)``; y points down."""
        once = places[..., :-1]
        moved = [before.of(once.reshape(2, -1)).reshape(once.shape) for before in shown.before]
        x, y = np.concatenate(moved, axis=-1)
        return np.stack([scale * (x - low[0]), scale * (high[1] - y)])

    width = max(scale * body.drawn_width, 4.0)
    spine, centre = pixels(shown.ends[:, points]), pixels(shown.centre[:, None])
    line = 'fill="none" stroke="currentColor" stroke-linecap="round" stroke-linejoin="round"'
    drawn = [
        f'<polyline points="{_points(spine[..., 0])}" {line} stroke-width="{width:.1f}" '
        f'opacity="0.15"/>',
        f'<polyline points="{_points(centre[:, 0])}" {line} stroke-width="1" opacity="0.4"/>',
        _moving_line(spine, f'{line} stroke-width="{width:.1f}"'),
        _moving_disc(spine[:, -1], f'r="{0.8 * width + 2:.1f}" fill="currentColor"'),
    ]
    for number, kind in enumerate(foot_kinds(body)):
        foot, colour = pixels(shown.feet[:, :, number]), "#009e73" if kind == WHEEL else "#d55e00"
        slides = (~shown.holding[number, :-1]).astype(int)
        values = ";".join(map(str, np.tile(slides, _PERIODS)))
        hollow = _animate("stroke-opacity", values, ' calcMode="discrete"')
        cap = "square" if kind == FOOT else "butt"
        look = f'stroke="{colour}" stroke-width="8" stroke-linecap="square"'
        inner = f'stroke="white" stroke-width="4.4" stroke-linecap="{cap}"'
        drawn += [_moving_line(foot, look), _moving_line(foot, inner, hollow)]
    return (
        f'<svg width="{wide}" height="{tall}" viewBox="0 0 {wide} {tall}" role="img" '
        f'style="max-width:100%" aria-label="{escape(solution.problem.name)} as it moves, two '
        f'periods">{"".join(drawn)}</svg>'
    )


def _points(places: np.ndarray) -> str:
    return " ".join(f"{x:.1f},{y:.1f}" for x, y in places.T)


def _animate(name: str, values: str, how: str = "") -> str:
    return f'<animate attributeName="{name}"{how} values="{values}" {_CLOCK}/>'


def _moving_line(places: np.ndarray, look: str, inside: str = "") -> str:
    """A line that runs through places, ``(2, n_point, n_time)``."""
    moves = _animate("points", ";".join(map(_points, np.moveaxis(places, -1, 0))))
    return f'<polyline points="{_points(places[..., 0])}" {look}>{moves}{inside}</polyline>'


def _moving_disc(places: np.ndarray, look: str) -> str:
    """A circle whose centre runs through places, ``(2, n_time)``."""
    x, y = ([f"{value:.1f}" for value in row] for row in places)
    moves = _animate("cx", ";".join(x)) + _animate("cy", ";".join(y))
    return f'<circle cx="{x[0]}" cy="{y[0]}" {look}>{moves}</circle>'


def _facts(solution: Solution) -> list[tuple[str, str]]:
    certificate, best = solution.certificate, solution.problem.objective
    if not certificate.replayed:
        return [(f"{best.name} (not replayed)", f"{solution.value:.5f}")]
    limit, error = certificate.value_at_zero_delta, certificate.value_error_at_zero_delta
    efficiency = (EFFICIENCY.label, f"{certificate.efficiency:.5f}")
    return [
        (best.label, f"{certificate.value:.5f} ± {certificate.value_error:.0e}"),
        ("for δ → 0", f"{limit:.5f} ± {error:.0e}"),
        *([] if best == EFFICIENCY else [efficiency]),
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
