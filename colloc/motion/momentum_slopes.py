"""How a chain's momenta change, with derivatives along everything that they depend on, from the symbolic statement.

Apart from `colloc.motion.kinds`, since it loads CasADi.
"""

from __future__ import annotations

from functools import lru_cache

import casadi as ca
import numpy as np

from colloc.mechanics.chain import Chain
from colloc.mechanics.inertia import STATES, momentum_rates
from colloc.mechanics.law import Law


@lru_cache(maxsize=32)
def _function(body: Chain, friction: Law, along_shapes: bool) -> ca.Function:
    """(angles, rates, momenta, delta, Froude number) to (tail velocity, velocity of the centre, power, rates of the momenta),
    and their derivatives along the momenta, or along all three."""
    angles, rates, states = (ca.SX.sym(*s) for s in (("q", body.n_joint), ("r", body.n_joint), ("s", len(STATES))))
    delta, froude = ca.SX.sym("delta"), ca.SX.sym("froude")
    now = momentum_rates(body, friction, angles, rates, states, delta=delta, froude=froude)
    out = ca.vertcat(now.z, states[:2], now.power, now.rates)
    along = ca.vertcat(angles, rates, states) if along_shapes else states
    slopes = ca.vec(ca.densify(ca.jacobian(out, along).T))
    return ca.Function("momenta", [angles, rates, states, delta, froude], [out, slopes], {"cse": True})


def momentum_slopes(
    body: Chain,
    friction: Law,
    shapes: tuple[np.ndarray, np.ndarray, float],
    states: np.ndarray,
    froude: float,
    *,
    along_shapes: bool,
) -> tuple[np.ndarray, np.ndarray]:
    """Tail velocity, velocity of the centre of mass, power and rates of the momenta, ``(9, n_time)``, and their derivatives along
    the momenta, ``(9, 3, n_time)``, or along angles, rates and momenta.

    Parameters
    ----------
    body, friction
    shapes
        Angles and rates ``(n_joint, n_time)``, and delta.
    states : (3, n_time)
    froude : float
    along_shapes : bool
    """
    angles, rates, delta = shapes
    out, slopes = (found.full() for found in _function(body, friction, along_shapes)(angles, rates, states, delta, froude))
    return out, slopes.reshape(len(out), -1, states.shape[1])
