"""Snapshots of a smooth body's motion in the lab frame over one period."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.integrate import cumulative_simpson

from colloc.mechanics.friction import Friction
from colloc.smooth.balance import Motion, PanelGrid, solve_smooth
from colloc.system.errors import ProblemError

_STEPS_BETWEEN = 24
"""Solved instants from one snapshot to the next."""


class Snapshots(NamedTuple):
    """Curves in the lab frame, the net displacement along the x axis."""

    t: np.ndarray
    x: np.ndarray
    y: np.ndarray


def snapshots(
    motion: Motion, friction: Friction, delta: float, count: int = 10, panels: int = 100
) -> Snapshots:
    """The body at `count` + 1 equally spaced phases of one period (paper, eqs. theta0 to y0).

    For drawing: velocities are integrated by Simpson's rule on a uniform grid, panels are refined
    to 1e-7 only. `count` is even; of an antipodal motion half a period is solved.
    """
    if count < 2 or count % 2:
        raise ProblemError(f"count must be even and at least 2, not {count!r}.")
    t = np.linspace(0.0, 1.0, _STEPS_BETWEEN * count + 1)
    half = t.size // 2
    solved = t[: half + 1] if motion.antipodal else t
    z = solve_smooth(motion, friction, solved, delta, quadrature_tolerance=1e-7).require().z
    if motion.antipodal:
        z = np.concatenate([z, np.array([[1.0], [-1.0], [-1.0]]) * z[:, 1:]], axis=1)
    theta = cumulative_simpson(z[2], x=t, initial=0.0)
    if motion.antipodal:
        theta = theta - 0.5 * theta[half]  # the path then advances along x
    rate = (z[0] + 1j * z[1]) * np.exp(1j * theta)
    tail = cumulative_simpson(rate.real, x=t, initial=0.0) + 1j * cumulative_simpson(
        rate.imag, x=t, initial=0.0
    )

    keep = slice(None, None, _STEPS_BETWEEN)
    grid = PanelGrid(np.linspace(0.0, 1.0, panels + 1)[:, None] * np.ones((1, count + 1)))
    angle = motion.angle(grid.nodes, t[keep])
    x, y = (grid.integrate(grid.widths * part, 0) for part in (np.cos(angle), np.sin(angle)))
    lab = tail[keep] + (x + 1j * y) * np.exp(1j * theta[keep])
    if abs(tail[-1]) > 1e-9:
        advance = np.angle(tail[-1])
        # antipodal paths lie along x already, up to rounding; seen from the other side they advance
        # to the right
        lab = lab * np.exp(-1j * (np.pi * round(advance / np.pi) if motion.antipodal else advance))
    return Snapshots(t[keep], lab.real, lab.imag)
