"""Families of gaits that steer: the best one of a problem for every turn per period.

After the straight gait, others are sought in the class without symmetry, each from its neighbour,
or from the mirror image of the opposite turn. Controllers can interpolate between neighbours.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from colloc.gaits.limits import one_sided
from colloc.gaits.objective import Objective
from colloc.gaits.problem import Problem
from colloc.gaits.symmetry import ANTIPODAL, NONE
from colloc.results.solution import Solution
from colloc.search.options import OPTIONS
from colloc.studies.saved import solve_member
from colloc.system.arguments import check_count, is_number
from colloc.system.errors import ProblemError
from colloc.system.lazy import higher

LEAST_WORK = Objective("1 / work", "least work")  # turning on the spot: moving takes work
_PHASES = 1000  # tried for the begin of a gait


@dataclass(frozen=True, eq=False)
class Steering:
    """Family of gaits by the angle that a period turns."""

    problem: Problem
    turns: tuple[float, ...]  # counter-clockwise [rad], ascending
    points: tuple[Solution, ...]
    on_the_spot: Steering | None = None  # gaits that turn with the least work

    @property
    def certified(self) -> bool:
        """True if every gait is certified."""
        spot = self.on_the_spot is None or self.on_the_spot.certified
        return spot and all(point.success for point in self.points)

    @property
    def efficiency(self) -> np.ndarray:
        """Chord of the arc of a period per work, independent of the phase at which it begins."""
        return np.array([point.arc.chord / point.work for point in self.points])

    @property
    def begins(self) -> tuple[float, ...]:
        """Phases at which to begin the gaits, so that each is near its neighbour that turns
        less."""
        t, straight = np.arange(_PHASES) / _PHASES, min(self.turns, key=abs)
        begins = dict.fromkeys(self.turns, 0.0)
        gaits = {turn: point.gait for turn, point in zip(self.turns, self.points, strict=True)}
        for turn, inner in _outwards(self.turns, straight):
            known, angles = gaits[inner].angles(t + begins[inner]), gaits[turn].angles(t)
            overlap = (np.fft.fft(angles) * np.conj(np.fft.fft(known))).sum(axis=0)
            begins[turn] = float(t[np.fft.ifft(overlap).real.argmax()])
        return tuple(begins.values())

    def table(self, phases: int = 100) -> dict[str, Any]:
        """Return turns, their arcs, and joint angles at equal phases from `begins`, as JSON can
        hold them; angles are interpolated linearly between turns."""
        t, points = np.arange(phases) / phases, self.points
        radii = [point.arc.radius for point in points]
        more = {} if self.on_the_spot is None else {"on_the_spot": self.on_the_spot.table(phases)}
        return more | {
            "name": self.problem.name,
            "turn_rad": list(self.turns),
            "chord_body_lengths": [point.arc.chord for point in points],
            "radius_body_lengths": [radius if math.isfinite(radius) else None for radius in radii],
            "work_per_period_weight_times_length": [point.work for point in points],
            "status": [point.status for point in points],
            "phase": t.tolist(),
            f"{points[0].gait.motor_gait.coordinate}_angles_rad": [
                point.gait.motor_gait.angles(t + begin).T.tolist()
                for point, begin in zip(points, self.begins, strict=True)
            ],
        }

    def plot(self, ax: Any = None, panel: str = "cost") -> Any:
        """Draw efficiency against the turn, and the tracks, as a matplotlib Figure; with a
        matplotlib Axes `ax` the panel "cost" or "tracks" there, and return the Axes."""
        if ax is None:
            return higher("pictures.families:steering_figure")(self)
        return higher("pictures.families:draw_steering")(ax, self, panel)

    def __repr__(self) -> str:
        turns = ", ".join(f"{math.degrees(turn):+.4g}" for turn in self.turns)
        verdict = "all certified" if self.certified else "NOT all certified"
        return f"<Steering of {self.problem.name}: {turns} degrees a period, {verdict}>"


def _outwards(turns: Sequence[float], middle: float) -> Iterator[tuple[float, float]]:
    """Turns to the left of the middle, then to the right, each with its inner neighbour."""
    for side in (
        [turn for turn in turns if turn > middle],
        [turn for turn in reversed(turns) if turn < middle],
    ):
        yield from zip(side, (middle, *side), strict=False)


def steer(
    problem: Problem,
    turns: Sequence[float],
    *,
    spot: Sequence[float] = (),
    starts: int = OPTIONS.starts,
    progress: Callable[[float, Solution], object] | None = None,
) -> Steering:
    """Find the best gaits of a problem for given turns per period.

    Parameters
    ----------
    problem : Problem
        States the gait that goes straight; its objective is that of all.
    turns : sequence of float
        Counter-clockwise [rad], less than half a turn.
    spot : sequence of float
        Turns on the spot, not 0.
    starts : int
        Starting points for the straight gait, and the first on the spot.
    progress : callable, optional
        Called with a turn and its solution.

    Raises
    ------
    ProblemError
        If a turn cannot be asked for, or the straight gait is not certified.
    NotConvergedError
        If no start leads anywhere.

    Examples
    --------
    >>> import colloc
    >>> problem = colloc.Problem("quick", gait=colloc.Harmonic(1, "bilateral"), delta=1e-2)
    >>> colloc.steer(problem, [0.0, 0.1], starts=1)
    <Steering of quick: +0, +5.73 degrees a period, all certified>
    """
    if not problem.gait.free or problem.regime.slides or problem.rotation != 0:
        raise ProblemError(
            "steering begins at a gait that is free and goes straight on the level: rotation 0, "
            "grade 0."
        )
    # by more than half a turn the body could turn the other way
    possible = all(is_number(turn) and abs(turn) < math.pi for turn in (*turns, *spot))
    if not len(turns) or not possible or 0 in spot:
        raise ProblemError(
            f"turns must be angles of less than half a turn a period, and not 0 on the spot; not "
            f"{[*turns, *spot]!r}."
        )
    check_count(starts=starts)

    def member(turn: float, stated: Problem, starts: int = starts) -> Solution:
        solution = solve_member(stated, starts)
        if progress is not None:
            progress(turn, solution)
        return solution

    straight = member(0.0, problem)
    if not straight.success:
        raise ProblemError(
            f"the straight gait is not certified, so there is nothing to steer: {straight.message}"
        )
    anywhere = problem.gait.with_symmetry(NONE)
    bent = problem.joint_map is not None and any(problem.joint_map.rest)
    mirrors = (
        ANTIPODAL in problem.body.symmetries and not one_sided(problem.joint_limit) and not bent
    )

    def family(
        stated: Problem, wanted: Sequence[float], known: dict[float, Solution]
    ) -> tuple[Solution, ...]:
        """Solve outwards from known members, or from all starts if there is none."""
        for turn, inner in _outwards(wanted, 0.0):
            begin = known[inner].gait if inner in known else None
            if -turn in known and mirrors:
                begin = known[-turn].gait.mirrored
            asked = {"gait": anywhere, "rotation": turn, "guess": begin}
            if begin is None:
                known[turn] = member(turn, stated.with_(**asked, delta_start=None))
            else:
                known[turn] = member(turn, stated.with_(**asked, delta_start=problem.delta), 1)
        return tuple(known[turn] for turn in wanted)

    turns, spot = (sorted({float(turn) for turn in each}) for each in (turns, spot))
    points = family(problem, turns, {0.0: straight})
    cheapest = problem.with_(gait=anywhere, objective=LEAST_WORK, rotation=1.0)
    places = Steering(cheapest, tuple(spot), family(cheapest, spot, {})) if spot else None
    return Steering(problem, tuple(turns), points, places)
