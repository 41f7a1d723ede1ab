"""Stages from a problem to a certified solution: explore, descend, refine, confirm, certify,
choose; retries, time limits and interrupts are decided here."""

import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import replace
from operator import attrgetter
from pathlib import Path

import numpy as np

from colloc.gaits.gait_fields import AnyGait
from colloc.gaits.objective import EFFICIENCY
from colloc.gaits.problem import Problem
from colloc.gaits.starts import is_visible, on_speed_floor
from colloc.results.answer import Answer
from colloc.results.checks import BACKLASH, Certificate
from colloc.results.solution import Solution
from colloc.search.certify import certify, is_trivial
from colloc.search.checkpoint import Progress, Run, active_run, checkpoint
from colloc.search.confirm import answer_of_iterate, confirm, solve_directly
from colloc.search.explore import (
    Exploration,
    explore,
    first_optimum,
    follow_rest,
    with_reachable_distance,
)
from colloc.search.iterate import Iterate, evaluate_at, space_near, space_of
from colloc.search.optimise import descend, leave_saddle, refine
from colloc.search.options import OPTIONS, TOLERANCES, settings
from colloc.system.arguments import check_choice
from colloc.system.errors import NotConvergedError, ProblemError
from colloc.system.interruption import clear_interrupt

REDUCED, FULL = "reduced", "full"
SEARCHES = (REDUCED, FULL)
_ADVICE = {
    BACKLASH: "least_distance=0.1, or more idle power",
    "joint limits": "another guess or a smaller joint_limit",
    "self-contact": "another guess or a smaller joint_limit",
    "delta influence": "a smaller delta",
    "second order": "another guess or more starts",
}


def solve(
    problem: Problem,
    starts: int | None = None,
    *,
    seconds: float = np.inf,
    search: str = REDUCED,
    keep: Path | None = None,
    progress: Callable[[Progress], object] = lambda progress: None,
    check: Callable[[Iterate], object] = lambda first: None,
) -> Solution:
    """The best gait of a problem's class that so many starts lead to, certified; see
    `colloc.solve`.

    `keep` is a checkpoint file: a solve of the same problem goes on from what is there. `check` is
    called with the best gait, where the search has found it and at the final delta, before its mesh
    is refined; what it raises ends the solve. After Ctrl-C, or once the time is over, the best gait
    so far is returned.
    """
    check_choice(SEARCHES, search=search)
    if search == FULL and (starts or 1) > 1:
        raise ProblemError(
            f"the full search is from the guess alone: starts must be 1, not {starts}."
        )
    begin, run = time.monotonic(), Run(keep, problem, progress)
    try:
        with run.active(seconds):
            reachable, guesses = with_reachable_distance(problem)
            if search == FULL and problem.gait.free:
                solution = certify_answer(reachable, solve_directly(reachable))
            else:
                solution = _solve(reachable, starts, check, guesses)
            least_distance = problem.least_distance
            least = {aim.name: least for aim, least in reachable.at_least}.get("distance")
            if least_distance is not None and least is not None and least < least_distance:
                solution.message = (
                    f"The farthest gait known at first goes {2 * least:.3g} body lengths per "
                    f"cycle, less than the {least_distance:g} required, so half of that was "
                    f"required: {least:.3g}. "
                    f"{solution.message}"
                ).strip()
    except KeyboardInterrupt:
        clear_interrupt()
        over = time.monotonic() - begin >= seconds
        why = f"the {seconds:g} s allowed have passed" if over else "interrupted"
        solution = _best_so_far(problem, run, why)
    solution.seconds = time.monotonic() - begin
    for each in (solution, solution.shrunk):
        if each is not None:
            each.settings = settings()
    return solution


