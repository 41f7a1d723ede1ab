"""Families of certified gaits, each solved from its neighbours.

Pareto fronts by the epsilon-constraint method, from their ends inwards: docs/howto/objectives.md
says where, and each gait is sought from the neighbour that reaches its level. What is no better
than these leaves a gap. Only the gaits that are left are certified.

Steering (docs/howto/steering.md): after the straight gait each is sought from its neighbour, or
from the mirror image of the opposite turn.
"""

from __future__ import annotations

import csv
import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from colloc.gaits.gait import ANTIPODAL, NONE
from colloc.gaits.gait_fields import AnyGait
from colloc.gaits.objective import DRIVEN, Objective, Period, objective_from
from colloc.gaits.problem import Problem
from colloc.gaits.regime import Free
from colloc.gaits.robot import BATTERY, one_sided
from colloc.results.solution import Solution
from colloc.results.store import load
from colloc.search.explore import with_reachable_distance
from colloc.search.iterate import space_near
from colloc.search.optimise import optimise
from colloc.search.options import MEDIUM, OPTIONS
from colloc.studies.solve import solve_member
from colloc.system.arguments import check_count, is_number
from colloc.system.environment import higher
from colloc.system.errors import CollocError, NotConvergedError, ProblemError
from colloc.verification.replay import replayer

_MOST_POINTS = 1000
# over the even spacing: duplicates, neighbours between which a gait is sought, and gaps
_CLOSE, _WIDE, _APART = 0.1, 1.9, 2.0
_SAME = 1e-3  # relative difference in both objectives up to which two gaits are one
_ROUGH = 3e-5  # relative error of an optimum on the mesh of another gait
_WAYS = Objective("distance"), Objective("distance / period", name="speed")
_LEAST_WORK = Objective("1 / work", "least work")  # turning on the spot: moving takes work
_PHASES = 1000  # tried for the begin of a gait

Objectives = tuple[Objective, Objective]


@dataclass(frozen=True)
class Gap:
    """Part of a front, wider than twice the even spacing, where nothing was found."""

    after: int  # the point before it
    why: str
    certified: bool  # whether gaits found there are; they are no better than its neighbours


@dataclass(frozen=True, eq=False)
class ParetoFront:
    """Certified gaits from the best by the first objective to the best by the second; gaps are
    where neighbours are more than twice the even spacing apart."""

    problem: Problem
    objectives: Objectives
    points: tuple[Solution, ...]
    gaps: tuple[Gap, ...] = ()

    @property
    def values(self) -> np.ndarray:
        """Both objectives of every point, by replay, ``(n, 2)``."""
        return np.array([_measure(point, self.objectives)[0] for point in self.points])

    @property
    def in_units(self) -> tuple[tuple[str, str], np.ndarray]:
        """Labels of both objectives and their values, ``(n, 2)``; of a robot cm/s and J/m."""
        (first, second), robot, values = self.objectives, self.problem.robot, self.values
        if robot is None or first not in _WAYS or second.name not in (BATTERY, DRIVEN.name):
            return (first.label, second.label), values
        pressing, (way, thrift) = robot.pressing(self.problem.grade), values.T
        unit: Any = robot.period if first == _WAYS[0] else math.sqrt(robot.length / pressing)
        speed, energy = 100 * robot.length * way / unit, robot.mass * pressing / thrift
        return ("speed [cm/s]", "energy [J/m]"), np.transpose([speed, energy])

    @property
    def title(self) -> str:
        """Such as "speed against energy"."""
        return " against ".join(label.partition(" [")[0] for label in self.in_units[0])

    @property
    def narrow(self) -> str:
        """A sentence if nobody can tell its ends apart by their objectives, else ""."""
        little = "The ends differ by less than 1 % in both: there is little to trade."
        return "" if _distinct_ends(self.values).any() else little

    @property
    def certified(self) -> bool:
        """True if the gaits that were found in its gaps are certified, too."""
        return all(gap.certified for gap in self.gaps)

    def plot(self, ax: Any = None) -> Any:
        """Draw the front and its gaits as a matplotlib Figure; with a matplotlib Axes `ax` the
        front there, and return the Axes."""
        return higher("pictures.figure:plot_front")(self, ax)

    def __repr__(self) -> str:
        first, second = (aim.name for aim in self.objectives)
        counts = f"{len(self.points)} verified points, {len(self.gaps)} gaps"
        return f"<ParetoFront of {self.problem.name}: {first} against {second}, {counts}>"


