"""One cell of a study: which starts are worth solving, and what became of them. This is what runs on a worker."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from colloc.gaits.equivalence import phase_distance
from colloc.gaits.harmonic import Fourier
from colloc.gaits.problem import Problem
from colloc.gaits.sampling import LATIN_HYPERCUBE, start_gait
from colloc.results.distinct_optima import Outcome
from colloc.results.solution import SOLVED
from colloc.studies.campaign import run_guess
from colloc.system.errors import CollocError
from colloc.verification.replay import replay

Index = tuple[int, ...]
_INSTANTS = 200
_SAME_START = 1e-3
_BETTER = 1e-3
GUESS, WARM, COLD, RESCUE = "guess", "warm", "cold", "rescue"


@dataclass(frozen=True, eq=False)
class Attempt:
    """One start of a cell: where it came from, and its outcome. `key` names the start, so that none is solved twice."""

    origin: str
    key: str
    outcome: Outcome


@dataclass(frozen=True, eq=False)
class Work:
    """What a worker needs to know about a cell.

    Attributes
    ----------
    cell : tuple of int
    problem : Problem
    inside : tuple of tuple of int
        Cells of the same task, earlier in it, whose gaits are warm starts.
    gaits : tuple of Fourier
        Warm starts from elsewhere.
    cold : tuple of int
        Numbers of the seeded starts.
    incumbent : float
        Efficiency to beat: warm starts that do worse as they are, and cold starts, are left out. 0: solve in any case.
    tried : frozenset of str
        Keys of starts solved before.
    warm_starts, warm_delta_start, time_limit, seed
        See `colloc.studies.study.Study`.
    """

    cell: Index
    problem: Problem
    inside: tuple[Index, ...]
    gaits: tuple[Fourier, ...]
    cold: tuple[int, ...]
    incumbent: float
    tried: frozenset[str]
    warm_starts: int
    warm_delta_start: float
    time_limit: float
    seed: int


def start_key(gait: Fourier) -> str:
    """A name for a start, the same wherever it comes from."""
    parts = (gait.mean, gait.cos, gait.sin)
    return hashlib.sha256(b"".join(np.ascontiguousarray(part).tobytes() for part in parts)).hexdigest()[:16]


def member(problem: Problem, gait: Fourier) -> Fourier | None:
    """The gait as a start of the problem: projected onto its class; None if that is inadmissible or hardly moves."""
    if gait.n_joint != problem.body.n_joint:
        return None
    projected = problem.gait.fourier(problem.gait.parameters(gait), gait.n_joint)
    try:
        problem.with_(guess=projected)
    except CollocError:
        return None
    return projected


def rough_efficiency(problem: Problem, gait: Fourier) -> float:
    """Efficiency of a gait as it is, from a coarse replay; 0 if that fails."""
    try:
        rough = replay(
            problem.body,
            problem.friction,
            lambda t: (gait.angles(t), gait.rates(t)),
            problem.delta,
            instants=_INSTANTS,
            most_instants=_INSTANTS,
        )
    except CollocError:
        return 0.0
    return rough.efficiency if np.isfinite(rough.efficiency) else 0.0


def warm_gaits(work: Work, gaits: Sequence[Fourier]) -> list[Fourier]:
    """The warm starts worth solving, best first."""
    distinct: list[Fourier] = []
    for gait in gaits:
        start = member(work.problem, gait)
        if start is None or start_key(start) in work.tried:
            continue
        if all(phase_distance(start, other) > _SAME_START for other in distinct):
            distinct.append(start)
    scored = sorted(((rough_efficiency(work.problem, gait), k) for k, gait in enumerate(distinct)), reverse=True)
    return [distinct[k] for score, k in scored[: work.warm_starts] if score > work.incumbent * (1 + _BETTER)]


def attempts_at(work: Work, found: dict[Index, Fourier]) -> list[Attempt]:
    """Solve a cell from its starts; `found` holds the best gaits of earlier cells of the task, by cell.

    If no warm start leads to a certified optimum, the best of them is tried once more from the problem's own delta_start,
    and then the problem's guess.
    """
    problem = work.problem
    attempts: list[Attempt] = []

    def solve(origin: str, gait: Fourier, delta_start: float) -> None:
        key = start_key(gait) + ("r" if origin == RESCUE else "")
        if key in work.tried or key in {a.key for a in attempts}:
            return
        stated = problem.with_(delta_start=delta_start)
        attempts.append(Attempt(origin, key, run_guess(stated, lambda: gait, len(attempts), work.time_limit)))

    def solved() -> bool:
        return work.incumbent > 0 or any(a.outcome.status == SOLVED for a in attempts)

    warm = warm_gaits(work, [*work.gaits, *(found[c] for c in work.inside if c in found)])
    for gait in warm:
        solve(WARM, gait, min(work.warm_delta_start, problem.delta_start))
    for number in work.cold:
        solve(COLD, start_gait(problem, LATIN_HYPERCUBE, work.seed, number), problem.delta_start)
    if not solved() and warm:
        solve(RESCUE, warm[0], problem.delta_start)
    if not solved():
        solve(GUESS, problem.guess, problem.delta_start)
    return attempts


def best_attempt(attempts: Sequence[Attempt]) -> Attempt | None:
    """The certified one of largest efficiency, or None."""
    certified = [a for a in attempts if a.outcome.status == SOLVED]
    return max(certified, key=lambda a: a.outcome.efficiency, default=None)


def run_chunk(chunk: tuple[Work, ...]) -> list[tuple[Index, list[Attempt]]]:
    """Solve the cells of a task one after the other; nothing is raised."""
    found: dict[Index, Fourier] = {}
    results = []
    for work in chunk:
        try:
            attempts = attempts_at(work, found)
        except Exception as error:
            message = f"{type(error).__name__}: {error}"
            guess = work.problem.guess
            attempts = [Attempt(GUESS, start_key(guess), Outcome(0, "error", message, guess, guess))]
        best = best_attempt(attempts)
        if best is not None:
            found[work.cell] = best.outcome.gait
        results.append((work.cell, attempts))
    return results
