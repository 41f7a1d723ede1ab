"""Gaits that are linear in columns over time, such as the primitives of a controller."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from colloc.gaits.harmonic import series_of
from colloc.gaits.linear import LinearClass
from colloc.system.arguments import named_arguments
from colloc.system.csv_table import csv_table
from colloc.system.errors import ProblemError

_DEGREE, _FEWEST, _SAMPLED, _ROUNDING = 5, 24, 192, 1e-15
"""Degree of the spline; samples at least; samples of functions; rounding."""
_ROUGH = 0.02  # relative error of interpolation at which columns are refused
_EVEN = 1e-3  # relative difference of even steps
_RESOLVED, _MOST = 1e-6, 24
"""Share of the mean square rate in harmonics left out, and the most harmonics of a mesh."""


@named_arguments
@dataclass(frozen=True)
class Basis(LinearClass):
    """The class of gaits that are linear in columns of one's own over time.

    A column is known at evenly spaced phases and interpolated by a periodic spline of degree 5.
    Where the search is, only its multiple can change: neither its shape nor its phase.

    Parameters
    ----------
    columns : sequence, or path of a CSV file
        Each column is ``(n_time,)``, a function of time that every joint has a coefficient of; or
        ``(n_joint, n_time)``, angles of all joints, with one coefficient [rad]. Samples are evenly
        spaced over one cycle, the first not repeated, at least 24; or a column is a function of
        phases ``(n_time,)`` that returns such values. A file has times in its first column and
        functions of time in the others.
    symmetry : {"none", "bilateral", "antipodal"}
        One that the columns have: images of columns have to be combinations of columns.

    Raises
    ------
    ProblemError
        If the columns cannot be read, are not finite, do not close, are too rough to be
        interpolated, or depend on one another.

    Examples
    --------
    >>> import numpy as np
    >>> from colloc import Basis
    >>> bump = lambda t: np.exp(2 * np.cos(2 * np.pi * t))
    >>> four = Basis([bump, lambda t: bump(t - 0.25), lambda t: bump(t - 0.5),
    ...     lambda t: bump(t - 0.75)])
    >>> four.size(n_joint=2)
    8
    >>> four.describe()
    '4 columns over time, interpolated to 2e-11, symmetry none'
    """

    columns: tuple
    symmetry: str = "none"

    series = series_of

    def __post_init__(self) -> None:
        object.__setattr__(self, "columns", _check_columns(self.columns))
        self._check_symmetry()
        if self.error > _ROUGH:
            raise ProblemError(
                f"the columns are too rough: a spline through their samples is off by "
                f"{self.error:.2g} of the largest one. "
                "Give columns that close after one cycle, more samples, or smoother ones."
            )

    @property
    def _whole(self) -> bool:
        # columns are angles of all joints
        return isinstance(self.columns[0][0], tuple)

    @cached_property
    def _spline(self) -> tuple[Any, float, int]:
        """A spline through the columns, its relative error, and the number of harmonics."""
        from scipy.interpolate import make_interp_spline

        values = np.array(self.columns)
        values = values.reshape(-1, values.shape[-1]).T
        n, largest = len(values), np.abs(values).max()
        phases, closed = np.arange(n + 1) / n, np.vstack([values, values[:1]])
        spline = make_interp_spline(phases, closed, _DEGREE, bc_type="periodic")

        def residual(every: int) -> float:
            kept = np.append(np.arange(0, n, every), n)
            coarse = make_interp_spline(phases[kept], closed[kept], _DEGREE, bc_type="periodic")
            return float(np.abs(coarse(phases) - closed).max() / largest)

        # the error falls from each halving of the step to the next by about the same factor
        half, quarter = residual(2), residual(4)
        falls = np.clip(half / max(quarter, _ROUNDING), 0.5 ** (_DEGREE + 1), 1.0)
        power = np.arange(n // 2 + 1)[:, None] ** 2 * np.abs(np.fft.rfft(values, axis=0)) ** 2
        power = power.sum(axis=1)
        left = 1 - np.cumsum(power) / power.sum()
        return spline, float(half * falls), int(np.clip(np.argmax(left < _RESOLVED), 1, _MOST))

    @property
    def error(self) -> float:
        """Estimated error of interpolation, relative to the largest value."""
        return self._spline[1]

    @property
    def harmonics(self) -> int:  # type: ignore[override]
        return self._spline[2]

    def functions(self, t: np.ndarray, derivative: int = 0) -> np.ndarray:
        return self._spline[0](np.asarray(t) % 1.0, nu=derivative).T

    def label(self, number: int) -> str:
        return super().label(number // len(self.columns[0]) if self._whole else number)

    def table_basis(self, n_joint: int) -> np.ndarray:
        if not self._whole:
            return super().table_basis(n_joint)
        count = len(self.columns)
        return np.einsum("jk,cp->jckp", np.eye(n_joint), np.eye(count)).reshape(-1, count)

    def check_joints(self, n_joint: int) -> None:
        if self._whole and len(self.columns[0]) != n_joint:
            raise ProblemError(
                f"the columns have angles of {len(self.columns[0])} joints, and the body has "
                f"{n_joint}."
            )
        super().check_joints(n_joint)

    def describe(self) -> str:
        count = len(self.columns)
        kind = "of angles of all joints" if self._whole else "over time"
        return (
            f"{count} column{'s' * (count > 1)} {kind}, interpolated to {self.error:.0e}, "
            f"symmetry {self.symmetry}"
        )


def _check_columns(columns: str | os.PathLike[str] | Sequence[Any]) -> tuple:
    phases = np.arange(_SAMPLED) / _SAMPLED
    if isinstance(columns, (str, os.PathLike)):
        columns = _read(Path(columns))
    try:
        arrays = [np.array(each(phases) if callable(each) else each, float) for each in columns]
    except (TypeError, ValueError):
        arrays = []
    if len({each.shape for each in arrays}) != 1 or arrays[0].ndim not in (1, 2):
        raise ProblemError(
            "gait.columns must be a sequence of columns, samples over a cycle or functions of the "
            "phase, all alike: (n_time,) or (n_joint, n_time)."
        )
    values = np.array(arrays)
    what = ""
    if values.shape[-1] < _FEWEST:
        what = f"have {values.shape[-1]} samples of a cycle: give at least {_FEWEST}"
    elif not np.isfinite(values).all():
        what = "must be finite numbers"
    elif np.ptp(values, axis=-1).max() == 0:
        what = "do not change over time: nothing would move"
    if what:
        raise ProblemError(f"gait.columns {what}.")
    if values.ndim == 2:
        return tuple(map(tuple, values.tolist()))
    return tuple(tuple(map(tuple, column)) for column in values.tolist())


def _read(path: Path) -> list[np.ndarray]:
    """Columns of a file after its first, even times of a cycle; a last line that repeats the first
    is dropped."""
    _, table = csv_table(path, _FEWEST)
    steps = np.diff(table[:, 0])
    if steps.min() <= 0 or np.ptp(steps) > _EVEN * steps.mean():
        raise ProblemError(f"{path}: the times in the first column must rise by even steps.")
    values = table[:, 1:]
    step = np.abs(np.diff(values, axis=0)).max(axis=1).mean()
    repeats = np.abs(values[-1] - values[0]).max() <= 0.1 * step
    return list(values[:-1].T if repeats else values.T)
