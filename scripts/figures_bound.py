"""Figures of the upper bound and of infinitesimal gaits."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from colloc.pictures.style import save, styled, subplots


def save_small_gait_map(path: Path, axis: np.ndarray, efficiency: np.ndarray, title: str) -> None:
    """Efficiency of the best infinitesimal gait over (angle 1, angle 2); NaN where links cross. Saves PNG and PDF."""
    with styled():
        figure, axes = subplots(figsize=(5.6, 4.6))
        image = axes.pcolormesh(axis, axis, efficiency.T, cmap="viridis", shading="nearest", rasterized=True)
        lines = axes.contour(axis, axis, efficiency.T, levels=np.arange(0.05, 1.0, 0.05), colors="white", linewidths=0.6)
        figure.colorbar(image, label="efficiency d/W of the best small gait").add_lines(lines)
        axes.set(xlabel="joint angle 1 [rad]", ylabel="joint angle 2 [rad]", title=title, aspect="equal")
    save(figure, path.with_suffix(""))
