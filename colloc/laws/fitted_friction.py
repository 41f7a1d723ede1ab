r"""Friction fitted to measured coefficients: a Stribeck curve of the speed in each direction,

    mu(v) = c_0 + c_1 exp(-v / v_S) + c_2 (1 - exp(-v / v_S)) + c_3 v,

dry friction, what is lost or gained of it within the speed v_S, and drag. No c is negative, so that
friction takes energy at every speed (non-negative least squares). Of the curves of one to three
terms Bayes' information criterion takes one, with at least two more samples than numbers; v_S is
one for all directions.
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
"""Number of samples, at least, and the largest value of one."""
_NAMES = {
    "speed": ("speed",),
    "along": ("along", "forward", "forwards"),
    "across": ("across", "sideways"),
    "back": ("back", "backward", "backwards"),
}
_TERMS = "{}", "{}*exp(-speed/{})", "{}*(1 - exp(-speed/{}))", "{}*speed"
_SETS = [(0,), (3,), (0, 1), (0, 2), (0, 3), (2, 3), (0, 1, 3), (0, 2, 3)]
_EXACT = 1e-6
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
    name, values = _read(table)
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
    return FittedFriction(_law(fits, v_s, scale), rms, largest, speed.size)


def _law(fits: list[np.ndarray], v_s: float, scale: float) -> Friction | OwnLaw:
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


def _read(table: Any) -> tuple[str, np.ndarray]:
    """The source, and speed, along, across and, where it differs, back ``(n, 3 or 4)``."""
    name, names = "the table of friction", list[str]()
    if isinstance(table, (str, os.PathLike)):
        name = str(table)
        names, values = csv_table(Path(table), _FEWEST)
    else:
        cells = np.array(table, dtype=object)
        if cells.ndim != 2 or len(cells) < _FEWEST:
            raise ProblemError(f"{name} must have a row for each of at least {_FEWEST} speeds.")
        values = np.vectorize(_number, otypes=[float])(cells)
        for k, j in np.argwhere(~np.isfinite(values)):
            what = f"{[*_NAMES, 'more'][min(j, 4)]} is {cells[k, j]!r}"
            raise ProblemError(f"{name}, sample {k + 1}: {what}, and must be a finite number.")
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
        found = [k for k, each in enumerate(names) if each in others]
        if not found and wanted != "back":
            raise ProblemError(
                f"{name} has no column {wanted!r}: its columns are {', '.join(names)}."
            )
        order += found[:1]
    return name, values[:, order]


def _number(cell: Any) -> float:
    try:
        return float(cell)
    except (TypeError, ValueError):
        return np.nan


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
    """The terms at speeds, ``(n, 4)``."""
    falls = np.exp(-speed / v_s)
    return np.stack([np.ones_like(speed), falls, 1 - falls, speed], axis=1)


def _fit(speed: np.ndarray, mu: np.ndarray, v_s: float) -> tuple[float, np.ndarray]:
    """The best criterion, and the coefficients of the terms ``(4,)``."""
    best, coefficients, basis = np.inf, np.zeros(4), _basis(speed, v_s)
    for terms in map(list, _SETS):
        numbers = len(terms) + (1 in terms or 2 in terms)  # with v_S
        if numbers >= mu.size - 1:
            continue
        size = np.maximum(np.abs(basis[:, terms]).max(axis=0), 1e-300)
        fit, rest = nnls(basis[:, terms] / size, mu)
        square = max(rest**2 / mu.size, (_EXACT * mu.max()) ** 2)
        criterion = mu.size * np.log(square) + numbers * np.log(mu.size)
        if criterion < best:
            best, coefficients = criterion, np.zeros(4)
            coefficients[terms] = fit / size
    return best, coefficients


def _fit_all(speed: np.ndarray, coefficients: np.ndarray) -> tuple[float, list[np.ndarray]]:
    """The best v_S, and the coefficients of the terms in all directions."""

    def score(log_speed: float) -> float:
        return sum(_fit(speed, mu, np.exp(log_speed))[0] for mu in coefficients)

    tried = np.log(np.geomspace(speed[speed > 0].min() / _BEYOND, speed.max() * _BEYOND, _SCAN))
    best = tried[np.argmin([score(s) for s in tried])]
    step = tried[1] - tried[0]
    found = minimize_scalar(
        score, bounds=(best - step, best + step), method="bounded", options={"xatol": 1e-10}
    )
    v_s = float(np.exp(found.x if found.fun < score(best) else best))
    return v_s, [_fit(speed, mu, v_s)[1] for mu in coefficients]
