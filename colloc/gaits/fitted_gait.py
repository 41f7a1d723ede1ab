"""Joint angles that were measured or invented, as a gait: closed and smooth, with the error of that
stated.

The angles are fitted by a Fourier series of the phase, by least squares: so steps of time need not
be equal, and noise is smoothed. How many harmonics that takes is told by generalised
cross-validation: what a further harmonic gains has to be worth its coefficients. By the same
measure the record gets a drift, which is taken out so that the gait closes, and a period: a time
from its last sample to the first one of the next period, or that after which it repeats itself.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, NamedTuple, cast

import numpy as np
from scipy.optimize import minimize_scalar
from scipy.special import fdtrc, stdtrit

from colloc.gaits.gait import GaitFunction
from colloc.gaits.harmonic import Fourier
from colloc.gaits.record import FEWEST, read_record
from colloc.system.errors import ProblemError

_MOST_HARMONICS, _SAMPLES_A_HARMONIC = 24, 4
_WORTH, _EXACT = 1.05, 1e-16
"""The fewest numbers are taken whose score is the best one's, to a factor and a mean square
[rad^2]."""
_PHASES = 1024
"""At which a function is sampled."""
_GAP, _GAPS = 5.0, 21
"""The first sample is the next one within so many typical steps after the last; gaps at which that
is tried at first."""
_DRIFT = 0.1
"""Share of what a joint moves that it may be off after a period: no more is closed."""
_LARGEST = 2 * np.pi
"""An angle beyond it is taken for one in degrees."""
_ALIKE = 1e-3, 0.03, 0.2
"""How much more a record may differ from itself a period later than several periods later, of what
it does on average: the first length of which that holds is tried as the period."""
_REPEATED, _SLOW, _SMALL = 2.0, 10.0, 1e-2
"""How much more mean square distance is allowed to periods that repeat than to as many harmonics as
one long period may have: the first factor, and the second, for noise that is slower than the
samples, up to such a share of what the joints move."""
_DRIFTS, _OPEN = 1.3, 4.0
"""The same for a record without a drift, as a part of a wave, with noise, looks a little like one;
and for one that would not close else."""
_TOLD = 0.5
"""A period longer than this share of a record is told without a drift: a part of a wave and a drift
are much alike."""
_ROUGH = 6
"""Harmonics by which the length of a period is told."""
SEVERAL = 1.1
"""Periods from which a record holds more than one."""
_STEP, _HIGHEST = 1e-5, 64
"""Of differences by the period, relative; harmonics of a class at most."""
_CHANCE = 0.05
"""That noise alone seems worth more harmonics."""
_COVERED = 0.97725
"""The probability that the standard normal distribution has up to two standard deviations."""

Given = Fourier | np.ndarray | str | os.PathLike[str] | Callable[[np.ndarray], np.ndarray]
"""A series; angles ``(n_joint, n_time)`` at equal steps of a period, or labelled by xarray; a CSV
file; or a function of phases ``(n_time,)``."""


@dataclass(frozen=True, eq=False)
class Uncertainty:
    """By what the coefficients of a series may be off that goes through samples.

    Attributes
    ----------
    directions : (n_direction, n_joint, n_coefficient)
        Changes of (mean, cos 1, sin 1, cos 2, ...), independent of one another, each of a standard
        deviation; also of harmonics that the series lacks.
    factor : float
        Standard deviations within which 95 % of all records lie: two, or Student's for few samples.
    richer : Fourier, optional
        A series of more harmonics through the samples, if what smoothing leaves out is more than
        noise.
    """

    directions: np.ndarray
    factor: float
    richer: Fourier | None


@dataclass(frozen=True, eq=False)
class FittedGait:
    """A Fourier series near given joint angles.

    Attributes
    ----------
    gait : Fourier
    rms, largest : float
        Distance of the joint angles from those given [rad]: root mean square, and largest of any
        joint at any sample.
    samples : int
        How many there are; 0 for a series, which is taken as it is.
    drift : float
        The most that any joint was off after a period [rad]; it is taken out evenly.
    degrees : bool
        Whether angles were given in degrees, and are told so.
    periods : float
        That the samples hold, of the length `period` in the unit of time of a file.
    uncertainty : Uncertainty, optional
        None for a series.
    taken : str
        What was read from a file, in words.
    centre : int
        About what all joints of a file are centred [degrees], if that looks like servos.
    """

    gait: Fourier
    rms: float = 0.0
    largest: float = 0.0
    samples: int = 0
    drift: float = 0.0
    degrees: bool = False
    periods: float = 1.0
    period: float = 1.0
    uncertainty: Uncertainty | None = None
    taken: str = ""
    centre: int = 0

    def describe(self) -> str:
        """How the gait was made, in words."""
        if not self.samples:
            return "the series as it was given"
        many = f"{self.gait.n_harmonic} harmonic{'s' * (self.gait.n_harmonic > 1)}"
        rms, largest = (_told(a, self.degrees, ".1e") for a in (self.rms, self.largest))
        drift = (
            f", a drift of {_told(self.drift, self.degrees)} a period taken out"
            if self.drift
            else ""
        )
        several = (
            f" of {self.periods:.3g} periods of {self.period:.4g}" if self.periods > SEVERAL else ""
        )
        begin = f"{self.taken}; " if self.taken else ""
        begin += (
            f"all joints move about {self.centre}°, which servos may count from; "
            if self.centre
            else ""
        )
        return (
            f"{begin}{many} through {self.samples} samples{several}{drift}: off by {rms} "
            f"r.m.s., {largest} at most"
        )


def _told(angle: float, degrees: bool, digits: str = ".3g") -> str:
    return f"{np.degrees(angle):{digits}}°" if degrees else f"{angle:{digits}} rad"


def fitted_gait(
    given: Given,
    n_joint: int,
    *,
    period: float | None = None,
    harmonics: int | None = None,
    degrees: bool = False,
) -> FittedGait:
    """The gait that joint angles are samples of.

    Parameters
    ----------
    given : gait, array, path of a CSV file, or callable
        See `Given`. A file has a column of times and one for each joint
        (`colloc.gaits.record.read_record`).
    n_joint : int
        That the body has.
    period : float, optional
        Of a file, in its unit of time; more than one may be recorded. By default it is told from
        the samples.
    harmonics : int, optional
        By default as many as the samples are worth.
    degrees : bool
        Whether angles are degrees; of a file, where it does not say what they are.

    Raises
    ------
    ProblemError
        If there are no such angles, they are not finite, times fall, the path is far from closed,
        or angles look like degrees.

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
    record = None
    if isinstance(given, (str, os.PathLike)):
        name = str(given)
        record = read_record(Path(given), n_joint, degrees=degrees)
        time, angles = record.time, record.angles
        period = period or record.period
    elif callable(given):
        time, period = np.arange(_PHASES) / _PHASES, 1.0
        angles = _numbers(
            name, given.angles(time) if isinstance(given, GaitFunction) else given(time)
        )
    elif {"joint"} < set(getattr(given, "dims", ())):  # labelled, as `Solution.to_xarray` has them
        labelled = cast(Any, given).transpose("joint", ...)
        angles, time = (
            _numbers(name, labelled),
            np.asarray(labelled[labelled.dims[-1]], dtype=float),
        )
    else:
        angles = _numbers(name, given)
        time = np.arange(angles.shape[1], dtype=float)
    _check_joints(name, len(angles), n_joint)
    if record is not None:
        fitted = _closed(
            name, time, angles, _fit(name, time, angles, period, harmonics), record.degrees
        )
        return replace(fitted, taken=record.taken, centre=record.centre)
    largest = np.abs(angles).max()
    if degrees:
        angles = np.radians(angles)
    elif largest > _LARGEST:
        raise ProblemError(
            f"{name} has an angle of {largest:.4g} rad: if angles are degrees, say so "
            f"(degrees=True, --degrees)."
        )
    time = time - time[0]
    return _closed(name, time, angles, _fit(name, time, angles, period, harmonics), degrees)


