"""One cell of a study: which starts are worth solving, and what became of them. This is what runs
on a worker."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from colloc.gaits.gait import delta_per_period
from colloc.gaits.gait_fields import AnyGait, fields, statement_hash
from colloc.gaits.problem import Problem
from colloc.gaits.starts import LATIN_HYPERCUBE, laid_into, start_gait
from colloc.results.distinct_optima import SAME_GAIT, distance, fourier_series, phase_distance
from colloc.results.outcome import ERROR, Outcome
from colloc.results.solution import SOLVED
from colloc.search.closure import closed_gait
from colloc.search.optimum import Optimum
from colloc.search.spaces import space_near
from colloc.studies.campaign import run_guess
from colloc.system.errors import CollocError
from colloc.verification.replayer import replayer

Index = tuple[int, ...]
_INSTANTS = 200
_LEVER = 0.5
"""Of a net rotation, in body lengths: how far the distance depends on the point of the body that is
followed."""
_SAME_START = 1e-3
BETTER = 1e-3
"""Relative gain in value that is worth a solve, and that a coarse replay can tell (see
`value_as_it_is`)."""
GUESS, WARM, COLD, RESCUE = "guess", "warm", "cold", "rescue"


def start_key(gait: AnyGait) -> str:
    """A name for a gait, the same wherever it comes from."""
    return statement_hash(fields(gait))[:16]


@dataclass(frozen=True, eq=False)
class Attempt:
    """One start of a cell: where it came from, and its outcome. `key` names the start, so that none
    is solved twice."""

    origin: str
    key: str
    outcome: Outcome

    @cached_property
    def gait_key(self) -> str:
        """The name of the gait where it ended."""
        return start_key(self.outcome.gait)


@dataclass(frozen=True, eq=False)
class Work:
    """What a worker needs to know about a cell."""

    cell: Index
    problem: Problem
    first: bool
    """Whether the cell has its own starts, the guess and the cold ones, still before it."""
    inside: tuple[Index, ...]
    """Cells of the same task, earlier in it, whose gaits are warm starts."""
    gaits: tuple[AnyGait, ...]
    """Warm starts from elsewhere."""
    cold: tuple[int, ...]
    """Numbers of the seeded starts."""
    incumbent: float
    """The best certified value so far; 0 if there is none."""
    tried: frozenset[str]
    """Keys of starts solved before."""
    warm_starts: int
    time_limit: float
    seed: int
    """These three: see `colloc.studies.study.Study`."""


@dataclass(frozen=True, eq=False)
class Visit:
    """What working on a cell gave."""

    cell: Index
    attempts: list[Attempt]
    scores: dict[str, float] = field(default_factory=dict)
    """The value there of every gait that came from elsewhere, as it is, by its `start_key`; NaN if
    nobody knows."""


def failed_visit(work: Work, status: str, message: str) -> Visit:
    """The visit of which nothing came. If the cell's own starts may be to blame, gaits from
    elsewhere have another chance."""
    guess = work.problem.guess
    attempt = Attempt(GUESS, start_key(guess), Outcome(0, status, message, guess, guess))
    return Visit(
        work.cell, [attempt], {} if work.first else {start_key(gait): np.nan for gait in work.gaits}
    )


def member(problem: Problem, gait: AnyGait) -> AnyGait | None:
    """The member of the problem's class next to a gait of any class; None if there is none that is
    admissible and moves."""
    body, kind = problem.body, problem.gait
    if gait.n_joint != body.n_joint or not kind.free:
        return None
    try:
        near = laid_into(kind, gait, body, problem.joint_limit, problem.smallest_shape_speed)
        space, v = space_near(problem, closed_gait(problem, near))
        projected = space.member(v)
        problem.with_(guess=projected)
    except CollocError:
        return None
    return projected


def value_as_it_is(
    problem: Problem, gait: AnyGait, instants: int = _INSTANTS, most_instants: int = _INSTANTS
) -> float:
    """The objective of a gait without a search, from a coarse replay; 0 if that fails.

    A net rotation makes the distance depend on the point that is followed. What it can be too large
    by is taken off, where it is not asked for.
    200 instants are within 3e-4 of 1,600 for the ellipse of efficiency 0.26 and delta from 1e-2 to
    1e-4.
    """
    try:
        found = replayer(problem.regime)(
            problem.body,
            problem.law,
            gait,
            delta_per_period(problem.gait, gait, problem.delta),
            instants=instants,
            most_instants=most_instants,
            breaks=gait.corner_phases,
            objective=problem.objective,
            turn=problem.rotation or 0.0,
        )
    except CollocError:
        return 0.0
    turned = 0.0 if problem.rotation is None else abs(found.rotation - problem.rotation)
    sure = problem.objective(
        {**found.values, "distance": max(0.0, found.distance - _LEVER * turned)}
    )
    return float(sure) if np.isfinite(sure) else 0.0


def visit(work: Work, found: dict[Index, AnyGait]) -> Visit:
    """Solve a cell from its starts; `found` holds the best gaits of earlier cells of the task, by
    cell.

    A gait from elsewhere is a start while it does better, as it is, than all that was found; the
    best ones come first. What leads to the gait that is certified by then, or to no better one, is
    passed over. If the best from elsewhere promises more than the search from it keeps, it is tried
    once more from the problem's own delta_start.
    """
    problem, attempts = work.problem, list[Attempt]()
    gaits = {start_key(g): g for g in (*work.gaits, *(found[c] for c in work.inside if c in found))}
    members = {
        key: near for key, gait in gaits.items() if (near := member(problem, gait)) is not None
    }
    scores = {
        key: value_as_it_is(problem, members[key]) if key in members else 0.0 for key in gaits
    }

    def solve(origin: str, gait: AnyGait, delta_start: float) -> None:
        key = start_key(gait) + ("r" if origin == RESCUE else "")
        if key in work.tried or key in {a.key for a in attempts}:
            return
        stated = problem.with_(delta_start=delta_start)
        attempts.append(
            Attempt(
                origin,
                key,
                run_guess(stated, lambda: gait, len(attempts), work.time_limit, worth=worth),
            )
        )

    def enough() -> float:
        """What a gait has to do to be better than all that was found."""
        best = best_attempt(attempts)
        return (1 + BETTER) * max(work.incumbent, 0.0 if best is None else best.outcome.value)

    def worth(end: Optimum) -> bool:
        best = best_attempt(attempts)
        if best is None:
            return end.value > enough() or not work.incumbent
        known, found = (fourier_series(problem, gait) for gait in (best.outcome.gait, end.gait))
        return (
            end.value > enough() and distance(known, found, problem.body, problem.law) > SAME_GAIT
        )

    def promising(key: str) -> bool:
        return scores[key] > enough()

    warm = _distinct_untried(work, members, scores)
    for key in warm[: work.warm_starts if work.first else 0]:
        solve(WARM, members[key], problem.delta)
    if work.first:
        solve(GUESS, problem.guess, problem.delta_start)
        for number in work.cold if problem.gait.free else ():
            solve(
                COLD, start_gait(problem, LATIN_HYPERCUBE, work.seed, number), problem.delta_start
            )
    for key in warm:
        if promising(key):
            solve(WARM, members[key], problem.delta)
    if warm and (promising(warm[0]) or not (work.incumbent or best_attempt(attempts))):
        solve(RESCUE, members[warm[0]], problem.delta_start)
    for key, near in members.items():
        if promising(key):  # for good, then: measured as finely as a certificate does
            scores[key] = value_as_it_is(problem, near, 1600, 25600)
    return Visit(work.cell, attempts, scores)


def _distinct_untried(
    work: Work, members: dict[str, AnyGait], scores: dict[str, float]
) -> list[str]:
    """Keys of the gaits that make different starts not solved before, the best first."""
    paths = {key: fourier_series(work.problem, near) for key, near in members.items()}
    distinct: list[str] = []
    for key in sorted(members, key=lambda key: -scores[key]):
        new = all(phase_distance(paths[key], paths[other]) > _SAME_START for other in distinct)
        if new and start_key(members[key]) not in work.tried:
            distinct.append(key)
    return distinct


def best_attempt(attempts: Sequence[Attempt]) -> Attempt | None:
    """The certified one of largest value, or None."""
    certified = [a for a in attempts if a.outcome.status == SOLVED]
    return max(certified, key=lambda a: a.outcome.value, default=None)


def run_chunk(chunk: tuple[Work, ...]) -> list[Visit]:
    """Solve the cells of a task one after the other; nothing is raised."""
    found: dict[Index, AnyGait] = {}
    visits = []
    for work in chunk:
        try:
            done = visit(work, found)
        except Exception as error:
            done = failed_visit(work, ERROR, f"{type(error).__name__}: {error}")
        best = best_attempt(done.attempts)
        if best is not None:
            found[work.cell] = best.outcome.gait
        visits.append(done)
    return visits
