"""Stages from a problem to a certified solution: explore, descend, refine, confirm, certify,
choose.

Each stage is a function of one value that returns the next one, in a module of its name. Retries,
time limits and interrupts are decided here.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

import numpy as np

from colloc.gaits.problem import Problem
from colloc.results.answer import Answer
from colloc.results.checks import Certificate
from colloc.results.solution import Solution
from colloc.search.certify import certify, is_trivial
from colloc.search.checkpoint import Progress, Run, active_run, checkpointed
from colloc.search.choose import choose, is_visible_solution, passes, solution_of
from colloc.search.confirm import answer_of_iterate, confirm
from colloc.search.descend import descend, leave_saddle
from colloc.search.direct_nlp import solve_directly
from colloc.search.explore import (
    Exploration,
    explore,
    first_optimum,
    follow_rest,
    is_finite,
)
from colloc.search.iterate import Iterate, evaluate_at
from colloc.search.options import OPTIONS, TOLERANCES
from colloc.search.refine import refine
from colloc.search.spaces import space_near, space_of
from colloc.system.errors import NotConvergedError, ProblemError
from colloc.system.interruption import clear_interrupt

REDUCED, FULL = "reduced", "full"
SEARCHES = (REDUCED, FULL)


def solve(
    problem: Problem,
    starts: int | None = None,
    *,
    seconds: float = np.inf,
    search: str = REDUCED,
    keep: Path | None = None,
    progress: Callable[[Progress], object] = lambda progress: None,
    accept: Callable[[Iterate], bool] = lambda first: True,
) -> Solution:
    """The best gait of a problem's class that so many starts lead to, certified.

    Parameters
    ----------
    problem : Problem
    starts : int, optional
        Starts at least: the guess, known gaits, seeded samples (`colloc.search.explore`), and small
        loops beside them. With 1 the guess alone. By default 32, with inertia 96; fewer once four
        new ones, and one in eight, met the best.
    seconds : float
        Wall time allowed. Then the best gait so far is returned, with status "interrupted" unless
        its certificate passes.
    search : {"reduced", "full"}
        Where gaits are searched: in the space of their parameters, or by IPOPT on the full program,
        from the guess alone.
    keep : path, optional
        Checkpoint file: a solve of the same problem goes on from what is there.
    progress : callable, optional
        Called with every `colloc.search.checkpoint.Progress`.
    accept : callable, optional
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

    def has_time() -> bool:
        return time.monotonic() < begin + OPTIONS.exploring * seconds

    try:
        with run.active(seconds):
            if search == FULL and problem.gait.free:
                solution = certify_answer(problem, solve_directly(problem))
            else:
                solution = _solve(problem, starts, has_time, accept)
    except KeyboardInterrupt:
        clear_interrupt()
        over = time.monotonic() - begin >= seconds
        why = f"the {seconds:g} s allowed are over" if over else "interrupted"
        solution = _best_so_far(problem, run, why)
    solution.seconds = time.monotonic() - begin
    return solution


def _solve(
    problem: Problem,
    starts: int | None,
    has_time: Callable[[], bool],
    accept: Callable[[Iterate], bool],
) -> Solution:
    explored = _explore(problem, starts, has_time)
    first = descend(explored.optima[0])
    if not accept(first):
        return Solution(problem, answer_of_iterate(first))
    solutions = _finish_best(problem, (first, *explored.optima[1:]))
    if not any(map(passes, solutions)) and explored.left:
        solutions += _finish_best(problem, follow_rest(problem, explored, has_time))
    solution = choose(problem, solutions)
    solution.starts, solution.others = explored.starts, explored.others
    if explored.failure and not solution.success:
        why = explored.failure[:1].upper() + explored.failure[1:]
        solution.message = f"{solution.message} {why}".strip()
    return solution


def _explore(problem: Problem, starts: int | None, has_time: Callable[[], bool]) -> Exploration:
    failure = ""
    if starts != 1 and problem.gait.free:
        try:
            return explore(problem, starts, has_time)
        except NotConvergedError as error:
            failure = str(error)  # what fails with the guess alone is said in detail
    return Exploration((first_optimum(problem, problem.guess),), 1, failure=failure)


