"""Gaits that steer: the best of a problem for every turn of a period that is asked for, from sharp
right to sharp left.

The straight gait comes first, of the problem's own class. The others are sought in the class
without symmetry, for no symmetric gait turns, each from its neighbour outwards; a turn to the right
from the mirror image of that to the left, if that is asked for, too, and is of the same body. Gaits
that turn on the spot are those of least work for their turn. Joint angles between those of two
neighbours turn by about as much as lies between, so that a controller can interpolate.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from colloc.gaits.limits import one_sided
from colloc.gaits.objective import Objective
from colloc.gaits.problem import Problem
from colloc.gaits.symmetry import ANTIPODAL, NONE
from colloc.results.solution import Solution
from colloc.search.explore import STARTS
from colloc.search.solve import solve
from colloc.studies.saved import member_file
from colloc.system.arguments import check_count, is_number
from colloc.system.errors import ProblemError
from colloc.system.late_binding import bound

_LARGEST = math.pi
"""By more than half a turn a period the body could as well turn the other way."""
LEAST_WORK = Objective("1 / work", "least work")
"""Of gaits that turn by a given angle: on the spot, for going anywhere takes work."""
_BEGINS = 1000
"""Phases that are tried."""


@dataclass(frozen=True, eq=False)
class Steering:
    """A family of gaits, by the angle that a period turns.

    Attributes
    ----------
    problem : Problem
    turns : tuple of float
        Counter-clockwise [rad], rising.
    points : tuple of Solution
        One for each, with a certificate of its own.
    on_the_spot : Steering, optional
        Those that turn with the least work, and hardly leave their place.
    """

    problem: Problem
    turns: tuple[float, ...]
    points: tuple[Solution, ...]
    on_the_spot: Steering | None = None

    @property
    def certified(self) -> bool:
        """Whether every gait is."""
        return all(point.success for point in self.points) and (
            self.on_the_spot is None or self.on_the_spot.certified
        )

    @property
    def efficiency(self) -> np.ndarray:
        """Chord of the arc of a period per work, of every gait: it does not depend on the phase it
        is begun at."""
        return np.array([point.arc.chord / point.work for point in self.points])

    @property
    def begins(self) -> tuple[float, ...]:
        """Phases at which to begin the gaits, each as near as can be to its neighbour that turns
        less: where a period begins matters for nothing else."""
        t = np.arange(_BEGINS) / _BEGINS
        found = dict.fromkeys(self.turns, 0.0)
        straight = min(self.turns, key=abs)
        gaits = {turn: point.gait for turn, point in zip(self.turns, self.points, strict=True)}
        for side in (
            [turn for turn in self.turns if turn > straight],
            [turn for turn in self.turns[::-1] if turn < straight],
        ):
            near = straight
            for turn in side:
                known, own = gaits[near].angles(t + found[near]), gaits[turn].angles(t)
                matched = np.fft.ifft(
                    (np.fft.fft(own) * np.conj(np.fft.fft(known))).sum(axis=0)
                ).real
                found[turn], near = float(t[matched.argmax()]), turn
        return tuple(found[turn] for turn in self.turns)

    def table(self, phases: int = 100) -> dict[str, Any]:
        """What a controller needs, as plain numbers: the turns, their arcs, and joint angles at
        equal phases from those of `begins`; between two turns angles are interpolated linearly."""
        t = np.arange(phases) / phases
        arcs = [point.arc for point in self.points]
        more = {} if self.on_the_spot is None else {"on_the_spot": self.on_the_spot.table(phases)}
        return more | {
            "name": self.problem.name,
            "turn_rad": list(self.turns),
            "chord_body_lengths": [each.chord for each in arcs],
            "radius_body_lengths": [
                each.radius if math.isfinite(each.radius) else None for each in arcs
            ],
            "work_per_period_weight_times_length": [point.work for point in self.points],
            "status": [point.status for point in self.points],
            "phase": t.tolist(),
            f"{self.points[0].gait.driven.coordinate}_angles_rad": [
                point.gait.driven.angles(t + begin).T.tolist()
                for point, begin in zip(self.points, self.begins, strict=True)
            ],
        }

    def plot(self, ax: Any = None, panel: str = "cost") -> Any:
        """Efficiency against the turn, and the tracks, as a matplotlib Figure; with `ax`, a
        matplotlib Axes, one of them there, "cost" or "tracks", and the Axes is returned."""
        return (
            bound("plot_steering")(self)
            if ax is None
            else bound("plot_steering_panel")(ax, self, panel)
        )

    def __repr__(self) -> str:
        told = ", ".join(f"{math.degrees(turn):+.4g}" for turn in self.turns)
        verdict = "all certified" if self.certified else "NOT all certified"
        return f"<Steering of {self.problem.name}: {told} degrees a period, {verdict}>"


def steer(
    problem: Problem,
    turns: Sequence[float],
    *,
    spot: Sequence[float] = (),
    starts: int = STARTS,
    progress: Callable[[float, Solution], object] | None = None,
) -> Steering:
    """The best gaits of a problem for given turns of a period.

    Parameters
    ----------
    problem : Problem
        Of gaits that go straight; its objective is that of all of them.
    turns : sequence of float
        Counter-clockwise [rad], less than half a turn; 0 need not be among them.
    spot : sequence of float
        Turns on the spot, the same way; not 0.
    starts : int
        From which the straight gait is the best, and the first on the spot.
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
    if (
        not len(turns)
        or not all(is_number(turn) and abs(turn) < _LARGEST for turn in (*turns, *spot))
        or 0 in spot
    ):
        raise ProblemError(
            f"turns must be angles of less than half a turn a period, and not 0 on the spot; not "
            f"{[*turns, *spot]!r}."
        )
    check_count(starts=starts)

    def solved(turn: float, stated: Problem, starts: int) -> Solution:
        solution = solve(stated, starts, keep=member_file(stated))
        if solution.interrupted:
            raise KeyboardInterrupt
        if progress is not None:
            progress(turn, solution)
        return solution

    straight = solved(0.0, problem, starts)
    if not straight.success:
        raise ProblemError(
            f"the straight gait is not certified, so there is nothing to steer: {straight.message}"
        )
    free = {"gait": problem.gait.with_symmetry(NONE)}
    from_neighbour = free | {"delta_start": problem.delta}
    bent = problem.joint_map is not None and any(problem.joint_map.rest)
    mirrors = (
        ANTIPODAL in problem.body.symmetries and not one_sided(problem.joint_limit) and not bent
    )

    def turned(
        stated: Problem, wanted: Sequence[float], known: dict[float, Solution]
    ) -> tuple[Solution, ...]:
        """Outwards from those that are known, to the left first; from all starts if there is
        none."""
        for side in (
            [turn for turn in wanted if turn > 0],
            [turn for turn in reversed(wanted) if turn < 0],
        ):
            near = known.get(0.0)
            for turn in side:
                if -turn in known and mirrors:
                    guess = known[-turn].gait.mirrored
                    near = solved(
                        turn, stated.with_(rotation=turn, guess=guess, **from_neighbour), 1
                    )
                elif near is not None:
                    near = solved(
                        turn, stated.with_(rotation=turn, guess=near.gait, **from_neighbour), 1
                    )
                else:
                    near = solved(
                        turn,
                        stated.with_(rotation=turn, guess=None, delta_start=None, **free),
                        starts,
                    )
                known[turn] = near
        return tuple(known[turn] for turn in wanted)

    turns, spot = (sorted({float(turn) for turn in each}) for each in (turns, spot))
    points = turned(problem, turns, {0.0: straight})
    cheapest = problem.with_(**free, objective=LEAST_WORK, rotation=1.0)
    places = Steering(cheapest, tuple(spot), turned(cheapest, spot, {})) if spot else None
    return Steering(problem, tuple(turns), points, places)
