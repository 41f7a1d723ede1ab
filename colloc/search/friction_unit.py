"""Friction in units of its own size: what a solver sees is never larger or smaller than it was made for.

Balance and velocities depend on the ratios of the coefficients only; forces and work are proportional to them, efficiency
inversely. So a problem with coefficients of 1e-6 is one with coefficients of 1, and its tolerances are relative to friction.
"""

from __future__ import annotations

import dataclasses

import numpy as np

from colloc.gaits.problem import Problem
from colloc.mechanics.law import Law
from colloc.results.level import Level


def friction_unit(friction: Law) -> float:
    """The power of ten nearest to the smallest coefficient, which bounds the efficiency: 1 for friction of usual size."""
    return float(10.0 ** np.rint(np.log10(friction.smallest)))


def in_friction_units(problem: Problem) -> tuple[Problem, float]:
    """The problem with its coefficients in units of `friction_unit`, and that unit."""
    unit = friction_unit(problem.friction)
    if unit == 1.0:
        return problem, 1.0
    return problem.with_(friction=problem.friction.in_units_of(unit)), unit


def restated(level: Level, unit: float) -> Level:
    """A level's efficiency and work for coefficients `unit` times as large; its variables stay in the solver's units."""
    return dataclasses.replace(level, efficiency=level.efficiency / unit, work=level.work * unit)
