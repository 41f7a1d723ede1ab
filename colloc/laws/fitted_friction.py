r"""Friction that was measured, as a law: a smooth curve through coefficients at speeds, with the
error of that stated.

Along, across and backwards alike, each coefficient is a Stribeck curve of the speed,

    mu(v) = c_0 + c_1 exp(-v / v_S) + c_2 (1 - exp(-v / v_S)) + c_3 v,

dry friction, what is lost or gained of it within the speed v_S, and drag. No c is negative: so
friction takes energy at every speed (non-negative least squares). Of the curves of one to three
terms the one is taken that the samples are worth, by Bayes' information criterion, with more
samples left than numbers by two at least; v_S is one for all directions.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from scipy.optimize import minimize_scalar, nnls

from colloc.laws.own_law import OwnLaw
from colloc.mechanics.friction import Friction
from colloc.system.arguments import check_finite
from colloc.system.csv_table import csv_table
from colloc.system.errors import ProblemError

_FEWEST, _MOST = 3, 1e9
"""Samples, at least, and the largest number that may be one."""
_NAMES = {
    "speed": ("speed",),
    "along": ("along", "forward", "forwards"),
    "across": ("across", "sideways"),
    "back": ("back", "backward", "backwards"),
}
"""Of the columns, and what else they may be called."""
_TERMS = "{}", "{}*exp(-speed/{})", "{}*(1 - exp(-speed/{}))", "{}*speed"
_SETS = [(0,), (3,), (0, 1), (0, 2), (0, 3), (2, 3), (0, 1, 3), (0, 2, 3)]
"""Which terms a curve may have."""
_EXACT = 1e-6
"""Root mean square, of the largest coefficient, that counts as none."""
_ROUGH = 0.3
"""Largest difference from a sample, of the largest coefficient, at which no curve stands for the
samples."""
_SCAN, _BEYOND = 60, 4.0
"""Speeds v_S that are tried, from the lowest over this to the highest times this."""


@dataclass(frozen=True, eq=False)
class FittedFriction:
    """A law of friction near measured coefficients.

    Attributes
    ----------
    law : Friction or OwnLaw
        The first where no coefficient depends on the speed.
    rms, largest : float
        Distance of the law's coefficients from those given: root mean square, and largest of any
        sample.
    samples : int
        How many there are of each direction.

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
    """The law of friction that measured coefficients are samples of.

    Parameters
    ----------
    table : path of a CSV file, or array
        A line, or row, for each speed: the speed, then the coefficient of friction (force over
        weight) of a piece of the body that slides along itself, and across itself; a fourth column
        if it slides backwards with another one. A file may name its columns ``speed, along, across,
        back``.
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
        or no curve is near.

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
    name, values = _read(table)
    scale = _speed_unit(length, period)
    speed, coefficients = values[:, 0], values[:, 1:].T
    _check(name, speed, coefficients)
    v_s = _stribeck_speed(speed, coefficients)
    fits = [_fitted(speed, mu, v_s)[1] for mu in coefficients]
    off = np.array([_basis(speed, v_s) @ fit for fit in fits]) - coefficients
    largest = float(np.abs(off).max())
    if largest > _ROUGH * coefficients.max():
        which, k = np.unravel_index(np.abs(off).argmax(), off.shape)
        raise ProblemError(
            f"{name}: no smooth curve is near the coefficients; at speed {speed[k]:g} the best one "
            f"misses "
            f"{coefficients[which, k]:g} by {largest:.2g}. Look at that sample, or state a law of "
            f"your own (OwnLaw)."
        )
    return FittedFriction(
        _law(fits, v_s, scale), float(np.sqrt((off**2).mean())), largest, speed.size
    )


def _law(fits: list[np.ndarray], v_s: float, scale: float) -> Friction | OwnLaw:
    """Coulomb's, where no coefficient knows the speed; else one of formulas."""
    forwards, sideways, backwards = fits[0], fits[1], fits[-1] if len(fits) > 2 else fits[0]
    if not any(fit[1:].any() for fit in fits):
        return Friction(mu_t=sideways[0], mu_f=forwards[0], mu_b=backwards[0])
    along, across, back = (_formula(fit, v_s) for fit in (forwards, sideways, backwards))
    if back != along:
        along = f"where(vs > 0, {along}, {back})"
    return OwnLaw(f"-({along})*vs/speed", f"-({across})*vn/speed", speed_unit=scale)


