"""From a problem to a certified solution: search in the reduced space, answer by the full program, certificate."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from colloc.gaits.objective import EFFICIENCY
from colloc.gaits.problem import Problem
from colloc.gaits.starts import on_speed_floor
from colloc.gaits.symmetry import NONE
from colloc.reduced.actuator_demand import check_actuators_suffice
from colloc.reduced.spaces import space_near
from colloc.results.certificate import certify
from colloc.results.solution import SOLVED, Solution
from colloc.results.steps import Level, SearchStep
from colloc.search.friction_unit import in_friction_units, in_unit, restated
from colloc.search.full_program import answer, level_found
from colloc.search.global_search import STARTS, best_of
from colloc.search.literal_search import literal_optimum
from colloc.search.prescribed import measured
from colloc.search.reduced_search import FACTOR, NOWHERE, Found, descended, kink_or_not, refined, searched
from colloc.search.relaxed_search import RELAXED_STARTS, best_relaxed_gait
from colloc.search.saddles import below_saddle
from colloc.system.errors import NotConvergedError

TRIVIAL_EFFICIENCY = 1e-4
"""Efficiency times the smallest friction coefficient (at most 1) below which a gait goes nowhere."""
TRIVIAL_ROTATION = 1e-3
"""Rotation a period [rad] from which a gait that goes nowhere turns."""
_SADDLES = 3
"""Saddles left one after another."""
_CONTENDERS, _REFINED = 3, 0.01
"""Gaits that are solved for at most, until a certificate holds; what their values may lose on a refined mesh, as a share."""
_FINITE = 2
"""Gaits of finite size that are solved for, until one keeps its size."""
_DRIER, _SMALL = 2, 2.0
"""Times that delta is lowered beyond what was asked, where a gait is so small that friction is viscous: at most so many times
the bound on the shape speed."""
_ROUGHLY = 1e-3
"""Relative error to which a gait is replayed that is no optimum."""
FINER = "a smaller mesh_tolerance"
ADVICE = {
    "joint limits": "another guess or a smaller joint_limit",
    "self-contact": "another guess or a smaller joint_limit",
    "delta influence": "a smaller delta",
    "second order": "another guess or more starts",
}
"""What helps against a check that failed; anything else is a matter of the mesh."""

Report = Callable[[Level], None]


def is_trivial(solution: Solution) -> bool:
    """Whether the search ended in a gait that goes nowhere and does not turn, such as a retraced one: no optimum."""
    if not solution.levels:
        return False
    if solution.problem.slope is not None:
        _, unit = in_friction_units(solution.problem)
        return in_unit(solution.value, 1 / unit, solution.problem.objective) < NOWHERE
    if abs(solution.efficiency) * solution.problem.friction.smallest >= TRIVIAL_EFFICIENCY:
        return False
    theta = solution.last.x[solution.layout.theta[0]]
    return not (solution.problem.gait.symmetry == NONE and abs(theta[-1] - theta[0]) > TRIVIAL_ROTATION)


def optimum(problem: Problem, on_level: Report | None = None, before: Sequence[Level] = ()) -> Solution:
    """A local optimum of a problem, not certified yet; arguments are those of `maximise_efficiency`.

    Its last level is the answer: the gait found, as IPOPT confirms it for the full program, or as it was found.
    """
    begin, levels = time.perf_counter(), list(before)
    if not problem.gait.free:
        level, message = measured(problem)
        if on_level is not None:
            on_level(level)
        return Solution(problem, [level], seconds=time.perf_counter() - begin, message=message)
    scaled, unit = in_friction_units(problem)

    def report(level: Level) -> None:
        levels.append(restated(level, unit, problem.objective))
        if on_level is not None:
            on_level(levels[-1])

    def ended(found: Found) -> None:
        report(level_found(found))

    if before:
        found, lacks = refined(descended(_last_found(scaled, Solution(problem, before)), scaled, ended), ended)
    else:
        found, lacks = searched(scaled, scaled.guess, ended)
    level, fails = answer(kink_or_not(found))
    report(level)
    message = " ".join(part for part in (fails, lacks) if part)
    return Solution(problem, levels, seconds=time.perf_counter() - begin, message=message)


def _last_found(scaled: Problem, done: Solution) -> Found:
    """The gait of the last level, for a search to go on from, of the problem in units of its friction."""
    stated = scaled.with_(body=done.resolved.body)
    space, v = space_near(stated, done.gait, done.last.edges, done.last.scheme)
    return Found.at(space, v, done.last.delta)


def maximise_efficiency(
    problem: Problem, on_level: Report | None = None, before: Sequence[Level] = (), *, literal: bool = False
) -> Solution:
    """Maximise a problem's objective and certify the result; look at ``solution.status`` before believing it.

    Parameters
    ----------
    problem : Problem
    on_level : callable, optional
        Called with every `colloc.results.solution.Level` as it ends.
    before : sequence of Level
        Levels of an interrupted run of the same problem; it goes on from the last one.
    literal : bool
        Whether IPOPT searches on the full program from the guess alone (`colloc.search.literal_search`).

    Returns
    -------
    Solution
        With status "solved", "not converged" or "certificate failed"; nothing is raised for the last two.

    Examples
    --------
    >>> from colloc import Harmonic, Problem, ellipse, maximise_efficiency
    >>> maximise_efficiency(Problem("near", ellipse(A0=0, A1=2.8, B1=1.3), gait=Harmonic(1, "bilateral"))).status
    'solved'
    """
    if problem.gait.mixes and not literal:
        return best_gait(problem, 1, on_level)
    begin = time.perf_counter()
    solution = literal_optimum(problem, on_level) if literal and problem.gait.free else optimum(problem, on_level, before)
    if problem.gait.free and is_trivial(solution):
        nowhere = (
            "the search ended in a trivial gait that goes nowhere (every retraced gait is a critical point). Try another "
            "guess, or an imposed symmetry."
        )
        steep = (
            f"no gait was found that climbs a grade of {problem.grade:g}, or goes the way asked for. Try a gentler slope, more "
            "starts, or more harmonics."
        )
        solution.message = nowhere if problem.slope is None else steep
    else:
        _certified(solution)
        if problem.gait.free and not literal:
            solution = _off_saddles(solution, on_level)
            for _ in range(_DRIER):
                if not _is_small_and_viscous(solution):
                    break
                solution = _at_smaller_delta(solution, problem.delta, on_level)
    solution.seconds = time.perf_counter() - begin
    return solution


def _failed(solution: Solution) -> list[str]:
    """Names of the checks that do not hold."""
    return [] if solution.certificate is None else [check.name for check in solution.certificate.failures]


def _off_saddles(solution: Solution, on_level: Report | None) -> Solution:
    """The solution itself, or, as long as its certificate calls it a saddle, the one below it, certified."""
    problem = solution.problem
    scaled, unit = in_friction_units(problem)
    for _ in range(_SADDLES):
        below = below_saddle(_last_found(scaled, solution)) if "second order" in _failed(solution) else None
        if below is None:
            break
        beside = restated(level_found(below), unit, problem.objective)
        if on_level is not None:
            on_level(beside)
        solution = optimum(problem, on_level, [*solution.levels, beside])
        _certified(solution)
    return solution


def _is_small_and_viscous(solution: Solution) -> bool:
    """Whether nothing fails but the influence of delta, at a gait that shrank to the bound on the shape speed, or nearly."""
    small = solution.gait.shape_speed < _SMALL * solution.problem.smallest_shape_speed
    return small and _failed(solution) == ["delta influence"]


def _at_smaller_delta(solution: Solution, asked: float, on_level: Report | None) -> Solution:
    """The solution gone on with at a smaller delta, certified: what is slow enough for a large gait is not for a small one."""
    delta = FACTOR * solution.problem.delta
    drier = optimum(solution.problem.with_(delta=delta), on_level, solution.levels[:-1])
    _certified(drier)
    drier.message = f"{drier.message} The gait is so small that delta had to be lowered from {asked:.1g} to {delta:.1g}."
    return drier


def best_gait(
    problem: Problem,
    starts: int | None = None,
    on_level: Report | None = None,
    seconds: float = np.inf,
    before: Sequence[Level] = (),
    watch: Callable[[SearchStep | str], object] = lambda step: None,
) -> Solution:
    """Maximise a problem's objective over the whole class, as far as many starts can tell, and certify the result.

    Parameters
    ----------
    problem : Problem
    starts : int, optional
        The guess, known gaits and seeded samples (`colloc.search.global_search`), and small loops. With 1 the guess alone, as
        `maximise_efficiency`. By default 32, of relaxed gaits 8.
    on_level : callable, optional
        Called with every `colloc.results.solution.Level` of the best gait.
    seconds : float
        Wall time after which no other start is begun.
    before : sequence of Level
        Levels of an interrupted run; it goes on from the last one.
    watch : callable
        Called with every `colloc.results.steps.SearchStep` before the first level; of relaxed gaits with what is under
        way, in words.

    Returns
    -------
    Solution
        ``solution.starts`` and ``solution.others`` say what it is the best of; where it shrank to the bound on the shape speed,
        ``solution.finite`` is the best gait that did not, if there is one. A class of relaxed gaits is answered by the best
        finite gait near its optimum, which is ``solution.relaxed``.
    """
    check_actuators_suffice(problem)
    if problem.gait.mixes:
        solution = best_relaxed_gait(problem, starts or RELAXED_STARTS, seconds=seconds, report=watch)
        if on_level is not None:
            on_level(solution.last)
        return solution
    starts = starts or STARTS
    if starts == 1 or before or not problem.gait.free:
        return maximise_efficiency(problem, on_level, before)
    begin = time.perf_counter()
    scaled, unit = in_friction_units(problem)
    try:
        chosen = best_of(scaled, starts, seconds, lambda step: watch(replace(step, efficiency=step.efficiency / unit)))
    except NotConvergedError:  # what fails with the guess alone is said in detail
        return maximise_efficiency(problem, on_level)
    objective = problem.objective
    contenders = [[restated(level_found(found), unit, objective) for found in levels] for levels in chosen.contenders]
    solution = _best_certified(problem, contenders, on_level, lambda: time.perf_counter() - begin < seconds)
    solution.starts = chosen.starts
    solution.others = tuple(replace(other, value=in_unit(other.value, unit, objective)) for other in chosen.others)
    if chosen.finite and on_speed_floor(problem, solution.gait):
        _add_finite(solution, [[restated(level_found(found), unit, objective) for found in levels] for levels in chosen.finite])
    solution.seconds = time.perf_counter() - begin
    return solution


def _best_certified(
    problem: Problem, contenders: list[list[Level]], on_level: Report | None, goes_on: Callable[[], bool]
) -> Solution:
    """The best solution that levels lead to, best first; the next ones are solved for where a certificate does not hold, or
    where a gait lost more on its refined mesh than they are behind."""
    tried: list[Solution] = []
    for levels in contenders[:_CONTENDERS]:
        best = max((s.value for s in tried if s.status == SOLVED), default=-np.inf)
        promised = levels[-1].value - _REFINED * abs(levels[-1].value)
        if tried and (promised < best or not goes_on()):
            break
        for level in levels:
            if on_level is not None:
                on_level(level)
        tried.append(maximise_efficiency(problem, on_level, levels))
    solved = [s for s in tried if s.status == SOLVED]
    if not solved or tried[0].status == SOLVED:
        return max(solved, key=lambda s: s.value, default=tried[0])
    solution = max(solved, key=lambda s: s.value)
    solution.message = f"{solution.message} A gait of {tried[0].value:.4f} is not certified: {tried[0].message}".strip()
    return solution


def _add_finite(solution: Solution, contenders: list[list[Level]]) -> None:
    """Solve for the gait of finite size that levels lead to, best first, and put it beside the solution; where it shrinks after
    all, for the next one."""
    for levels in contenders[:_FINITE]:
        finite = maximise_efficiency(solution.problem, None, levels)
        if on_speed_floor(finite.problem, finite.gait):
            continue
        if finite.status != SOLVED:
            solution.message = f"{solution.message} The best gait of finite size, not certified: {finite.value:.4f}."
            return
        found = finite.certificate
        finite.starts, finite.others = solution.starts, tuple(o for o in solution.others if not o.on_speed_floor)
        solution.finite = finite
        text = f"The best gait of finite size: {found.value:.6f} +- {found.value_error:.0e}, certified."
        solution.message = f"{solution.message} {text}"
        return


def _certified(solution: Solution) -> None:
    """Put the certificate into a solution, and what it says into its message."""
    problem = solution.problem
    try:
        if solution.last.optimal:
            solution.certificate = certify(solution)
        else:  # it cannot pass: what it does is told roughly, for exactly may take minutes
            solution.certificate = certify(solution, tolerance=_ROUGHLY, instants=problem.body.usual.instants)
    except NotConvergedError as error:
        solution.message = f"the replay failed: {error}"
        return
    if solution.message and not solution.last.optimal:
        return  # why the search ended says more than what does not hold for that
    failed = solution.certificate.failures
    if failed:
        failures = ", ".join(f"{c.name} {c.value:.1e} (allowed {c.threshold:.0e})" for c in failed)
        advice = " and ".join(dict.fromkeys(ADVICE.get(c.name, FINER) for c in failed))
        parts = [f"the certificate failed: {failures}. Try {advice}.", solution.message]
        solution.message = " ".join(p for p in parts if p)
    elif problem.gait.free and on_speed_floor(problem, solution.gait):
        better = "more efficient" if problem.objective == EFFICIENCY else "better"
        solution.message = (
            f"the optimum lies on the bound smallest_shape_speed = {problem.smallest_shape_speed:g}: the gait shrinks as far "
            f"as it may, smaller ones are {better} still. Lower the bound (and delta with it) to see how far that goes."
        )
