r"""Laws of friction of one's own: by two formulas, checked for what the solvers rely on; or fitted
to measured coefficients, a Stribeck curve of the speed in each direction,

    mu(v) = c_0 + c_1 exp(-v / v_S) + c_2 (1 - exp(-v / v_S)) + c_3 v,

with no c negative, so that friction takes energy at every speed (non-negative least squares). Of
the curves of one to three terms Bayes' information criterion takes one, with at least two more
samples than numbers; v_S is one for all directions.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import scipy  # loads `optimize` where it is used, in a tenth of a second

from colloc.mechanics.friction import Friction, regularised_speed
from colloc.mechanics.law import Matrix
from colloc.numerics.arrays import Array
from colloc.numerics.expression import Formula, formula
from colloc.system.arguments import check_finite, check_positive, finite_array, named_arguments
from colloc.system.csv_table import csv_table
from colloc.system.errors import ProblemError

VARIABLES = ("vs", "vn", "speed", "delta")
_DIRECTIONS, _SPEEDS, _DELTAS = 48, np.geomspace(1e-4, 1e2, 13), (1e-6, 1e-2)
_STEP, _JUMP = 1e-9, 1e-6
"""Distance in delta, and change of the force over the largest, that tell a jump from a slope of
1/delta."""
_NEARLY, _STEEP = 1e-3, 0.5
"""A small part of the speed, and more than that of the force it has alone."""
_RTOL, _LEAST = 1e-10, 1e-12
_ANGLE = np.linspace(0, 2 * np.pi, 721)[None]
_CIRCLE, _DRY = (np.cos(_ANGLE), np.sin(_ANGLE)), np.array([[1e-9]])  # unit speed, and its delta


def _samples() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Velocities in all directions, over many speeds and two deltas, ``(1, n)`` each."""
    angle = 2 * np.pi * (np.arange(_DIRECTIONS) + 0.5) / _DIRECTIONS
    speed, angle, delta = (a.reshape(1, -1) for a in np.meshgrid(_SPEEDS, angle, _DELTAS))
    return speed * np.cos(angle), speed * np.sin(angle), delta


def _same(a: Array, b: Array) -> bool:
    return bool(np.allclose(a, b, rtol=_RTOL, atol=0.0))


