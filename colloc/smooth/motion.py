"""Prescribed motions of a smooth body: tangent angle and rate as functions of arc length and
phase."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from colloc.system.errors import ProblemError

Field = Callable[[np.ndarray, np.ndarray], np.ndarray]
"""Arc length ``(n_body, n_time)`` and phase ``(n_time,)`` to values ``(n_body, n_time)``."""


@dataclass(frozen=True, eq=False)
class Motion:
    """A periodic motion Theta(s, t).

    angle, rate: Theta [rad] and its time derivative [rad/period]. breaks: phase ``(n_time,)`` to
    arc lengths ``(n_break, n_time)`` where Theta is not smooth; panels end there. stages: phases
    from 0 to `fraction` between which the motion is smooth in time. antipodal: Theta(s, t + 1/2) =
    -Theta(s, t), the second half period mirrors the first (paper, section VI).
    """

    angle: Field
    rate: Field
    breaks: Callable[[np.ndarray], np.ndarray] | None = None
    stages: tuple[float, ...] = (0.0, 1.0)
    antipodal: bool = False

    def __post_init__(self) -> None:
        first, last, steps = self.stages[0], self.stages[-1], np.diff(self.stages)
        if first != 0.0 or last != self.fraction or min(steps) <= 0:
            raise ProblemError(
                f"motion.stages must ascend from 0 to {self.fraction:g}, not {self.stages}."
            )

    @property
    def fraction(self) -> float:
        """The part of the period that has to be solved."""
        return 0.5 if self.antipodal else 1.0

    def first_edges(self, t: np.ndarray, n_panel: int) -> np.ndarray:
        """Panel edges ``(n_edge, n_time)``: the breaks, and `n_panel` + 1 equal parts besides."""
        even = np.repeat(np.linspace(0.0, 1.0, n_panel + 1)[:, None], t.size, axis=1)
        if self.breaks is None:
            return even
        return np.sort(np.concatenate([even, np.clip(self.breaks(t), 0.0, 1.0)]), axis=0)


def _travelling_wave(
    profile: Callable, slope: Callable, waves: float, direction: float = -1.0
) -> Motion:
    """Theta = profile(2 pi (waves s + direction t)) of a 2 pi-periodic, half-wave antisymmetric
    profile; direction -1 runs from tail to head (paper, figure 5A), +1 back (figure 5B)."""

    def phase(s: np.ndarray, t: np.ndarray) -> np.ndarray:
        return 2 * np.pi * (waves * s + direction * t)

    return Motion(
        lambda s, t: profile(phase(s, t)),
        lambda s, t: 2 * np.pi * direction * slope(phase(s, t)),
        stages=(0.0, 0.5),
        antipodal=True,
    )


def tanh_wave(amplitude: float = 1.3, steepness: float = 20.0, waves: float = 2.0) -> Motion:
    """Smoothed triangular wave ``amplitude tanh(steepness sin(2 pi (waves s - t)))`` (paper, figure
    5A)."""

    def profile(phase: np.ndarray) -> np.ndarray:
        return amplitude * np.tanh(steepness * np.sin(phase))

    def slope(phase: np.ndarray) -> np.ndarray:
        inner = np.clip(steepness * np.sin(phase), -300, 300)
        return amplitude * steepness * np.cos(phase) / np.cosh(inner) ** 2

    return _travelling_wave(profile, slope, waves)


def sine_wave(amplitude: float = 1.0, waves: float = 1.0) -> Motion:
    """``amplitude sin(2 pi (waves s + t))`` (paper, figure 5B)."""
    return _travelling_wave(
        lambda phase: amplitude * np.sin(phase), lambda phase: amplitude * np.cos(phase), waves, 1.0
    )


def standing_wave(amplitude: float = 1.0) -> Motion:
    """``amplitude sin(2 pi s) sin(2 pi t)`` (paper, figure 6C)."""
    k = 2 * np.pi
    return Motion(
        lambda s, t: amplitude * np.sin(k * s) * np.sin(k * t),
        lambda s, t: amplitude * np.sin(k * s) * k * np.cos(k * t),
        stages=(0.0, 0.25, 0.5),
        antipodal=True,
    )
