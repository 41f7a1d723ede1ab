"""Worst instants of path constraints, one in every mesh cell.

An inequality between nodes is kept by constraining it at these instants, repeated at every solve:
the exchange method for semi-infinite programs. Links that pass each other's ends give peaks with a
kink, so instants are found by nested sampling.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from colloc.gaits.gait_fields import AnyGait
from colloc.gaits.limits import Limit
from colloc.numerics.mesh import Mesh
from colloc.numerics.peaks import SAMPLES, peaks, vertex
from colloc.transcription.shape_checks import ShapeCheck

_NEAR, _FAR = 0.1, 1.0
"""Distances from the bound [rad] below which a cell, or a peak, is watched."""
_HELD_SHARE, _HELD_NEAR = 1e-3, 0.05
"""A check is replaced by its tangent plane where both sums have at least this share in it and it is
this near to its bound [rad]: elsewhere the gait may move far."""
_STEP, _LARGEST, _STEPS = 1e-3, 0.1, 4
"""Sampling and largest step of Newton's method, as parts of a cell; number of steps."""


def worst_instants(
    gait: AnyGait, mesh: Mesh, checks: Sequence[ShapeCheck], limit: Limit
) -> list[np.ndarray]:
    """Worst instant of each check in every mesh cell, ``(n_interval,)``."""
    return [_worst(gait, mesh, check, np.arange(mesh.n), limit) for check in checks]


def near_peaks(
    gait: AnyGait, mesh: Mesh, checks: Sequence[ShapeCheck], limit: Limit
) -> list[tuple[np.ndarray, np.ndarray]]:
    """Cells in which each check might bind soon, and its worst instants there."""
    fine = np.linspace(0.0, 1.0, SAMPLES + 1)
    times, found = (mesh.edges[:-1, None] + mesh.h[:, None] * fine).ravel(), []
    given = {check.derivative: check for check in checks}
    shapes = {order: check.of(gait, times) for order, check in given.items()}
    for check in checks:
        beyond = (
            check.magnitudes(shapes[check.derivative], limit)
            - check.bounds(limit)[1]
            + check.middle(limit)
        )
        highest = beyond.reshape(mesh.n, -1).max(axis=1)
        around = np.concatenate([[-np.inf], highest, [-np.inf]])
        peak = (highest >= around[:-2]) & (highest >= around[2:])
        cells = np.flatnonzero((highest > -_NEAR) | (peak & (highest > -_FAR)))
        found.append(
            (cells, _worst(gait, mesh, check, cells, limit) if cells.size else np.empty(0))
        )
    return found


def _worst(
    gait: AnyGait, mesh: Mesh, check: ShapeCheck, cells: np.ndarray, limit: Limit
) -> np.ndarray:

    def beyond(t: np.ndarray) -> np.ndarray:
        return check.magnitudes(check.of(gait, t.ravel()), limit).reshape(t.shape)

    return peaks(beyond, mesh.edges[cells], mesh.h[cells])[0]


def moving(
    values: np.ndarray,
    check: ShapeCheck,
    limit: Limit,
    times: np.ndarray,
    mesh: Mesh,
    cells: np.ndarray,
) -> np.ndarray:
    """Worst instants near their bound and off the edges of their cells, ``(k,)`` int."""
    near = check.excess(values, limit) > -_NEAR
    share = (times - mesh.edges[cells]) / mesh.h[cells]
    return np.flatnonzero(near & (share > _STEP) & (share < 1 - _STEP))


def following_instants(
    check: ShapeCheck,
    shares: np.ndarray,
    gait: AnyGait,
    times: np.ndarray,
    *,
    cells: tuple[np.ndarray, np.ndarray],
    limit: Limit,
) -> np.ndarray:
    """Worst instants of a gait near those of another one, in the same cells, by Newton's method."""
    left, h = cells
    step, held = _STEP * h, np.tile(shares, 3)

    def heights(t: np.ndarray) -> np.ndarray:
        return check.cut(check.of(gait, np.concatenate([t - step, t, t + step])), held).reshape(
            3, -1
        )

    sign = np.sign(heights(times)[1] - check.middle(limit)) if check.both_ways else 1.0
    for _ in range(_STEPS):
        before, here, after = sign * heights(times)
        move = vertex(before, here, after) * step
        last = times
        times = np.clip(
            times + np.clip(move, -_LARGEST * h, _LARGEST * h), left + step, left + h - step
        )
        if np.abs(times - last).max() < _STEP * step.min():
            break
    return times


def check_values(check: ShapeCheck, gait: AnyGait, times: np.ndarray) -> np.ndarray:
    return check.along(check.of(gait, times))


def held_shares(check: ShapeCheck, gait: AnyGait, times: np.ndarray) -> np.ndarray:
    """Shares that the cuts hold at the instants, ``(n_time,)``."""
    shapes = check.of(gait, times)
    shares = check.share(shapes)
    if check.both_ways:
        return shares
    both = (shares > _HELD_SHARE) & (shares < 1 - _HELD_SHARE)
    return np.where(both & (check.along(shapes) > -_HELD_NEAR), shares, check.itself(shapes))
