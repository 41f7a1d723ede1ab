"""Friction from motion: the coefficients under which a body whose joint angles were measured goes
the measured way.

The joint angles are fitted (`colloc.gaits.fitted_gait`) and the motion integrated; origin and
direction of the measured axes follow in closed form. What is left is least squares on logarithms x
of the coefficients over the stated ones. Errors are those of the residuals, as many as are
independent, and of the samples of the joint angles.
"""

from __future__ import annotations

import math
import os
import re
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from scipy.optimize import least_squares
from scipy.special import stdtrit

from colloc.gaits.coupled import Coupled
from colloc.gaits.fitted_gait import COVERED, Uncertainty, correlation_time, fitted_gait
from colloc.gaits.gait import delta_per_period
from colloc.gaits.gait_fields import AnyGait
from colloc.gaits.harmonic import Fourier, Harmonic
from colloc.gaits.parameters import COEFFICIENTS, parameters
from colloc.gaits.problem import Problem
from colloc.gaits.record import FEWEST, HEADINGS, read_record
from colloc.mechanics.chain import Chain
from colloc.results.motion import RigidMotion
from colloc.smooth.prescribed_body import schedule
from colloc.system.arguments import check_finite
from colloc.system.csv_table import read_table
from colloc.system.errors import ProblemError
from colloc.verification.adaptive_motion import fine_motion
from colloc.verification.differential_motion import GaitWithInertia

_UNITS = {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "rad": 1.0, "deg": np.pi / 180, "°": np.pi / 180}
_POINTS = {"head": "head", "tail": "tail", "centre": "centre", "center": "centre"}
_ACCURACY = 1e-5  # of the motion [body lengths]
_STEP = 1e-3  # of x in differences
_VAGUE, _HELD = 3.0, 1e-2
"""Standard deviations of x before anything is measured, and of what the motion does not tell."""
_FARTHEST = math.log(100.0)  # largest x
_UNTOLD = 0.5  # standard deviation of x from which the motion does not tell it
_MISSED, _ALIKE = 0.1, 3.0
"""Residual over the extent of the path, and like samples in a row, from which no coefficients
explain it."""
_PART = 0.3  # of the largest change, that is named


@dataclass(frozen=True, eq=False)
class Identified:
    """Friction found from a motion."""

    problem: Problem = field(repr=False)  # with this friction
    coefficients: dict[str, tuple[float, float]]
    """Values and errors, two standard deviations; these are infinite where the motion does not tell
    a coefficient, and 0 where it is as stated."""
    before: float
    """Root mean square distance of the predicted path from the measured one with the stated
    coefficients [body lengths; rad if there are headings alone]."""
    after: float  # with the identified ones
    remarks: tuple[str, ...]  # what the motion does not tell
    message: str  # what was read

    @property
    def line(self) -> str:
        """For the problem file."""
        feet = getattr(self.problem.body, "feet", ())
        own = any(foot.friction is not None for foot in feet)
        return f"feet={feet!r}" if own else f"friction={self.problem.friction!r}"

    def facts(self) -> dict[str, Any]:
        """Plain numbers (JSON); None for an error that is infinite."""
        finite = {x: [v, e if e < math.inf else None] for x, (v, e) in self.coefficients.items()}
        plain = {name: getattr(self, name) for name in ("before", "after", "remarks", "message")}
        return {"coefficients": finite, **plain, "line": self.line}

    def __str__(self) -> str:
        words = {0.0: "as stated", math.inf: "not told by this motion"}
        rows = [
            f"{name:<10}  {value:<8.4g} {words.get(error, f'+- {error:.2g}')}"
            for name, (value, error) in self.coefficients.items()
        ]
        off = f"{self.before:.2g} before, {self.after:.2g} after"
        rows += [f"predicted path off by {off} (r.m.s.)", *self.remarks, self.line]
        return "\n".join(f"  {row}" for row in rows)