def _finish_best(problem: Problem, optima: Sequence[Iterate]) -> list[Solution]:
    """Solutions of the best optima: of finite size first, then better ones that shrank; all in one
    order where the problem asks for any size."""
    if problem.shrinking:
        return _finish_until(problem, optima, passes)
    solutions = _finish_until(
        problem,
        [optimum for optimum in optima if is_finite(optimum)],
        lambda solution: passes(solution) and is_visible_solution(solution),
    )
    best = max((each.answer.value for each in solutions if passes(each)), default=-np.inf)
    better = [each for each in optima if not is_finite(each) and each.value > best]
    return solutions + _finish_until(problem, better, passes)


def _finish_until(
    problem: Problem, optima: Sequence[Iterate], counts: Callable[[Solution], bool]
) -> list[Solution]:
    """Solutions, best first, as long as none counts, or it lost more on its refined mesh than the
    next one is behind."""
    solutions: list[Solution] = []
    for optimum in optima[: OPTIONS.attempts]:
        best = max((each.answer.value for each in solutions if counts(each)), default=-np.inf)
        if optimum.value - OPTIONS.close * abs(optimum.value) < best:
            break
        solutions.append(finish(problem, optimum))
        active_run().solutions.append(solutions[-1])
    return solutions


def finish(problem: Problem, optimum: Iterate) -> Solution:
    """An optimum refined, confirmed and certified, at a smaller delta where friction is viscous at
    its speeds: small gaits and sticking feet need one."""
    solution = certify_answer(problem, confirm_optimum(optimum))
    for _ in range(OPTIONS.attempts - 1):
        failures = [check.name for check in solution.certificate.failures]
        # a prescribed motion is measured at the delta that is asked for
        if failures != ["delta influence"] or not problem.gait.free:
            break
        drier = optimum.problem.with_(delta=OPTIONS.delta_ratio * optimum.problem.delta)
        optimum = _of_problem(optimum, drier)
        with suppress(NotConvergedError):  # there the body may have no such motion
            solution = certify_answer(problem, confirm_optimum(optimum))
    return solution


def _of_problem(optimum: Iterate, problem: Problem) -> Iterate:
    old = optimum.space
    return replace(optimum, space=space_of(problem, None, old.edges, old.scheme, old.far))


def confirm_optimum(optimum: Iterate) -> Answer:
    """An optimum through refine and confirm; where it turns out to be a saddle, the one below."""
    optimum = refine(descend(optimum))
    answer = confirm(optimum)
    for _ in range(OPTIONS.attempts):
        second = answer.second_order
        if not second.smallest + second.error < -TOLERANCES.saddle:
            break
        below = leave_saddle(optimum)
        if below is None:
            break
        optimum = refine(below)
        answer = confirm(optimum)
    return answer


def certify_answer(problem: Problem, answer: Answer) -> Solution:
    """A solution with its certificate; without one where the gait goes nowhere, or cannot be
    replayed."""
    if answer.problem.gait.free and is_trivial(answer):
        return solution_of(problem, answer)
    active_run().report("certify", 0, 1)
    try:
        return solution_of(problem, answer, _certificate(answer))
    except NotConvergedError as error:
        return solution_of(problem, answer, failure=str(error))


@checkpointed
def _certificate(answer: Answer) -> Certificate:
    if answer.optimal:
        return certify(answer)
    # an exact replay may take minutes, for what is no optimum
    instants = answer.problem.body.defaults.instants
    return certify(answer, tolerance=TOLERANCES.replay_gap, instants=instants)


def _best_so_far(problem: Problem, run: Run, why: str) -> Solution:
    if any(map(passes, run.solutions)):
        solution = choose(problem, run.solutions)
    elif run.solutions:
        solution = Solution(problem, run.solutions[0].answer)
    else:
        guess = space_near(problem, problem.guess)
        best = run.best or evaluate_at(*guess, problem.delta_start)
        solution = Solution(problem, answer_of_iterate(best))
    solution.interrupted = True
    solution.message = f"{why}; this is the best gait so far. {solution.message}".strip()
    return solution
