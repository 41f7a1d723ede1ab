"""Measured or invented joint angles as a gait: a Fourier series of the phase by least squares.

Generalised cross-validation tells how many harmonics the samples are worth, whether the record
drifts, which is taken out so that the gait closes, and the period: from the last sample to the
first one of the next period, or after which the record repeats itself.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Collection
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, NamedTuple, cast

import numpy as np
import scipy  # loads `optimize` and `special` where they are used

from colloc.gaits.gait import GaitFunction
from colloc.gaits.harmonic import Fourier
from colloc.gaits.record import FEWEST, LARGEST, Column, Record, read_record
from colloc.mechanics.chain import Chain
from colloc.system.arguments import check_finite, finite_array
from colloc.system.errors import ProblemError

_MOST_HARMONICS, _SAMPLES_A_HARMONIC = 24, 4
_WORTH, _EXACT = 1.05, 1e-16  # factor and mean square [rad^2] by which scores count as equal
_PHASES = np.arange(1024) / 1024  # at which a function is sampled
_GAP = 5  # most steps from the last sample to the next period
_DRIFT = 0.1  # drift per cycle that still closes, of a joint's range
_ALIKE = 0.2
"""Excess of the difference of a record from itself one cycle later over several later, at most."""
_REPEATED, _DRIFTS = 10.0, 4.0
"""Ratio of the score of several cycles to that of a long one, and without a drift to with one."""
_ROUGH = 6  # harmonics by which the period is told
SEVERAL = 1.1  # periods from which a record holds more than one
_STEP = 1e-5  # relative, of differences by the period
_HIGHEST = 64  # harmonics of a class at most
_CHANCE = 0.05  # that noise alone seems worth more harmonics
COVERED = 0.97725  # standard normal distribution at two standard deviations
_TINY = 1e-300

Given = Fourier | np.ndarray | str | os.PathLike[str] | Callable[[np.ndarray], np.ndarray]
"""A series; angles ``(n_joint, n_time)`` at equal steps of a cycle, or labelled by xarray; a CSV
file; or a function of phases ``(n_time,)``."""


@dataclass(frozen=True, eq=False)
class Uncertainty:
    directions: np.ndarray
    """Independent changes by a standard deviation, ``(n_direction, n_joint, n_coefficient)``, as
    `Fourier.table`; also of harmonics beyond the series."""
    factor: float  # standard deviations that cover 95 %: two, or Student's for few samples
    richer: Fourier | None  # of more harmonics, if smoothing leaves out more than noise


@dataclass(frozen=True, eq=False)
class FittedGait:
    gait: Fourier
    rms: float = 0.0  # root-mean-square residual of the angles [rad]
    largest: float = 0.0  # and the largest
    samples: int = 0  # 0 for a series, which is taken as it is
    drift: float = 0.0  # largest drift of a joint per cycle [rad], taken out
    degrees: bool = False  # whether angles were given in degrees
    periods: float = 1.0  # that the samples hold
    period: float = 1.0  # in the unit of time of a file
    uncertainty: Uncertainty | None = None  # None for a series
    record: Record | None = None  # of a file
    path: np.ndarray | None = None  # of centre and tail over a cycle, (2, 2, n_time)
    went: float = 0.0  # distance of the centre per cycle, mean over the record [body lengths]

    @property
    def seconds(self) -> float | None:
        """A cycle of a record whose unit of time is known [s]."""
        second = self.record.second if self.record else None
        return self.period / second if second else None

    @property
    def centre(self) -> int:
        """`colloc.gaits.record.Record.centre`."""
        return self.record.centre if self.record else 0

    def describe(self, used: Collection[Column] = ()) -> str:
        if not self.samples:
            return "the series as it was given"
        plural = "s" * (self.gait.n_harmonic > 1)
        rms, largest = (_format(a, self.degrees, ".1e") for a in (self.rms, self.largest))
        text = f"{self.record.describe(used)}; " if self.record else ""
        if self.centre:
            text += f"all joints move about {self.centre}°, which servos may count from; "
        text += f"{self.gait.n_harmonic} harmonic{plural} fitted to {self.samples} samples"
        if self.periods > SEVERAL:
            text += f" of {self.periods:.3g} cycles of {self.period:.4g}"
        if self.drift:
            text += f", a drift of {_format(self.drift, self.degrees)} per cycle taken out"
        return f"{text}: residual {rms} r.m.s., {largest} at most"


def _format(angle: float, degrees: bool, digits: str = ".3g") -> str:
    return f"{np.degrees(angle):{digits}}°" if degrees else f"{angle:{digits}} rad"


def fitted_gait(
    source: Given,
    n_joint: int,
    *,
    period: float | None = None,
    harmonics: int | None = None,
    degrees: bool = False,
    body: Chain | None = None,
) -> FittedGait:
    """Fit a gait to joint angles; `period` is in the unit of time of a file, and `degrees` holds
    where a file names no unit. Markers may tell the angles of a `body`."""
    name, record = "the gait", None
    if isinstance(source, Fourier):
        angles = source.mean[:, None]
    elif isinstance(source, (str, os.PathLike)):
        name, record = str(source), read_record(Path(source), n_joint, degrees=degrees, body=body)
        time, angles, degrees = record.time, record.angles, record.degrees
        period = period or record.period
    elif callable(source):
        time, period = _PHASES, 1.0
        function = source.angles if isinstance(source, GaitFunction) else source
        angles = finite_array(name, function(time), 2)
    elif {"joint"} < set(getattr(source, "dims", ())):  # labelled, as `Solution.to_xarray` has them
        labelled = cast(Any, source).transpose("joint", ...)
        angles = finite_array(name, labelled, 2)
        time = np.asarray(labelled[labelled.dims[-1]], dtype=float)
    else:
        angles = finite_array(name, source, 2)
        time = np.arange(angles.shape[1], dtype=float)
    if (count := len(angles)) != n_joint:
        raise ProblemError(
            f"{name} has angles of {count} joint{'s' * (count != 1)}, and the body has {n_joint}."
        )
    if isinstance(source, Fourier):
        return FittedGait(source)
    if angles.shape[1] < FEWEST:
        raise ProblemError(f"{name} must have angles at {FEWEST} times or more.")
    if record is None and degrees:
        angles = np.radians(angles)
    elif record is None and (largest := np.abs(angles).max()) > LARGEST:
        raise ProblemError(
            f"{name} has an angle of {largest:.4g} rad: if angles are degrees, say so "
            f"(degrees=True, --degrees)."
        )
    samples = _Samples(name, time - time[0], angles, degrees)
    fitted = samples.gait(samples.best_fit(period, harmonics))
    if record is None:
        return fitted
    fitted = replace(fitted, record=record)
    return fitted if record.path is None else _with_path(fitted, samples, record.path)


def _with_path(fitted: FittedGait, samples: _Samples, path: np.ndarray) -> FittedGait:
    """A gait with what the markers went in its cycle; a step beyond the record, where a cycle
    ends without its last sample, they go straight on."""
    end, step = samples.time[-1], samples.step
    time = np.append(samples.time, end + 2 * step)
    path = np.append(path, path[..., -1:] + 2 * (path[..., -1:] - path[..., -2:-1]), axis=2)
    begin = samples.time[samples.time + fitted.period <= end + 1.5 * step]
    x, y = (np.interp(begin + fitted.period, time, row) for row in path[0])
    steps = np.hypot(x - path[0, 0, : begin.size], y - path[0, 1, : begin.size])
    went = float(steps.mean()) if begin.size else 0.0
    return replace(fitted, path=path[..., time <= fitted.period + 0.5 * step], went=went)


class _Fit(NamedTuple):
    harmonics: int
    drifts: bool  # whether the record drifts
    score: float  # mean square residual over the square of the share of numbers that are left
    period: float
    chosen: bool = False  # whether the period was told from the samples

    def columns(self, time: np.ndarray) -> np.ndarray:
        """The drift, if there is one, 1, cos 1, sin 1, cos 2, ...: ``(n_time, n_number)``."""
        phases = time / self.period
        turns = 2 * np.pi * phases[:, None] * np.arange(1, self.harmonics + 1)
        waves = np.stack([np.cos(turns), np.sin(turns)], axis=2).reshape(phases.size, -1)
        drift = [phases - phases.mean()] if self.drifts else []
        return np.column_stack([*drift, np.ones(phases.size), waves])


def _best(fits: list[_Fit]) -> float:
    return min(fit.score for fit in fits)


class _Samples(NamedTuple):
    name: str
    time: np.ndarray
    angles: np.ndarray  # (n_joint, n_time)
    degrees: bool  # for messages

    @property
    def step(self) -> float:
        """Median time step; the mean if most samples share a rounded time."""
        time = self.time
        return float(np.median(np.diff(time))) or float(time[-1] - time[0]) / (time.size - 1)

    def least_squares(self, fit: _Fit) -> tuple[np.ndarray, np.ndarray]:
        """Coefficients of the columns of a fit, ``(n_joint, n_number)``, and the residuals."""
        columns = fit.columns(self.time)
        table = np.linalg.lstsq(columns, self.angles.T, rcond=None)[0].T
        return table, self.angles - table @ columns.T

    def scores(self, fit: _Fit, fewest: int, chosen: int) -> list[_Fit]:
        """Fits of `fewest` to all harmonics, with `chosen` more numbers, by one QR."""
        q = np.linalg.qr(fit.columns(self.time))[0]
        parts = q.T @ self.angles.T
        gains, left = (parts**2).sum(axis=1), ((self.angles.T - q @ parts) ** 2).sum()
        residual = left + np.append(np.cumsum(gains[::-1])[::-1], 0.0)
        fits = []
        for k in range(fewest, fit.harmonics + 1):
            numbers = 1 + fit.drifts + 2 * k
            free = 1 - (numbers + chosen) / self.time.size
            score = float(residual[numbers] / self.angles.size / free**2)
            fits.append(fit._replace(harmonics=k, score=score, chosen=chosen > 0))
        return fits

    def check(self, period: float | None, harmonics: int | None) -> None:
        step, most, span = self.step, (self.time.size - 3) // 2, self.time[-1]
        what = ""
        if period is None:
            period = np.nan
        else:
            check_finite(positive=True, period=period)
        if span < 0.5 * period:
            what = f"{self.name} holds {span:.4g} of a period of {period:.4g}: record at least one."
        elif period < FEWEST * step:
            what = (
                f"{self.name} has a sample every {step:.4g}, fewer than {FEWEST} in a period of "
                f"{period:.4g}: give the period in the file's unit of time."
            )
        elif harmonics is not None and not 1 <= harmonics <= most:
            what = f"{self.time.size} samples determine 1 to {most} harmonics, not {harmonics}."
        if what:
            raise ProblemError(what)

    def best_fit(self, period: float | None, harmonics: int | None) -> _Fit:
        self.check(period, harmonics)
        end, step = self.time[-1], self.step

        def up_to(most, period, chosen, drifts=False):
            many = min(self.time.size, int(period / step))  # samples of a cycle
            most = harmonics or min(most, max(1, (many - 1) // _SAMPLES_A_HARMONIC))
            return self.scores(_Fit(most, drifts, np.inf, period), harmonics or 1, chosen)

        def fits(period, chosen):
            closed = up_to(_MOST_HARMONICS, period, chosen)
            return closed + up_to(_MOST_HARMONICS, period, chosen, drifts=True)

        def score(period):
            return _best(up_to(_ROUGH, period, 0))

        def best_period(low, high):
            how: Any = {"method": "bounded", "options": {"xatol": 1e-9 * high}}
            return float(scipy.optimize.minimize_scalar(score, bounds=(low, high), **how).x)

        if period is not None:
            candidates = fits(period, 0)
        else:
            # the next period begins with the last sample, or some steps later, or was recorded
            gaps = end + step * np.arange(_GAP + 1)
            later = min(map(best_period, gaps[:-1], gaps[1:]), key=score)
            repeats = [best_period(*bracket) for bracket in self.find_repeats()]
            candidates = fits(gaps[0], 0) + fits(gaps[1], 0)
            for each in (later, *(each for each in repeats if each > 0.5 * end)):
                candidates += fits(each, 1)
            several = [fits(each, 1) for each in repeats if each <= 0.5 * end]
            enough = _REPEATED * min(map(_best, (candidates, *several))) + _EXACT
            candidates = next((each for each in several if _best(each) <= enough), candidates)
        closed = [fit for fit in candidates if not fit.drifts]
        if _best(closed) <= _DRIFTS * _best(candidates) + _EXACT:
            candidates = closed
        enough = max(_WORTH * _best(candidates), _EXACT)
        return min(fit for fit in candidates if fit.score <= enough)

    def find_repeats(self) -> list[tuple[float, float]]:
        """Likely brackets of the period: least differences of the record from itself later."""
        step = self.step
        even = np.arange(0.0, self.time[-1], step)
        moved = np.array([np.interp(even, self.time, row - row.mean()) for row in self.angles])
        n = even.size
        alike, later = _autocorrelation(moved), np.arange(n)
        squares = np.append(0.0, np.cumsum((moved**2).sum(axis=0)))
        differs = squares[n - later] + squares[n] - squares[later] - 2 * alike
        differs = (differs / (n - later) / (2 * squares[n] / n + _TINY))[: n - 1]
        inner = np.arange(FEWEST, differs.size - 1)
        falls, rises = differs[inner] <= differs[inner - 1], differs[inner] < differs[inner + 1]
        least = inner[falls & rises]
        if not least.size:
            return []
        first = least[np.argmax(differs[least] <= 1.5 * differs[least].min() + _ALIKE)]
        around, length, times = 0.25 * first, float(first), 1
        while 2 * times * length + around < n - 2:
            times *= 2
            low, high = (round(times * length + side * around) for side in (-1, 1))
            length = float(low + np.argmin(differs[low : high + 1])) / times
        low, high = (length - 2.0 / times) * step, (length + 2.0 / times) * step
        # a gap in the record may hide that it repeats sooner
        return [(low / k, high / k) for k in (3, 2, 1) if low > k * FEWEST * step]

    def gait(self, fit: _Fit) -> FittedGait:
        """The gait without the drift of its record. `ProblemError` if that is not small."""
        table, _ = self.least_squares(fit)
        gait = Fourier.from_table(table[:, int(fit.drifts) :])
        drift = np.abs(table[:, 0]) * fit.drifts  # per cycle
        ranges = np.ptp(gait.angles(_PHASES), axis=1)
        gap, what = np.diff(self.time).max(), ""
        if ranges.max() > 3 * np.ptp(self.angles, axis=1).max():
            what = f"has no samples for {gap:.4g} of a period of {fit.period:.4g}"
        elif drift.max() > _DRIFT * ranges.max():
            joint = int(drift.argmax())
            off, moves = (_format(each[joint], self.degrees) for each in (drift, ranges))
            what = f"does not close: after a cycle joint {joint + 1} is off by {off}, and it moves "
            what += f"through {moves}"
        if what:
            raise ProblemError(
                f"{self.name} {what}. Give one whole period, or say how long it is "
                f"(period=, --period)."
            )
        off = gait.angles(self.time / fit.period) - self.angles
        return FittedGait(
            gait,
            rms=float(np.sqrt((off**2).mean())),
            largest=float(np.abs(off).max()),
            samples=self.time.size,
            drift=float(drift.max()),
            degrees=self.degrees,
            periods=self.time[-1] / fit.period,
            period=fit.period,
            uncertainty=self.uncertainty(fit),
        )

    def uncertainty(self, fit: _Fit) -> Uncertainty:
        """Covariance of the fit, of harmonics up to twice the highest, and of a period told from
        the samples."""
        time, first = self.time, int(fit.drifts)
        most = min(time.size - first, round(fit.period / self.step))
        most = min(max((most - 1) // 2, fit.harmonics), _HIGHEST)
        twice, far = (fit._replace(harmonics=min(most, k * fit.harmonics + 1)) for k in (2, 4))
        (table, residuals), (richer, rest) = self.least_squares(fit), self.least_squares(far)
        joints, used = len(table), table.shape[1]
        # whether more harmonics fit better than by chance (F test)
        more, left = richer.shape[1] - used, time.size - richer.shape[1]
        ratio = ((residuals**2).sum() / ((rest**2).sum() + _TINY) - 1) * left / max(more, 1)
        by_chance = left > 0 and scipy.special.fdtrc(joints * more, joints * left, ratio) > _CHANCE
        is_richer = more >= 1 and not by_chance
        if is_richer and left > 0:
            # what is left of the residuals is noise; where nothing is left, all of them may be
            residuals, used = rest, richer.shape[1]
        freedom = max(time.size - used, 1)
        u, s, v = np.linalg.svd(twice.columns(time), full_matrices=False)
        variance = (residuals**2).sum(axis=1) / freedom * correlation_time(residuals)
        deviation = np.sqrt(variance) + _TINY
        # the symmetric root of the covariance, as rounding decides about another's directions
        root = ((v.T / s) @ v)[first:].T
        each = deviation[:, None] * np.eye(joints)
        directions = np.einsum("jk,ri->jrki", each, root).reshape(-1, joints, root.shape[1])
        if fit.chosen:
            factors = 1 + _STEP, 1 - _STEP
            longer, shorter = (fit._replace(period=fit.period * x).columns(time) for x in factors)
            by_period = table @ (longer - shorter).T / (2 * _STEP)
            along = by_period @ u
            orthogonal = ((by_period - along @ u.T) / deviation[:, None]) ** 2
            change = -((along / s) @ v)[None, :, first:] / np.sqrt(orthogonal.sum() + _TINY)
            directions = np.concatenate([directions, change])
        series = Fourier.from_table(richer[:, first:]) if is_richer else None
        return Uncertainty(directions, float(scipy.special.stdtrit(freedom, COVERED)), series)


def _autocorrelation(rows: np.ndarray) -> np.ndarray:
    n = rows.shape[1]
    spectrum = np.abs(np.fft.rfft(rows, 2 * n, axis=1)) ** 2
    return np.fft.irfft(spectrum.sum(axis=0), 2 * n)[:n]


def correlation_time(residuals: np.ndarray) -> float:
    """Samples in a row that share a residual: 1 for white noise, more if a fit lacks something."""
    correlation = _autocorrelation(residuals)
    correlation /= correlation[0] + _TINY
    ends = np.flatnonzero(correlation <= 0)
    end = ends[0] if ends.size else correlation.size
    return float(1 + 2 * correlation[1:end].sum())
