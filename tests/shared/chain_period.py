"""Chains of straight links as models of a smooth body: how their distance and work converge in the
number of links.

A smooth body that follows its own track slides along its tangent everywhere. A straight link on a
track of curvature kappa cannot: its normal velocity is that of a rotation, ``kappa sigma V`` at
sigma from its middle, and transverse friction charges ``mu_t kappa^2 sigma^2 V`` for it. Averaged
over a link of length 1/n the work is too large by the relative amount

    (mu_t / mu_f) <kappa^2> / (12 n^2),

second order, but with the anisotropy as a factor: the number of links needed grows like its square
root.
"""

from __future__ import annotations

import numpy as np

from colloc import Chain, Friction, ProblemError, solve_balance
from colloc.mechanics.balance import instant, total_power
from colloc.smooth.balance import Motion


def chain_period(
    motion: Motion, friction: Friction, delta: float, n_link: int, instants: int = 32
) -> tuple[float, float]:
    """Distance and work per period of a chain whose links have the motion's tangent angles at their
    midpoints.

    Equal steps in time over the half period that an antipodal motion needs: spectrally accurate for
    travelling waves.

    Raises
    ------
    ProblemError
        If the motion is not antipodal.
    """
    if not motion.antipodal:
        raise ProblemError("the chain study needs an antipodal motion.")
    t = (np.arange(instants) + 0.5) / (2 * instants)
    middle = ((np.arange(n_link) + 0.5) / n_link)[:, None] * np.ones((1, instants))
    phi, rate = motion.angle(middle, t), motion.rate(middle, t)
    body = Chain((1.0 / n_link,) * n_link)
    angles, rates = np.diff(phi, axis=0), np.diff(rate, axis=0)
    z = solve_balance(body, friction, angles, rates, delta).require().z
    now = instant(body, friction, angles, rates, z, delta)
    W = float(np.mean(total_power(now.velocity, now.force)))
    # the tail link turns with z[2]; the motion's frame turns with what its own angle does not
    # explain
    omega = z[2] - rate[0]
    spectrum = np.fft.rfft(np.concatenate([omega, -omega]))
    k = np.arange(spectrum.size) * 2j * np.pi
    spectrum[0], k[0] = 0.0, 1.0
    theta = np.fft.irfft(spectrum / k, 2 * instants)[:instants]
    cx, cy = body.centre_velocity(now.posture, now.velocity)
    along = np.mean((cx[0] + 1j * cy[0]) * np.exp(1j * (theta + phi[0])))
    return abs(along.real), W