def identify(
    problem: Problem,
    record: str | os.PathLike[str],
    *,
    length: float | None = None,
    mu_forward: float | None = None,
    period: float | None = None,
    harmonics: int | None = None,
    degrees: bool = False,
) -> Identified:
    """Identify coefficients of friction from measured joint angles and the way that a body went.

    Slow motion under dry friction tells ratios of coefficients alone: the forward one is taken as
    stated. With inertia all of them are found.

    Parameters
    ----------
    problem : Problem
        Body and law of friction; the search begins at its coefficients.
    record : path of a CSV file
        Times and joint angles as for `colloc.evaluate`, over one or more periods, and places: x, y
        of the centre of mass, head_x, head_y, tail_x, tail_y; perhaps the direction of the tail
        link, theta, yaw or heading, or head_theta. Or markers at all ends and joints, which tell
        the angles too. Axes may lie anywhere, y to the left of x.
    length : float, optional
        Of the body [m], if places are in m or, by their names, cm or mm; by default that of the
        problem's robot. Without any they are in body lengths.
    mu_forward : float, optional
        The forward coefficient as measured otherwise, where motion tells ratios alone; by default
        the stated one.
    period, harmonics, degrees
        See `colloc.evaluate`.

    Returns
    -------
    Identified
        Its `problem` has the friction that was found, `coefficients` has values and errors.

    Raises
    ------
    ProblemError
        If the record cannot be read or holds no path, or the problem is one on a slope, of a
        prescribed motion, or under a law without coefficients.
    NotConvergedError
        If the motion cannot be computed.

    Examples
    --------
    A record as of a robot on a floor that one does not know:

    >>> import tempfile, colloc
    >>> gait, floor = colloc.ellipse(A0=0.3, A1=1.6, B1=1.1), colloc.Problem("floor", delta=1e-3)
    >>> carpet = floor.with_(friction=colloc.Friction(mu_t=1.7, mu_f=1.0, mu_b=1.3))
    >>> record = tempfile.mkdtemp() + "/record.csv"
    >>> colloc.evaluate(carpet, gait).to_dataframe()[::10].to_csv(record)
    >>> colloc.identify(floor, record).problem.friction
    Friction(mu_t=1.7, mu_f=1.0, mu_b=1.3)
    """
    if problem.regime.slides or schedule(problem.body) or problem.regime.free is not None:
        raise ProblemError(
            f"{problem.name} is no gait on the level at one pace: state a problem of such gaits."
        )
    length = length or getattr(problem.robot, "length", None)
    if length is not None:
        check_finite(positive=True, length=length)
    path, n_motor, body = Path(record), problem.n_motor, problem.body
    how: Any = {"degrees": degrees, "body": None}
    if isinstance(body, Chain) and not problem.joint_map:  # whose angles markers may tell
        how["body"] = body
    fitted = fitted_gait(path, n_motor, period=period, harmonics=harmonics, **how)
    read = read_record(path, n_motor, **how)
    if read.path is None:
        way = _read_way(path, read.rows, length)
    else:
        places = read.path[:, 0] + 1j * read.path[:, 1]
        way = _Way(["centre", "tail"], places, [], np.empty((0, read.time.size)))
    fit = _Fit(problem.without_robot, way, fitted.gait, read.time / fitted.period)
    if mu_forward is not None:
        check_finite(positive=True, mu_forward=mu_forward)
        if not fit.only_ratios:
            raise ProblemError(
                "with inertia the motion tells all coefficients: leave mu_forward out."
            )
        fit.stated = fit.stated * (mu_forward / fit.stated[fit.forward])
    x = np.zeros(len(fit.free))
    before = fit.rms(x)
    for _ in range(2):  # then with the noise of places and of headings
        x = fit.best(x)
    alike, covariance = fit.covariance(x, fitted.uncertainty)
    squares, directions = np.linalg.eigh(covariance) if x.size else (np.empty(0), np.empty((0, 0)))
    untold = directions.T[squares > _UNTOLD**2]
    if untold.size:
        fit.prior = np.vstack([fit.prior, untold / _HELD])
        x = fit.best(0 * x)
    freedom, errors = max(fit.freedom / alike, 1.0), np.zeros(len(fit.names))
    deviations = np.sqrt(np.diag(covariance))
    errors[fit.free] = np.where(deviations < _UNTOLD, deviations, np.inf)
    values, after = fit.values(x), fit.rms(x)
    remarks = [fit.say(direction) for direction in untold]
    if fit.only_ratios:
        remarks.append(
            f"Slow motion tells ratios alone: one factor of all coefficients, here by "
            f"{fit.names[fit.forward]} as stated, changes only torques and work."
        )
    extent = float(np.nanstd(way.places if way.points else way.headings))
    if after > _MISSED * extent and alike > _ALIKE:
        remarks.append(
            "No coefficients lead there: are lengths, order and signs of joints, and the side of y "
            "right?"
        )
    errors *= values * float(stdtrit(freedom, COVERED))
    found = zip(fit.names, zip(values.tolist(), errors.tolist(), strict=True), strict=True)
    message = f"{fitted.describe()}; path of {', '.join(way.points) or 'headings'}"
    unit = f"of {length:g} m" if length else "lengths"
    message += f" in body {unit}"
    return Identified(fit.with_(x, 5), dict(found), before, after, tuple(remarks), message)


