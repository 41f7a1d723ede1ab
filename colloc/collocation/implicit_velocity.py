"""The velocity map as a CasADi function: tail velocities from the NumPy solver, for a whole mesh at
once."""

from __future__ import annotations

import casadi as ca
import numpy as np

from colloc.mechanics.bodies import Body
from colloc.mechanics.law import Law

_TOLERANCE, ACCEPTED = 1e-12, 1e3
"""Where rounding stops the solver short of the tolerance, a residual of so many times the tolerance
will do."""


class ImplicitVelocity(ca.Callback):
    """(angles, rates, start, delta) to balanced tail velocities ``(3, n_time)``; not differentiable
    by CasADi.

    The start only saves steps; NaN stands for the velocities last found. The same arguments are not
    solved twice. An instant that does not converge gives NaN, which an optimiser takes as a step
    too far.
    """

    def __init__(self, body: Body, friction: Law, n_time: int) -> None:
        ca.Callback.__init__(self)
        self._body, self._friction, self._n_time = body, friction, n_time
        self._last: tuple[np.ndarray, np.ndarray, float] | None = None
        self._z: np.ndarray | None = None
        self.solves = 0
        self.construct("velocity_map", {"enable_fd": False})

    def get_n_in(self) -> int:
        return 4

    def get_sparsity_in(self, index: int) -> ca.Sparsity:
        return ca.Sparsity.dense(
            *(
                (self._body.n_joint, self._n_time),
                (self._body.n_joint, self._n_time),
                (3, self._n_time),
                (1, 1),
            )[index]
        )

    def get_sparsity_out(self, index: int) -> ca.Sparsity:
        return ca.Sparsity.dense(3, self._n_time)

    def eval(self, arguments: list[ca.DM]) -> list[ca.DM]:
        angles, rates, start, delta = *(a.full() for a in arguments[:3]), float(arguments[3])
        if self._last is not None and self._z is not None:
            same = (
                self._last[2] == delta
                and np.array_equal(self._last[0], angles)
                and np.array_equal(self._last[1], rates)
            )
            if same:
                return [ca.DM(self._z)]
        if not (np.isfinite(angles).all() and np.isfinite(rates).all()):
            return [ca.DM(np.full((3, self._n_time), np.nan))]
        if np.isnan(start).any() and self._z is not None:
            start = self._z
        solved = self._body.solve(
            self._friction, angles, rates, delta, start=np.nan_to_num(start), tolerance=_TOLERANCE
        )
        self.solves += 1
        z = np.where(solved.residual < ACCEPTED * _TOLERANCE, solved.z, np.nan)
        self._last = (angles, rates, delta)
        self._z = z
        return [ca.DM(z)]