def _solve(
    problem: Problem,
    starts: int | None,
    check: Callable[[Iterate], object],
    guesses: Sequence[AnyGait],
) -> Solution:
    explored, failure = None, ""
    if starts != 1 and problem.gait.free:
        try:
            explored = explore(problem, starts, guesses)
        except NotConvergedError as error:
            failure = str(error)  # what fails with the guess alone is said in detail
    explored = explored or Exploration([first_optimum(problem, problem.guess)], 1)
    check(explored.optima[0])
    first = descend(explored.optima[0])
    check(first)
    solutions = _finish_best(problem, (first, *explored.optima[1:]))
    if explored.left and not any(map(passes, solutions)):
        solutions += _finish_best(problem, follow_rest(problem, explored))
    solution = choose(problem, solutions)
    solution.starts, solution.others = explored.starts, tuple(explored.others)
    if failure and not solution.success:
        why = failure[:1].upper() + failure[1:]
        solution.message = f"{solution.message} {why}".strip()
    return solution


def _finish_best(problem: Problem, optima: Sequence[Iterate]) -> list[Solution]:
    """Solutions of the best optima: of finite size first, then better ones that shrank; together
    where the problem asks for any size. Best first, as long as none passes, or it lost more on its
    refined mesh than the next one is behind."""
    solutions: list[Solution] = []
    for shrank in (None,) if problem.shrinking else (False, True):
        best, least = -np.inf, -np.inf
        if shrank:
            least = max((each.answer.value for each in solutions if passes(each)), default=-np.inf)
        kind = [
            each
            for each in optima
            if shrank is None or (is_visible(each.gait) is not shrank and each.value > least)
        ]
        kind.sort(key=attrgetter("strays"))
        for optimum in kind[: OPTIONS.attempts]:
            if optimum.value - OPTIONS.close * abs(optimum.value) < best:
                break
            solutions.append(solution := finish(problem, optimum))
            active_run().solutions.append(solution)
            if passes(solution) and (shrank is not False or is_visible(solution.answer.gait)):
                best = max(best, solution.answer.value)
    return solutions


def finish(problem: Problem, optimum: Iterate) -> Solution:
    """An optimum refined, confirmed and certified, at a smaller delta where friction is viscous at
    its speeds: small gaits and sticking feet need one."""
    solution = certify_answer(problem, confirm_optimum(optimum))
    for _ in range(OPTIONS.attempts - 1):
        failures = [check.name for check in solution.certificate.failures]
        # a prescribed motion is measured at the delta that is asked for
        if "delta influence" not in failures or not problem.gait.free:
            break
        old, last = optimum.space, optimum.problem
        drier = last.with_(delta=OPTIONS.delta_ratio * last.delta)
        optimum = replace(optimum, space=space_of(drier, old.edges, old.scheme, old.far))
        with suppress(NotConvergedError):  # there the body may have no such motion
            solution = certify_answer(problem, confirm_optimum(optimum))
    return solution


def confirm_optimum(optimum: Iterate) -> Answer:
    """An optimum through refine and confirm; where it turns out to be a saddle, the one below."""
    below = descend(optimum)
    for left in range(OPTIONS.attempts, -1, -1):
        optimum = refine(below)
        active_run().report("confirm", 0, 1, optimum)
        answer = confirm(optimum)
        second = answer.second_order
        if not left or not second.smallest + second.error < -TOLERANCES.saddle:
            break
        if (lower := leave_saddle(optimum)) is None:
            break
        below = lower
    return answer


