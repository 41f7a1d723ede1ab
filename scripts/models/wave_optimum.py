"""Travelling waves optimised over amplitude, wavelength and profile for given friction.

    Theta(s, t) = a_1 sin p + a_3 sin 3p + ...,     p = 2 pi (waves s + direction t)

The few parameters are searched without derivatives (Nelder and Mead) on the converged efficiency of each wave, so an
optimum is local, and its efficiency needs no replay other than on a finer mesh.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import optimize

from colloc.mechanics.friction import Friction
from colloc.smooth.motion import Motion, travelling_wave
from colloc.system.errors import ProblemError
from scripts.models.period import Period, measured_period, period


def odd_wave(amplitudes: np.ndarray, waves: float, direction: float = 1.0) -> Motion:
    """The wave with odd harmonics of the given amplitudes [rad]; odd, so that half a period mirrors it."""
    k = 2 * np.arange(len(amplitudes)) + 1

    def profile(p: np.ndarray) -> np.ndarray:
        return sum((a * np.sin(m * p) for a, m in zip(amplitudes, k, strict=True)), np.zeros_like(p))

    def slope(p: np.ndarray) -> np.ndarray:
        return sum((a * m * np.cos(m * p) for a, m in zip(amplitudes, k, strict=True)), np.zeros_like(p))

    return travelling_wave(profile, slope, waves, direction)


@dataclass(frozen=True, eq=False)
class WaveOptimum:
    """An optimised wave: harmonics' amplitudes, waves on the body, its period, and the efficiencies evaluated."""

    amplitudes: np.ndarray
    waves: float
    period: Period
    evaluations: int


def optimise_wave(
    friction: Friction,
    amplitudes: np.ndarray,
    waves: float,
    *,
    most_waves: float = 2.0,
    direction: float = 1.0,
    delta: float = 1e-4,
    evaluations: int = 80,
) -> WaveOptimum:
    """Maximise efficiency from the given harmonics and number of waves on the body.

    Parameters
    ----------
    friction : Friction
    amplitudes : (n,)
        Of the odd harmonics 1, 3, ... [rad].
    waves, most_waves : float
        Waves on the body to start from, and the largest number allowed: shorter waves waste less sideways motion, so
        without a limit there is no optimum.
    direction : {1, -1}
        From head to tail, or tail to head.
    delta : float
    evaluations : int
        Most evaluations of the efficiency.
    """
    if not 0 < waves <= most_waves:
        raise ProblemError(f"waves must lie between 0 and most_waves = {most_waves:g}, not {waves!r}.")

    def loss(parameters: np.ndarray) -> float:
        waves_now = most_waves - abs(most_waves - parameters[-1])  # reflected at the limit
        if waves_now < 0.1:
            return 1.0
        motion = odd_wave(parameters[:-1], waves_now, direction)
        return -period(motion, friction, delta, intervals=1, nodes=6, quadrature_tolerance=1e-7).efficiency

    start = np.append(amplitudes, waves)
    simplex = np.vstack([start, start + np.diag(np.append(np.full(len(amplitudes), 0.1), -0.2))])
    options = {"maxfev": evaluations, "initial_simplex": simplex, "xatol": 1e-4, "fatol": 1e-7}
    found = optimize.minimize(loss, start, method="Nelder-Mead", options=options)
    best, best_waves = found.x[:-1], most_waves - abs(most_waves - found.x[-1])
    return WaveOptimum(
        best, best_waves, measured_period(odd_wave(best, best_waves, direction), friction, delta, intervals=4), found.nfev
    )
