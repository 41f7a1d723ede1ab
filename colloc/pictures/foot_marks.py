"""How what a body stands on is drawn: feet as squares, wheels as bars along their rolling
direction, pads as bars along their link; hollow while they slide."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes

from colloc.mechanics.feet import FOOT, WHEEL
from colloc.pictures.style import GREEN, VERMILION


class FootMarks:
    """The feet of a body, wheels and pads among them, on axes.

    Parameters
    ----------
    axes : Axes
    kinds : sequence of str
        Of each foot (`colloc.mechanics.feet.Foot.kind`).
    size : float
        Of the marks [points].
    """

    def __init__(self, axes: Axes, kinds: Sequence[str], size: float) -> None:
        self._kinds = np.array(kinds)
        self._marks = {}
        for kind in dict.fromkeys(kinds):
            look: dict[str, Any] = {"marker": "s", "ls": ""} if kind == FOOT else {}
            self._marks[kind] = [
                axes.plot(
                    [],
                    [],
                    color=colour,
                    ms=part * size,
                    lw=part * size,
                    solid_capstyle=cap,
                    zorder=3,
                    **look,
                )[0]
                for colour, part, cap in (
                    (GREEN if kind == WHEEL else VERMILION, 1.0, "projecting"),
                    ("white", 0.55, "butt"),
                )
            ]

    def place(self, places: np.ndarray, held: np.ndarray) -> None:
        """Put them at places ``(2, 2, n_foot)``, as both ends; those that do not hold ``(n_foot,)``
        are hollow."""
        # no line from foot to foot
        apart = np.concatenate([places, np.full_like(places[:, :1], np.nan)], axis=1)
        for kind, (whole, hollow) in self._marks.items():
            for line, chosen in (
                (whole, self._kinds == kind),
                (hollow, (self._kinds == kind) & ~held),
            ):
                line.set_data(*apart[..., chosen].transpose(0, 2, 1).reshape(2, -1))

    def key(self) -> dict[str, Any]:
        """What a legend says to what it shows."""
        last = next(reversed(self._marks), "")
        return {
            f"{kind} (filled: holds)" if kind == last else kind: tuple(marks)
            for kind, marks in self._marks.items()
        }
