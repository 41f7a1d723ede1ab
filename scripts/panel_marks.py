"""Marks on panels of figures that only scripts draw."""

from __future__ import annotations

from typing import Any

import numpy as np


def letter(axes: Any, text: str) -> None:
    """A bold panel letter at the upper left, outside the axes."""
    if axes.name == "3d":
        axes.text2D(-0.02, 1.0, text, transform=axes.transAxes, fontweight="bold", va="bottom")
    else:
        axes.text(
            -0.02, 1.02, text, transform=axes.transAxes, fontweight="bold", va="bottom", ha="right"
        )


def bare(axes: Any) -> None:
    """Equal scales, no frame."""
    axes.set_aspect("equal")
    axes.set_axis_off()


def arrows(
    axes: Any,
    x: np.ndarray,
    y: np.ndarray,
    vx: np.ndarray,
    vy: np.ndarray,
    scale: float,
    colour: str,
) -> None:
    """Arrows of length `scale` times the vector, in data units."""
    axes.quiver(
        x, y, scale * vx, scale * vy, color=colour, angles="xy", scale_units="xy", scale=1,
        width=0.004, headwidth=4, headlength=5, zorder=3,
    )  # fmt: skip
