"""Joint angles that were measured or invented, as a gait: closed and smooth, with the error of that stated.

The angles are fitted by a Fourier series of the phase, by least squares: so steps of time need not be equal, and noise is
smoothed. How many harmonics that takes is told by generalised cross-validation: what a further harmonic gains has to be worth
its coefficients. By the same measure the record gets a drift, which is taken out so that the gait closes, and a time from its
last sample to the first one of the next period.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple, cast

import numpy as np
from scipy.optimize import minimize_scalar

from colloc.gaits.gait import GaitFunction
from colloc.gaits.harmonic import Fourier
from colloc.system.csv_table import csv_table
from colloc.system.errors import ProblemError

_MOST_HARMONICS, _SAMPLES_A_HARMONIC = 24, 4
_WORTH, _EXACT = 1.05, 1e-16
"""The fewest numbers are taken whose score is the best one's, to a factor and a mean square [rad^2]."""
_PHASES = 1024
"""At which a function is sampled."""
_GAP, _GAPS = 5.0, 21
"""The first sample is the next one within so many typical steps after the last; gaps at which that is tried at first."""
_DRIFT = 0.1
"""Share of what a joint moves that it may be off after a period: no more is closed."""
_LARGEST = 2 * np.pi
"""An angle beyond it is taken for one in degrees."""
_FEWEST = 6
"""Samples of a gait, and of each of its periods."""
RAMP = "# ramp_s: "
"""Begins the line of a file whose samples before time 0 are the way from rest into the gait."""
_OTHERS = "_per_s", "_n_m", "_w"
"""Ends of names of columns that are no angles."""

Given = Fourier | np.ndarray | str | os.PathLike[str] | Callable[[np.ndarray], np.ndarray]
"""A series; angles ``(n_joint, n_time)`` at equal steps of a period, or labelled by xarray; a CSV file; or a function of phases
``(n_time,)``."""


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
    drift : float
        The most that any joint was off after a period [rad]; it is taken out evenly.
    degrees : bool
        Whether angles were given in degrees, and are told so.
    """

    gait: Fourier
    rms: float = 0.0
    largest: float = 0.0
    samples: int = 0
    drift: float = 0.0
    degrees: bool = False

    def describe(self) -> str:
        """How the gait was made, in words."""
        if not self.samples:
            return "the series as it was given"
        many = f"{self.gait.n_harmonic} harmonic{'s' * (self.gait.n_harmonic > 1)}"
        rms, largest = (_told(a, self.degrees, ".1e") for a in (self.rms, self.largest))
        drift = f", a drift of {_told(self.drift, self.degrees)} a period taken out" if self.drift else ""
        return f"{many} through {self.samples} samples{drift}: off by {rms} r.m.s., {largest} at most"


def _told(angle: float, degrees: bool, digits: str = ".3g") -> str:
    return f"{np.degrees(angle):{digits}}°" if degrees else f"{angle:{digits}} rad"


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
        Whether angles are degrees; also of those columns of a file whose names end in ``_deg``.

    Raises
    ------
    ProblemError
        If there are no such angles, they are not finite, times do not rise, the path is far from closed, or angles look like
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
    in_degrees = np.full(n_joint, degrees)
    if isinstance(given, (str, os.PathLike)):
        name = str(given)
        time, angles, named = _read(Path(given), n_joint)
        in_degrees |= named
    elif callable(given):
        time, period = np.arange(_PHASES) / _PHASES, 1.0
        angles = _numbers(name, given.angles(time) if isinstance(given, GaitFunction) else given(time))
    elif {"joint"} < set(getattr(given, "dims", ())):  # labelled, as `Solution.to_xarray` has them
        labelled = cast(Any, given).transpose("joint", ...)
        angles, time = _numbers(name, labelled), np.asarray(labelled[labelled.dims[-1]], dtype=float)
    else:
        angles = _numbers(name, given)
        time = np.arange(angles.shape[1], dtype=float)
    _check_joints(name, len(angles), n_joint)
    largest = np.abs(angles[~in_degrees]).max(initial=0.0)
    if largest > _LARGEST:
        raise ProblemError(
            f"{name} has an angle of {largest:.4g} rad: if angles are degrees, say so (degrees=True, --degrees)."
        )
    angles = np.where(in_degrees[:, None], np.radians(angles), angles)
    time = time - time[0]
    return _closed(name, time, angles, _fit(name, time, angles, period, harmonics), bool(in_degrees.all()))


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


def _read(path: Path, n_joint: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Times, angles ``(n_joint, n_time)``, and of which joints the names say degrees."""
    names, table = csv_table(path, _FEWEST)
    if RAMP in path.read_text(encoding="utf-8", errors="replace"):
        table = table[table[:, 0] >= 0]
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
    return values[0], values[kept], np.array([bool(names) and names[j].endswith("_deg") for j in kept])


