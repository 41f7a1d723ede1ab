"""Figures of the smooth-body studies: optimised against prescribed crawlers, and chains against smooth bodies."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib import colormaps

from colloc.gaits.polygon import Corners
from colloc.pictures.style import BLUE, GREEN, VERMILION, save, styled, subplots
from colloc.smooth.crawler_body import CrawlerBody


def _region_curves(body: CrawlerBody, gait: Corners, times: np.ndarray) -> np.ndarray:
    """The bump region at some times seen from its rear end, in units of epsilon, ``(n, n_time)`` complex."""
    s = np.linspace(0.5 - body.epsilon, 0.5 + body.epsilon, 801)
    angle = body.angle(s, gait.angles(times))
    steps = 0.5 * (np.exp(1j * angle[1:]) + np.exp(1j * angle[:-1])) * (s[1] - s[0]) / body.epsilon
    return np.concatenate([np.zeros((1, times.size)), np.cumsum(steps, axis=0)])


def crawler_comparison(
    body: CrawlerBody,
    prescribed: Corners,
    optimised: Corners,
    epsilons: np.ndarray,
    efficiencies: dict[str, np.ndarray],
    folder: Path,
) -> list[Path]:
    """Shapes of the bump region over half a period, and the distance of the efficiency from 1 against epsilon.

    Parameters
    ----------
    body : CrawlerBody
    prescribed, optimised : Corners
        The two crawlers to draw.
    epsilons : (k,)
    efficiencies : dict of str to (k,)
        For "prescribed" and "optimised".
    folder : Path
    """
    with styled():
        figure, axes = subplots(1, 3, figsize=(9.5, 3.6), width_ratios=(1, 1, 1.5))
        figure.suptitle("The bump region at phases from 0 to 1/2", x=0.02, ha="left", fontsize=9)
        times = np.linspace(0.0, 0.4999, 9)
        colours = colormaps["viridis"](np.linspace(0.0, 0.9, times.size))
        for ax, gait, title in zip(axes, (prescribed, optimised), ("A  prescribed", "B  optimised"), strict=False):
            curves = _region_curves(body, gait, times)
            for k, colour in enumerate(colours):
                ax.plot(curves[:, k].real, curves[:, k].imag - 0.75 * k, color=colour, lw=1.6)
                ax.text(-0.12, -0.75 * k, f"{times[k]:.2f}", ha="right", va="center", fontsize=7)
            ax.set_title(title, loc="left")
            ax.set_aspect("equal")
            ax.set_axis_off()
        for (name, values), colour, marker in zip(efficiencies.items(), (BLUE, VERMILION), "os", strict=True):
            axes[2].loglog(epsilons, 1 - values, marker=marker, color=colour, label=name)
        guide = np.array([epsilons.min(), epsilons.max()])
        axes[2].loglog(guide, 0.6 * guide, "k--", lw=0.8, label=r"slope 1")
        axes[2].set_xlabel(r"half-width of the bump region, $\epsilon$")
        axes[2].set_ylabel("1 - efficiency")
        axes[2].set_title("C  distance from the bound", loc="left")
        axes[2].legend()
        return save(figure, folder / "crawlers_optimised")


def chain_convergence(links: np.ndarray, errors: dict[float, np.ndarray], folder: Path) -> list[Path]:
    """Relative excess of the work of chains over that of the smooth body against the number of links, by mu_t."""
    with styled():
        figure, ax = subplots(figsize=(4.2, 3.2))
        for (mu, error), colour, marker in zip(errors.items(), (BLUE, GREEN, VERMILION), "osD", strict=True):
            ax.loglog(links, np.abs(error), marker=marker, color=colour, ms=4, label=rf"$\mu_t = {mu:g}$")
            if mu > 1:
                ax.loglog(links, mu * 2 * np.pi**2 / (12 * links**2), color=colour, lw=0.8, ls="--")
        ax.set_xlabel("links")
        ax.set_ylabel(r"$|W / W_{\rm smooth} - 1|$")
        ax.set_title(r"wave B; dashed $\mu_t \langle\kappa^2\rangle / (12 n^2)$", loc="left")
        ax.legend()
        return save(figure, folder / "chain_convergence")
