"""Joint angles that were measured or invented, as a gait: closed and smooth, with the error of that stated.

The angles are fitted by a Fourier series of the phase, by least squares: so steps of time need not be equal, and noise is
smoothed. How many harmonics that takes is told by generalised cross-validation: what a further harmonic gains has to be worth
its coefficients.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from colloc.gaits.gait import GaitFunction
from colloc.gaits.harmonic import Fourier
from colloc.system.csv_table import csv_table
from colloc.system.errors import ProblemError

_MOST_HARMONICS, _SAMPLES_A_HARMONIC = 24, 4
_WORTH, _EXACT = 1.05, 1e-16
"""The fewest harmonics are taken whose score is the best one's, to a factor and a mean square [rad^2]."""
_PHASES = 1024
"""At which a function is sampled."""
_NEAR, _FAR = 0.01, 5.0
"""The last sample is the first one again within so many typical steps; a path is not closed that jumps by so many."""
_LARGEST = 2 * np.pi
"""An angle beyond it is taken for one in degrees."""
_FEWEST = 3
"""Samples of a gait."""
_OTHERS = "_per_s", "_n_m", "_w"
"""Ends of names of columns that are no angles."""

Given = Fourier | np.ndarray | str | os.PathLike[str] | Callable[[np.ndarray], np.ndarray]
"""A series; angles ``(n_joint, n_time)`` at equal steps of a period; a CSV file; or a function of phases ``(n_time,)``."""


@dataclass(frozen=True, eq=False)
class FittedGait:
    """A Fourier series near given joint angles.

    Attributes
    ----------
    gait : Fourier
    rms, largest : float
        Distance of the joint angles from those given [rad]: root mean square, and largest of any joint at any sample.
    samples : int
        How many there are; 0 for a series, which is taken as it is.
    """

    gait: Fourier
    rms: float = 0.0
    largest: float = 0.0
    samples: int = 0

    def describe(self) -> str:
        """How the gait was made, in words."""
        if not self.samples:
            return "the series as it was given"
        many = f"{self.gait.n_harmonic} harmonic{'s' * (self.gait.n_harmonic > 1)}"
        return f"{many} through {self.samples} samples: off by {self.rms:.1e} rad r.m.s., {self.largest:.1e} at most"


def fitted_gait(
    given: Given, n_joint: int, *, period: float | None = None, harmonics: int | None = None, degrees: bool = False
) -> FittedGait:
    """The gait that joint angles are samples of.

    Parameters
    ----------
    given : gait, array, path of a CSV file, or callable
        See `Given`. A file has a column of times, then one for each joint; names and ``#`` lines are optional, and columns
        whose names end in ``_per_s``, ``_N_m`` or ``_W`` are left out.
    n_joint : int
        That the body has.
    period : float, optional
        Of a file, in its unit of time; more than one may be recorded. By default the file holds one.
    harmonics : int, optional
        By default as many as the samples are worth.
    degrees : bool
        Whether angles are degrees; also where every name of a file's columns ends in ``_deg``.

    Raises
    ------
    ProblemError
        If there are no such angles, they are not finite, times do not rise, the path is not closed, or angles look like
        degrees.

    Examples
    --------
    >>> t = np.arange(40) / 40
    >>> found = fitted_gait(np.stack([np.cos(2 * np.pi * t), 0.5 * np.sin(2 * np.pi * t)]), 2)
    >>> np.allclose(found.gait.sin, [[0], [0.5]]), found.largest < 1e-12
    (True, True)
    """
    name = "the gait"
    if isinstance(given, Fourier):
        _check_joints(name, given.n_joint, n_joint)
        return FittedGait(given)
    if isinstance(given, (str, os.PathLike)):
        name = str(given)
        time, angles, in_degrees = _read(Path(given), n_joint)
        degrees = degrees or in_degrees
    elif callable(given):
        time = np.arange(_PHASES) / _PHASES
        angles = _numbers(name, given.angles(time) if isinstance(given, GaitFunction) else given(time))
    else:
        angles = _numbers(name, given)
        time = np.arange(angles.shape[1], dtype=float)
    _check_joints(name, len(angles), n_joint)
    if degrees:
        angles = np.radians(angles)
    elif (largest := np.abs(angles).max()) > _LARGEST:
        raise ProblemError(
            f"{name} has an angle of {largest:.4g} rad: if angles are degrees, say so (degrees=True, --degrees)."
        )
    return _fit(_phases(name, time, angles, period), angles, harmonics)


