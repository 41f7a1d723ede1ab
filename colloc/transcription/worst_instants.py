"""Where a gait comes closest to the bounds on its shapes and rates: one instant for every check in
every mesh cell.

An inequality between nodes is kept by constraining it at these instants; repeated at every solve,
this is the exchange method for semi-infinite programs. Links that pass each other's ends give peaks
with a kink, so the instants are found by sampling finer and finer around the highest sample, not by
curvature alone.
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
"""A search watches every cell in which a check is nearer to its bound than the first [rad], and
peaks nearer than the second: the rest is looked at again when the gait has moved."""
_HELD_SHARE, _HELD_NEAR = 1e-3, 0.05
"""A check is replaced by its tangent plane where both sums have at least this share in it and where
it is nearer to its bound than this [rad]: elsewhere the gait may move far, and the plane would
forbid what is free."""
_STEP, _LARGEST, _STEPS = 1e-3, 0.1, 4
"""Of Newton's method for a moving worst instant, as shares of its cell: between the samples, and
the largest; and how many."""


def worst_instants(
    gait: AnyGait, mesh: Mesh, checks: Sequence[ShapeCheck], limit: Limit
) -> list[np.ndarray]:
    """For each check, the instant in every mesh cell where it comes closest to its bound,
    ``(n_interval,)``."""
    return [_worst(gait, mesh, check, np.arange(mesh.n), limit) for check in checks]


def near_peaks(
    gait: AnyGait, mesh: Mesh, checks: Sequence[ShapeCheck], limit: Limit
) -> list[tuple[np.ndarray, np.ndarray]]:
    """For each check, the mesh cells in which it might bind soon, and its worst instants there,
    ``(n,)`` each.

    Those are the cells in which it is near its bound (`limit` for angles, else 0), and those in
    which it has a peak.
    """
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
    """Which of the worst instants of cells move with the gait and might bind, ``(k,)`` int: those
    near their bound and off the edges of their cells. What is on an edge stays there: the next cell
    has it too."""
    near = check.excess(values, limit) > -_NEAR
    share = (times - mesh.edges[cells]) / mesh.h[cells]
    return np.flatnonzero(near & (share > _STEP) & (share < 1 - _STEP))


def followed(
    check: ShapeCheck,
    shares: np.ndarray,
    gait: AnyGait,
    times: np.ndarray,
    *,
    cells: tuple[np.ndarray, np.ndarray],
    limit: Limit,
) -> np.ndarray:
    """The worst instants of a gait near those of another one, in the same cells and with the shares
    held, ``(n,)``.

    By Newton's method on the check along the gait. `cells`: where they begin and how wide they are,
    ``(n,)`` each.
    """
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
        last, times = (
            times,
            np.clip(
                times + np.clip(move, -_LARGEST * h, _LARGEST * h), left + step, left + h - step
            ),
        )
        if np.abs(times - last).max() < _STEP * step.min():
            break
    return times


def check_values(check: ShapeCheck, gait: AnyGait, times: np.ndarray) -> np.ndarray:
    """A check along a gait, ``(n_time,)``."""
    return check.along(check.of(gait, times))


def held_shares(check: ShapeCheck, gait: AnyGait, times: np.ndarray) -> np.ndarray:
    """The share of the first sum to hold in the cut at each of the instants, or that of the check
    itself, ``(n_time,)``."""
    shapes = check.of(gait, times)
    shares = check.share(shapes)
    if check.both_ways:
        return shares
    both = (shares > _HELD_SHARE) & (shares < 1 - _HELD_SHARE)
    return np.where(both & (check.along(shapes) > -_HELD_NEAR), shares, check.itself(shapes))
