"""Work-precision pictures: error against processor time."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from colloc.pictures.style import BLACK, BLUE, GREEN, ORANGE, PURPLE, SKY, VERMILION, save, styled, subplots

_COLOURS = (BLUE, VERMILION, GREEN, ORANGE, PURPLE, SKY, BLACK)
_MARKERS = "osD^vPX"

Series = Mapping[str, tuple[np.ndarray, np.ndarray]]
"""Name of a scheme to processor seconds and relative errors."""


def save_work_precision(folder: Path, name: str, uniform: Series, refined: Series, title: str) -> list[Path]:
    """Errors on uniform and on refined meshes against processor time, one colour a scheme; PNG and PDF."""
    with styled():
        figure, axes = subplots(figsize=(6.6, 4.4))
        for index, scheme in enumerate(uniform):
            style = {"color": _COLOURS[index % len(_COLOURS)], "marker": _MARKERS[index % len(_MARKERS)], "ms": 5}
            axes.loglog(*uniform[scheme], ls=":", mfc="white", **style)
            if scheme in refined:
                axes.loglog(*refined[scheme], ls="-", label=scheme, **style)
        axes.plot([], [], ":", color=BLACK, marker="o", mfc="white", label="uniform meshes")
        axes.plot([], [], "-", color=BLACK, marker="o", label="refined")
        axes.set(xlabel="processor time [s]", ylabel="relative error of the efficiency", title=title)
        ticks = [0.1, 0.2, 0.5, 1, 2, 5, 10, 20, 50]
        low, high = axes.get_xlim()
        axes.set_xticks([t for t in ticks if low <= t <= high], [f"{t:g}" for t in ticks if low <= t <= high])
        axes.set_xticks([], minor=True)
        axes.legend(loc="center left", bbox_to_anchor=(1.0, 0.5))
        axes.grid(alpha=0.25)
        return save(figure, folder / name)