@dataclass(eq=False)
class _Point:
    """A gait of a front: a solution, or an optimum of a problem, not yet certified."""

    values: np.ndarray  # (2,)
    errors: np.ndarray
    gait: AnyGait
    edges: np.ndarray  # of a mesh that is fine enough for such gaits
    source: Solution | Problem


def pareto_front(
    problem: Problem,
    first: Objective | str | None = None,
    second: Objective | str | None = None,
    points: int = 5,
    *,
    best: Solution | None = None,
    starts: int | None = None,
    progress: Callable[[int, Solution], object] | None = None,
) -> ParetoFront:
    """Find the Pareto front of two objectives of a problem.

    Parameters
    ----------
    problem : Problem
        Its constraints hold for every point.
    first, second : Objective or str, optional
        As for `colloc.gaits.problem.Problem`. By default distance, of a robot whose period is free
        speed, and the problem's own objective.
    points : int
        At least 2, and more until neighbours lie no farther apart than twice the even spacing, in
        either objective. Dominated points and duplicates are left out.
    best : Solution, optional
        The certified best gait by the second objective, if it is known; its problem counts then.
    starts : int, optional
        Starting points for both ends; by default as many as a solve takes.
    progress : callable, optional
        Called with the number of gaits certified so far and the last one.

    Raises
    ------
    ProblemError
        If the objectives are the same, or one of their best gaits is not certified.
    NotConvergedError
        If no start leads anywhere.

    Examples
    --------
    >>> import colloc
    >>> floor, gait = colloc.Friction(mu_t=10), colloc.Harmonic(1, "bilateral")
    >>> problem = colloc.Problem("quick", friction=floor, gait=gait, delta=1e-2)
    >>> colloc.pareto_front(problem, "speed", "efficiency", 3, starts=1)
    <ParetoFront of quick: speed against efficiency, 3 verified points, 0 gaps>
    """
    problem = best.problem if best else problem
    if not problem.gait.free:
        raise ProblemError("nothing is free in a prescribed motion: it is one point, and no front.")
    way = _WAYS[isinstance(problem.froude, Free)]
    aims = objective_from(first or way), objective_from(second or problem.objective)
    if aims[0].expression == aims[1].expression:
        raise ProblemError(f"a front needs two objectives, not {aims[0].name} twice.")
    if starts is not None:
        check_count(starts=starts)
    if not 2 <= points <= _MOST_POINTS:
        raise ProblemError(f"a front has 2 to {_MOST_POINTS} points, not {points}.")
    reachable, _ = with_reachable_distance(problem)
    free, intervals, certified = reachable.with_(least_distance=None), points - 1, list[_Point]()

    def add(solution):
        values, errors = _measure(solution, aims)
        certified.append(_Point(values, errors, solution.gait, solution.answer.edges, solution))
        if progress is not None:
            progress(len(certified), solution)

    def optimum(which, level, point):
        at_least = *free.at_least, (aims[which], level)
        beside = free.with_(objective=aims[1 - which], at_least=at_least, delta_start=free.delta)
        space, v = space_near(beside, point.gait, point.edges)
        end = optimise(space, v, beside.delta, MEDIUM)
        if end.violation > MEDIUM:
            raise NotConvergedError("no gait was found there")
        period = end.program().period(end.v)
        values = np.array([aim(period) for aim in aims])
        return _Point(values, _ROUGH * np.abs(values), end.gait, point.edges, beside)

    # the best by the second objective first: of two gaits that nobody can tell apart it stays
    for k, end in ((1, best), (0, None)):
        end = end or solve_member(free.with_(objective=aims[k]), starts)
        if not end.success:
            raise ProblemError(
                f"the gait of best {aims[k].name} is not verified, so there is no front: "
                f"{end.message}"
            )
        add(end)
    front, empty = [*certified], set[tuple[_Point, _Point]]()
    for _ in range(2 * points):
        apart = _apart(_thin(front, intervals), intervals)
        least = _WIDE if len(apart) >= intervals else 1.0
        wide = {pair: x for pair, x in apart.items() if pair not in empty and x.max() > least}
        if not wide:
            break
        pair = max(wide, key=lambda each: wide[each].max())
        for which in np.argsort(-wide[pair]).tolist():  # the other one if the front jumps there
            parts = max(2, round(wide[pair][which]))
            begin, end = (each.values[which] for each in pair)
            level = float(begin + parts // 2 / parts * (end - begin))
            with suppress(CollocError):
                front.append(optimum(which, level, pair[which]))
            if pair not in pairwise(_thin(front, intervals)):
                break
        else:
            empty.add(pair)
    failed = list[tuple[_Point, str]]()
    for point in _thin(front, intervals):
        if isinstance(source := point.source, Problem):
            try:
                solution = solve_member(source.with_(guess=point.gait), 1)
            except CollocError as error:
                failed.append((point, str(error)))
                continue
            if solution.success:
                add(solution)
            else:
                failed.append((point, solution.message))
    front, gaps = _thin(certified, intervals), list[Gap]()
    for k, ((a, b), width) in enumerate(_apart(front, intervals).items()):
        if width.max() > _APART:
            between = (why for each, why in failed if a.values[0] > each.values[0] > b.values[0])
            why = next(between, "")
            gaps.append(Gap(k, why or "the best gaits met there are those beside it", not why))
    solutions: Any = (point.source for point in front)
    return ParetoFront(reachable, aims, tuple(solutions), tuple(gaps))


def read_front(table: Path, problem: Problem) -> ParetoFront | None:
    """The front in a table of `colloc solve --front` or `colloc pareto`, if the best gait of the
    problem is one of its ends."""
    with table.open(newline="") as lines:
        rows = [*csv.DictReader(lines)]
    if not rows or "file" not in rows[0]:
        return None
    points = tuple(load(table.with_suffix("") / Path(row["file"]).name) for row in rows)
    problems = [point.problem for point in points]
    if problem.hash not in (each.hash for each in problems):
        return None
    every = (aim for each in problems for aim in (each.objective, *dict(each.at_least)))
    by_expression = {aim.expression: aim for aim in (*_WAYS, *every)}
    first, second = (by_expression.get(name) or Objective(name) for name in [*rows[0]][1:3])
    gaps = (Gap(k, row["gap"], True) for k, row in enumerate(rows) if row.get("gap"))
    return ParetoFront(problem, (first, second), points, tuple(gaps))


@lru_cache(maxsize=256)
def _measure(solution: Solution, aims: Objectives) -> np.ndarray:
    """Objectives of a solution and their errors, ``(2, 2)``, from its certificate or a replay."""
    problem, measured = solution.problem, []
    for aim in aims:
        period: Period = solution.certificate
        if not set(aim.uses) <= set(period.values):
            how: Any = {"objective": aim, "turn": problem.rotation or 0.0}
            period = solution.played_by(replayer(problem.regime), **how)
        value = aim(period.values)
        measured.append((value, abs(value) * period.error_of(aim)))
    return np.transpose(measured)


def _thin(points: Iterable[_Point], intervals: int) -> list[_Point]:
    """The points that no other dominates (by more than the errors), without near duplicates."""
    front: list[_Point] = []
    for each in points:
        values, errors = each.values, each.errors
        if any((values <= other.values + other.errors + errors).all() for other in front):
            continue
        left = [p for p in front if (values < p.values - p.errors - errors).any()]
        spread = np.ptp([values, *(other.values for other in front)], axis=0)
        close = np.maximum(spread * _CLOSE / intervals, _SAME * np.abs(values))
        twins = ((np.abs(values - other.values) < close).all() for other in front)
        if len(left) < len(front) or not any(twins):
            front = [*left, each]
    return sorted(front, key=lambda each: -each.values[0])


def _distinct_ends(values: np.ndarray) -> np.ndarray:
    """Objectives by which the ends of a front can be told apart, ``(2,)``."""
    return np.ptp(values, axis=0) > OPTIONS.close * np.abs(values).max(axis=0)


def _apart(front: list[_Point], intervals: int) -> dict[tuple[_Point, _Point], np.ndarray]:
    """Neighbours and their distance in each objective over the even spacing; 0 in an objective in
    which nobody can tell the ends apart."""
    values = np.array([each.values for each in front])
    spread = np.where(_distinct_ends(values), np.ptp(values, axis=0), np.inf)
    apart = np.abs(np.diff(values, axis=0)) / spread
    return dict(zip(pairwise(front), intervals * apart, strict=True))


@dataclass(frozen=True, eq=False)
class Steering:
    """Family of gaits by the angle that a cycle turns."""

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
        """Chord of the arc of a cycle per work, independent of the phase at which it begins."""
        return np.array([point.arc.chord / point.work for point in self.points])

    @property
    def begins(self) -> tuple[float, ...]:
        """Phases at which to begin the gaits, so that each is near its neighbour that turns
        less."""
        t, straight = np.arange(_PHASES) / _PHASES, min(self.turns, key=abs)
        begins = dict.fromkeys(self.turns, 0.0)
        gaits = {turn: point.gait for turn, point in zip(self.turns, self.points, strict=True)}
        for turn, inner in _outwards(self.turns, straight):
            there, angles = gaits[inner].angles(t + begins[inner]), gaits[turn].angles(t)
            overlap = (np.fft.fft(angles) * np.conj(np.fft.fft(there))).sum(axis=0)
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
        return higher("pictures.figure:plot_steering")(self, ax, panel)

    def __repr__(self) -> str:
        turns = ", ".join(f"{math.degrees(turn):+.4g}" for turn in self.turns)
        verdict = "all verified" if self.certified else "NOT all verified"
        return f"<Steering of {self.problem.name}: {turns} degrees per cycle, {verdict}>"


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
    """Find the best gaits of a problem for given turns per cycle.

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
    <Steering of quick: +0, +5.73 degrees per cycle, all verified>
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
            f"turns must be angles of less than half a turn per cycle, and not 0 on the spot; not "
            f"{[*turns, *spot]!r}."
        )
    check_count(starts=starts)

    def member(turn, problem, starts=starts):
        solution = solve_member(problem, starts)
        if progress is not None:
            progress(turn, solution)
        return solution

    straight = member(0.0, problem)
    if not straight.success:
        raise ProblemError(
            f"the straight gait is not verified, so there is nothing to steer: {straight.message}"
        )
    anywhere = problem.gait.with_symmetry(NONE)
    joints = problem.joint_map
    lopsided = one_sided(problem.joint_limit) or (joints is not None and any(joints.rest))
    mirrors = ANTIPODAL in problem.body.symmetries and not lopsided

    def family(problem, turns, members):
        for turn, inner in _outwards(turns, 0.0):
            begin = members[inner].gait if inner in members else None
            if -turn in members and mirrors:
                begin = members[-turn].gait.mirrored
            changes = {"gait": anywhere, "rotation": turn, "guess": begin}
            if begin is None:
                members[turn] = member(turn, problem.with_(**changes, delta_start=None))
            else:
                members[turn] = member(turn, problem.with_(**changes, delta_start=problem.delta), 1)
        return tuple(members[turn] for turn in turns)

    turns, spot = (sorted({float(turn) for turn in each}) for each in (turns, spot))
    points = family(problem, turns, {0.0: straight})
    cheapest = problem.with_(gait=anywhere, objective=_LEAST_WORK, rotation=1.0)
    places = Steering(cheapest, tuple(spot), family(cheapest, spot, {})) if spot else None
    return Steering(problem, tuple(turns), points, places)
