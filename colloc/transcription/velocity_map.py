"""The velocity map z = Z(q, r) of a body as a repeated function: tail velocities from the NumPy
solver for a whole mesh at once, derivatives from the balance by the implicit function theorem.

The balance itself is a step function of z as delta goes to 0 and does not converge as a
constraint; the velocity map is mild where the balance is not.
"""

from __future__ import annotations

from functools import lru_cache

import casadi as ca
import numpy as np

from colloc.mechanics.bodies import Body
from colloc.mechanics.law import Law
from colloc.numerics.repeated import LocalFunction
from colloc.numerics.sqp import keep_last

_TOLERANCE, ACCEPTED = 1e-12, 1e3
"""Tolerance, and the factor on it where rounding stops the solver."""


@lru_cache(maxsize=32)
def velocity_map(body: Body, law: Law, *, relative: bool = False) -> LocalFunction:
    """Local functions of (theta, q, r, z): z - Z, velocities of the centre of mass, power at Z."""
    sizes = (("theta", 1), ("q", body.n_joint), ("r", body.n_joint), ("z", 3), ("delta", 1))
    theta, q, r, z, delta = (ca.SX.sym(name, size) for name, size in sizes)
    solved, slow = ca.SX.sym("Z", 3), delta * ca.norm_2(r) if relative else delta
    balanced = body.sliding(law, q, r, solved, slow)
    centre, c, s = body.sliding(law, q, r, z, slow).centre, ca.cos(theta), ca.sin(theta)
    ahead, aside = c * centre[0] - s * centre[1], s * centre[0] + c * centre[1]
    out = ca.vertcat(z - solved, ahead, aside, balanced.power)
    local = ca.vertcat(theta, q, r, z)
    return LocalFunction(local, ca.SX(0, 1), delta, out, solved, balanced.force)


class BalancedVelocity(ca.Callback):
    """(angles, rates, start, delta) to balanced tail velocities ``(3, n_time)``, cached; NaN where
    the balance does not converge."""

    def __init__(self, body: Body, friction: Law, n_time: int) -> None:
        ca.Callback.__init__(self)
        self._body, self._friction = body, friction
        sizes = (body.n_joint, n_time), (body.n_joint, n_time), (3, n_time), (1, 1)
        self._inputs = [ca.Sparsity.dense(*size) for size in sizes]
        self._z, self._start, self.solves = np.full((3, n_time), np.nan), np.empty(0), 0
        self._balanced = keep_last(self._solve)
        self.construct("velocity_map", {"enable_fd": False})

    def of_local(self, local: ca.MX, delta: ca.MX, *, relative: bool) -> ca.MX:
        ends = np.cumsum([1, self._body.n_joint, self._body.n_joint]).tolist()
        _, q, r, start = ca.vertsplit(local, [0, *ends, local.shape[0]])
        if not relative:
            return self(q, r, start, delta)
        speed = ca.sqrt(ca.sum1(r * r))  # Z grows like r and delta
        unit, start = (each / ca.repmat(speed, each.size1(), 1) for each in (r, start))
        return ca.repmat(speed, 3, 1) * self(q, unit, start, delta)

    def get_n_in(self) -> int:
        return len(self._inputs)

    def get_sparsity_in(self, index: int) -> ca.Sparsity:
        return self._inputs[index]

    def get_sparsity_out(self, index: int) -> ca.Sparsity:
        return self._inputs[2]

    def eval(self, arguments: list[ca.DM]) -> list[ca.DM]:
        angles, rates, self._start = (a.full() for a in arguments[:3])
        at = np.concatenate([angles.ravel(), rates.ravel(), [float(arguments[3])]])
        return [
            ca.DM(self._balanced(at) if np.isfinite(at).all() else np.full_like(self._z, np.nan))
        ]

    def _solve(self, at: np.ndarray) -> np.ndarray:
        angles, rates = at[:-1].reshape(2, self._body.n_joint, -1)
        start = self._z if np.isnan(self._start).any() else self._start
        solved = self._body.solve(
            self._friction, angles, rates, at[-1], start=np.nan_to_num(start), tolerance=_TOLERANCE
        )
        self.solves += 1
        self._z = np.where(solved.residual < ACCEPTED * _TOLERANCE, solved.z, np.nan)
        return self._z
