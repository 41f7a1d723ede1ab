"""The balance of a body on a slope at given orientations, with derivatives: what every motion on a
slope is made from."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from colloc.gaits.sloped import Slope
from colloc.mechanics.bodies import BalancedMotion, BalanceSolution
from colloc.mechanics.chain import Chain
from colloc.mechanics.chain_motion import motion_and_derivatives
from colloc.mechanics.fixed_point import solve_balance
from colloc.mechanics.law import Law

_LOAD = slice(-2, None)


class OnSlope(NamedTuple):
    """A chain at instants on a slope."""

    solved: BalanceSolution
    now: BalancedMotion
    on_shape: np.ndarray
    """Derivatives of (tail velocity, velocity of the centre, power) with respect to (angles,
    rates), ``(6, 2 n_joint, n)``."""
    on_theta: np.ndarray
    """The same with respect to the orientation, ``(6, n)``."""


def balance_on_slope(
    body: Chain,
    friction: Law,
    slope: Slope,
    shapes: tuple[np.ndarray, np.ndarray, float],
    theta: np.ndarray,
    **settings: object,
) -> OnSlope:
    """The balance under the weight's pull.

    Parameters
    ----------
    body, friction, slope
    shapes
        Angles and rates ``(n_joint, n)``, and delta.
    theta : (n,)
        Angles of the tail link from straight uphill [rad].
    **settings
        Of `colloc.mechanics.fixed_point.solve_balance`: ``start`` and ``tolerance``.
    """
    load = slope.pull(theta[None])
    solved = solve_balance(body, friction, *shapes, load=load, **settings)  # type: ignore[arg-type]
    now, slopes = motion_and_derivatives(body, friction, *shapes, solved, load)
    on_load = slopes[:, _LOAD]
    # the pull turns against theta
    return OnSlope(
        solved, now, slopes[:, : _LOAD.start], on_load[:, 0] * load[1] - on_load[:, 1] * load[0]
    )
