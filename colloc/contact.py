"""Which shapes are admissible: joint limits, and links that must not cross.

Neighbours can only fold onto each other (|angle| <= pi). Links i and i + 2 with a joint at both ends of link i + 1 cross
iff, with a and b the two joint angles, ``min(b + chi(a; l_i), a + chi(b; l_i+2)) > pi`` or the mirror image, where
``chi(a; l) = atan2(l sin a, m + l cos a)`` and m is the length between; for equal lengths chi = a/2 and the condition is
``min(2 a + b, a + 2 b) > 2 pi``. (Base m, base angles pi - a and pi - b: the tip of one link lies beyond the line of the
other on both sides.)
"""

from __future__ import annotations

import numpy as np

from colloc.arrays import Array, namespace
from colloc.body import Chain

SMOOTHING = 1e-3
"""Width [rad] of the smoothed minimum; it errs to the safe side, by at most half of this."""


def _subtended(angle: Array, link: float, middle: float) -> Array:
    if link == middle:
        return 0.5 * angle
    xp = namespace(angle)
    return xp.arctan2(link * xp.sin(angle), middle + link * xp.cos(angle))


def crossing_bounds(body: Chain, angles: Array) -> Array | None:
    """Smooth functions that are <= pi only at shapes where no links i and i + 2 cross, ``(2 (n_link - 2), n_time)``.

    None for a body of two links. Joint angles ``(n_joint, n_time)``.
    """
    if body.n_link < 3:
        return None
    xp = namespace(angles)
    rows = []
    for i in range(body.n_link - 2):
        before, middle, after = body.lengths[i : i + 3]
        a, b = angles[i : i + 1, :], angles[i + 1 : i + 2, :]
        first = b + _subtended(a, before, middle)
        second = a + _subtended(b, after, middle)
        gap = first - second
        spread = 0.5 * (xp.sqrt(gap * gap + SMOOTHING * SMOOTHING) - SMOOTHING)
        mean = 0.5 * (first + second)
        rows += [mean - spread, -mean - spread]
    return xp.stack(rows)


def crossing_depth(body: Chain, angles: np.ndarray) -> np.ndarray:
    """How far links penetrate each other, ``(n_time,)``; 0 where no two of them cross.

    Plain segment intersection of all pairs that are not neighbours, independent of `crossing_bounds`: the depth is the
    smallest distance from an end of one of two crossing segments to the other segment.
    """
    x, y = body.joints(angles)
    depth = np.zeros(angles.shape[1])
    for i in range(body.n_link):
        for j in range(i + 2, body.n_link):
            p, r = np.stack([x[i], y[i]]), np.stack([x[i + 1] - x[i], y[i + 1] - y[i]])
            q, s = np.stack([x[j], y[j]]), np.stack([x[j + 1] - x[j], y[j + 1] - y[j]])
            d1, d2 = _cross(r, q - p), _cross(r, q + s - p)
            d3, d4 = _cross(s, p - q), _cross(s, p + r - q)
            crossing = (d1 * d2 < 0) & (d3 * d4 < 0)
            lr, ls = body.lengths[i], body.lengths[j]
            distance = np.min([np.abs(d1) / lr, np.abs(d2) / lr, np.abs(d3) / ls, np.abs(d4) / ls], axis=0)
            depth = np.maximum(depth, np.where(crossing, distance, 0.0))
    return depth


def _cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return a[0] * b[1] - a[1] * b[0]