def _check_joints(name: str, count: int, n_joint: int) -> None:
    if count != n_joint:
        raise ProblemError(f"{name} has angles of {count} joint{'s' * (count != 1)}, and the body has {n_joint}.")


def _numbers(name: str, given: object) -> np.ndarray:
    try:
        angles = np.array(given, dtype=float)
    except (TypeError, ValueError):
        raise ProblemError(
            f"{name} must be joint angles, a number for each joint and time, not {type(given).__name__}."
        ) from None
    if angles.ndim != 2 or angles.shape[1] < _FEWEST:
        raise ProblemError(f"{name} must have a row for each joint and a column for each of at least {_FEWEST} times.")
    if not np.isfinite(angles).all():
        joint, k = np.argwhere(~np.isfinite(angles))[0]
        raise ProblemError(f"{name} has no finite angle of joint {joint + 1} at sample {k + 1}.")
    return angles


def _read(path: Path, n_joint: int) -> tuple[np.ndarray, np.ndarray, bool]:
    """Times, angles ``(n_joint, n_time)``, and whether the names of the columns say degrees."""
    names, table = csv_table(path, _FEWEST)
    values, width = table.T, table.shape[1]
    kept = [j for j in range(1, width) if not (names and names[j].endswith(_OTHERS))]
    if len(kept) != n_joint:
        raise ProblemError(
            f"{path} has {len(kept)} column{'s' * (len(kept) != 1)} of angles, and the body has {n_joint} joints: write a "
            "column of times, then one for each joint."
        )
    falls = np.flatnonzero(np.diff(values[0]) <= 0)
    if falls.size:
        raise ProblemError(f"{path}: the times in the first column do not rise after sample {falls[0] + 1}.")
    return values[0], values[kept], bool(names) and all(names[j].endswith("_deg") for j in kept)


def _phases(name: str, time: np.ndarray, angles: np.ndarray, period: float | None) -> np.ndarray:
    """Of the samples, from 0; the last may be the first again, else the first follows after another step."""
    time = time - time[0]
    if period is not None:
        if not np.isfinite(period) or period <= 0:
            raise ProblemError(f"the period must be positive, not {period:g}.")
        if time[-1] < 0.5 * period:
            raise ProblemError(f"{name} holds {time[-1]:.4g} of a period of {period:.4g}: record at least one.")
        return time / period
    steps = np.linalg.norm(np.diff(angles), axis=0)
    jump, typical = float(np.linalg.norm(angles[:, -1] - angles[:, 0])), float(np.median(steps))
    if jump > _FAR * max(steps.max(), 1e-12):
        raise ProblemError(
            f"{name} does not close: the last sample is {jump:.3g} rad from the first, where steps are {steps.max():.3g} at "
            "most. Give one whole period, or say how long it is (period=, --period)."
        )
    return time / (time[-1] if jump < _NEAR * typical else time[-1] + np.median(np.diff(time)))


def _fit(phases: np.ndarray, angles: np.ndarray, harmonics: int | None) -> FittedGait:
    most = min(_MOST_HARMONICS, max(1, (phases.size - 1) // _SAMPLES_A_HARMONIC))
    if harmonics is not None and not 1 <= harmonics <= (phases.size - 1) // 2:
        raise ProblemError(f"{phases.size} samples determine 1 to {(phases.size - 1) // 2} harmonics, not {harmonics}.")
    tried = range(1, most + 1) if harmonics is None else (harmonics,)
    fits = [_series(phases, angles, k) for k in tried]
    # mean square over the square of the share of numbers that are left
    scores = [_square(fit, phases, angles) / (1 - (2 * fit.n_harmonic + 1) / phases.size) ** 2 for fit in fits]
    enough = max(_WORTH * min(scores), _EXACT)
    gait = next(fit for fit, score in zip(fits, scores, strict=True) if score <= enough)
    off = gait.angles(phases) - angles
    return FittedGait(gait, float(np.sqrt((off**2).mean())), float(np.abs(off).max()), phases.size)


def _series(phases: np.ndarray, angles: np.ndarray, harmonics: int) -> Fourier:
    k = 2 * np.pi * np.arange(1, harmonics + 1)
    waves = np.concatenate([np.ones((phases.size, 1)), np.cos(phases[:, None] * k), np.sin(phases[:, None] * k)], axis=1)
    table = np.linalg.lstsq(waves, angles.T, rcond=None)[0].T
    return Fourier(table[:, 0], table[:, 1 : harmonics + 1], table[:, harmonics + 1 :])


def _square(fit: Fourier, phases: np.ndarray, angles: np.ndarray) -> float:
    return float(((fit.angles(phases) - angles) ** 2).mean())
