"""Distance, work and efficiency of a smooth body over one period, with an error estimate.

The balance is solved at the Gauss nodes of every stage of the motion (paper, eqs. theta0 to y0,
dist, W and eta); orientation and path follow by integrating the tail's velocity. Where the second
half period mirrors the first, only the first is solved: its sideways displacement and rotation are
undone, its work and advance repeated.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from colloc.mechanics.law import Law
from colloc.numerics.schemes import scheme
from colloc.smooth.balance import Motion, SmoothSolution, solve_smooth
from colloc.system.errors import ProblemError


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