class _Way(NamedTuple):
    """Measured places ``(n_point, n)`` (complex) and directions ``(n_heading, n)``; NaN if
    blank."""

    points: list[str]
    places: np.ndarray
    ends: list[str]
    headings: np.ndarray


def _read_way(path: Path, rows: np.ndarray, length: float | None) -> _Way:
    table = read_table(path)
    found: dict[tuple[str, str], np.ndarray] = {}
    for k, each in enumerate(zip(table.names, table.units, strict=True)):
        words = re.findall(r"[^\W\d_]+|\d+|°", " ".join(each).lower())
        what = next((word for word in words if word in {"x", "y", *HEADINGS}), "")
        if not what or {*words} - {what, "pos", "position", *_UNITS, *_POINTS}:
            continue
        unit = next((word for word in words if word in _UNITS), "")
        point = next((_POINTS[word] for word in words if word in _POINTS), "")
        scale = _UNITS.get(unit, 1.0)
        if what in HEADINGS:
            found[point or "tail", "theta"] = np.unwrap(scale * table.values[rows, k])
        elif unit and length is None:
            raise ProblemError(
                f"{path}: {table.names[k]} is in {unit}: give the length of the body [m]."
            )
        else:
            found[point or "centre", what] = scale / (length or 1.0) * table.values[rows, k]
    points = [point for point, what in found if what == "x" and (point, "y") in found]
    ends = [point for point, what in found if what == "theta"]
    both = [found[point, "x"] + 1j * found[point, "y"] for point in points]
    places = np.array(both, dtype=complex).reshape(-1, rows.size)
    headings = np.array([found[end, "theta"] for end in ends]).reshape(-1, rows.size)
    if min((np.isfinite(each).sum() for each in (*places, *headings)), default=0) < FEWEST:
        raise ProblemError(
            f"{path} holds no path of the body: give columns x and y of the centre of mass, or "
            f"head_x, head_y, tail_x, tail_y, or theta."
        )
    return _Way(points, places, ends, headings)


