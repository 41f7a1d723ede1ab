"""Serpenoid gaits: one wave of bending that travels along a chain, known by a few numbers however
many joints there are.

    q_j(t) = offset + sum_k  a_k cos k psi_j + b_k sin k psi_j,      psi_j = 2 pi t - lag (j - (n + 1) / 2),      a_1 = 0

(S. Hirose, Biologically Inspired Robots, 1993). The lag is the one number in which angles are not
linear. So the program has Fourier coefficients among its variables, as for all series, and one more
group of equations that makes them a wave's.
"""  # noqa: E501

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from colloc.gaits.harmonic import SAME_START, Fourier, Harmonic, shifted
from colloc.gaits.symmetry import ANTIPODAL, BILATERAL, NONE
from colloc.mechanics.bodies import Body
from colloc.numerics.arrays import Array, namespace
from colloc.system.arguments import named_arguments
from colloc.system.errors import ProblemError

_LAGS = np.linspace(-np.pi, np.pi, 361)
"""Where the lag of the wave nearest to a gait is looked for first; equal lags a whole turn apart
are the same wave."""


@named_arguments
@dataclass(frozen=True, eq=False, repr=False)
class SerpenoidSeries(Fourier):
    """The Fourier series of a serpenoid gait, which knows its lag.

    Parameters
    ----------
    mean, cos, sin
        As of a `Fourier`.
    lag : float
        By how much of its phase a joint follows the one behind it, positive where the wave travels
        towards the head [rad].
    """

    lag: float

    def lines(self) -> list[str]:
        """The wave in words, then the formula."""
        amplitude = float(np.hypot(self.cos[0, 0], self.sin[0, 0]))
        offset = np.round(self.mean[0], 4) + 0.0
        waves = abs(self.lag) * (self.n_joint + 1) / (2 * np.pi)
        towards = "head" if self.lag > 0 else "tail"
        told = (
            f"serpenoid: amplitude {amplitude:.4f} rad, offset {offset:+.4f} rad, lag "
            f"{self.lag:+.4f} rad a joint"
        )
        return [
            f"{told} ({waves:.3f} waves along the body, towards the {towards})",
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
        """The class in words, for reports."""
        return f"serpenoid, {super().describe()}"

    def check_joints(self, n_joint: int) -> None:
        """A `ProblemError` for one joint, along which no wave travels."""
        if n_joint < 2:
            raise ProblemError(
                "a serpenoid wave travels along a chain: the class Serpenoid needs at least three "
                "links."
            )

    @property
    def _waves(self) -> list[tuple[int, bool]]:
        """Of each amplitude its harmonic, and whether it is a sine's."""
        found = [(1, True)]
        for k in range(2, self.harmonics + 1):
            if self.symmetry == ANTIPODAL and k % 2 == 0:
                continue
            found += [(k, True)] if self.symmetry == BILATERAL else [(k, False), (k, True)]
        return found

    @property
    def n_own(self) -> int:
        """The parameters from which the others, the Fourier coefficients, follow."""
        return 1 + int(self.symmetry == NONE) + len(self._waves)

    def coefficients(self, own: Array, n_joint: int) -> list[list[Array]]:
        """(mean, cos 1, sin 1, cos 2, ...) of every joint, from the own parameters: NumPy or
        CasADi."""
        xp = namespace(own)
        offset = own[1] if self.symmetry == NONE else 0 * own[0]
        amplitudes = [own[i] for i in range(self.n_own - len(self._waves), self.n_own)]
        table = []
        for place in _places(n_joint):
            row = [offset, *[0 * own[0]] * (2 * self.harmonics)]
            for (k, sine), amplitude in zip(self._waves, amplitudes, strict=True):
                cos, sin = xp.cos(k * place * own[0]), xp.sin(k * place * own[0])
                row[2 * k - 1] += amplitude * (-sin if sine else cos)
                row[2 * k] += amplitude * (cos if sine else sin)
            table.append(row)
        return table

    def coefficient_slopes(self, own: np.ndarray, n_joint: int) -> np.ndarray:
        """Derivatives of the coefficients, ``(n_joint * (2 K + 1), n_own)``."""
        columns = [np.zeros((n_joint, 2 * self.harmonics + 1))]
        unit = np.eye(self.n_own)
        for i in range(1, self.n_own):  # linear in all but the lag
            only = unit[i].copy()
            only[0] = own[0]
            columns.append(np.array(self.coefficients(only, n_joint), dtype=float))
        turning = np.arange(1, self.harmonics + 1) * _places(n_joint)[:, None]
        table = np.array(self.coefficients(own, n_joint), dtype=float)
        columns[0][:, 1::2], columns[0][:, 2::2] = (
            -turning * table[:, 2::2],
            turning * table[:, 1::2],
        )
        return np.array([column.ravel() for column in columns]).T

    def _basis(self, n_joint: int) -> np.ndarray:
        """Of all parameters, own ones and Fourier coefficients, the latter alone enter the
        angles."""
        n = n_joint * (2 * self.harmonics + 1)
        return np.hstack([np.zeros((n, self.n_own)), np.eye(n)])

    def full(self, own: np.ndarray, n_joint: int) -> np.ndarray:
        """All parameters: the own ones, then the Fourier coefficients that follow from them."""
        return np.concatenate([own, np.ravel(self.coefficients(own, n_joint))])

    def fourier(self, parameters: np.ndarray, n_joint: int) -> SerpenoidSeries:
        """The gait of parameters, of which the own ones count."""
        with np.errstate(over="ignore", invalid="ignore"):  # a series refuses what is not finite
            table = np.array(self.coefficients(parameters[: self.n_own], n_joint), dtype=float)
        return SerpenoidSeries(table[:, 0], table[:, 1::2], table[:, 2::2], float(parameters[0]))

    def parameters(self, gait: Fourier) -> np.ndarray:
        """The own parameters of the wave nearest to a gait, after shifting its start phase if that
        is free."""
        lag, start = self._begun(gait)
        gait = gait.resized(self.harmonics)
        wave = _at_the_middle(
            gait if abs(start) <= SAME_START else shifted(gait, -start / (2 * np.pi)), lag
        )
        offset = [gait.mean.mean()] if self.symmetry == NONE else []
        return np.array(
            [
                lag,
                *offset,
                *(-wave[k - 1].imag if sine else wave[k - 1].real for k, sine in self._waves),
            ]
        )

    def _begun(self, gait: Fourier) -> tuple[float, float]:
        """The lag of the wave nearest to a gait, and by how much of its phase it begins off that of
        members [rad]."""
        lag, gait = getattr(gait, "lag", None), gait.resized(self.harmonics)
        if lag is None:
            lag = self._nearest_lag(gait)
        wave = _at_the_middle(gait, lag)
        return lag, 0.0 if self.symmetry == BILATERAL or wave[0] == 0 else float(
            np.angle(1j * wave[0])
        )

    def in_phase(self, gait: Fourier) -> bool:
        return abs(self._begun(gait)[1]) <= SAME_START

    def _nearest_lag(self, gait: Fourier) -> float:
        """The lag at which the joints agree best on what wave they are part of."""
        from scipy.optimize import minimize_scalar

        def agreed(lag: float) -> float:
            wave = _at_the_middle(gait, lag)
            kept = wave.imag if self.symmetry == BILATERAL else np.abs(wave)
            return -float(np.sum(kept**2))

        first = _LAGS[np.argmin([agreed(lag) for lag in _LAGS])]
        step = _LAGS[1] - _LAGS[0]
        bounds = max(first - step, -np.pi), min(first + step, np.pi)
        return float(
            minimize_scalar(agreed, bounds=bounds, method="bounded", options={"xatol": 1e-12}).x
        )

    def nearest(self, gait: Fourier) -> np.ndarray:
        return self.parameters(gait)

    def largest_parameters(self, body: Body, limit: float) -> np.ndarray:
        """Bounds as for all series; the lag's is half a turn."""
        bounds = super().largest_parameters(body, limit)
        bounds[0] = np.pi
        return bounds


def _places(n_joint: int) -> np.ndarray:
    """Of the joints, counted from the middle one."""
    return np.arange(n_joint) - 0.5 * (n_joint - 1)


def _at_the_middle(gait: Fourier, lag: float) -> Any:
    """Amplitudes ``cos - i sin`` of the harmonics of the wave with a lag that fits all joints best,
    ``(n_harmonic,)``."""
    k = np.arange(1, gait.n_harmonic + 1)
    return (
        (gait.cos - 1j * gait.sin) * np.exp(1j * k * lag * _places(gait.n_joint)[:, None])
    ).mean(axis=0)
