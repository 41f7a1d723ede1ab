"""Friction in units of its own size: what a solver sees is never larger or smaller than it was made for.

Balance and velocities depend on the ratios of the coefficients only; forces and work are proportional to them, efficiency
inversely. So a problem with coefficients of 1e-6 is one with coefficients of 1, and its tolerances are relative to friction.
An objective that is proportional to no power of the coefficients is left as it is.
"""

from __future__ import annotations

import numpy as np

from colloc.gaits.limits import Limit
from colloc.gaits.objective import Objective
from colloc.gaits.problem import Problem
from colloc.mechanics.law import Law


def friction_unit(friction: Law) -> float:
    """The power of ten nearest to the smallest coefficient, which bounds the efficiency: 1 for friction of usual size."""
    return float(10.0 ** np.rint(np.log10(friction.smallest)))


def in_friction_units(problem: Problem) -> tuple[Problem, float]:
    """The problem with its coefficients in units of `friction_unit`, and that unit."""
    unit = friction_unit(problem.law)
    if unit == 1.0 or any(aim.degree is None for aim in problem.aims):
        return problem, 1.0
    least = tuple((aim, in_unit(value, 1 / unit, aim)) for aim, value in problem.at_least)
    limits = {name: _over(getattr(problem, name), unit) for name in ("torque_limit", "power_limit")}
    grade = problem.grade / unit  # the weight's pull is a force, too
    return problem.with_(friction=problem.law.in_units_of(unit), at_least=least, grade=grade, **limits), unit


def _over(limit: Limit | None, unit: float) -> Limit | None:
    if limit is None:
        return None
    return tuple(each / unit for each in limit) if isinstance(limit, tuple) else limit / unit


def in_unit(value: float, unit: float, objective: Objective) -> float:
    """The value of an objective for coefficients `unit` times as large."""
    return value * unit ** (objective.degree or 0.0)
