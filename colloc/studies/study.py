"""A study: a grid of problems over named axes. A cell is an index into the axes.

Warm starts travel along an axis of numbers from the value before, of texts from every one before.
"""

from __future__ import annotations

import itertools
import math
import os
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from colloc.gaits.problem import Problem
from colloc.gaits.problem_file import place_of, stated_names, words_of
from colloc.gaits.starts import LARGEST_SEED
from colloc.system.arguments import check_count, named_arguments, shown
from colloc.system.errors import ProblemError
from colloc.system.files import check_name

Index = tuple[int, ...]
NUMBERS = ("value", "value_error", "efficiency", "efficiency_error", "distance", "work")
COLUMNS: dict[str, float | str] = {
    **dict.fromkeys((*NUMBERS, "delta", "trivial_bound", "upper_bound"), math.nan),
    **dict.fromkeys(("neighbour_value", "seconds", "wave", "forward"), math.nan),
    **dict.fromkeys(("bilateral", "antipodal", "retraced", "at_slowest", "winding"), 0),
    **dict.fromkeys(("below_neighbour", "starts", "starts_certified"), 0),
    **dict.fromkeys(("status", "message", "origin", "gait_class", "problem_hash"), ""),
}
"""Results of a cell with one value, and its placeholder."""
ARRAYS = {"mean": ("joint",), "cos": ("joint", "harmonic"), "sin": ("joint", "harmonic")}
_RESERVED = {*COLUMNS, *ARRAYS, "joint", "harmonic"}
MOST_CELLS = 1_000_000


@named_arguments
@dataclass(frozen=True)
class Axis:
    """Axis of a grid.

    Parameters
    ----------
    name : str
        The keyword with which the study's function is called.
    values : sequence of float or of str
        In the order in which warm starts travel.
    label, units : str
        For figures and files; by default the name, and "1".
    travels : bool
        Whether warm starts travel along this axis.

    Examples
    --------
    >>> from colloc import Axis
    >>> Axis("mu_t", (0.5, 1, 2), "mu_t / mu_f").values
    (0.5, 1.0, 2.0)
    """

    name: str
    values: tuple
    label: str = ""
    units: str = "1"
    travels: bool = True

    def __post_init__(self) -> None:
        try:
            sequence = (self.values,) if isinstance(self.values, str) else self.values
            values = tuple(v if isinstance(v, str) else float(v) for v in sequence)
        except (TypeError, ValueError, OverflowError):
            raise ProblemError(
                f"values of an axis must be numbers or names, not {self.values!r}."
            ) from None
        object.__setattr__(self, "values", values)
        name, texts = self.name, {isinstance(v, str) for v in values}
        if not isinstance(name, str) or not name.isidentifier() or name in _RESERVED:
            raise ProblemError(
                f"the name of an axis must be a Python name, and not that of a column of the "
                f"results, not {shown(name)}."
            )
        distinct = len(texts) == 1 and len(set(values)) == len(values)
        if not distinct or not (True in texts or np.isfinite(values).all()):
            raise ProblemError(
                f"axis {name}: values must be distinct finite numbers, or distinct texts, and at "
                f"least one."
            )

    @property
    def of_texts(self) -> bool:
        return isinstance(self.values[0], str)