class _Fit:
    def __init__(self, problem: Problem, way: _Way, gait: Fourier, phases: np.ndarray) -> None:
        self.problem, self.way, self.gait, self.phases = problem, way, gait, phases
        numbers, symbols = parameters(problem), {text: x for x, text in COEFFICIENTS.items()}
        known: dict[str, float] = {}
        groups: dict[str, list[int]] = {}
        for k, number in enumerate(numbers):
            words, *feet = number.name.split(" of f")
            if (symbol := symbols.get(words, "power")) != "power":
                name = " of f".join([symbol, *feet])
                forwards = name.replace("mu_b of", "mu_f of")  # a wheel rolls both ways alike
                name = forwards if known.get(forwards) == number.value else name
                known[name] = number.value
                groups.setdefault(name, []).append(k)
        if not groups:
            raise ProblemError(f"{problem.name} has a law without coefficients: state Friction().")
        self.groups, self.stated = list(groups.values()), np.array([*known.values()])
        short = [name.split(" of ")[0] for name in groups]
        self.names = short if len({*short}) == len(short) else [*groups]
        self.forward = next((k for k, x in enumerate(short) if x in ("mu_f", "tangential")), 0)
        self.only_ratios = not problem.froude and problem.law.degree is not None
        every = range(len(short))
        self.free = [k for k in every if k != self.forward or not self.only_ratios]
        self.prior = np.eye(len(self.free)) / _VAGUE
        self.scale = np.full(2, 1e-3)  # noise of places and of headings
        seen = [2 * np.isfinite(way.places).sum(), np.isfinite(way.headings).sum()]
        # less the numbers that place the axes
        self.seen = np.array(seen) - [3 * (seen[0] > 0), len(way.headings)]
        self.freedom = max(float(self.seen.sum()) - len(self.free), 1.0)

    def values(self, x: np.ndarray) -> np.ndarray:
        values = self.stated.copy()
        values[self.free] *= np.exp(x)
        return values

    def with_(self, x: np.ndarray, digits: int = 12) -> Problem:
        changed = self.problem
        for group, value in zip(self.groups, self.values(x), strict=True):
            for which in group:
                number = parameters(changed)[which]
                changed = number.changed(float(f"{value:.{digits}g}") / number.value - 1)
        return changed

    def off(self, x: np.ndarray, gait: Fourier | None = None) -> tuple[np.ndarray, np.ndarray]:
        """Predicted places and headings less measured ones, in the axes that fit best."""
        at, turned = self.poses(self.with_(x), gait or self.gait)
        seen = np.isfinite(self.way.places)
        count = max(int(seen.sum()), 1)
        both = (np.where(seen, each, 0) for each in (at, self.way.places))
        at, measured = (each - seen * each.sum() / count for each in both)
        turn = np.vdot(at, measured)
        angles = turned - self.way.headings
        angles -= np.array([np.nanmean(row) for row in angles]).reshape(-1, 1)
        return at * turn / max(abs(turn), 1e-300) - measured, np.nan_to_num(angles)

    def poses(self, problem: Problem, series: Fourier) -> tuple[np.ndarray, np.ndarray]:
        body, law, t, gait = problem.body, problem.law, self.phases % 1.0, _driven(problem, series)
        delta = delta_per_period(problem.gait, gait, problem.delta)
        if problem.froude:
            regime = problem.regime.at(gait)
            moving = GaitWithInertia(body, law, gait, delta, froude=regime.froude, regime=regime)
            rough = moving.find_period()
            course = moving.periodic_run(rough.momenta, _ACCURACY, rough.slopes).course
            order = np.argsort(t)
            theta, x, y = course.at(t[order])[3:6, np.argsort(order)]
            place, (turn, *end) = x + 1j * y, course.states[3:6, -1]
            period = RigidMotion(turn, complex(*end))
        else:
            motion = fine_motion(body, law, gait, delta, np.linspace(0, 1, 21), _ACCURACY, None)
            theta, place = motion.at(t)[:2]
            period = RigidMotion(motion.theta[-1], motion.path[-1])
        whole = period.repeat(np.floor(self.phases))
        x, y = whole.of(np.stack([place.real, place.imag]))
        theta = theta + whole.rotation
        angles = gait(t)[0]
        along, across = np.array(body.outline(angles)) - np.array(body.centre(angles))[:, None]
        outline = (along + 1j * across) * np.exp(1j * theta)
        at = {"tail": outline[0], "head": outline[-1], "centre": 0 * outline[0]}
        bent = np.unwrap(np.angle(np.diff(along + 1j * across, axis=0)[-1]))
        ends = {"tail": theta, "centre": theta, "head": theta + bent}
        shape = -1, t.size
        places = np.array([x + 1j * y + at[point] for point in self.way.points], dtype=complex)
        headings = np.array([ends[end] for end in self.way.ends])
        return places.reshape(shape), headings.reshape(shape)

    def rms(self, x: np.ndarray) -> float:
        off = self.off(x)[0 if self.way.points else 1]
        return float(np.sqrt((np.abs(off) ** 2).mean()))

    def rows(self, x: np.ndarray, gait: Fourier | None = None) -> np.ndarray:
        off = zip(self.off(x, gait), self.scale, strict=True)
        places, angles = (each.ravel() / scale for each, scale in off)
        return np.concatenate([places.real, places.imag, angles])

    def slopes(self, x: np.ndarray) -> np.ndarray:
        steps = _STEP * np.eye(x.size)
        rows = [(self.rows(x + h) - self.rows(x - h)) / (2 * _STEP) for h in steps]
        return np.reshape(rows, (x.size, -1)).T

    def best(self, x: np.ndarray) -> np.ndarray:
        """The best x, and the noise there."""
        if x.size:
            x = least_squares(
                lambda x: np.append(self.rows(x), self.prior @ x),
                x,
                lambda x: np.vstack([self.slopes(x), self.prior]),
                bounds=(-_FARTHEST, _FARTHEST),
                xtol=1e-6,
            ).x
        left = np.array([(np.abs(part) ** 2).sum() for part in self.off(x)])
        share = self.freedom / self.seen.sum()
        self.scale = np.sqrt(left / np.maximum(self.seen * share, 1)) + _ACCURACY
        return x

    def covariance(self, x: np.ndarray, samples: Uncertainty | None) -> tuple[float, np.ndarray]:
        """Number of residuals in a row that are alike, and the covariance of x."""
        places, angles = self.off(x)
        blocks = [each for each in (places.real, places.imag, angles) if each.size]
        alike = max(1.0, *map(correlation_time, blocks))
        slopes, here = self.slopes(x), self.rows(x)
        covariance = np.linalg.inv(slopes.T @ slopes / alike + self.prior.T @ self.prior)
        if samples is not None and x.size:
            most = max(samples.directions.shape[2] // 2, self.gait.n_harmonic)
            table = self.gait.resize(most).table
            others = [Fourier.from_table(table + each) for each in samples.directions]
            others += [samples.richer] if samples.richer is not None else []
            moved = [slopes.T @ (self.rows(x, each) - here) for each in others]
            effects = covariance @ np.transpose(moved) / alike
            covariance = covariance + effects @ effects.T
        return alike, covariance

    def say(self, direction: np.ndarray) -> str:
        """Sentence about a change of x that the motion does not show."""
        change = np.zeros(len(self.names))
        change[self.free] = direction / np.abs(direction).max()
        # any factor of all is left out, so as to name few
        shifts = [0.0, *change] if self.only_ratios else [0.0]
        change = min((change - c for c in shifts), key=lambda c: (np.abs(c) > _PART).sum())
        parts = np.flatnonzero(np.abs(change) > _PART)
        names = " and ".join(self.names[k] for k in parts)
        if parts.size == 1:
            others = " and ".join(name for name in self.names if name != names)
            why = "the body moves alike whatever it is"
            return f"This gait cannot tell {names} from {others}: {why}."
        by = ", ".join(f"{self.names[k]} {100 * np.expm1(0.1 * change[k]):+.0f} %" for k in parts)
        return f"This gait cannot tell {names} apart: the body moves alike with {by}."


def _driven(problem: Problem, series: Fourier) -> AnyGait:
    if not isinstance(problem.gait, Coupled):
        return series
    gears = replace(problem.gait, gait=Harmonic(series.n_harmonic))
    return gears.driven_by(series, problem.body.n_joint)
