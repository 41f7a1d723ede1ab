"""Distance, work and efficiency of a smooth body over one period, with an error estimate; snapshots.

The balance is solved at the Gauss nodes of every stage of the motion (paper, eqs. theta0 to y0,
dist, W and eta); orientation and path follow by integrating the tail's velocity. Where the second
half period mirrors the first, only the first is solved: its sideways displacement and rotation are
undone, its work and advance repeated.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from scipy.integrate import cumulative_simpson

from colloc.mechanics.law import Law
from colloc.numerics.schemes import scheme
from colloc.smooth.balance import Motion, PanelGrid, SmoothSolution, solve_smooth
from colloc.system.errors import ProblemError

_STEPS_BETWEEN = 24
"""Solved instants from one snapshot to the next."""


@dataclass(frozen=True)
class Period:
    """What a smooth body achieves in a period."""

    d: float  # [body lengths]
    W: float  # against friction [weight x length]
    W_inner: float  # within the region asked for
    rotation: float  # net [rad]
    errors: dict[str, float]  # differences of d, W, W_inner, efficiency from a coarser computation
    path: np.ndarray  # tail position and orientation at the nodes, (3, n_time)
    nodes: SmoothSolution

    @property
    def efficiency(self) -> float:
        """d / W (paper, eq. eta)."""
        return self.d / self.W

    @property
    def W_outer(self) -> float:
        """Work outside the region."""
        return self.W - self.W_inner


def period(
    motion: Motion,
    friction: Law,
    delta: float,
    *,
    intervals: int = 4,
    nodes: int = 6,
    **settings: Any,
) -> Period:
    """Distance and work of one period."""
    if intervals < 1:
        raise ProblemError(f"intervals must be at least 1, not {intervals!r}.")
    unit = scheme(f"gauss-{nodes}")
    stages = np.asarray(motion.stages)
    even = np.arange(intervals) / intervals
    edges = np.append((stages[:-1, None] + np.diff(stages)[:, None] * even).ravel(), stages[-1])
    h = np.diff(edges)[:, None]
    t = edges[:-1, None] + h * unit.c
    solution = solve_smooth(motion, friction, t.ravel(), delta, **settings).require()
    u, v, omega = solution.z.reshape(3, *t.shape)

    def integral(rate: np.ndarray) -> tuple[np.ndarray, float | complex]:
        """Running integral at the nodes, and the whole."""
        steps = (h * rate) @ unit.b
        start = np.concatenate([[0.0], np.cumsum(steps)])
        return start[:-1, None] + (h * rate) @ unit.A.T, start[-1]

    theta, turned = integral(omega)
    if motion.antipodal:
        theta = theta - 0.5 * turned
    place, moved = integral((u + 1j * v) * np.exp(1j * theta))
    repeats = 2.0 if motion.antipodal else 1.0
    W, W_inner = (
        repeats * float(integral(p.reshape(t.shape))[1].real)
        for p in (solution.power, solution.power_inside)
    )
    return Period(
        2.0 * abs(moved.real) if motion.antipodal else abs(moved),
        W,
        W_inner,
        0.0 if motion.antipodal else float(turned.real),
        {},
        np.stack([place.real.ravel(), place.imag.ravel(), theta.ravel()]),
        solution,
    )


def measured_period(
    motion: Motion,
    friction: Law,
    delta: float,
    *,
    intervals: int = 8,
    order: int = 8,
    **settings: Any,
) -> Period:
    """`period`, with its difference from half the intervals in time and two orders less in arc
    length as the error."""
    fine = period(motion, friction, delta, intervals=intervals, order=order, **settings)
    coarse = period(
        motion, friction, delta, intervals=max(1, intervals // 2), order=order - 2, **settings
    )
    names = ("d", "W", "W_inner", "efficiency")
    return replace(
        fine, errors={name: abs(getattr(fine, name) - getattr(coarse, name)) for name in names}
    )


class Snapshots(NamedTuple):
    """Curves in the lab frame, the net displacement along the x axis."""

    t: np.ndarray
    x: np.ndarray
    y: np.ndarray


def snapshots(
    motion: Motion, friction: Law, delta: float, count: int = 10, panels: int = 100
) -> Snapshots:
    """The body at `count` + 1 equally spaced phases of one period (paper, eqs. theta0 to y0).

    For drawing: velocities are integrated by Simpson's rule on a uniform grid, panels are refined
    to 1e-7 only. `count` is even; of an antipodal motion half a period is solved.
    """
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
    # SciPy 1.13 knows no complex numbers here
    x, y = cumulative_simpson([rate.real, rate.imag], x=t, initial=0.0)
    tail = x + 1j * y
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
