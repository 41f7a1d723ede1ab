"""Rates of a chain's momenta (`colloc.mechanics.inertia`) with derivatives, by the compiled kernel
or, without one, by CasADi."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np

from colloc.mechanics.balance import Moving
from colloc.mechanics.chain import Chain
from colloc.mechanics.inertia import STATES, momentum_rates
from colloc.mechanics.law import Law
from colloc.mechanics.native_kernel import kernel_momenta, native_kernel

N_OUT = 9
"""Tail velocity, velocity of the centre of mass, power, rates of the momenta."""


@lru_cache(maxsize=32)
def _function(body: Chain, friction: Law, *, differentiated: bool) -> Any:
    """(angles, rates, momenta, delta, Froude number) to outputs and derivatives along the first
    three."""
    import casadi as ca  # which nothing slow needs, nor a search

    sizes = {"angles": body.n_joint, "rates": body.n_joint, "momenta": len(STATES)}
    given = {name: ca.SX.sym(name, size) for name, size in sizes.items()}
    delta, froude = ca.SX.sym("delta"), ca.SX.sym("froude")
    now = momentum_rates(body, friction, *given.values(), delta=delta, froude=froude)
    out = ca.vertcat(now.z, given["momenta"][:2], now.power, now.rates)
    slopes = (
        ca.vec(ca.densify(ca.jacobian(out, ca.vertcat(*given.values())).T))
        if differentiated
        else ca.SX(0, 1)
    )
    return ca.Function("momenta", [*given.values(), delta, froude], [out, slopes], {"cse": True})


def momenta_at(
    body: Chain,
    friction: Law,
    shapes: tuple[np.ndarray, np.ndarray, float],
    states: np.ndarray,
    froude: float,
) -> tuple[np.ndarray, np.ndarray]:
    """Outputs ``(9, n_time)`` and derivatives ``(9, 2 n_joint + 3, n_time)`` along angles, rates,
    momenta; `shapes` are angles, rates ``(n_joint, n_time)`` and delta."""
    return _momenta(body, friction, shapes, states, froude, 2 * body.n_joint + len(STATES))


def momenta_along_states(
    body: Chain,
    friction: Law,
    shapes: tuple[np.ndarray, np.ndarray, float],
    states: np.ndarray,
    froude: float,
) -> tuple[np.ndarray, np.ndarray]:
    """Outputs, and derivatives along the momenta alone, ``(9, 3, n_time)``."""
    return _momenta(body, friction, shapes, states, froude, len(STATES))


def _momenta(
    body: Chain,
    friction: Law,
    shapes: tuple[np.ndarray, np.ndarray, float],
    states: np.ndarray,
    froude: float,
    columns: int,
) -> tuple[np.ndarray, np.ndarray]:
    library, (angles, rates, delta) = native_kernel(body, friction), shapes
    if library is not None:
        return kernel_momenta(
            library,
            Moving(body, friction, angles, rates, delta, None),
            states,
            froude,
            columns=columns,
        )
    out, slopes = _function(body, friction, differentiated=True)(
        angles, rates, states, delta, froude
    )
    return np.asarray(out.full()), np.asarray(slopes.full()).reshape(N_OUT, -1, states.shape[1])[
        :, -columns:
    ]


class MomentaAt:
    """Outputs ``(n, 9)`` for n momenta at one time, in a few microseconds."""

    def __init__(self, body: Chain, friction: Law, delta: float, froude: float, n: int = 1) -> None:
        shapes = np.zeros((2, body.n_joint))
        momenta = np.zeros((n, len(STATES)))
        numbers = np.array([[delta], [froude]])
        self._given, self._out = (*shapes, momenta, *numbers), np.zeros((n, N_OUT))
        one = _function(body, friction, differentiated=False)
        self._function = one.map("momenta", "serial", n, [0, 1, 3, 4], list[int]())
        self._buffer, self._evaluate = self._function.buffer()
        for k, given in enumerate(self._given):
            self._buffer.set_arg(k, memoryview(given.reshape(-1).data))
        self._buffer.set_res(0, memoryview(self._out.reshape(-1).data))

    def __call__(self, angles: np.ndarray, rates: np.ndarray, states: np.ndarray) -> np.ndarray:
        self._given[0][:], self._given[1][:], self._given[2][:] = angles, rates, states
        self._evaluate()
        return self._out.copy()
