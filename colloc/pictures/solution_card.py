"""A solution as a small HTML card for notebooks: a film and the numbers."""

from __future__ import annotations

from typing import Any

import numpy as np

from colloc.gaits.objective import EFFICIENCY
from colloc.mechanics.contact import link_width
from colloc.pictures.motion_frames import foot_kinds, foot_words, frames
from colloc.pictures.templates import render
from colloc.results.solution import Solution

_FRAMES, _PERIODS, _SECONDS = 24, 2, 3.0  # frames and seconds of each period of the film
_POINTS = 30  # of a body, at most
_WIDTH, _TALLEST = 320, 200  # of the film [pixels]


def solution_card(solution: Solution) -> str:
    checks = solution.certificate.checks if solution.certificate.replayed else ()
    return render(
        "card.html",
        solution=solution,
        facts=_facts(solution),
        failed=sum(not check.passed for check in checks),
        checks=[
            (f"{'✓' if x.passed else '✗'} {x.name}", f"{x.value:.1e} (≤ {x.threshold:.0e})")
            for x in checks
        ],
        foot_words=foot_words(foot_kinds(solution.problem.body)),
        seconds=f"{_PERIODS * _SECONDS:g}",
        **_film(solution),
    )


def _film(solution: Solution) -> dict[str, Any]:
    """Two periods from above, as points of an animated SVG."""
    shown, body = frames(solution, _FRAMES + 1, arrows=1, periods=_PERIODS), solution.problem.body
    count = shown.ends.shape[1]
    points = np.linspace(0, count - 1, min(_POINTS, count)).round().astype(int)
    low, high = shown.window
    scale = min(_WIDTH / (high - low)[0], _TALLEST / (high - low)[1])

    def pixels(places: np.ndarray) -> np.ndarray:
        """Pixels of all periods in a row, ``(2, n_point, n_time)``; y points down."""
        once = places[..., :-1]
        moved = [before.of(once.reshape(2, -1)).reshape(once.shape) for before in shown.before]
        x, y = np.concatenate(moved, axis=-1)
        return np.stack([scale * (x - low[0]), scale * (high[1] - y)])

    spine, (track,) = pixels(shown.ends[:, points]), pixels(shown.centre[:, None]).swapaxes(0, 1)
    slides = (~shown.holding[:, :-1]).astype(int)
    return {
        "size": np.ceil(scale * (high - low)).astype(int),
        "width": max(scale * link_width(body), 4.0),
        "spine": _texts(spine),
        "track": _texts(track[..., None])[0],
        "head": [[f"{x:.1f}" for x in row] for row in spine[:, -1]],
        "feet": [
            {
                "kind": kind,
                "frames": _texts(pixels(shown.feet[:, :, k])),
                "slides": np.tile(slides[k], _PERIODS),
            }
            for k, kind in enumerate(foot_kinds(body))
        ],
    }


def _texts(places: np.ndarray) -> list[str]:
    """Points ``(2, n_point, n_time)`` of every frame."""
    return [" ".join(f"{x:.1f},{y:.1f}" for x, y in at.T) for at in np.moveaxis(places, -1, 0)]


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
