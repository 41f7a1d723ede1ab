"""The objective for delta -> 0 with an error bar, and whether the mesh resolves delta."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from colloc.results.level import Level
from colloc.results.solution import Solution
from colloc.verification.mesh_error import mesh_error

RESOLVED = 1e-4
"""Largest relative error of the objective, of the mesh, at which delta counts as resolved: the certificate's replay gap."""


@dataclass(frozen=True)
class Limit:
    """An extrapolated value and its estimated error."""

    value: float
    error: float


_DECADE = 0.1
_SLOWEST = 0.9


def extrapolated_limit(values: Sequence[float], errors: Sequence[float]) -> Limit:
    """Limit for delta -> 0 of one gait's value, from its values at delta, delta/10 and delta/100.

    Regularisation acts like c delta at leading order, so a ninth of the last change remains; sticking links act like
    delta log delta, and gaits of the size of delta like delta squared, with any signs. So the error is that ninth again; or
    more where the two changes fall off more slowly; and no less than what is left of a linear part of the first change that
    other parts hide in the second.

    Parameters
    ----------
    values, errors : (3,)
        Values of the objective and their own errors.
    """
    first, second = values[1] - values[0], values[2] - values[1]
    linear = _DECADE / (1 - _DECADE)
    falloff = min(abs(second) / max(abs(first), 1e-300), _SLOWEST)
    left = max(max(linear, falloff / (1 - falloff)) * abs(second), linear * _DECADE * abs(first))
    own = (1 + linear) * errors[2] + linear * errors[1]
    return Limit(float(values[2] + linear * second), float(left + own))


def value_at_zero_delta(solution: Solution) -> Limit:
    """Objective of the optimum for delta -> 0, from the levels of the continuation.

    Regularisation acts like c delta at leading order: c is the slope between the two smallest deltas, both on the mesh the
    continuation ran on, and the result is moved by it from the last level, which may have a finer mesh. The error bar adds
    the mesh error of the last level to the larger of that whole move and what the next-larger pair of levels would change.

    Raises
    ------
    ValueError
        If fewer than two deltas converged.
    """
    first: dict[float, Level] = {}
    for level in solution.levels:
        if level.optimal:
            first.setdefault(level.delta, level)
    deltas = np.array(sorted(first))
    if deltas.size < 2 or not solution.last.optimal:
        raise ValueError("the limit delta -> 0 needs at least two converged levels of delta; start at a larger delta.")
    values = np.array([first[d].value for d in deltas])
    slopes = np.diff(values) / np.diff(deltas)
    move = -slopes[0] * deltas[0]
    error = abs(move)
    if deltas.size > 2:
        error = max(error, abs(slopes[1] - slopes[0]) * deltas[0])
    mesh_error = mesh_errors(solution).sum() * abs(solution.value)
    return Limit(float(solution.value + move), float(error + mesh_error))


def mesh_errors(solution: Solution) -> np.ndarray:
    """Share of every mesh interval in the relative error of the objective of the last level, magnitudes, ``(n_interval,)``."""
    return np.abs(mesh_error(solution.problem, solution.mesh, solution.gait, solution.delta_per_period).value)


def resolution_warning(solution: Solution) -> str | None:
    """One sentence if the last level's mesh does not resolve its delta, None if it does.

    Judged by the error of collocating the gait on its mesh, against a finer quadrature with velocities solved
    anew (see `colloc.verification.mesh_error`): stick phases that fall between the nodes show there.
    """
    mesh, level = solution.mesh, solution.last
    errors = mesh_errors(solution)
    if errors.sum() <= RESOLVED:
        return None
    worst, what = int(np.argmax(errors)), solution.problem.objective.name
    return (
        f"delta = {level.delta:.1e} is under-resolved by {mesh.n} intervals: the mesh changes the {what} by about "
        f"{errors.sum():.0e} (relative), most of it at phase {mesh.edges[worst]:.3f} to {mesh.edges[worst + 1]:.3f}; "
        "use more intervals or a smaller mesh_tolerance."
    )
