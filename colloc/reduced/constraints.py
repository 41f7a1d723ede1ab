"""Path constraints of gaits as rows at the worst instants of one gait."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

Function = Callable[[np.ndarray], np.ndarray]


@dataclass(frozen=True, eq=False)
class Constraints:
    """``lower <= values(v) <= upper``: shape constraints at the worst instants of one gait.

    Attributes
    ----------
    kinds : dict
        Name to the full program's rows of that name that are among these, in order.
    lower, upper : (n_row,)
    excess : float
        How far the gait exceeds any bound [rad, body lengths, or relative to a largest speed].
    values, slopes : callable
        Parameters ``(n,)`` to the rows ``(n_row,)`` and their derivatives ``(n_row, n)``.
    moving : callable, optional
        Makes the same rows at the worst instants of whatever gait they are evaluated at.
    """

    kinds: dict[str, np.ndarray]
    lower: np.ndarray
    upper: np.ndarray
    excess: float
    values: Function
    slopes: Function
    moving: Callable[[], Constraints] | None = None

    def following(self) -> Constraints:
        """Rows that follow the worst instants of the gait, where they can."""
        return self if self.moving is None else self.moving()

    def through(self, full: Function, slopes: Function) -> Constraints:
        """Rows of other parameters v, by the chain rule through ``full(v)``."""

        def moving() -> Constraints:
            return self.following().through(full, slopes)

        return replace(
            self,
            values=lambda v: self.values(full(v)),
            slopes=lambda v: self.slopes(full(v)) @ slopes(v),
            moving=moving,
        )
