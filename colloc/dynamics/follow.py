"""Integration of a differential equation through a period, by adaptive multistep methods: an
independent check of collocated motions. Rates may jump at given phases."""

from __future__ import annotations

import threading
import warnings
from collections.abc import Callable
from contextlib import suppress
from itertools import pairwise
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from colloc.system.errors import NotConvergedError

if TYPE_CHECKING:
    from scipy.integrate import OdeSolution

STEP = 1 / 100
"""Local error over that of a run. Stick and slip make kinks, which methods of long steps skip
(Runge and Kutta's left 1e-5 at 1e-7 a step); Adams' errs by 8 to 40 times a step."""
_METHODS = ("LSODA", 50_000), ("Radau", np.inf)
"""Methods and their largest number of evaluations; the second for friction that is stiff beside
little inertia."""
ONE_SIDED = 1e-12
"""Distance in phase from a jump at which rates are evaluated."""
_ONE_AT_A_TIME = threading.RLock()
"""Old LSODA is not reentrant, and warning filters are shared by all threads."""


class _TooOften(Exception): ...


class Course(NamedTuple):
    phases: np.ndarray
    """Steps of the solver, ``(n,)``."""
    states: np.ndarray
    at: OdeSolution
    """States at phases, ``(n_state, n_time)``."""


def integrate_period(
    rates: Callable[[float, np.ndarray, Any], tuple[np.ndarray, Any]],
    begin: np.ndarray,
    tolerance: np.ndarray | float,
    breaks: tuple[float, ...] = (),
    longest: float = np.inf,
    jacobian: Callable[[float, np.ndarray], np.ndarray] | None = None,
) -> Course:
    """Follow states from `begin` ``(n_state,)`` at phase 0 to 1, each to about a tolerance, by
    steps no longer than `longest`; `NotConvergedError` if the solver cannot go on.

    rates: of a phase, the states and what it last said to remember (None at first), such as
    velocities from which the next balance may start: their rates, and what to remember. breaks:
    phases in (0, 1), ascending, at which the rates jump. jacobian: derivatives of the rates
    ``(n_state, n_state)`` at a phase; by default from differences, one evaluation a state.
    """
    from scipy.integrate import OdeSolution, solve_ivp

    near: Any = None
    first = last = left = 0.0

    def inside(t: float) -> float:
        return min(max(t, first + ONE_SIDED), last - ONE_SIDED)  # rates may jump at the ends

    def slope(t: float, state: np.ndarray) -> np.ndarray:
        nonlocal near, left
        left -= 1
        if left < 0:
            raise _TooOften
        found, near = rates(inside(t), state, near)
        return found

    exact = jacobian and (lambda t, state: jacobian(inside(t), state))

    phases, states, ends, pieces, state = [], [], [0.0], [], begin
    for first, last in pairwise([0.0, *breaks, 1.0]):
        accuracy = {"rtol": 1e-13, "atol": STEP * tolerance, "max_step": longest, "jac": exact}
        for method, most in _METHODS:
            left = most
            giving_up = warnings.catch_warnings(action="ignore", category=UserWarning)
            with (
                suppress(_TooOften),
                _ONE_AT_A_TIME,
                giving_up,
                np.errstate(over="ignore"),
            ):  # of the steps of Radau's differences
                run = solve_ivp(
                    slope, (first, last), state, method=method, dense_output=True, **accuracy
                )
                if run.success:
                    break
        else:
            raise NotConvergedError(
                f"the motion could not be followed beyond phase {run.t[-1]:.4f}."
            )
        state = run.y[:, -1]
        phases.append(run.t)
        states.append(run.y)
        ends.extend(run.sol.ts[1:])
        pieces.extend(run.sol.interpolants)
    at = OdeSolution(ends, pieces)
    return Course(np.concatenate(phases), np.concatenate(states, axis=1), at)
