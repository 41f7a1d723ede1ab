"""Where functions of time are largest, and what their largest values add to second derivatives.

A constraint that holds at every instant is laid on the instants at which it comes closest to its
bound; repeated, this is the exchange method for semi-infinite programs (Hettich and Kortanek, SIAM
Review 35, 1993). Such an instant moves with whatever the function depends on.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

SAMPLES = 16
"""Intervals between the samples of a stretch; every zoom samples 8 times as densely."""


def vertex(low: np.ndarray, here: np.ndarray, high: np.ndarray) -> np.ndarray:
    """Where the parabola through three equally spaced values has its maximum, from the middle one,
    in spacings; 0 where it has none.

    Examples
    --------
    >>> float(vertex(np.array(0.0), np.array(3.0), np.array(2.0)))
    0.25
    """
    bend = low - 2 * here + high
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(bend < 0, 0.5 * (low - high) / bend, 0.0)


def peaks(
    function: Callable[[np.ndarray], np.ndarray],
    left: np.ndarray,
    width: np.ndarray,
    zooms: int = 3,
) -> tuple[np.ndarray, np.ndarray]:
    """The instant in each of n stretches at which a function of its own is largest ``(n,)``, and
    the largest sample ``(n,)``.

    It is sampled finer and finer around the highest sample, since peaks may have kinks; at last one
    parabola places a smooth maximum between the samples to fourth order in their distance.

    Parameters
    ----------
    function : callable
        Values ``(n, k)`` at instants ``(n, k)`` of the stretches.
    left, width : (n,)
    zooms : int

    Examples
    --------
    >>> at, height = peaks(lambda t: -((t - 0.3) ** 2), np.zeros(1), np.ones(1))
    >>> round(float(at[0]), 9)
    0.3
    """
    rows, fine = np.arange(left.size), np.linspace(0.0, 1.0, SAMPLES + 1)
    for zoom in range(zooms + 1):
        times = left[:, None] + width[:, None] * fine
        values = function(times)
        best = np.argmax(values, axis=1)
        inner = np.clip(best, 1, SAMPLES - 1)
        if zoom < zooms:
            left, width = times[rows, inner - 1], 2 * width / SAMPLES
    offset = np.where(
        best == inner, np.clip(vertex(*(values[rows, inner + k] for k in (-1, 0, 1))), -1, 1), 0.0
    )
    return times[rows, best] + offset * width / SAMPLES, values[rows, best]


def curvature_of_moving(
    multipliers: np.ndarray, values: np.ndarray, slopes: np.ndarray
) -> np.ndarray:
    """What is added to the second derivatives ``(n, n)`` of multipliers times functions c(t, v)
    held at their peaks in time, as these move with v: the largest value of c has the second
    derivative c_vv - c_tv c_tv' / c_tt.

    A peak that lies on an edge, where the parabola through the three values has no vertex beside
    the middle one, stays there.

    Parameters
    ----------
    multipliers : (n_function,)
    values : (3, n_function)
        A little before the peaks, at them, and as much after them.
    slopes : (3, n_function, n)
        Derivatives with respect to v there.

    Examples
    --------
    The largest value of -(t - v)^2 is 0 whatever v is, and held at t it bends by -2:

    >>> h, one = 0.1, np.ones(1)
    >>> curvature_of_moving(one, -np.array([[h**2], [0], [h**2]]), 2 * np.array([[[-h]], [[0.0]],
    ...     [[h]]]))
    array([[2.]])
    """
    low, here, high = values
    bend = low - 2 * here + high
    moves = (multipliers * bend < 0) & (np.abs(high - low) < np.abs(bend))
    turning = 0.5 * (slopes[2] - slopes[0])[moves]
    return -turning.T @ ((multipliers[moves] / bend[moves])[:, None] * turning)
