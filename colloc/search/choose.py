"""Which of several certified gaits is the answer, and what is said of it.

A gait may shrink as far as the problem lets it: with dry friction small cycles may go farthest for
their work. Nobody can build those, so the best gait of finite size, one that a person sees move, is
the answer, unless the problem asks otherwise; a better one that shrank stands beside it.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from colloc.gaits.objective import EFFICIENCY
from colloc.gaits.problem import Problem
from colloc.gaits.starts import on_speed_floor
from colloc.results.answer import Answer
from colloc.results.checks import Certificate
from colloc.results.solution import Solution
from colloc.search.certify import Certified, is_trivial

FINER = "a smaller mesh_tolerance"
ADVICE = {
    "joint limits": "another guess or a smaller joint_limit",
    "self-contact": "another guess or a smaller joint_limit",
    "delta influence": "a smaller delta",
    "second order": "another guess or more starts",
}
"""What helps against a check that failed; anything else is a matter of the mesh."""


def choose(problem: Problem, found: Sequence[Certified]) -> Solution:
    """The solution that certified answers make.

    Parameters
    ----------
    problem : Problem
    found : sequence of Certified
        In the order of what the search promised, the best first; at least one.

    Returns
    -------
    Solution
        Its answer is the best gait of finite size whose certificate holds (of any size, if the
        problem asks for that, or there is no other); `shrunk` is a better one that nobody sees
        move.
    """
    held = [each for each in found if each.holds]
    finite = [each for each in held if each.is_finite or problem.shrinking]
    best = max(finite or held, key=lambda each: each.answer.value, default=found[0])
    solution = solution_of(problem, best)
    lost = [each for each in found if not each.holds and each.answer.value > best.answer.value]
    if best.holds and lost:
        told = solution_of(problem, lost[0])
        solution.message = (
            f"{solution.message} A gait of {told.answer.value:.4f} is not certified: {told.message}"
        ).strip()
    smaller = [
        each for each in held if not each.is_finite and each.answer.value > best.answer.value
    ]
    if finite and smaller and not problem.shrinking:
        solution.shrunk = solution_of(problem, max(smaller, key=lambda each: each.answer.value))
        value = solution.shrunk.certificate.value
        text = (
            f"Smaller gaits do better still: {value:.6f} where one shrank until nobody sees it "
            f"move, kept beside this one."
        )
        solution.message = f"{solution.message} {text}".strip()
    return solution


def solution_of(problem: Problem, found: Certified) -> Solution:
    """A solution of one answer, and what is said of it."""
    answer, certificate, failure = found
    return Solution(
        problem, answer, certificate, message=_message(problem, answer, certificate, failure)
    )


def _message(problem: Problem, answer: Answer, certificate: Certificate, failure: str) -> str:
    if problem.gait.free and is_trivial(answer):
        if not problem.regime.slides:
            return (
                "the search ended in a trivial gait that goes nowhere (every retraced gait is a "
                "critical point). Try another "
                "guess, or an imposed symmetry."
            )
        return (
            f"no gait was found that climbs a grade of {problem.grade:g}, or goes the way asked "
            f"for. Try a gentler slope, more "
            "starts, or more harmonics."
        )
    if failure:
        return f"the replay failed: {failure}"
    if answer.message and not answer.optimal:
        return answer.message  # why the search ended says more than what does not hold for that
    lowered = ""
    if answer.delta < problem.delta * (1 - 1e-9):
        lowered = (
            f"The gait is so slow or small that delta had to be lowered from "
            f"{problem.delta:.1g} to {answer.delta:.1g}."
        )
    text = answer.message
    failed = certificate.failures
    if failed:
        failures = ", ".join(f"{c.name} {c.value:.1e} (allowed {c.threshold:.0e})" for c in failed)
        advice = " and ".join(dict.fromkeys(ADVICE.get(c.name, FINER) for c in failed))
        text = f"the certificate failed: {failures}. Try {advice}. {text}"
    elif problem.gait.free and on_speed_floor(problem, answer.gait):
        better = "more efficient" if problem.objective == EFFICIENCY else "better"
        text = (
            f"the optimum lies on the bound smallest_shape_speed = "
            f"{problem.smallest_shape_speed:g}: the gait shrinks as far "
            f"as it may, smaller ones are {better} still. For a gait that a robot can make raise "
            f"the bound; to see how far "
            "smaller ones go, lower it (and delta with it)."
        )
    elif problem.gait.free and on_speed_floor(answer.problem, answer.gait):
        text = (
            "Gaits that become smaller become better here, so the search kept them large: it met "
            "no better gait with a shape "
            f"speed of {answer.problem.smallest_shape_speed:.2g} or more. For another size state "
            f"smallest_shape_speed, or the "
            'distance, at_least={"distance": 0.1}.'
        )
    return f"{text} {lowered}".strip()


def promised(each: Certified) -> float:
    """The value of a certified answer, minus infinity of another one."""
    return each.answer.value if each.holds else -np.inf