@named_arguments
@dataclass(frozen=True)
class OwnLaw:
    """Friction per length by formulas of the sliding velocity; a law of friction.

    Parameters
    ----------
    tangential, normal : str
        Force along the body and across it, in terms of ``vs`` and ``vn``, the velocity along
        (positive towards the head) and across; ``speed``, which is ``sqrt(vs**2 + vn**2 +
        delta**2)``; numbers, ``+ - * / **``, ``sqrt``, ``exp``, ``log``, ``tanh``, ``abs`` and
        ``where(condition, a, b)``. Where a dry law divides by the speed, let it be ``speed``: it is
        never zero.
    unit, speed_unit : float
        Divisor of forces; factor of velocities and delta before the formulas see them.

    Raises
    ------
    ProblemError
        If a formula cannot be read, or the law gives energy to the body somewhere, does not vanish
        at rest, or differs between left and right (the mirror image of a gait would be another
        gait).

    Examples
    --------
    Friction that weakens when the body slides fast:

    >>> from colloc import OwnLaw
    >>> law = OwnLaw("-vs/speed * (1 + 0.5*exp(-speed))", "-2*vn/speed * (1 + 0.5*exp(-speed))")
    >>> law.reversible, law.degree
    (True, None)
    """

    tangential: str = "-vs/speed"
    normal: str = "-vn/speed"
    unit: float = 1.0
    speed_unit: float = 1.0

    kernel_numbers = ()
    associated = False  # samples cannot tell: several motions are reckoned with

    def __post_init__(self) -> None:
        check_positive(self, "unit", "speed_unit", of="friction.")
        vs, vn, delta = _samples()
        zero = np.zeros((1, 1))
        with np.errstate(all="ignore"):  # what is not finite is refused
            fs, fn = (np.broadcast_to(f, vs.shape) for f in self.density(vs, vn, delta))
            rest = np.abs(self.density(zero, zero, zero + _DELTAS[0])).max()
        if not np.isfinite([*fs, *fn]).all() or np.isnan(rest):
            where = "at rest (vs = vn = 0)" if np.isnan(rest) else "somewhere"
            raise ProblemError(
                f"friction: a formula has no finite value {where}; divide by speed, which is never "
                f"zero."
            )
        gain = fs * vs + fn * vn
        if (gain >= 0).any():
            worst = 0, np.argmax(gain / np.hypot(vs, vn))
            raise ProblemError(
                f"friction: at (vs, vn) = ({vs[worst]:.3g}, {vn[worst]:.3g}) the force "
                f"({fs[worst]:.3g}, {fn[worst]:.3g}) does not oppose the motion, so friction would "
                f"give energy to the body; look at the signs."
            )
        if rest > 0:
            raise ProblemError("friction: a formula does not vanish at rest (vs = vn = 0).")
        left = self.density(vs, -vn, delta)
        if not (_same(left[0], fs) and _same(left[1], -fn)):
            raise ProblemError(
                "friction: the law differs between left and right (vn and -vn), which the "
                "symmetries exclude."
            )
        if self.smallest <= 0:
            raise ProblemError("friction: nothing resists sliding along the body, or across it.")
        # a force that jumps has no balance where it does
        step = _STEP * delta
        for name, *sides in (
            ("vs", self.density(step, vn, delta), self.density(-step, vn, delta)),
            ("vn", self.density(vs, step, delta), self.density(vs, -step, delta)),
        ):
            jump = np.hypot(*(a - b for a, b in zip(*sides, strict=True)))
            if (jump / np.hypot(*sides[0]).max()).max() > _JUMP:
                raise ProblemError(
                    f"friction: the force jumps where {name} changes its sign; let it vanish or "
                    f"agree there."
                )
        # flat but for a step in one velocity: Newton's steps run off to 1e154
        one, nearly = np.ones((1, 1)), np.array([[_NEARLY]])
        for name, k, alone, beside in (
            ("vs", 0, self.density(one, nearly, _DRY), self.density(nearly, one, _DRY)),
            ("vn", 1, self.density(nearly, one, _DRY), self.density(one, nearly, _DRY)),
        ):
            if abs(beside[k]) > _STEEP * abs(alone[k]):
                raise ProblemError(
                    f"friction: the force by {name} is dry regardless of the other velocity, which "
                    f"no formula is solved for; divide by speed, or state a wheel's friction as "
                    f"Axle(rolling=..., sideways=...)."
                )

    @property
    def formulas(self) -> tuple[str, ...]:
        return self.tangential, self.normal

    @property
    def _read(self) -> tuple[Formula, ...]:
        return tuple(formula(text, VARIABLES) for text in self.formulas)

    @property
    def label(self) -> str:
        return "own law of friction"

    def describe(self) -> str:
        scale = "" if self.unit == 1 else f", over {self.unit:g}"
        if self.speed_unit != 1:
            scale += f"; a body length per period is a speed of {self.speed_unit:g} (speed_unit)"
        return f"{self.tangential} along, {self.normal} across the body{scale}"

    @cached_property
    def degree(self) -> float | None:
        vs, vn, delta = _samples()
        before, after = (np.hypot(*self.density(t * vs, t * vn, t * delta)) for t in (1.0, 2.0))
        degrees = np.log2(after / before)
        mean = float(np.round(degrees.mean(), 9)) + 0.0
        return mean if np.abs(degrees - mean).max() < _RTOL else None

    @cached_property
    def reversible(self) -> bool:
        vs, vn, delta = _samples()
        forward, backward = self.density(vs, vn, delta), self.density(-vs, -vn, delta)
        return all(_same(-b, f) for f, b in zip(forward, backward, strict=True))

    @cached_property
    def regularised(self) -> bool:
        return any(name in each.names for each in self._read for name in ("speed", "delta"))

    @cached_property
    def smallest(self) -> float:
        fs, fn = self.density(*_CIRCLE, _DRY)
        return float(-(fs * _CIRCLE[0] + fn * _CIRCLE[1]).max())

    @cached_property
    def largest(self) -> float:
        return float(np.hypot(*self.density(*_CIRCLE, _DRY)).max())

    def in_units_of(self, unit: float) -> OwnLaw:
        return replace(self, unit=self.unit * unit)

    def in_speeds_of(self, unit: float) -> OwnLaw:
        return replace(self, speed_unit=self.speed_unit * unit)

    def density(self, vs: Array, vn: Array, delta: Array) -> tuple[Array, Array]:
        vs, vn, delta = (self.speed_unit * a for a in (vs, vn, delta + 0.0 * vs))
        at = {"vs": vs, "vn": vn, "speed": regularised_speed(vs, vn, delta), "delta": delta}
        fs, fn = (each(at) / self.unit + 0.0 * vs for each in self._read)
        return fs, fn

    def density_jacobian(self, vs: Array, vn: Array, delta: Array) -> Matrix:
        vs, vn, delta = (self.speed_unit * a for a in (vs, vn, delta))
        zero, r = 0.0 * (vs + vn), regularised_speed(vs, vn, delta)
        at, scale = {"vs": vs, "vn": vn, "speed": r, "delta": delta}, self.speed_unit / self.unit
        rows = []
        for each in self._read:
            by = dict.fromkeys(at, 0.0) | each.partials(at)
            slopes = by["vs"] + by["speed"] * vs / r, by["vn"] + by["speed"] * vn / r
            rows.append(tuple(zero - scale * slope for slope in slopes))
        return tuple(rows)

    def density_secant(self, vs: Array, vn: Array, delta: Array) -> Matrix:
        # beside the trace, which is nearly 0 where each component is dry by itself
        (ss, _), (_, nn) = self.density_jacobian(vs, vn, delta)
        along, across = (
            regularised_speed(ss + nn, f * v / (v * v + delta * delta + _LEAST**2), _LEAST)
            for f, v in zip(self.density(vs, vn, delta), (vs, vn), strict=True)
        )
        return (along, 0.0 * ss), (0.0 * ss, across)

    def density_potential(self, vs: Array, vn: Array, delta: Array) -> Array:
        raise NotImplementedError("formulas need not be the gradient of a function.")


