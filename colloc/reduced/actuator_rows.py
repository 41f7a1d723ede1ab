"""Limits of the actuators as rows of the reduced program.

Rows stand at the points of the mesh. By as much as the largest value in an interval exceeds that at
its points, less is allowed there; measured again whenever the rows are placed, this leaves no
excess once the gait settles.
"""

from __future__ import annotations

import numpy as np

from colloc.mechanics.densities import PathLimits
from colloc.numerics.peaks import SAMPLES, curvature_of_moving, peaks
from colloc.reduced.motion import ReducedMotion

_INSIDE = np.linspace(1e-9, 1 - 1e-9, SAMPLES + 1)
"""Samples of an interval; rates may jump at its ends."""
_NEAR = 0.3
"""Distance from the bound, over the limit, from which a value is no row."""
_ZOOMS, _CLOSE = 1, 0.02
"""Values this close to their limit are zoomed into between the samples."""
_SHIFT, _STEP = 1e-2, 1e-5
"""Shift of a peak in its interval, and step of parameters for differences."""
_EXACT = 3e-5
"""Relative excess that counts as none, less than a certificate allows."""


class ActuatorRows:
    """Shares of the limits at the points of a mesh, as functions of a gait's parameters.

    Attributes
    ----------
    lower, upper : (n_share, n_point)
    placed : (2, n_row)
        Share and point of each row.
    """

    def __init__(
        self,
        motion: ReducedMotion,
        limits: PathLimits,
    ) -> None:
        self._motion, self._limits = motion, limits
        self.placed = np.empty((2, 0), dtype=int)
        shape = len(limits.names), motion.mesh.n_point
        self.lower, self.upper = np.tile(limits.least[:, None], shape[1]), np.ones(shape)

    def place(self, v: np.ndarray, delta: float) -> float:
        """Choose the rows for the gait v; return how far it exceeds any limit, relative."""
        mesh = self._motion.mesh
        here = self._limits.sizes(self._all(v, delta))
        largest = self._largest(v, delta)
        between = np.maximum(largest - here[:, mesh.points].max(axis=2), 0.0)
        lowered = np.zeros_like(here)
        for points in mesh.points.T:  # neighbours may share a point
            lowered[:, points] = np.maximum(lowered[:, points], between)
        # a gait may do several times what is allowed, between points alone
        self.upper = np.maximum(1.0 - lowered, 0.0)
        self.lower = np.where(np.isfinite(self.lower), -self.upper, self.lower)
        self.placed = np.stack(np.nonzero(here > self.upper - _NEAR))
        excess = float(largest.max()) - 1.0
        return excess if excess > _EXACT or np.isnan(excess) else 0.0

    def _largest(self, v: np.ndarray, delta: float) -> np.ndarray:
        """Largest shares in every interval, ``(n_share, n)``."""
        mesh = self._motion.mesh
        t = mesh.edges[:-1, None] + mesh.h[:, None] * _INSIDE
        found = self._limits.sizes(self._signed_at(v, delta, t.ravel())).reshape(-1, *t.shape)
        largest = found.max(axis=2)
        share, interval = np.nonzero(largest > 1.0 - _CLOSE)
        if share.size:
            each = np.arange(share.size)
            near = np.clip(found[share, interval].argmax(axis=1), 1, SAMPLES - 1)
            left, right = t[interval, near - 1], t[interval, near + 1]

            def own(t: np.ndarray) -> np.ndarray:
                return self._limits.sizes(self._signed_at(v, delta, t.ravel())).reshape(
                    -1, *t.shape
                )[share, each]

            largest[share, interval] = np.maximum(
                largest[share, interval], peaks(own, left, right - left, _ZOOMS)[1]
            )
        return largest

    def _signed_at(self, v: np.ndarray, delta: float, t: np.ndarray) -> np.ndarray:
        return self._motion.shares(self._limits, v, delta, t)

    def of_moving_peaks(self, v: np.ndarray, delta: float, on_rows: np.ndarray) -> np.ndarray:
        """Part ``(n, n)`` of the Lagrangian's second derivatives that is due to peaks between the
        points which move with the gait (`colloc.reduced.second_order`)."""
        held = np.flatnonzero(on_rows)
        if held.size == 0:
            return np.zeros((v.size, v.size))
        (share, point), on_rows = self.placed[:, held], on_rows[held]
        mesh = self._motion.mesh
        interval = (mesh.points[:, :, None] == point).any(axis=1).argmax(axis=0)
        each, left, width = np.arange(held.size), mesh.edges[interval], mesh.h[interval]
        edge = _INSIDE[0] * width

        def shares(at: np.ndarray, t: np.ndarray) -> np.ndarray:
            """Of every row ``(n_row, k)``, for parameters and phases of that shape."""
            return self._signed_at(at, delta, t.ravel()).reshape(-1, *t.shape)[share, each]

        peak, _ = peaks(lambda t: np.abs(shares(v, t)), left + edge, width - 2 * edge)
        t = peak[:, None] + _SHIFT * width[:, None] * np.array([-1.0, 0.0, 1.0])
        steps = _STEP * np.eye(v.size)
        slopes = np.array([shares(v + step, t) - shares(v - step, t) for step in steps]) / (
            2 * _STEP
        )
        return curvature_of_moving(on_rows, shares(v, t).T, slopes.transpose(2, 1, 0))

    def _all(self, v: np.ndarray, delta: float) -> np.ndarray:
        return self._motion.shares(self._limits, v, delta)

    def bounds(self) -> tuple[np.ndarray, np.ndarray]:
        return self.lower[tuple(self.placed)], self.upper[tuple(self.placed)]

    def values(self, v: np.ndarray, delta: float) -> np.ndarray:
        return self._all(v, delta)[tuple(self.placed)]

    def slopes(self, v: np.ndarray, delta: float) -> np.ndarray:
        """Derivatives of the rows, ``(n_row, n)``."""
        if not self.placed.size:
            return np.empty((0, v.size))
        return self._motion.share_slopes(self._limits, v, delta, self.placed)

    def every_bound(self) -> tuple[np.ndarray, np.ndarray]:
        """Bounds at all points, in the order of the full program's rows."""
        return self.lower.T.ravel(), self.upper.T.ravel()

    def multipliers(self, on_rows: np.ndarray) -> np.ndarray:
        """Multipliers of the full program's rows, from those of these."""
        found = np.zeros(self.upper.shape)
        found[tuple(self.placed)] = on_rows
        return found.T.ravel()
