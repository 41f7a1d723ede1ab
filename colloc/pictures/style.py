"""What all figures share: colours that colour-blind readers tell apart, sizes, saving, bodies with arrows."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np

BLACK, ORANGE, SKY, GREEN, YELLOW, BLUE, VERMILION, PURPLE = (
    "#000000",
    "#E69F00",
    "#56B4E9",
    "#009E73",
    "#F0E442",
    "#0072B2",
    "#D55E00",
    "#CC79A7",
)
"""The palette of Okabe and Ito."""
VELOCITY, FORCE = BLUE, VERMILION
SEQUENTIAL, DIVERGING = "viridis", "cividis"
_STYLE: Any = {
    "font.size": 9,
    "axes.titlesize": 9,
    "axes.labelsize": 9,
    "legend.fontsize": 8,
    "legend.frameon": False,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "figure.dpi": 110,
    "savefig.dpi": 180,
    "pdf.fonttype": 42,
    "figure.constrained_layout.use": True,
}


@contextmanager
def styled() -> Iterator[None]:
    """The common style, for figures made inside."""
    with plt.rc_context(_STYLE):
        yield


def save(figure: Any, folder: Path, name: str) -> list[Path]:
    """Write a figure as PNG and PDF, close it, and return both paths."""
    folder.mkdir(parents=True, exist_ok=True)
    paths = [folder / f"{name}.png", folder / f"{name}.pdf"]
    for path in paths:
        figure.savefig(path, metadata={"CreationDate": None} if path.suffix == ".pdf" else None)
    plt.close(figure)
    return paths


def letter(axes: Any, text: str) -> None:
    """A bold panel letter at the upper left, outside the axes."""
    if axes.name == "3d":
        axes.text2D(-0.02, 1.0, text, transform=axes.transAxes, fontweight="bold", va="bottom")
    else:
        axes.text(-0.02, 1.02, text, transform=axes.transAxes, fontweight="bold", va="bottom", ha="right")


def bare(axes: Any) -> None:
    """Equal scales, no frame."""
    axes.set_aspect("equal")
    axes.set_axis_off()


def arrows(axes: Any, x: np.ndarray, y: np.ndarray, vx: np.ndarray, vy: np.ndarray, scale: float, colour: str) -> None:
    """Arrows of length `scale` times the vector, in data units."""
    axes.quiver(
        x, y, scale * vx, scale * vy, color=colour, angles="xy", scale_units="xy", scale=1,
        width=0.004, headwidth=4, headlength=5, zorder=3,
    )  # fmt: skip


def snapshot_colours(count: int) -> np.ndarray:
    """Colours from light (first) to dark (last)."""
    return plt.get_cmap("cividis_r")(np.linspace(0.05, 0.95, count))