_FEWEST, _MOST = 3, 1e9
"""Number of samples, at least, and the largest value of one."""
_NAMES = {
    "speed": ("speed",),
    "along": ("along", "forward", "forwards"),
    "across": ("across", "sideways"),
    "back": ("back", "backward", "backwards"),
}
_TERMS = "{}", "{}*exp(-speed/{})", "{}*(1 - exp(-speed/{}))", "{}*speed"
_SETS = [(0,), (3,), (0, 1), (0, 2), (0, 3), (2, 3), (0, 1, 3), (0, 2, 3)]
_NO_RESIDUAL = 1e-6
"""Root mean square, over the largest coefficient, that counts as none."""
_ROUGH = 0.3
"""Largest residual, over the largest coefficient, of an acceptable curve."""
_SCAN, _BEYOND = 60, 4.0
"""Number of v_S tried, from the lowest speed over this factor to the highest times it."""


@dataclass(frozen=True, eq=False)
class FittedFriction:
    """A law of friction fitted to measured coefficients.

    Attributes
    ----------
    law : Friction or OwnLaw
        The first where no coefficient depends on the speed.
    rms, largest : float
        Root mean square and largest residual of the coefficients.
    samples : int
        Number of samples of each direction.

    Examples
    --------
    >>> found = fitted_friction([[0.1, 0.5, 0.9], [0.2, 0.5, 0.9], [0.3, 0.5, 0.9]])
    >>> found.law
    Friction(mu_t=0.9, mu_f=0.5, mu_b=0.5)
    """

    law: Friction | OwnLaw
    rms: float
    largest: float
    samples: int

    def __str__(self) -> str:
        off = f"off by {self.rms:.1e} r.m.s., {self.largest:.1e} at most"
        return f"{self.samples} samples, {off}: {self.law.describe()}"


def fitted_friction(
    table: str | os.PathLike[str] | np.ndarray | Sequence[Sequence[Any]],
    *,
    length: float | None = None,
    period: float | None = None,
) -> FittedFriction:
    """Fit a law of friction to measured coefficients.

    Parameters
    ----------
    table : path of a CSV file, or array
        A row for each speed: the speed, then the coefficient of friction (force over weight) of a
        piece of the body that slides along itself, and across itself; a fourth column if it slides
        backwards with another one. A file may name its columns ``speed, along, across, back``.
    length, period : float, optional
        Of the robot [m] and its gait [s], where speeds are in m/s. Without them they are in body
        lengths per period.

    Returns
    -------
    FittedFriction
        Its `law` is a problem's ``friction``.

    Raises
    ------
    ProblemError
        If the table cannot be read, a coefficient is not positive, speeds are negative or too few,
        or no curve fits.

    Examples
    --------
    Carpet that holds more the slower the robot slides:

    >>> speed = np.linspace(0.01, 1, 20)
    >>> mu = 0.4 + 0.2 * np.exp(-speed / 0.1)
    >>> found = fitted_friction(np.column_stack([speed, mu, 2 * mu]))
    >>> print(found.law.formulas[0])
    -(0.4 + 0.2*exp(-speed/0.1))*vs/speed
    >>> found.largest < 1e-6
    True
    """
    name, values = _read_table(table)
    speed, coefficients = values[:, 0], values[:, 1:].T
    _check(name, speed, coefficients)
    if (length is None) != (period is None):
        raise ProblemError(
            "speeds in m/s take both: the length of the robot [m] and the period of its gait [s]."
        )
    scale = 1.0
    if length is not None and period is not None:
        check_finite(positive=True, length=length, period=period)
        scale = length / period
    v_s, fits = _fit_all(speed, coefficients)
    off = np.array([_basis(speed, v_s) @ fit for fit in fits]) - coefficients
    largest = float(np.abs(off).max())
    if largest > _ROUGH * coefficients.max():
        which, k = np.unravel_index(np.abs(off).argmax(), off.shape)
        raise ProblemError(
            f"{name}: no smooth curve is near the coefficients; at speed {speed[k]:g} the best one "
            f"misses {coefficients[which, k]:g} by {largest:.2g}. Look at that sample, or state a "
            f"law of your own (OwnLaw)."
        )
    rms = float(np.sqrt((off**2).mean()))
    return FittedFriction(_law_of(fits, v_s, scale), rms, largest, speed.size)


