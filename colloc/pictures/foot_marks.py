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
        self._kinds, self._marks = np.array(kinds), {}
        for kind in dict.fromkeys(kinds):
            look: dict[str, Any] = {"marker": "s", "ls": ""} if kind == FOOT else {}
            colour = GREEN if kind == WHEEL else VERMILION

            def line(colour: str, size: float, cap: Any, look: dict[str, Any] = look) -> Any:
                look = {"ms": size, "lw": size, "solid_capstyle": cap, "zorder": 3, **look}
                return axes.plot([], [], color=colour, **look)[0]

            filled, hollow = line(colour, size, "projecting"), line("white", 0.55 * size, "butt")
            self._marks[kind] = (filled, hollow)

    def place(self, places: np.ndarray, held: np.ndarray) -> None:
        """Put them at places ``(2, 2, n_foot)``, as both ends; those that do not hold ``(n_foot,)``
        are hollow."""
        # no line from foot to foot
        apart = np.concatenate([places, np.full_like(places[:, :1], np.nan)], axis=1)
        for kind, (filled, hollow) in self._marks.items():
            of_kind = self._kinds == kind
            for line, chosen in ((filled, of_kind), (hollow, of_kind & ~held)):
                line.set_data(*apart[..., chosen].transpose(0, 2, 1).reshape(2, -1))

    def key(self) -> dict[str, Any]:
        """Words of a legend to what it shows."""
        last = next(reversed(self._marks), "")
        words = {kind: f"{kind} (filled: holds)" if kind == last else kind for kind in self._marks}
        return {words[kind]: marks for kind, marks in self._marks.items()}
