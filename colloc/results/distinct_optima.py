"""What a search over many starts found: outcomes, and the distinct optima among them with their frequencies."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from colloc.gaits.equivalence import distance
from colloc.gaits.gait_fields import AnyGait
from colloc.gaits.harmonic import Fourier, Harmonic
from colloc.gaits.path_samples import fourier_through
from colloc.gaits.problem import Problem
from colloc.results.solution import CERTIFICATE_FAILED, NOT_CONVERGED, SOLVED

TRIVIAL, ERROR, TIME_LIMIT, CRASHED = "trivial gait", "error", "time limit", "crashed"
STATUSES = (SOLVED, TRIVIAL, CERTIFICATE_FAILED, NOT_CONVERGED, TIME_LIMIT, ERROR, CRASHED)
SAME_VALUE, SAME_GAIT = 1e-3, 0.05
"""Two certified optima are the same if their values differ by less than this relative amount and their paths by less than
this root-mean-square distance [rad], modulo symmetries. The objective is flat at its maximum, so the path is the laxer."""
SERIES_HARMONICS = 16
"""Free paths and polygons are tabulated and told apart by their Fourier series in arc length."""


def series_class(problem: Problem) -> Harmonic:
    """The class of the Fourier series that stand for gaits of a problem: its own, if that is one of harmonics."""
    return problem.gait.series(SERIES_HARMONICS)


def fourier_series(problem: Problem, gait: AnyGait) -> Fourier:
    """The Fourier series that stands for a gait of a problem."""
    return fourier_through(gait, series_class(problem))


@dataclass(frozen=True, eq=False, repr=False)
class Outcome:
    """What became of one start.

    Attributes
    ----------
    start : int
        Its number.
    status : str
        One of `STATUSES`; only "solved" (certified by replay) is a success.
    message : str
        What went wrong, if something did.
    guess, gait : Fourier, ArcPath or Corners
        Where the search began and ended.
    efficiency, efficiency_error, distance, work : float
        Replayed and, failing that, collocated; NaN if there is none.
    delta : float
        In the units of the problem, the smallest at which an optimum was found; NaN if none.
    iterations : int
    seconds : float
        Wall time, certificate included.
    cpu_seconds : float
        Processor time of the same, which other work on the machine does not lengthen as much.
    value, value_error : float
        Of the problem's objective; by default those of the efficiency.
    """

    start: int
    status: str
    message: str
    guess: AnyGait
    gait: AnyGait
    efficiency: float = np.nan
    efficiency_error: float = np.nan
    distance: float = np.nan
    work: float = np.nan
    delta: float = np.nan
    iterations: int = 0
    seconds: float = 0.0
    cpu_seconds: float = 0.0
    value: float = np.nan
    value_error: float = np.nan

    def __post_init__(self) -> None:
        for name, usual in (("value", self.efficiency), ("value_error", self.efficiency_error)):
            if np.isnan(getattr(self, name)):
                object.__setattr__(self, name, usual)

    def __repr__(self) -> str:
        return f"<Outcome of start {self.start}: {self.status}, d/W = {self.efficiency:.6g}, {self.cpu_seconds:.1f} s>"


@dataclass(frozen=True, eq=False, repr=False)
class Basin:
    """A distinct certified optimum and the starts that ended there.

    Attributes
    ----------
    best : Outcome
        Its member of largest value.
    starts : tuple of int
    frequency : float
        Share of all starts tried.
    """

    best: Outcome
    starts: tuple[int, ...]
    frequency: float

    def __repr__(self) -> str:
        return f"<Basin with d/W = {self.best.efficiency:.6g} of {len(self.starts)} starts>"


def basins(problem: Problem, outcomes: Sequence[Outcome]) -> list[Basin]:
    """The distinct certified optima, best first.

    Outcomes join the first, better, optimum they agree with in value and in gait modulo start phase and the
    symmetries of body and friction (see `colloc.gaits.equivalence.images`).
    """
    solved = sorted((o for o in outcomes if o.status == SOLVED), key=lambda o: -o.value)
    found: list[list[Outcome]] = []
    paths: list[Fourier] = []
    for outcome in solved:
        path = fourier_series(problem, outcome.gait)
        for members, near in zip(found, paths, strict=True):
            best = members[0]
            if best.value - outcome.value > SAME_VALUE * abs(best.value):
                continue
            if distance(near, path, problem.body, problem.friction) < SAME_GAIT:
                members.append(outcome)
                break
        else:
            found.append([outcome])
            paths.append(path)
    return [Basin(m[0], tuple(sorted(o.start for o in m)), len(m) / len(outcomes)) for m in found]


def counts(outcomes: Sequence[Outcome]) -> dict[str, int]:
    """How many starts ended in each status; only those that occur."""
    return {s: n for s in STATUSES if (n := sum(o.status == s for o in outcomes))}
