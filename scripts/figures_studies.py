"""The friction plane: which kind of gait is best, and how efficient it is."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.colors import BoundaryNorm, ListedColormap, LogNorm
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from colloc.pictures.style import GREEN, ORANGE, SEQUENTIAL, SKY, styled, subplots
from colloc.studies.gait_class import DIRECT, RETROGRADE, STANDING
from scripts.panel_marks import letter

KINDS = (RETROGRADE, STANDING, DIRECT)
_COLOURS = {RETROGRADE: SKY, STANDING: ORANGE, DIRECT: GREEN}
_MARKERS = {"both": "o", "bilateral": "s", "antipodal": "^", "none": "x"}


def _edges(values: np.ndarray) -> np.ndarray:
    """Borders of cells about values that are evenly spaced in the logarithm."""
    steps = np.log(values)
    middle = 0.5 * (steps[1:] + steps[:-1])
    return np.exp(np.concatenate([[1.5 * steps[0] - 0.5 * steps[1]], middle, [1.5 * steps[-1] - 0.5 * steps[-2]]]))


def _plane(axes: Any, x: np.ndarray, y: np.ndarray) -> None:
    axes.set(xscale="log", yscale="log", xlabel=r"$\mu_t/\mu_f$", ylabel=r"$\mu_b/\mu_f$")
    axes.set_xlim(*_edges(x)[[0, -1]])
    axes.set_ylim(*_edges(y)[[0, -1]])


def friction_plane_figure(
    mu_t: np.ndarray,
    mu_b: np.ndarray,
    efficiency: np.ndarray,
    kind: np.ndarray,
    symmetry: np.ndarray,
    small: np.ndarray,
) -> Any:
    """Three panels over the plane.

    Parameters
    ----------
    mu_t, mu_b : (n,), (m,)
        Coefficients relative to mu_f.
    efficiency : (n, m)
        Of the best certified gait, mu_f d/W; NaN where there is none.
    kind, symmetry : (n, m) of str
        "retrograde", "standing" or "direct"; "both", "bilateral", "antipodal" or "none". "" where there is none.
    small : (n, m) of bool
        Gaits at the smallest shape speed that was allowed.
    """
    x, y = _edges(mu_t), _edges(mu_b)
    with styled():
        figure, (left, middle, right) = subplots(1, 3, figsize=(11.4, 3.9))
        codes = np.full(kind.shape, np.nan)
        for code, name in enumerate(KINDS):
            codes[kind == name] = code
        colours = ListedColormap([_COLOURS[name] for name in KINDS])
        left.pcolormesh(x, y, codes.T, cmap=colours, norm=BoundaryNorm([-0.5, 0.5, 1.5, 2.5], 3), alpha=0.75)
        handles: list[Any] = [Patch(color=_COLOURS[name], alpha=0.75, label=f"{name} wave") for name in KINDS]
        for name, marker in _MARKERS.items():
            i, j = np.nonzero(symmetry == name)
            if i.size:
                size = np.where(small[i, j], 5.0, 22.0)
                left.scatter(mu_t[i], mu_b[j], s=size, marker=marker, c="black", linewidths=0.8)
                label = {"both": "bilateral and antipodal", "none": "no symmetry"}.get(name, name)
                handles.append(Line2D([], [], marker=marker, color="black", ls="", ms=4.5, label=label))
        if small.any():
            handles.append(Line2D([], [], marker="o", color="black", ls="", ms=2, label="small symbol: small strokes"))
        figure.legend(handles=handles, loc="outside lower left", ncols=4)
        left.set_title("kind and symmetry of the best gait")
        shown = middle.pcolormesh(x, y, efficiency.T, cmap=SEQUENTIAL, norm=LogNorm())
        _contours(middle, mu_t, mu_b, efficiency)
        figure.colorbar(shown, ax=middle, label=r"$\mu_f\, d/W$")
        middle.set_title("its efficiency, certified")
        trivial = 1.0 / np.minimum(1.0, np.minimum.outer(mu_t, mu_b))
        gap = right.pcolormesh(x, y, (efficiency / trivial).T, cmap=SEQUENTIAL, vmin=0, vmax=1)
        figure.colorbar(gap, ax=right, label=r"efficiency $\times\ \min(\mu)/\mu_f$")
        right.set_title("over the bound 1/min($\\mu$)")
        for axes, name in zip((left, middle, right), "abc", strict=True):
            _plane(axes, mu_t, mu_b)
            letter(axes, name)
    return figure


def _contours(axes: Any, mu_t: np.ndarray, mu_b: np.ndarray, efficiency: np.ndarray) -> None:
    levels = [0.1, 0.15, 0.2, 0.3, 0.5, 0.7, 1.0, 1.5, 2.0]
    drawn = axes.contour(mu_t, mu_b, efficiency.T, levels=levels, colors="white", linewidths=0.7)
    axes.clabel(drawn, fontsize=7, fmt="%g")
