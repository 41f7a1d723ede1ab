"""From a problem to a certified solution: the stages of a search, in order.

    explore -> descend -> refine -> confirm -> certify -> choose

Each is a function of one value that returns the next one, in a module of its name, and can be
called by itself. Only here is decided what comes after what, how often something is tried again,
how long all of it may take, and what an interrupt leaves.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from colloc.gaits.problem import Problem
from colloc.results.answer import Answer
from colloc.results.solution import Solution
from colloc.search.certify import GAP, SADDLE, Certified, certify, is_trivial
from colloc.search.choose import choose, promised, solution_of
from colloc.search.confirm import confirm, unconfirmed
from colloc.search.converge import as_it_is
from colloc.search.descend import FACTOR, below_saddle, descend
from colloc.search.explore import CLOSE, Exploration, begin_at, explore, followed_further, is_finite
from colloc.search.literal import literal_answer
from colloc.search.optimum import Optimum
from colloc.search.refine import refine
from colloc.search.run import Progress, Run, this_run
from colloc.search.spaces import space_near
from colloc.system.errors import NotConvergedError, ProblemError
from colloc.system.interruption import clear_interrupt

REDUCED, FULL = "reduced", "full"
SEARCHES = (REDUCED, FULL)
_TRIES = 3
"""Gaits of a kind that are solved for at most, until a certificate holds; saddles left one after
another; and deltas tried where nothing but the influence of delta fails."""
_EXPLORING = 0.6
"""The share of the time allowed that is spent on starts; the rest is for the answer."""


def solve(
    problem: Problem,
    starts: int | None = None,
    *,
    seconds: float = np.inf,
    search: str = REDUCED,
    keep: Path | None = None,
    progress: Callable[[Progress], object] = lambda news: None,
    worth: Callable[[Optimum], bool] = lambda first: True,
) -> Solution:
    """The best gait of a problem's class that so many starts lead to, certified.

    Parameters
    ----------
    problem : Problem
    starts : int, optional
        The guess, known gaits and seeded samples (`colloc.search.explore`), and small loops: at
        least so many. With 1 the guess alone. By default 32, with inertia 96; fewer once four new
        ones, and one in eight, met the best.
    seconds : float
        Wall time allowed. Then the best gait so far is returned, with status "interrupted" unless
        its certificate holds.
    search : {"reduced", "full"}
        Where gaits are searched: in the space of their parameters, or by IPOPT on the full program,
        from the guess alone.
    keep : path, optional
        File in which everything found is kept until the end; a solve of the same problem goes on
        from what is there.
    progress : callable, optional
        Called with every `colloc.search.run.Progress`.
    worth : callable, optional
        Whether the best gait, at the final delta and before its mesh is refined, is worth an
        answer. By default it is.

    Returns
    -------
    Solution
        With status "solved", "not converged", "certificate failed" or, after Ctrl-C or when the
        time is over, "interrupted"; nothing is raised for the last three.

    Examples
    --------
    >>> from colloc import Harmonic, Problem, ellipse
    >>> from colloc.search.solve import solve
    >>> solve(Problem("near", ellipse(A0=0, A1=2.8, B1=1.3), gait=Harmonic(1, "bilateral")),
    ...     starts=1).status
    'solved'
    """
    if search not in SEARCHES:
        raise ProblemError(f"search must be one of {', '.join(SEARCHES)}, not {search!r}.")
    begin, run = time.monotonic(), Run(keep, problem, progress)
    try:
        with run.under_way(seconds):
            solution = _solved(problem, starts, search, begin + _EXPLORING * seconds, worth)
    except KeyboardInterrupt:
        clear_interrupt()
        over = time.monotonic() - begin >= seconds
        solution = _interrupted(
            problem, run, f"the {seconds:g} s allowed are over" if over else "interrupted"
        )
    solution.seconds = time.monotonic() - begin
    return solution


def _solved(
    problem: Problem,
    starts: int | None,
    search: str,
    until: float,
    worth: Callable[[Optimum], bool],
) -> Solution:
    """The stages, in order. After the time `until` nothing else is explored."""

    def goes_on() -> bool:
        return time.monotonic() < until

    if search == FULL and problem.gait.free:
        return solution_of(problem, certified(literal_answer(problem)))
    explored = _explored(problem, starts, goes_on)
    first = descend(explored.optima[0])
    if not worth(first):
        return Solution(problem, unconfirmed(first))
    explored = replace(explored, optima=(first, *explored.optima[1:]))
    found = _certified_best(problem, explored.optima)
    if not any(each.holds for each in found) and explored.left:
        found += _certified_best(problem, followed_further(problem, explored, goes_on))
    solution = choose(problem, found)
    solution.starts, solution.others = explored.starts, explored.others
    if explored.failure and not solution.success:
        why = explored.failure[:1].upper() + explored.failure[1:]
        solution.message = f"{solution.message} {why}".strip()
    return solution


def _explored(problem: Problem, starts: int | None, goes_on: Callable[[], bool]) -> Exploration:
    failure = ""
    if starts != 1 and problem.gait.free:
        try:
            return explore(problem, starts, goes_on)
        except NotConvergedError as error:
            failure = str(error)  # what fails with the guess alone is said in detail
    return Exploration((begin_at(problem, problem.guess),), 1, failure=failure)


def _certified_best(problem: Problem, optima: Sequence[Optimum]) -> list[Certified]:
    """The best gaits, certified: of finite size first, then what shrank and is better; in one row
    where either will do."""
    if problem.shrinking:
        return _tried(optima, lambda found: found.holds)
    finite = [optimum for optimum in optima if is_finite(optimum)]
    shrunk = [optimum for optimum in optima if not is_finite(optimum)]
    found = _tried(finite, lambda found: found.holds and found.is_finite)
    best = max(map(promised, found), default=-np.inf)
    return [
        *found,
        *_tried([optimum for optimum in shrunk if optimum.value > best], lambda found: found.holds),
    ]


def _tried(optima: Sequence[Optimum], counts: Callable[[Certified], bool]) -> list[Certified]:
    """Certified answers, best first: the next one where one does not count, or lost more on its
    refined mesh than the next one is behind."""
    tried: list[Certified] = []
    for optimum in optima[:_TRIES]:
        best = max((each.answer.value for each in tried if counts(each)), default=-np.inf)
        if optimum.value - CLOSE * abs(optimum.value) < best:
            break
        tried.append(finished(optimum))
        this_run().answers.append((tried[-1].answer, tried[-1].certificate))
    return tried


def finished(optimum: Optimum) -> Certified:
    """An optimum through the last stages: refined, confirmed, and certified.

    Where it turns out to be a saddle, the search goes on below it; where friction is viscous at its
    speeds, at a smaller delta: what is slow enough for a large gait is not for a small one, or
    where feet hold.
    """
    found = certified(confirmed(optimum))
    for _ in range(_TRIES - 1):
        if not _is_viscous(found):
            break
        optimum = _at_smaller_delta(optimum)
        with suppress(NotConvergedError):  # there the body may have no such motion
            found = certified(confirmed(optimum))
    return found


def confirmed(optimum: Optimum) -> Answer:
    """An optimum through the stages to the answer, which has no certificate yet."""
    optimum = refine(descend(optimum))
    answer = confirm(optimum)
    for _ in range(_TRIES):
        if not answer.second_order.smallest + answer.second_order.error < -SADDLE:
            break
        below = below_saddle(optimum)
        if below is None:
            break
        optimum = refine(below)
        answer = confirm(optimum)
    return answer


def certified(answer: Answer) -> Certified:
    """An answer with its certificate; without one where it goes nowhere, or cannot be replayed."""
    problem, run = answer.problem, this_run()
    if problem.gait.free and is_trivial(answer):
        return Certified(answer)
    run.told("certify", 0, 1)
    # exactly may take minutes, for what is no optimum
    roughly: dict[str, Any] = (
        {} if answer.optimal else {"tolerance": GAP, "instants": problem.body.usual.instants}
    )
    try:
        return Certified(answer, run.kept("certify", (answer,), lambda: certify(answer, **roughly)))
    except NotConvergedError as error:
        return Certified(answer, failure=str(error))


def _is_viscous(found: Certified) -> bool:
    """Whether nothing fails but the influence of delta: the gait is so slow, or small, that
    friction is viscous at it. A motion that is prescribed is measured at the delta that is asked
    for."""
    viscous = [check.name for check in found.certificate.failures] == ["delta influence"]
    return viscous and found.answer.problem.gait.free


def _at_smaller_delta(optimum: Optimum) -> Optimum:
    return replace(optimum, problem=optimum.problem.with_(delta=FACTOR * optimum.problem.delta))


def _interrupted(problem: Problem, run: Run, why: str) -> Solution:
    """The best that was found before an interrupt."""
    found = [Certified(*each) for each in run.answers]
    if any(each.holds for each in found):
        solution = choose(problem, found)
    elif found:
        solution = Solution(problem, found[0].answer)
    else:
        best = run.best or as_it_is(*space_near(problem, problem.guess), problem.delta_start)
        solution = Solution(problem, unconfirmed(best))
    solution.interrupted = True
    solution.message = f"{why}; this is the best gait so far. {solution.message}".strip()
    return solution