def certify_answer(problem: Problem, answer: Answer) -> Solution:
    """A solution with its certificate and message; without a certificate where the gait goes
    nowhere, or cannot be replayed."""
    is_free, text, solution = problem.gait.free, answer.message, Solution(problem, answer)
    if is_free and is_trivial(answer):
        solution.message = (
            f"no gait was found that climbs a grade of {problem.grade:g}, or goes the way asked "
            f"for. Try a gentler slope, more starts, or more harmonics."
            if problem.regime.slides
            else "the search ended in a trivial gait that goes nowhere (every retraced gait is a "
            "critical point). Try another guess, or an imposed symmetry."
        )
        return solution
    active_run().report("certify", 0, 1)
    try:
        solution.certificate = _certificate(answer)
    except NotConvergedError as error:
        solution.message = f"the replay failed: {error}"
        return solution
    if text and not answer.optimal:
        solution.message = text  # why the search ended says more than what does not hold for that
        return solution
    if failed := solution.certificate.failures:
        stopped = any(check.name == "mesh error" for check in failed)  # no mesh was fine enough
        finer = f"{'more starts or a larger' if stopped else 'a smaller'} mesh_tolerance"
        advice = " and ".join(dict.fromkeys(_ADVICE.get(c.name, finer) for c in failed))
        text = (
            f"the certificate failed: {solution.certificate.missed}. Try {advice}. {text}".strip()
        )
    elif is_free and on_speed_floor(problem, answer.gait):
        better = "more efficient" if problem.objective == EFFICIENCY else "better"
        text = (
            f"this gait is as small as smallest_shape_speed = {problem.smallest_shape_speed:g} "
            f"allows; smaller ones are {better} still. For a gait that a robot can perform raise "
            "the bound; for smaller ones lower it (and delta with it)."
        )
    elif is_free and on_speed_floor(answer.problem, answer.gait):
        text = (
            "Gaits improve here as they shrink, so the search kept them large: it found "
            "no better gait with a shape speed of "
            f"{answer.problem.smallest_shape_speed:.2g} or more. For another size set "
            'smallest_shape_speed, or at_least={"distance": 0.1}.'
        )
    if answer.delta < problem.delta * (1 - 1e-9):
        text += (
            f" The gait is so slow or small that delta had to be lowered from "
            f"{problem.delta:.1g} to {answer.delta:.1g}."
        )
    solution.message = text.strip()
    return solution


@checkpoint
def _certificate(answer: Answer) -> Certificate:
    if answer.optimal:
        return certify(answer)
    # an exact replay may take minutes, for what is no optimum
    instants = answer.problem.body.defaults.instants
    return certify(answer, tolerance=TOLERANCES.replay_gap, instants=instants)


def passes(solution: Solution) -> bool:
    """True if the first-order conditions and every check of the certificate hold."""
    return solution.answer.optimal and solution.certificate.passed


def choose(problem: Problem, solutions: Sequence[Solution]) -> Solution:
    """The best solution of finite size whose certificate passes (of any size, if the problem asks
    for that, or there is no other), else the first one.

    With dry friction small cycles may go farthest for their work, but nobody can build those: a
    better one that nobody sees move is returned beside it, as `shrunk`.
    """
    value = attrgetter("answer.value")
    passing = [each for each in solutions if passes(each)]
    finite = [each for each in passing if problem.shrinking or is_visible(each.answer.gait)]
    solution = replace(max(finite or passing, key=value, default=solutions[0]))
    better = [each for each in solutions if value(each) > value(solution)]
    now = solution.certificate
    # what the replay did not measure, or found to be better by more than the errors
    failing = [
        each
        for each in better
        if not passes(each)
        and not each.certificate.value - each.certificate.value_error <= now.value + now.value_error
    ]
    if passes(solution) and failing:
        text = f"A gait of {value(failing[0]):.6f} is not verified: {failing[0].message}"
        solution.message = f"{solution.message} {text}".strip()
    smaller = [each for each in better if passes(each) and not is_visible(each.answer.gait)]
    if finite and smaller and not problem.shrinking:
        solution.shrunk = max(smaller, key=value)
        text = (
            f"A tiny gait is better still, {solution.shrunk.certificate.value:.6f}, but of no "
            f"practical use: it is saved beside this one."
        )
        solution.message = f"{solution.message} {text}".strip()
    return solution


def _best_so_far(problem: Problem, run: Run, why: str) -> Solution:
    if any(map(passes, run.solutions)):
        solution = choose(problem, run.solutions)
    elif run.solutions:
        solution = Solution(problem, run.solutions[0].answer)
    else:
        best = run.best or evaluate_at(*space_near(problem, problem.guess), problem.delta_start)
        solution = Solution(problem, answer_of_iterate(best))
    solution.interrupted = True
    solution.message = f"{why}; this is the best gait so far. {solution.message}".strip()
    return solution
