"""The velocity that balances a smooth body as a CasADi function, from its NumPy solver, for a whole mesh at once."""

from __future__ import annotations

from collections.abc import Callable

import casadi as ca
import numpy as np

from colloc.mechanics.damped_newton import State

_USABLE = 1e-7

Solve = Callable[[np.ndarray, np.ndarray, float, np.ndarray], State]
"""From shape coordinates and rates ``(n_shape, n_time)``, delta and starting velocities ``(3, n_time)`` to a solution."""


class BalancedVelocity(ca.Callback):
    """(q, rates, delta) to balanced velocities ``(3, n_time)``; CasADi does not differentiate it.

    Calls start from the last solution, and the same arguments are not solved twice. An instant that does not converge
    gives NaN, which an optimiser takes as a step too far.
    """

    def __init__(self, solve: Solve, n_shape: int, n_time: int) -> None:
        ca.Callback.__init__(self)
        self._solve, self._n_shape, self._n_time = solve, n_shape, n_time
        self._key: tuple[bytes, bytes, float] | None = None
        self._z = np.zeros((3, n_time))
        self.construct("balanced_velocity", {"enable_fd": False})

    def get_n_in(self) -> int:
        return 3

    def get_n_out(self) -> int:
        return 1

    def get_sparsity_in(self, index: int) -> ca.Sparsity:
        return ca.Sparsity.dense(1, 1) if index == 2 else ca.Sparsity.dense(self._n_shape, self._n_time)

    def get_sparsity_out(self, index: int) -> ca.Sparsity:
        return ca.Sparsity.dense(3, self._n_time)

    def eval(self, arguments: list[ca.DM]) -> list[ca.DM]:
        q, rates, delta = arguments[0].full(), arguments[1].full(), float(arguments[2])
        key = (q.tobytes(), rates.tobytes(), delta)
        if key == self._key:
            return [ca.DM(self._z)]
        if not (np.isfinite(q).all() and np.isfinite(rates).all()):
            return [ca.DM(np.full((3, self._n_time), np.nan))]
        solved = self._solve(q, rates, delta, self._z)
        if (solved.residual > _USABLE).any():
            return [ca.DM(np.where(solved.residual < _USABLE, solved.velocity, np.nan))]
        self._key, self._z = key, solved.velocity
        return [ca.DM(self._z)]