@named_arguments
@dataclass(frozen=True)
class Study:
    """A grid of problems, and how hard to search each cell.

    Parameters
    ----------
    name : str
        Of the results; letters, digits, ``_``, ``-`` and ``.``, as for a problem.
    axes : tuple of Axis
    problem : callable
        Returns the `Problem` of a cell; called with a keyword for every axis. A cell for which it
        raises is recorded and skipped.
    cold_starts : int
        Seeded random starts of every cell, besides its problem's guess and the warm ones.
    warm_starts : int
        Warm starts that are solved in any case: those whose gaits do best in the cell unchanged.
        Others are solved if their gaits do better, unchanged, than all results so far.
    chunk : int
        Cells along the last axis that make one task, with warm starts travelling inside.
    time_limit : float
        Seconds for one start.
    seed : int

    Examples
    --------
    >>> import colloc
    >>> def problem(mu_b):
    ...     return colloc.Problem("grid", friction=colloc.Friction(mu_b=mu_b),
    ...         gait=colloc.Harmonic(1, "bilateral"))
    >>> study = colloc.Study("grid", (colloc.Axis("mu_b", (1, 2)),), problem)
    >>> study.shape
    (2,)
    """

    name: str
    axes: tuple[Axis, ...]
    problem: Callable[..., Problem]
    cold_starts: int = 4
    warm_starts: int = 2
    chunk: int = 1
    time_limit: float = 120.0
    seed: int = 0

    def __post_init__(self) -> None:
        axes = tuple(self.axes) if isinstance(self.axes, Iterable) else (self.axes,)
        object.__setattr__(self, "axes", axes)
        if not axes or not all(isinstance(axis, Axis) for axis in axes):
            raise ProblemError("a study needs at least one Axis.")
        if len({axis.name for axis in axes}) != len(axes):
            raise ProblemError("two axes of a study have the same name.")
        check_name(self.name)
        if not callable(self.problem):
            raise ProblemError("problem must be a function from coordinates to a Problem.")
        check_count(LARGEST_SEED, least=0, cold_starts=self.cold_starts, seed=self.seed)
        check_count(LARGEST_SEED, warm_starts=self.warm_starts, chunk=self.chunk)
        if not self.time_limit > 0:
            raise ProblemError(f"time_limit must be positive, not {self.time_limit!r}.")
        if (cells := math.prod(self.shape)) > MOST_CELLS:
            raise ProblemError(f"a study may have {MOST_CELLS} cells, not {cells}; split it.")

    @cached_property
    def shape(self) -> tuple[int, ...]:
        return tuple(len(axis.values) for axis in self.axes)

    def cells(self) -> Iterator[Index]:
        """Return all cells, the last axis fastest."""
        return itertools.product(*map(range, self.shape))

    def coordinates(self, cell: Index) -> dict[str, float | str]:
        """Return the values of the axes at a cell, by name."""
        return {axis.name: axis.values[i] for axis, i in zip(self.axes, cell, strict=True)}

    def label(self, cell: Index) -> str:
        """Return the coordinates of a cell as text."""
        return ", ".join(
            f"{name} {value:.4g}" if isinstance(value, float) else f"{name} {value}"
            for name, value in self.coordinates(cell).items()
        )

    def problem_at(self, cell: Index) -> Problem:
        """Return the problem of a cell.

        Raises
        ------
        ProblemError
            With what the study's function raises, where.
        """
        coordinates = self.coordinates(cell)
        where = ", ".join(f"{name} = {value}" for name, value in coordinates.items())
        try:
            problem = self.problem(**coordinates)
        except Exception as error:
            place = place_of(error)
            raise ProblemError(
                f"no problem at {where}: {place}{': ' * bool(place)}{words_of(error)}"
            ) from None
        if isinstance(problem, Problem):
            return problem
        what = type(problem).__name__
        raise ProblemError(f"no problem at {where}: the study's function gave a {what}.")

    def around(self, cell: Index, *, before: bool = False) -> list[Index]:
        """Return the neighbours of a cell; only those whose gaits come first with `before`."""
        neighbours = []
        for a, axis in enumerate(self.axes):
            i, count = cell[a], self.shape[a]
            places = [*range(count)] if axis.of_texts else [i - 1, i + 1]
            neighbours += [
                (*cell[:a], k, *cell[a + 1 :])
                for k in places
                if axis.travels and 0 <= k < (i if before else count) and k != i
            ]
        return neighbours


def read_study_file(path: str | os.PathLike[str]) -> tuple[Study, str]:
    """Execute a study file; returns its study and text. `ProblemError` if it states none."""
    path, names, source = stated_names(path, "study")
    study = names.get("STUDY")
    if isinstance(study, Study):
        return study, source
    what = f"STUDY must be a Study, not {type(study).__name__}"
    what = "states no STUDY" if study is None else what
    raise ProblemError(f"{path}: {what}; end it with STUDY = Study(...).")
