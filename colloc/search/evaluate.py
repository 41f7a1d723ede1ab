"""A gait that is given, not sought: replayed, certified as far as that applies, and a solution like any other."""

from __future__ import annotations

import math
import time
from dataclasses import replace

from colloc.gaits.fitted_gait import FittedGait, Given, fitted_gait
from colloc.gaits.harmonic import Harmonic
from colloc.gaits.problem import Problem
from colloc.results.checks import UNCERTIFIED
from colloc.results.solution import Solution
from colloc.search.certify import GAP, certify, goes_nowhere
from colloc.search.prescribed import evaluated_answer
from colloc.system.errors import NotConvergedError, ProblemError


def evaluate(
    problem: Problem, gait: Given, *, period: float | None = None, harmonics: int | None = None, degrees: bool = False
) -> Solution:
    """What a gait of one's own achieves: joint angles measured or invented, on the body and the ground of a problem.

    The angles are closed and smoothed (`colloc.gaits.fitted_gait.fitted_gait`), replayed and certified; that the gait is an
    optimum is not asked. It may turn the body, if it does.

    Parameters
    ----------
    problem : Problem
        Whose body, friction, limits and objective are meant; its class of gaits is left out.
    gait : any gait, array, path of a CSV file, or callable
        Joint angles: a series, ``(n_joint, n_time)`` at equal steps of a period, an xarray DataArray with a dimension "joint"
        and one of times, a file with a column of times, or a function of phases ``(n_time,)``.
    period, harmonics, degrees
        See `colloc.gaits.fitted_gait.fitted_gait`.

    Returns
    -------
    Solution
        Of a class of as many harmonics as the gait has; its message tells how far the angles were smoothed.

    Raises
    ------
    ProblemError
        If the gait cannot be read, has other joints than the body, or the problem is one on a slope or of a prescribed motion.

    Examples
    --------
    >>> import colloc
    >>> mine = colloc.evaluate(colloc.Problem("mine"), colloc.ellipse(A0=0, A1=1.5, B1=1.0))
    >>> mine.success, round(mine.efficiency, 3)
    (True, 0.123)
    """
    begin = time.monotonic()
    if problem.regime.slides:
        raise ProblemError("on a slope a gait goes where its body points: follow it with colloc.slope_motion.")
    if problem.body.schedule:
        raise ProblemError(f"{problem.name} is a prescribed motion: it has no other gaits.")
    fitted = fitted_gait(gait, problem.body.n_joint, period=period, harmonics=harmonics, degrees=degrees)
    problem.regime.at(fitted.gait)  # refuses one that does not say a pace which the problem leaves open
    solution = _evaluated(problem, fitted)
    solution.seconds = time.monotonic() - begin
    return solution


def _evaluated(problem: Problem, fitted: FittedGait) -> Solution:
    gait_class, length = Harmonic(fitted.gait.n_harmonic), 2 * math.pi * fitted.gait.shape_speed
    if fitted.gait.shape_speed < problem.smallest_shape_speed:
        raise ProblemError(
            f"the gait hardly moves: its shape speed {fitted.gait.shape_speed:.3g} is below smallest_shape_speed "
            f"{problem.smallest_shape_speed:g}, where friction is viscous."
        )
    # of unit-speed classes delta is that at unit shape speed
    delta = problem.delta * (length if problem.gait.unit_speed else 1.0)
    usual = {"guess": None, "delta_start": None, "intervals": None}
    stated = problem.with_(gait=gait_class, rotation=None, delta=delta, **usual)
    answer = evaluated_answer(stated, fitted.gait)
    turned = answer.motion.rotation
    if abs(turned) < GAP * answer.distance:
        if not problem.uses("rotation"):  # which then may be anything
            stated = stated.with_(rotation=0.0)
            answer = replace(answer, problem=stated)
    else:  # how far it goes is then the chord of its arc
        stated = stated.with_(rotation=turned)
        answer = evaluated_answer(stated, fitted.gait)
    if goes_nowhere(answer):
        said = "It goes nowhere for its work, so there is no value to certify: is it one that retraces its path?"
        return Solution(stated, answer, message=f"{fitted.describe()}. {said}")
    certificate, said = UNCERTIFIED, ""
    try:
        certificate = certify(answer)
        failures = ", ".join(
            f"{check.name} {check.value:.1e} (allowed {check.threshold:.0e})" for check in certificate.failures
        )
        said = f" It fails: {failures}." if failures else ""
    except NotConvergedError as error:
        said = f" The replay failed: {error}"
    return Solution(stated, answer, certificate, message=f"{fitted.describe()}.{said}")
