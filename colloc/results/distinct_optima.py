"""The distinct optima among the outcomes of many starts, with their frequencies."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from colloc.gaits.gait_fields import AnyGait
from colloc.gaits.harmonic import Fourier, Harmonic
from colloc.gaits.path_samples import fourier_through
from colloc.gaits.problem import Problem
from colloc.results.equivalence import are_one
from colloc.results.outcome import Outcome
from colloc.results.solution import SOLVED

SERIES_HARMONICS = 16
"""Free paths and polygons are tabulated and told apart by their Fourier series in arc length."""


def series_class(problem: Problem) -> Harmonic:
    """The class of the Fourier series that stand for gaits of a problem: its own, if that is one of harmonics."""
    return problem.gait.series(SERIES_HARMONICS)


def fourier_series(problem: Problem, gait: AnyGait) -> Fourier:
    """The Fourier series that stands for a gait of a problem."""
    return fourier_through(gait, series_class(problem))


@dataclass(frozen=True, eq=False)
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
    symmetries of body and friction (see `colloc.results.equivalence.images`).
    """
    solved = sorted((o for o in outcomes if o.status == SOLVED), key=lambda o: -o.value)
    found: list[tuple[list[Outcome], Fourier]] = []
    for outcome in solved:
        path = fourier_series(problem, outcome.gait)
        for members, near in found:
            if are_one((members[0].value, near), (outcome.value, path), problem.body, problem.friction):
                members.append(outcome)
                break
        else:
            found.append(([outcome], path))
    return [Basin(m[0], tuple(sorted(o.start for o in m)), len(m) / len(outcomes)) for m, _ in found]