class _Fit(NamedTuple):
    """Which series is to go through angles at times from 0."""

    harmonics: int
    drifts: bool
    """Whether the record drifts."""
    score: float
    """Mean square distance over the square of the share of numbers that are left."""
    period: float


def _columns(time: np.ndarray, fit: _Fit) -> np.ndarray:
    """The drift, if there is one, then 1, the first cosine and sine, the second ...: ``(n_time, n_number)``."""
    phases = time / fit.period
    turns = 2 * np.pi * phases[:, None] * np.arange(1, fit.harmonics + 1)
    waves = np.stack([np.cos(turns), np.sin(turns)], axis=2).reshape(phases.size, -1)
    columns = np.concatenate([(phases - phases.mean())[:, None], np.ones((phases.size, 1)), waves], axis=1)
    return columns if fit.drifts else columns[:, 1:]


def _tried(time: np.ndarray, angles: np.ndarray, fit: _Fit, chosen: int = 0) -> list[_Fit]:
    """Fits of up to as many harmonics, by one factorisation; so many numbers were `chosen` besides."""
    q = np.linalg.qr(_columns(time, fit))[0]
    parts = q.T @ angles.T
    gains, left = (parts**2).sum(axis=1), ((angles.T - q @ parts) ** 2).sum()
    missed = left + np.append(np.cumsum(gains[::-1])[::-1], 0.0)
    numbers = 1 + fit.drifts + 2 * np.arange(1, fit.harmonics + 1)
    scores = missed[numbers] / angles.size / (1 - (numbers + chosen) / time.size) ** 2
    return [fit._replace(harmonics=k, score=float(score)) for k, score in enumerate(scores, 1)]


def _fit(name: str, time: np.ndarray, angles: np.ndarray, period: float | None, harmonics: int | None) -> _Fit:
    count, step = time.size, float(np.median(np.diff(time)))
    if period is not None:
        if not np.isfinite(period) or period <= 0:
            raise ProblemError(f"the period must be positive, not {period:g}.")
        if time[-1] < 0.5 * period:
            raise ProblemError(f"{name} holds {time[-1]:.4g} of a period of {period:.4g}: record at least one.")
        if period < _FEWEST * step:
            raise ProblemError(
                f"{name} has a sample every {step:.4g}, fewer than {_FEWEST} in a period of {period:.4g}: give the period in "
                "the file's unit of time."
            )
    if harmonics is not None and not 1 <= harmonics <= (count - 3) // 2:
        raise ProblemError(f"{count} samples determine 1 to {(count - 3) // 2} harmonics, not {harmonics}.")
    most = harmonics or min(_MOST_HARMONICS, max(1, (count - 1) // _SAMPLES_A_HARMONIC))

    def tried(period: float, drifts: bool, chosen: int = 0) -> list[_Fit]:
        return _tried(time, angles, _Fit(most, drifts, np.inf, period), chosen)[(harmonics or 1) - 1 :]

    def missed(gap: float) -> float:
        return min(fit.score for fit in tried(time[-1] + gap * step, False))

    found = [
        fit for way in (False, True) for last in ([period] if period else time[-1] + [0.0, step]) for fit in tried(last, way)
    ]
    if period is None:
        grid = np.linspace(0.0, _GAP, _GAPS)
        near = min(grid, key=missed)
        around = max(near - grid[1], 0.0), near + grid[1]
        gap = float(minimize_scalar(missed, bounds=around, method="bounded", options={"xatol": 1e-8}).x)
        found += [fit for way in (False, True) for fit in tried(time[-1] + gap * step, way, 1)]
    enough = max(_WORTH * min(fit.score for fit in found), _EXACT)
    return min(fit for fit in found if fit.score <= enough)


def _closed(name: str, time: np.ndarray, angles: np.ndarray, fit: _Fit, degrees: bool) -> FittedGait:
    """A gait without the drift of its record. `ProblemError` if that is no small one."""
    columns = _columns(time, fit)
    table = np.linalg.lstsq(columns, angles.T, rcond=None)[0].T
    drift, series = np.abs(table[:, 0]) * fit.drifts, table[:, int(fit.drifts) :]
    gait = Fourier(series[:, 0], series[:, 1::2], series[:, 2::2])
    moves = np.ptp(gait.angles(np.arange(_PHASES) / _PHASES), axis=1)
    for joint in np.flatnonzero(drift > _DRIFT * moves.max()):
        raise ProblemError(
            f"{name} does not close: after a period joint {joint + 1} is off by {_told(drift[joint], degrees)}, and it moves "
            f"through {_told(moves[joint], degrees)}. Give one whole period, or say how long it is (period=, --period)."
        )
    off = gait.angles(time / fit.period) - angles
    return FittedGait(gait, float(np.sqrt((off**2).mean())), float(np.abs(off).max()), time.size, float(drift.max()), degrees)
