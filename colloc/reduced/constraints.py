"""What keeps gaits in their class: rows at the worst instants of one gait, as a value."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

Function = Callable[[np.ndarray], np.ndarray]


@dataclass(frozen=True, eq=False)
class Constraints:
    """``lower <= values(v) <= upper``: checks of the shape at the worst instants of one gait, and
    what else a class asks.

    Attributes
    ----------
    kinds : dict
        The rows in order: of each kind, those of the full program's rows of that name that are
        among them.
    lower, upper : (n_row,)
    excess : float
        How far the gait exceeds any bound at its worst instants [rad, body lengths, or relative to
        a largest speed].
    values : callable
        Of parameters ``(n,)``: the rows, ``(n_row,)``.
    slopes : callable
        Of parameters: derivatives of the rows, ``(n_row, n)``.
    moving : callable, optional
        Makes the same rows at the worst instants of whatever gait they are asked for, in the mesh
        cells where they stand. As long as such an instant is not on an edge, their slopes are the
        same.
    """

    kinds: dict[str, np.ndarray]
    lower: np.ndarray
    upper: np.ndarray
    excess: float
    values: Function
    slopes: Function
    moving: Callable[[], Constraints] | None = None

    def following(self) -> Constraints:
        """The rows as the worst instants move with the gait; themselves where those do not."""
        return self if self.moving is None else self.moving()

    def through(self, full: Function, slopes: Function) -> Constraints:
        """The rows of other parameters v, from which these, ``full(v)``, follow with derivatives
        ``slopes(v)``."""

        def moving() -> Constraints:
            return self.following().through(full, slopes)

        return replace(
            self,
            values=lambda v: self.values(full(v)),
            slopes=lambda v: self.slopes(full(v)) @ slopes(v),
            moving=moving,
        )
