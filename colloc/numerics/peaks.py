"""Peaks of functions of time (exchange method; Hettich and Kortanek, SIAM Review 35, 1993), and
what they add to second derivatives as they move."""

from collections.abc import Callable

import numpy as np

SAMPLES = 16
"""Intervals between the samples of a stretch; every zoom samples 8 times as densely."""


def vertex(low: np.ndarray, here: np.ndarray, high: np.ndarray) -> np.ndarray:
    """Maximum of the parabola through three equally spaced values, from the middle one in
    spacings."""
    bend = low - 2 * here + high
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(bend < 0, 0.5 * (low - high) / bend, 0.0)


def peaks(
    function: Callable[[np.ndarray], np.ndarray],
    left: np.ndarray,
    width: np.ndarray,
    zooms: int = 3,
) -> tuple[np.ndarray, np.ndarray]:
    """Instant in each of n stretches at which a function of its own, of instants ``(n, k)``, is
    largest, and the largest sample: sampled finer and finer, since peaks may have kinks."""
    rows, fine = np.arange(left.size), np.linspace(0.0, 1.0, SAMPLES + 1)
    for zoom in range(zooms + 1):
        times = left[:, None] + width[:, None] * fine
        values = function(times)
        best = np.argmax(values, axis=1)
        inner = np.clip(best, 1, SAMPLES - 1)
        if zoom < zooms:
            left, width = times[rows, inner - 1], 2 * width / SAMPLES
    offset = np.clip(vertex(*(values[rows, inner + k] for k in (-1, 0, 1))), -1, 1)
    offset = np.where(best == inner, offset, 0.0)
    return times[rows, best] + offset * width / SAMPLES, values[rows, best]


def curvature_of_moving(
    multipliers: np.ndarray, values: np.ndarray, slopes: np.ndarray
) -> np.ndarray:
    """Second derivatives ``(n, n)`` that moving peaks add to multipliers times functions c(t, v)
    held at their peaks in time: ``max_t c`` has c_vv - c_tv c_tv' / c_tt.

    values ``(3, n_function)``, slopes by v ``(3, n_function, n)``: a little before the peaks, at
    them, and as much after. A peak on an edge stays there.
    """
    low, here, high = values
    bend = low - 2 * here + high
    moves = (multipliers * bend < 0) & (np.abs(high - low) < np.abs(bend))
    turning = 0.5 * (slopes[2] - slopes[0])[moves]
    return -turning.T @ ((multipliers[moves] / bend[moves])[:, None] * turning)
