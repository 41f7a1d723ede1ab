"""The answer among certified solutions, and its message.

With dry friction small cycles may go farthest for their work, but nobody can build those. So the
best gait of finite size, one that a person sees move, is the answer unless the problem asks
otherwise; a better one that shrank is returned beside it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from colloc.gaits.objective import EFFICIENCY
from colloc.gaits.problem import Problem
from colloc.gaits.starts import is_visible, on_speed_floor
from colloc.results.answer import Answer
from colloc.results.checks import UNCERTIFIED, Certificate
from colloc.results.solution import Solution
from colloc.search.certify import is_trivial

ADVICE = {
    "joint limits": "another guess or a smaller joint_limit",
    "self-contact": "another guess or a smaller joint_limit",
    "delta influence": "a smaller delta",
    "second order": "another guess or more starts",
}
FINER = "a smaller mesh_tolerance"


def passes(solution: Solution) -> bool:
    """True if the first-order conditions and every check of the certificate hold."""
    return solution.answer.optimal and solution.certificate.passed


def is_visible_solution(solution: Solution) -> bool:
    return is_visible(solution.answer.gait)


def choose(problem: Problem, solutions: Sequence[Solution]) -> Solution:
    """The best solution of finite size whose certificate passes (of any size, if the problem asks
    for that, or there is no other), else the first one; `shrunk` is a better one that nobody sees
    move."""
    passing = [each for each in solutions if passes(each)]
    finite = [each for each in passing if problem.shrinking or is_visible_solution(each)]
    solution = replace(max(finite or passing, key=_value, default=solutions[0]))
    better = [each for each in solutions if _value(each) > _value(solution)]
    failing = [each for each in better if not passes(each)]
    if passes(solution) and failing:
        text = f"A gait of {_value(failing[0]):.4f} is not certified: {failing[0].message}"
        solution.message = f"{solution.message} {text}".strip()
    smaller = [each for each in better if passes(each) and not is_visible_solution(each)]
    if finite and smaller and not problem.shrinking:
        solution.shrunk = max(smaller, key=_value)
        text = (
            f"Smaller gaits do better still: {solution.shrunk.certificate.value:.6f} where one "
            f"shrank until nobody sees it move, kept beside this one."
        )
        solution.message = f"{solution.message} {text}".strip()
    return solution


def _value(solution: Solution) -> float:
    return solution.answer.value


def solution_of(
    problem: Problem, answer: Answer, certificate: Certificate = UNCERTIFIED, failure: str = ""
) -> Solution:
    """A solution of one answer with its message; `failure` is why there was no replay."""
    message = _message(problem, answer, certificate, failure)
    return Solution(problem, answer, certificate, message=message)


def _message(problem: Problem, answer: Answer, certificate: Certificate, failure: str) -> str:
    is_free = problem.gait.free
    if is_free and is_trivial(answer):
        if not problem.regime.slides:
            return (
                "the search ended in a trivial gait that goes nowhere (every retraced gait is a "
                "critical point). Try another guess, or an imposed symmetry."
            )
        return (
            f"no gait was found that climbs a grade of {problem.grade:g}, or goes the way asked "
            f"for. Try a gentler slope, more starts, or more harmonics."
        )
    if failure:
        return f"the replay failed: {failure}"
    if answer.message and not answer.optimal:
        return answer.message  # why the search ended says more than what does not hold for that
    text = answer.message
    if failed := certificate.failures:
        failures = ", ".join(f"{c.name} {c.value:.1e} (allowed {c.threshold:.0e})" for c in failed)
        advice = " and ".join(dict.fromkeys(ADVICE.get(c.name, FINER) for c in failed))
        text = f"the certificate failed: {failures}. Try {advice}. {text}"
    elif is_free and on_speed_floor(problem, answer.gait):
        better = "more efficient" if problem.objective == EFFICIENCY else "better"
        text = (
            f"the optimum lies on the bound smallest_shape_speed = "
            f"{problem.smallest_shape_speed:g}: the gait shrinks as far as it may, smaller ones "
            f"are {better} still. For a gait that a robot can make raise the bound; to see how far "
            "smaller ones go, lower it (and delta with it)."
        )
    elif is_free and on_speed_floor(answer.problem, answer.gait):
        text = (
            "Gaits that become smaller become better here, so the search kept them large: it met "
            "no better gait with a shape speed of "
            f"{answer.problem.smallest_shape_speed:.2g} or more. For another size state "
            f"smallest_shape_speed, or the distance, "
            'at_least={"distance": 0.1}.'
        )
    if answer.delta < problem.delta * (1 - 1e-9):
        text += (
            f" The gait is so slow or small that delta had to be lowered from "
            f"{problem.delta:.1g} to {answer.delta:.1g}."
        )
    return text.strip()
