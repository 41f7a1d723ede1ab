"""From a problem to a certified solution: continuation, then the certificate."""

from __future__ import annotations

import time
from collections.abc import Sequence

from colloc.gaits.problem import Problem
from colloc.gaits.sampling import on_speed_floor
from colloc.results.certificate import certify
from colloc.results.level import Level
from colloc.results.solution import Solution
from colloc.search.continuation import continue_delta
from colloc.search.level_run import TRIVIAL, Report
from colloc.system.errors import NotConvergedError

FINER = "more intervals or a smaller mesh_tolerance"
ADVICE = {
    "joint limits": "another guess or a smaller joint_limit",
    "self-contact": "another guess or a smaller joint_limit",
    "delta influence": "a smaller delta",
    "delta step": "a smaller delta",
}
"""What helps against a check that failed; anything else is a matter of the mesh."""


def is_trivial(solution: Solution) -> bool:
    """Whether the search ended in a gait that goes nowhere, such as a retraced one: a critical point, but no optimum."""
    return solution.last.status == TRIVIAL


def maximise_efficiency(problem: Problem, on_level: Report | None = None, before: Sequence[Level] = ()) -> Solution:
    """Maximise d/W and certify the result; look at ``solution.status`` before believing it.

    Parameters
    ----------
    problem : Problem
    on_level : callable, optional
        Called with every `colloc.results.solution.Level` as it ends.
    before : sequence of Level
        Levels of an interrupted run of the same problem; it goes on from the last optimal one.

    Returns
    -------
    Solution
        With status "solved", "not converged" or "certificate failed"; nothing is raised for the last two.
    """
    begin = time.perf_counter()
    solution = continue_delta(problem, on_level, before=before)
    if is_trivial(solution):
        solution.message = (
            "the search ended in a trivial gait that goes nowhere (every retraced gait is a critical point of the "
            "efficiency). Try another guess, or an imposed symmetry."
        )
    elif solution.levels[-1].optimal:
        try:
            solution.certificate = certify(solution)
        except NotConvergedError as error:
            solution.message = f"the replay failed: {error}"
        else:
            failed = solution.certificate.failures
            if failed:
                failures = ", ".join(f"{c.name} {c.value:.1e} (allowed {c.threshold:.0e})" for c in failed)
                advice = " and ".join(dict.fromkeys(ADVICE.get(c.name, FINER) for c in failed))
                solution.message = f"the certificate failed: {failures}. Try {advice}."
            elif on_speed_floor(problem, solution.gait):
                solution.message = (
                    f"the optimum lies on the bound smallest_shape_speed = {problem.smallest_shape_speed:g}: smaller gaits are "
                    "more efficient still. Lower the bound (and delta with it) to see how far that goes."
                )
    solution.seconds = time.perf_counter() - begin
    return solution
