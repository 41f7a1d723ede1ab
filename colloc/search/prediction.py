"""Where the optimum is expected at the next delta: a secant through the levels passed, on this mesh or on the last one."""

from __future__ import annotations

import numpy as np

_LARGEST_MOVE = 0.5


class Track:
    """Optima passed on the way down in delta.

    Close to an optimum the gait moves almost linearly in delta, and a mesh displaces it almost equally at all of them. From
    the predicted gait Newton steps converge at once where, from the last one, they would have to pass the kinks between.
    """

    def __init__(self) -> None:
        self._here: list[tuple[float, np.ndarray]] = []
        self._before: list[tuple[float, np.ndarray]] = []

    def __bool__(self) -> bool:
        return bool(self._here or self._before)

    def record(self, delta: float, parameters: np.ndarray) -> None:
        """Note an optimum on the current mesh."""
        self._here.append((delta, parameters))

    def remeshed(self) -> None:
        """Another mesh follows; what the last one showed serves until the new one has shown two levels."""
        if len(self._here) > 1:
            self._before = self._here
        self._here = []

    def move(self, delta: float) -> np.ndarray | float:
        """Expected change of the gait parameters from the last optimum to the one at delta; 0 if nothing is known [rad]."""
        if len(self._here) > 1:
            (d0, p0), (d1, p1) = self._here[-2:]
            known = delta < d1 < d0
            move = (p1 - p0) * ((delta - d1) / (d1 - d0)) if known else np.zeros_like(p1)
        elif self._here and self._before:
            move = self._interpolated(delta) - self._interpolated(self._here[-1][0])
        else:
            return 0.0
        return move if np.abs(move).max() < _LARGEST_MOVE else 0.0

    def _interpolated(self, delta: float) -> np.ndarray:
        """The last mesh's optimum at delta, ``(n_parameter,)``; beyond its levels the nearest of them."""
        levels = sorted(self._before, key=lambda level: level[0])
        deltas = [d for d, _ in levels]
        return np.array([np.interp(delta, deltas, column) for column in np.array([p for _, p in levels]).T])