def _check_joints(name: str, count: int, n_joint: int) -> None:
    if count != n_joint:
        raise ProblemError(
            f"{name} has angles of {count} joint{'s' * (count != 1)}, and the body has {n_joint}."
        )


def _numbers(name: str, given: object) -> np.ndarray:
    try:
        angles = np.array(given, dtype=float)
    except (TypeError, ValueError):
        raise ProblemError(
            f"{name} must be joint angles, a number for each joint and time, not "
            f"{type(given).__name__}."
        ) from None
    if angles.ndim != 2 or angles.shape[1] < FEWEST:
        raise ProblemError(
            f"{name} must have a row for each joint and a column for each of at least {FEWEST} "
            f"times."
        )
    if not np.isfinite(angles).all():
        joint, k = np.argwhere(~np.isfinite(angles))[0]
        raise ProblemError(f"{name} has no finite angle of joint {joint + 1} at sample {k + 1}.")
    return angles


class _Fit(NamedTuple):
    """Which series is to go through angles at times from 0."""

    harmonics: int
    drifts: bool
    """Whether the record drifts."""
    score: float
    """Mean square distance over the square of the share of numbers that are left."""
    period: float
    chosen: bool = False
    """Whether the period was told from the samples."""


def _columns(time: np.ndarray, fit: _Fit) -> np.ndarray:
    """The drift, if there is one, then 1, the first cosine and sine, the second ...: ``(n_time,
    n_number)``."""
    phases = time / fit.period
    turns = 2 * np.pi * phases[:, None] * np.arange(1, fit.harmonics + 1)
    waves = np.stack([np.cos(turns), np.sin(turns)], axis=2).reshape(phases.size, -1)
    columns = np.concatenate(
        [(phases - phases.mean())[:, None], np.ones((phases.size, 1)), waves], axis=1
    )
    return columns if fit.drifts else columns[:, 1:]


