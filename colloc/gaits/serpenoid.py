"""Serpenoid gaits: a wave of bending that travels along a chain (S. Hirose, Biologically Inspired
Robots, 1993),

    q_j(t) = offset + sum_k  a_k cos k psi_j + b_k sin k psi_j,      a_1 = 0,

    psi_j = 2 pi t - lag (j - (n + 1) / 2).

A map into Fourier series, linear in all parameters but the lag; in the full program it is a
constraint on the Fourier coefficients.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from colloc.gaits.harmonic import SAME_START, Fourier, Harmonic, shift_phase
from colloc.gaits.symmetry import ANTIPODAL, BILATERAL, NONE
from colloc.mechanics.bodies import Body
from colloc.numerics.arrays import Array, namespace
from colloc.system.arguments import named_arguments
from colloc.system.errors import ProblemError

_COMPLEX_STEP = 1e-30
_LAGS = np.linspace(-np.pi, np.pi, 361)  # first guesses of the lag of a gait


@named_arguments
@dataclass(frozen=True, eq=False, repr=False)
class SerpenoidSeries(Fourier):
    """The Fourier series of a serpenoid gait with its lag [rad of phase a joint], positive where
    the wave travels towards the head."""

    lag: float

    def lines(self) -> list[str]:
        amplitude = float(np.hypot(self.cos[0, 0], self.sin[0, 0]))
        offset = np.round(self.mean[0], 4) + 0.0
        waves = abs(self.lag) * (self.n_joint + 1) / (2 * np.pi)
        return [
            f"serpenoid: amplitude {amplitude:.4f} rad, offset {offset:+.4f} rad, lag "
            f"{self.lag:+.4f} rad a joint ({waves:.3f} waves along the body, towards the "
            f"{'head' if self.lag > 0 else 'tail'})",
            *super().lines(),
        ]


@named_arguments
@dataclass(frozen=True)
class Serpenoid(Harmonic):
    """The class of serpenoid gaits: an amplitude, a lag from joint to joint, an offset that turns,
    temporal harmonics.

    Its parameters are the lag, the offset where there is no symmetry, and the amplitudes: two or
    three numbers with one harmonic, for any number of links.

    Parameters
    ----------
    harmonics : int
        Of the wave in time; antipodal gaits have odd ones alone.
    symmetry : {"none", "bilateral", "antipodal"}
        Without one there is an offset, the same in all joints.

    Raises
    ------
    ProblemError
        If the symmetry leaves gaits nothing of the highest harmonic.

    Examples
    --------
    >>> from colloc import Chain, Friction, Problem, Serpenoid
    >>> snake = Problem("snake", body=Chain((1 / 8,) * 8), friction=Friction(mu_t=10),
    ...     gait=Serpenoid(symmetry="antipodal"))
    >>> snake.gait.describe()
    'serpenoid, 1 harmonic, symmetry antipodal'
    """

    linear = False

    def describe(self) -> str:
        return f"serpenoid, {super().describe()}"

    def check_joints(self, n_joint: int) -> None:
        if n_joint < 2:
            raise ProblemError(
                "a serpenoid wave travels along a chain: the class Serpenoid needs at least three "
                "links."
            )

    @property
    def _waves(self) -> list[tuple[int, bool]]:
        """Harmonic of each amplitude, and whether it is that of a sine."""
        waves = [(1, True)]
        for k in range(2, self.harmonics + 1):
            if self.symmetry == ANTIPODAL and k % 2 == 0:
                continue
            waves += [(k, True)] if self.symmetry == BILATERAL else [(k, False), (k, True)]
        return waves

    @property
    def n_wave(self) -> int:
        """Number of parameters of the wave; the Fourier coefficients follow them."""
        return 1 + int(self.symmetry == NONE) + len(self._waves)

    def coefficients(self, wave: Array, n_joint: int) -> list[list[Array]]:
        """(mean, cos 1, sin 1, cos 2, ...) of every joint, of a wave; NumPy or CasADi."""
        xp, lag = namespace(wave), wave[0]
        offset = wave[1] if self.symmetry == NONE else 0 * lag
        amplitudes = [wave[i] for i in range(self.n_wave - len(self._waves), self.n_wave)]
        table = []
        for place in _places(n_joint):
            row = [offset, *[0 * lag] * (2 * self.harmonics)]
            for (k, sine), amplitude in zip(self._waves, amplitudes, strict=True):
                cos, sin = xp.cos(k * place * lag), xp.sin(k * place * lag)
                row[2 * k - 1] += amplitude * (-sin if sine else cos)
                row[2 * k] += amplitude * (cos if sine else sin)
            table.append(row)
        return table

    def coefficient_slopes(self, wave: np.ndarray, n_joint: int) -> np.ndarray:
        """Derivatives of `coefficients`, ``(n_joint * (2 K + 1), n_wave)``, by complex steps."""
        steps = wave + 1j * _COMPLEX_STEP * np.eye(self.n_wave)
        columns: list = [np.ravel(self.coefficients(step, n_joint)).imag for step in steps]
        return np.array(columns).T / _COMPLEX_STEP

    def full(self, wave: np.ndarray, n_joint: int) -> np.ndarray:
        """The parameters of a wave, then its Fourier coefficients."""
        return np.concatenate([wave, np.ravel(self.coefficients(wave, n_joint))])

    def _basis(self, n_joint: int) -> np.ndarray:
        n = n_joint * (2 * self.harmonics + 1)  # the Fourier coefficients alone enter the angles
        return np.hstack([np.zeros((n, self.n_wave)), np.eye(n)])

    def member(self, parameters: np.ndarray, n_joint: int) -> SerpenoidSeries:
        with np.errstate(over="ignore", invalid="ignore"):  # a series refuses what is not finite
            table = np.array(self.coefficients(parameters[: self.n_wave], n_joint), dtype=float)
        return SerpenoidSeries.from_table(table, float(parameters[0]))

    def parameters(self, gait: Fourier) -> np.ndarray:
        """Of the wave nearest to a series, after shifting its start phase if that is free."""
        lag, start = self._lag_and_start(gait)
        gait = gait.resize(self.harmonics)
        if abs(start) > SAME_START:
            gait = shift_phase(gait, -start / (2 * np.pi))
        wave = _at_the_middle(gait, lag)
        offset = [gait.mean.mean()] if self.symmetry == NONE else []
        amplitudes = (-wave[k - 1].imag if sine else wave[k - 1].real for k, sine in self._waves)
        return np.array([lag, *offset, *amplitudes])

    project = parameters

    def is_synchronous(self, gait: Fourier) -> bool:
        return abs(self._lag_and_start(gait)[1]) <= SAME_START

    def _lag_and_start(self, gait: Fourier) -> tuple[float, float]:
        """Lag at which the joints agree best on the wave they are part of, and by how much it
        starts off the phase of members [rad]."""
        lag, gait = getattr(gait, "lag", None), gait.resize(self.harmonics)

        def disagreement(lag: float) -> float:
            wave = _at_the_middle(gait, lag)
            amplitudes = wave.imag if self.symmetry == BILATERAL else np.abs(wave)
            return -float(np.sum(amplitudes**2))

        if lag is None:
            from scipy.optimize import minimize_scalar

            first = _LAGS[np.argmin([disagreement(lag) for lag in _LAGS])]
            step = _LAGS[1] - _LAGS[0]
            bounds = max(first - step, -np.pi), min(first + step, np.pi)
            how: Any = {"method": "bounded", "options": {"xatol": 1e-12}}
            lag = float(minimize_scalar(disagreement, bounds=bounds, **how).x)
        first = _at_the_middle(gait, lag)[0]
        in_phase = self.symmetry == BILATERAL or first == 0
        return lag, 0.0 if in_phase else float(np.angle(1j * first))

    def bounds(self, body: Body, limit: float) -> tuple[np.ndarray, np.ndarray]:
        _, largest = super().bounds(body, limit)
        largest[0] = np.pi  # a lag of a whole turn more is the same wave
        return -largest, largest


def _places(n_joint: int) -> np.ndarray:
    return np.arange(n_joint) - 0.5 * (n_joint - 1)


def _at_the_middle(gait: Fourier, lag: float) -> Any:
    """Amplitudes ``cos - i sin`` of the wave of a lag that is nearest to a gait, at the middle of
    the body, ``(n_harmonic,)``."""
    k = np.arange(1, gait.n_harmonic + 1)
    phase = np.exp(1j * k * lag * _places(gait.n_joint)[:, None])
    return ((gait.cos - 1j * gait.sin) * phase).mean(axis=0)