def _law_of(fits: list[np.ndarray], v_s: float, scale: float) -> Friction | OwnLaw:
    fits = [*fits, fits[0]][:3]  # along, across, and back
    if not any(fit[1:].any() for fit in fits):
        along, across, back = (fit[0] for fit in fits)
        return Friction(mu_t=across, mu_f=along, mu_b=back)
    along, across, back = (
        " + ".join(
            term.format(f"{c:.6g}", f"{v_s:.6g}") for term, c in zip(_TERMS, fit, strict=True) if c
        )
        for fit in fits
    )
    if back != along:
        along = f"where(vs > 0, {along}, {back})"
    return OwnLaw(f"-({along})*vs/speed", f"-({across})*vn/speed", speed_unit=scale)


def _read_table(table: Any) -> tuple[str, np.ndarray]:
    name, names = "the table of friction", list[str]()
    if isinstance(table, (str, os.PathLike)):
        name = str(table)
        names, values = csv_table(Path(table), _FEWEST)
    else:
        values = finite_array(name, table, 2)
        if len(values) < _FEWEST:
            raise ProblemError(f"{name} must have a row for each of at least {_FEWEST} speeds.")
    if not names:
        if values.shape[1] not in (3, 4):
            raise ProblemError(
                f"{name} has {values.shape[1]} columns: write the speed, the coefficient along, "
                f"across and, if it differs, backwards; a file may name its columns speed, along, "
                f"across, back."
            )
        return name, values
    order = []
    for wanted, others in _NAMES.items():
        columns = [k for k, each in enumerate(names) if each in others]
        if not columns and wanted != "back":
            raise ProblemError(
                f"{name} has no column {wanted!r}: its columns are {', '.join(names)}."
            )
        order += columns[:1]
    return name, values[:, order]


def _check(name: str, speed: np.ndarray, coefficients: np.ndarray) -> None:
    what = ""
    if (speed < 0).any():
        what = f"speed {speed.min():g} is negative; give speeds of sliding without their direction"
    elif max(speed.max(), coefficients.max()) > _MOST:
        what = f"speeds and coefficients must be below {_MOST:g}; is a column in the wrong place?"
    elif speed.max() == 0:
        what = "all speeds are 0; friction is a matter of sliding"
    elif (coefficients <= 0).any():
        which, k = np.argwhere(coefficients <= 0)[0]
        what = (
            f"sample {k + 1}: the coefficient {tuple(_NAMES)[1 + which]} is "
            f"{coefficients[which, k]:g}, and must be positive"
        )
    if what:
        raise ProblemError(f"{name}: {what}.")


def _basis(speed: np.ndarray, v_s: float) -> np.ndarray:
    falls = np.exp(-speed / v_s)
    return np.stack([np.ones_like(speed), falls, 1 - falls, speed], axis=1)


def _fit_direction(speed: np.ndarray, mu: np.ndarray, v_s: float) -> tuple[float, np.ndarray]:
    best, coefficients, basis = np.inf, np.zeros(4), _basis(speed, v_s)
    for terms in map(list, _SETS):
        numbers = len(terms) + (1 in terms or 2 in terms)  # with v_S
        if numbers >= mu.size - 1:
            continue
        size = np.maximum(np.abs(basis[:, terms]).max(axis=0), 1e-300)
        fit, rest = scipy.optimize.nnls(basis[:, terms] / size, mu)
        square = max(rest**2 / mu.size, (_NO_RESIDUAL * mu.max()) ** 2)
        criterion = mu.size * np.log(square) + numbers * np.log(mu.size)
        if criterion < best:
            best, coefficients = criterion, np.zeros(4)
            coefficients[terms] = fit / size
    return best, coefficients


def _fit_all(speed: np.ndarray, coefficients: np.ndarray) -> tuple[float, list[np.ndarray]]:
    def score(log_speed):
        return sum(_fit_direction(speed, mu, np.exp(log_speed))[0] for mu in coefficients)

    grid = np.log(np.geomspace(speed[speed > 0].min() / _BEYOND, speed.max() * _BEYOND, _SCAN))
    best = grid[np.argmin([score(s) for s in grid])]
    step = grid[1] - grid[0]
    minimum = scipy.optimize.minimize_scalar(
        score, bounds=(best - step, best + step), method="bounded", options={"xatol": 1e-10}
    )
    v_s = float(np.exp(minimum.x if minimum.fun < score(best) else best))
    return v_s, [_fit_direction(speed, mu, v_s)[1] for mu in coefficients]