def _tried(time: np.ndarray, angles: np.ndarray, fit: _Fit, chosen: int = 0) -> list[_Fit]:
    """Fits of up to as many harmonics, by one factorisation; so many numbers were `chosen`
    besides."""
    q = np.linalg.qr(_columns(time, fit))[0]
    parts = q.T @ angles.T
    gains, left = (parts**2).sum(axis=1), ((angles.T - q @ parts) ** 2).sum()
    missed = left + np.append(np.cumsum(gains[::-1])[::-1], 0.0)
    numbers = 1 + fit.drifts + 2 * np.arange(1, fit.harmonics + 1)
    scores = missed[numbers] / angles.size / (1 - (numbers + chosen) / time.size) ** 2
    return [
        fit._replace(harmonics=k, score=float(score), chosen=chosen > 0)
        for k, score in enumerate(scores, 1)
    ]


def _fit(
    name: str, time: np.ndarray, angles: np.ndarray, period: float | None, harmonics: int | None
) -> _Fit:
    count, step = time.size, _typical_step(time)
    if period is not None:
        if not np.isfinite(period) or period <= 0:
            raise ProblemError(f"the period must be positive, not {period:g}.")
        if time[-1] < 0.5 * period:
            raise ProblemError(
                f"{name} holds {time[-1]:.4g} of a period of {period:.4g}: record at least one."
            )
        if period < FEWEST * step:
            raise ProblemError(
                f"{name} has a sample every {step:.4g}, fewer than {FEWEST} in a period of "
                f"{period:.4g}: give the period in "
                "the file's unit of time."
            )
    if harmonics is not None and not 1 <= harmonics <= (count - 3) // 2:
        raise ProblemError(
            f"{count} samples determine 1 to {(count - 3) // 2} harmonics, not {harmonics}."
        )

    def tried(
        period: float, drifts: bool, chosen: int = 0, most: int = _MOST_HARMONICS
    ) -> list[_Fit]:
        many = min(count, int(period / step))  # samples of a period
        most = harmonics or min(most, max(1, (many - 1) // _SAMPLES_A_HARMONIC))
        return _tried(time, angles, _Fit(most, drifts, np.inf, period), chosen)[
            (harmonics or 1) - 1 :
        ]

    def missed(period: float) -> float:
        return min(fit.score for fit in tried(period, False, most=_ROUGH))

    def nearest(low: float, high: float) -> float:
        """The period between two that fits best."""
        return float(
            minimize_scalar(
                missed, bounds=(low, high), method="bounded", options={"xatol": 1e-9 * high}
            ).x
        )

    def both(periods: Iterable[float], chosen: int) -> list[_Fit]:
        return [
            fit
            for period in periods
            for drifts in (False, True)
            for fit in tried(period, drifts, chosen)
        ]

    found = both([period] if period else time[-1] + np.array([0.0, step]), 0)
    if period is None:
        grid = time[-1] + step * np.linspace(0.0, _GAP, _GAPS)
        near = min(grid, key=missed)
        around = max(near - grid[1] + grid[0], grid[0]), near + grid[1] - grid[0]
        repeats = [nearest(low, high) for low, high in _repeats(time, angles, step)]
        found += both([nearest(*around)], 1)
        found += [
            fit for each in repeats if each > _TOLD * time[-1] for fit in tried(each, False, 1)
        ]
        several = [both([each], 1) for each in sorted(repeats) if each <= _TOLD * time[-1]]
        best = min(fit.score for fits in (found, *several) for fit in fits)
        enough = (
            max(_REPEATED * best, min(_SLOW * best, _SMALL * float(angles.var(axis=1).mean())))
            + _EXACT
        )
        found = next((fits for fits in several if min(fit.score for fit in fits) <= enough), found)
    closed = [fit for fit in found if not fit.drifts]
    if min(fit.score for fit in closed) <= _DRIFTS * min(fit.score for fit in found) + _EXACT:
        found = closed
    told = _cheapest(found)
    left_open = told.drifts and not _closes(*_coefficients(time, angles, told)[1:])
    return (
        _cheapest(closed)
        if left_open and min(fit.score for fit in closed) <= _OPEN * told.score
        else told
    )


def _cheapest(fits: list[_Fit]) -> _Fit:
    """The fit of the fewest numbers whose score is about the best."""
    enough = max(_WORTH * min(fit.score for fit in fits), _EXACT)
    return min(fit for fit in fits if fit.score <= enough)


def _coefficients(
    time: np.ndarray, angles: np.ndarray, fit: _Fit
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The numbers of every joint, how much it drifts in a period, and through what angle it moves,
    ``(n_joint, ...)``."""
    table = np.linalg.lstsq(_columns(time, fit), angles.T, rcond=None)[0].T
    moves = np.ptp(
        _series(table[:, int(fit.drifts) :]).angles(np.arange(_PHASES) / _PHASES), axis=1
    )
    return table, np.abs(table[:, 0]) * fit.drifts, moves


def _closes(drift: np.ndarray, moves: np.ndarray) -> bool:
    return bool(drift.max() <= _DRIFT * moves.max())


def _typical_step(time: np.ndarray) -> float:
    """Between samples; of many at one instant, as where stamps are rounded, the mean."""
    return float(np.median(np.diff(time))) or float(time[-1] - time[0]) / (time.size - 1)


def _repeats(time: np.ndarray, angles: np.ndarray, step: float) -> list[tuple[float, float]]:
    """Between what lengths of time a record may repeat itself, the likeliest ones: where it differs
    least from itself that much later. Of many periods a length is told by as many as there are."""
    even = np.arange(0.0, time[-1], step)
    moved = np.array([np.interp(even, time, row - row.mean()) for row in angles])
    n = even.size
    spectrum = np.abs(np.fft.rfft(moved, 2 * n, axis=1)) ** 2
    alike = np.fft.irfft(spectrum.sum(axis=0), 2 * n)[:n]
    squares = np.append(0.0, np.cumsum((moved**2).sum(axis=0)))
    later = np.arange(n)
    differs = (
        (squares[n - later] + squares[n] - squares[later] - 2 * alike)
        / (n - later)
        / (2 * squares[n] / n + 1e-300)
    )
    differs = differs[: n - 1]
    if n <= FEWEST:
        return []
    inner = np.arange(FEWEST, differs.size - 1)
    least = inner[(differs[inner] <= differs[inner - 1]) & (differs[inner] < differs[inner + 1])]
    if not least.size:
        return []
    found = set()
    for more in _ALIKE:
        first = least[np.argmax(differs[least] <= 1.5 * differs[least].min() + more)]
        around, length, times = 0.25 * first, float(first), 1
        while 2 * times * length + around < n - 2:
            times *= 2
            window = np.arange(round(times * length - around), round(times * length + around) + 1)
            length = float(window[np.argmin(differs[window])]) / times
        for part in (1, 2, 3):  # what a gap in the record may hide
            if length - 2.0 / times > part * FEWEST:
                found.add(
                    ((length - 2.0 / times) * step / part, (length + 2.0 / times) * step / part)
                )
    return sorted(found)


def _closed(
    name: str, time: np.ndarray, angles: np.ndarray, fit: _Fit, degrees: bool
) -> FittedGait:
    """A gait without the drift of its record. `ProblemError` if that is no small one."""
    table, drift, moves = _coefficients(time, angles, fit)
    gait, joint = _series(table[:, int(fit.drifts) :]), int(drift.argmax())
    if not _closes(drift, moves):
        raise ProblemError(
            f"{name} does not close: after a period joint {joint + 1} is off by "
            f"{_told(drift[joint], degrees)}, and it moves "
            f"through {_told(moves[joint], degrees)}. Give one whole period, or say how long it is "
            f"(period=, --period)."
        )
    off = gait.angles(time / fit.period) - angles
    uncertainty = _uncertainty(time, angles, fit, table)
    return FittedGait(
        gait,
        float(np.sqrt((off**2).mean())),
        float(np.abs(off).max()),
        time.size,
        float(drift.max()),
        degrees,
        time[-1] / fit.period,
        fit.period,
        uncertainty,
    )


def _uncertainty(time: np.ndarray, angles: np.ndarray, fit: _Fit, table: np.ndarray) -> Uncertainty:
    """By what a least-squares fit may be off: the covariance of its numbers, and of the period
    where samples told it.

    So large harmonics may be that the samples do not show: those up to twice the highest are in the
    covariance, too. Where they hold more of the residuals than their share, noise is slower than
    the samples, and there is as much of it in the others.
    """
    first, samples = int(fit.drifts), round(fit.period / _typical_step(time))
    most = min(max((min(time.size - first, samples) - 1) // 2, fit.harmonics), _HIGHEST)
    near, far = (fit._replace(harmonics=min(most, many * fit.harmonics + 1)) for many in (2, 4))
    residuals, size, richer = (
        angles - table @ _columns(time, fit).T,
        table.shape[1],
        _richer(time, angles, table, fit, far),
    )
    if richer is not None and richer.shape[1] < time.size:
        # what is left of the residuals is noise; where nothing is left, all of them may be
        size = richer.shape[1]
        residuals = angles - richer @ _columns(time, far).T
    columns, left, freedom = (
        _columns(time, near),
        (residuals**2).sum(axis=1),
        max(time.size - size, 1),
    )
    u, s, v = np.linalg.svd(columns, full_matrices=False)
    share = (
        ((residuals @ u) ** 2).sum()
        / (left.sum() + 1e-300)
        * freedom
        / max(columns.shape[1] - table.shape[1], 1)
    )
    deviation = np.sqrt(left / freedom * max(share, _correlation_time(residuals))) + 1e-300
    root = (v.T / s)[first:].T  # a row for each direction
    directions = np.einsum("j,jk,ri->jrki", deviation, np.eye(len(table)), root).reshape(
        -1, len(table), root.shape[1]
    )
    if fit.chosen:
        later, sooner = (
            _columns(time, fit._replace(period=fit.period * (1 + step))) for step in (_STEP, -_STEP)
        )
        by_period = table @ (later - sooner).T / (2 * _STEP)
        along = by_period @ u
        beside = ((by_period - along @ u.T) / deviation[:, None]) ** 2
        directions = np.concatenate(
            [directions, -((along / s) @ v)[None, :, first:] / np.sqrt(beside.sum() + 1e-300)]
        )
    more = None if richer is None else _series(richer[:, first:])
    return Uncertainty(directions, float(stdtrit(freedom, _COVERED)), more)


def _richer(
    time: np.ndarray, angles: np.ndarray, table: np.ndarray, fit: _Fit, far: _Fit
) -> np.ndarray | None:
    """The numbers of a fit of more harmonics, if these are worth more than noise would be (F
    test)."""
    columns = _columns(time, far)
    more, left = columns.shape[1] - table.shape[1], time.size - columns.shape[1]
    richer = np.linalg.lstsq(columns, angles.T, rcond=None)[0].T
    missed, still = (
        ((angles - x @ y.T) ** 2).sum()
        for x, y in ((table, _columns(time, fit)), (richer, columns))
    )
    worth = (missed / (still + 1e-300) - 1) * left / max(more, 1)
    if more < 1 or (left > 0 and fdtrc(len(angles) * more, len(angles) * left, worth) > _CHANCE):
        return None
    return np.asarray(richer)


def _correlation_time(residuals: np.ndarray) -> float:
    """How many samples in a row have one residual: 1 for noise without memory, more where a fit
    lacks something."""
    n = residuals.shape[1]
    spectrum = np.abs(np.fft.rfft(residuals, 2 * n, axis=1)) ** 2
    correlation = np.fft.irfft(spectrum.sum(axis=0), 2 * n)[:n]
    correlation /= correlation[0] + 1e-300
    ends = np.flatnonzero(correlation <= 0)
    return float(1 + 2 * correlation[1 : ends[0] if ends.size else n].sum())


def _series(table: np.ndarray) -> Fourier:
    """The series of coefficients (mean, cos 1, sin 1, ...)."""
    return Fourier(table[:, 0], table[:, 1::2], table[:, 2::2])


def coefficients(gait: Fourier) -> np.ndarray:
    """(mean, cos 1, sin 1, cos 2, ...) of every joint, ``(n_joint, 2 n_harmonic + 1)``."""
    table = np.empty((gait.n_joint, 2 * gait.n_harmonic + 1))
    table[:, 0], table[:, 1::2], table[:, 2::2] = gait.mean, gait.cos, gait.sin
    return table
