"""Where a gait comes closest to the bounds on its shapes: one instant for every check in every mesh cell.

An inequality between nodes is kept by constraining it at these instants; repeated at every solve, this is the exchange
method for semi-infinite programs. Links that pass each other's ends give peaks with a kink, so the instants are found by
sampling finer and finer around the highest sample, not by curvature alone.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from colloc.collocation.shape_checks import ShapeCheck
from colloc.gaits.path_samples import Gait
from colloc.numerics.mesh import Mesh

_SAMPLES = 16
_ZOOMS = 3
"""Every zoom samples 8 times as densely. On a cell of 1/40 of a period the last samples are 3e-6 periods apart, within
which angles change by far less than the width over which a kink is smoothed."""
_HELD_SHARE, _HELD_NEAR = 1e-3, 0.05
"""A check is replaced by its tangent plane where both sums have at least this share in it and where it is nearer to its bound
than this [rad]: elsewhere the gait may move far, and the plane would forbid what is free."""


def worst_instants(gait: Gait, mesh: Mesh, checks: Sequence[ShapeCheck]) -> list[np.ndarray]:
    """For each check, the instant in every mesh cell where it comes closest to its bound, ``(n_interval,)``."""
    return [_worst(gait, mesh, check) for check in checks]


def _worst(gait: Gait, mesh: Mesh, check: ShapeCheck) -> np.ndarray:
    cells, fine = np.arange(mesh.n), np.linspace(0.0, 1.0, _SAMPLES + 1)
    left, width = mesh.edges[:-1], mesh.h
    for zoom in range(_ZOOMS + 1):
        times = left[:, None] + width[:, None] * fine
        values = check_values(check, gait, times.ravel()).reshape(times.shape)
        if check.name.startswith("joint"):
            values = np.abs(values)
        best = np.argmax(values, axis=1)
        inner = np.clip(best, 1, _SAMPLES - 1)
        if zoom < _ZOOMS:
            left, width = times[cells, inner - 1], 2 * width / _SAMPLES
    # one parabola through the best sample and its neighbours places a smooth maximum inside to O(step^4)
    low, mid, high = (values[cells, inner + k] for k in (-1, 0, 1))
    curvature = low - 2 * mid + high
    with np.errstate(divide="ignore", invalid="ignore"):
        offset = np.where(curvature < 0, 0.5 * (low - high) / curvature, 0.0)
    offset = np.where(best == inner, np.clip(offset, -1, 1), 0.0)
    return times[cells, best] + offset * width / _SAMPLES


def check_values(check: ShapeCheck, gait: Gait, times: np.ndarray) -> np.ndarray:
    """A check along a gait, ``(n_time,)``."""
    return np.array(check.value.map(times.size)(gait.angles(times))).ravel()


def held_shares(check: ShapeCheck, gait: Gait, times: np.ndarray) -> np.ndarray:
    """The share of the first sum to hold in the cut at each of the instants, or -1 for the check itself, ``(n_time,)``."""
    angles = gait.angles(times)
    shares = np.array(check.share.map(times.size)(angles)).ravel()
    both = (shares > _HELD_SHARE) & (shares < 1 - _HELD_SHARE)
    return np.where(both & (check_values(check, gait, times) > -_HELD_NEAR), shares, -1.0)
