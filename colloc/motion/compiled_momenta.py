"""How a chain's momenta change (`colloc.mechanics.inertia`), compiled from its symbolic statement: at many instants with exact
derivatives, and at one instant after another.

Apart from those who use it, since it loads CasADi, which nothing slow needs.
"""

from __future__ import annotations

from functools import lru_cache

import casadi as ca
import numpy as np

from colloc.mechanics.chain import Chain
from colloc.mechanics.inertia import STATES, momentum_rates
from colloc.mechanics.law import Law

N_OUT = 9
"""Tail velocity, velocity of the centre of mass, power, rates of the momenta."""


@lru_cache(maxsize=32)
def _function(body: Chain, friction: Law, along: str) -> ca.Function:
    """(angles, rates, momenta, delta, Froude number) to the outputs, and their derivatives along those of the first three that
    are named."""
    sizes = {"angles": body.n_joint, "rates": body.n_joint, "momenta": len(STATES)}
    given = {name: ca.SX.sym(name, size) for name, size in sizes.items()}
    delta, froude = ca.SX.sym("delta"), ca.SX.sym("froude")
    now = momentum_rates(body, friction, *given.values(), delta=delta, froude=froude)
    out = ca.vertcat(now.z, given["momenta"][:2], now.power, now.rates)
    named = ca.vertcat(*(given[name] for name in along.split()))
    slopes = ca.vec(ca.densify(ca.jacobian(out, named).T)) if along else ca.SX(0, 1)
    return ca.Function("momenta", [*given.values(), delta, froude], [out, slopes], {"cse": True})


def momentum_slopes(
    body: Chain,
    friction: Law,
    shapes: tuple[np.ndarray, np.ndarray, float],
    states: np.ndarray,
    froude: float,
    along: str = "momenta",
) -> tuple[np.ndarray, np.ndarray]:
    """Tail velocity, velocity of the centre of mass, power and rates of the momenta, ``(9, n_time)``, and their derivatives.

    Parameters
    ----------
    body, friction
    shapes
        Angles and rates ``(n_joint, n_time)``, and delta.
    states : (3, n_time)
    froude : float
    along : str
        Along which of "angles rates momenta" derivatives are taken, ``(9, n, n_time)``.
    """
    angles, rates, delta = shapes
    out, slopes = (found.full() for found in _function(body, friction, along)(angles, rates, states, delta, froude))
    return out, slopes.reshape(N_OUT, -1, states.shape[1])


class MomentaAt:
    """The outputs at one instant after another, ``(9,)``, a few microseconds each."""

    def __init__(self, body: Chain, friction: Law, delta: float, froude: float) -> None:
        self._given = (
            np.zeros(body.n_joint),
            np.zeros(body.n_joint),
            np.zeros(len(STATES)),
            np.array([delta]),
            np.array([froude]),
        )
        self._out, self._function = np.zeros(N_OUT), _function(body, friction, "")
        self._buffer, self._evaluate = self._function.buffer()
        for k, given in enumerate(self._given):
            self._buffer.set_arg(k, memoryview(given.data))
        self._buffer.set_res(0, memoryview(self._out.data))

    def __call__(self, angles: np.ndarray, rates: np.ndarray, states: np.ndarray) -> np.ndarray:
        """Of angles and rates ``(n_joint,)`` and momenta ``(3,)``."""
        self._given[0][:], self._given[1][:], self._given[2][:] = angles, rates, states
        self._evaluate()
        return self._out.copy()
