"""Efficiency, upper bound and gap of a gait, in one line for reports."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import TYPE_CHECKING

from colloc.bounds.motions import Domain
from colloc.gaits.objective import EFFICIENCY
from colloc.gaits.problem import Problem
from colloc.gaits.robot import widest
from colloc.mechanics.chain import Chain
from colloc.mechanics.friction import Friction
from colloc.mechanics.law import rate_independent
from colloc.system.errors import ProblemError, ReadOnlyRunWarning, StoreError

if TYPE_CHECKING:
    from colloc.bounds.sampled import Bound


def _has_bound(problem: Problem) -> bool:
    # work that depends on the pace has no bound per distance, nor has a body that coasts
    dry = problem.regime.slow_on_level and rate_independent(problem.law)
    return dry and problem.objective == EFFICIENCY and problem.rotation == 0


def refusal(problem: Problem) -> str:
    """Why no upper bound can be computed for the gaits of a problem; "" if one can."""
    if not isinstance(problem.body, Chain) or not isinstance(problem.friction, Friction):
        return (
            "upper bounds are computed for chains of links under Coulomb friction, or the elliptic "
            "law, only; for this one there is 1/min(mu)."
        )
    if not _has_bound(problem):
        return "upper bounds are of the efficiency, on the level, of gaits that do not turn."
    try:
        _domain(problem)
    except ProblemError as error:
        return str(error)
    return ""


def _domain(problem: Problem) -> Domain:
    return Domain(problem.body, problem.friction, widest(problem.joint_limit))  # type: ignore[arg-type]


def upper_bound(problem: Problem, folder: Path, *, compute: bool) -> Bound | None:
    """The bound for a problem's body, friction and joint limit: from the cache beside the results,
    or computed.

    None where there can be none (`refusal`), unless it is asked for: a `ProblemError`. A cache that
    cannot be read or written costs a `ReadOnlyRunWarning`.
    """
    why, cache = refusal(problem), folder / "bounds.sqlite"
    if why and compute:
        raise ProblemError(why)
    if why or not (compute or cache.exists()):
        return None
    from colloc.bounds.sampled import efficiency_bound, known_bound, usual_budget

    domain = _domain(problem)
    at = domain.body, domain.friction, domain.joint_limit
    try:
        if compute:
            return efficiency_bound(*at, cache=cache)
        return known_bound(domain, usual_budget(domain), cache)
    except StoreError as error:
        warnings.warn(f"{error} No bound is taken from it.", ReadOnlyRunWarning, stacklevel=2)
        return efficiency_bound(*at) if compute else None


def gap_line(
    problem: Problem, efficiency: float, bound: Bound | None, *, asked: bool = False
) -> str:
    """Efficiency, upper bound and gap; without a bound 1/min(mu), with the hint to ask for one."""
    if bound is not None:
        return f"  {bound.report(efficiency)}"
    if not _has_bound(problem):
        return f"  no upper bound on {problem.objective.name!r} is known"
    limit = 1.0 / problem.law.smallest
    tighter = "" if asked or refusal(problem) else "; --bound computes a tighter one"
    return f"  upper bound {limit:.4g} (= 1/min mu), gap {limit - efficiency:.4f}{tighter}"