def _read(table: Any) -> tuple[str, np.ndarray]:
    """Where the samples are from, and speed, along, across and, where it differs, back ``(n, 3 or
    4)``."""
    if not isinstance(table, (str, os.PathLike)):
        cells = np.array(table, dtype=object)
        if cells.ndim != 2 or len(cells) < _FEWEST or cells.shape[1] not in (3, 4):
            raise ProblemError(
                f"the table of friction must be numbers with a row for each of at least {_FEWEST} "
                f"speeds: the speed, the "
                "coefficient along, across and, if it differs, backwards."
            )
        values = np.vectorize(_number, otypes=[float])(cells)
        for k, j in np.argwhere(~np.isfinite(values)):
            what = f"{tuple(_NAMES)[j]} is {cells[k, j]!r}"
            raise ProblemError(
                f"the table of friction, sample {k + 1}: {what}, and must be a finite number."
            )
        return "the table of friction", values
    names, values = csv_table(Path(table), _FEWEST)
    if not names:
        if values.shape[1] not in (3, 4):
            raise ProblemError(
                f"{table} has {values.shape[1]} columns: write the speed, the coefficient along, "
                f"across and, if it differs, "
                "backwards; or name the columns speed, along, across, back."
            )
        return str(table), values
    order = []
    for wanted, others in _NAMES.items():
        found = [k for k, own in enumerate(names) if own in others]
        if not found and wanted != "back":
            raise ProblemError(
                f"{table} has no column {wanted!r}: its columns are {', '.join(names)}."
            )
        order += found[:1]
    return str(table), values[:, order]


def _number(cell: Any) -> float:
    """What a cell of a table says; NaN where that is no number."""
    try:
        return float(cell)
    except (TypeError, ValueError):
        return np.nan


def _check(name: str, speed: np.ndarray, coefficients: np.ndarray) -> None:
    if (speed < 0).any():
        raise ProblemError(
            f"{name}: speed {speed.min():g} is negative; give speeds of sliding without their "
            f"direction."
        )
    if max(speed.max(), coefficients.max()) > _MOST:
        raise ProblemError(
            f"{name}: speeds and coefficients must be below {_MOST:g}; is a column in the wrong "
            f"place?"
        )
    if speed.max() == 0:
        raise ProblemError(f"{name}: all speeds are 0; friction is a matter of sliding.")
    if (coefficients <= 0).any():
        which, k = np.argwhere(coefficients <= 0)[0]
        direction = tuple(_NAMES)[1 + which]
        raise ProblemError(
            f"{name}, sample {k + 1}: the coefficient {direction} is {coefficients[which, k]:g}. "
            f"It has to be positive, else "
            "friction would give energy to the body."
        )


def _speed_unit(length: float | None, period: float | None) -> float:
    """Speed of a body length per period, in the table's unit."""
    if length is None and period is None:
        return 1.0
    if length is None or period is None:
        raise ProblemError(
            "speeds in m/s take both: the length of the robot [m] and the period of its gait [s]."
        )
    check_finite(positive=True, length=length, period=period)
    return length / period


def _basis(speed: np.ndarray, v_s: float) -> np.ndarray:
    """The terms ``(n, 4)`` at speeds."""
    falls = np.exp(-speed / v_s)
    return np.stack([np.ones_like(speed), falls, 1 - falls, speed], axis=1)


def _fitted(speed: np.ndarray, mu: np.ndarray, v_s: float) -> tuple[float, np.ndarray]:
    """The best criterion of fits, and the coefficients of the terms ``(4,)`` that the samples are
    worth."""
    tried = [terms for terms in _SETS if _numbers(terms) < mu.size - 1]
    return min((_of_terms(speed, mu, v_s, terms) for terms in tried), key=lambda found: found[0])


def _numbers(terms: tuple[int, ...]) -> int:
    """That a curve of some terms has: their coefficients, and v_S."""
    return len(terms) + (1 in terms or 2 in terms)


def _of_terms(
    speed: np.ndarray, mu: np.ndarray, v_s: float, terms: tuple[int, ...]
) -> tuple[float, np.ndarray]:
    """Bayes' information criterion of a fit with some terms, and its coefficients ``(4,)``."""
    basis, found = _basis(speed, v_s)[:, terms], np.zeros(4)
    size = np.maximum(np.abs(basis).max(axis=0), 1e-300)
    found[list(terms)], rest = nnls(basis / size, mu)
    found[list(terms)] /= size
    square = max(rest**2 / mu.size, (_EXACT * mu.max()) ** 2)
    return mu.size * np.log(square) + _numbers(terms) * np.log(mu.size), found


def _stribeck_speed(speed: np.ndarray, coefficients: np.ndarray) -> float:
    """The speed v_S with which the fits of all directions are best."""

    def score(log_speed: float) -> float:
        return sum(_fitted(speed, mu, np.exp(log_speed))[0] for mu in coefficients)

    tried = np.log(np.geomspace(speed[speed > 0].min() / _BEYOND, speed.max() * _BEYOND, _SCAN))
    best = tried[np.argmin([score(s) for s in tried])]
    step = tried[1] - tried[0]
    found = minimize_scalar(
        score, bounds=(best - step, best + step), method="bounded", options={"xatol": 1e-10}
    )
    return float(np.exp(found.x if found.fun < score(best) else best))


def _formula(fit: np.ndarray, v_s: float) -> str:
    """The curve of coefficients of the terms, as text."""
    return " + ".join(
        term.format(f"{c:.6g}", f"{v_s:.6g}") for term, c in zip(_TERMS, fit, strict=True) if c > 0
    )
