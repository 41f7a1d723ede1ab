"""Kinks of a gait's velocities: instants at which a point of a link comes to rest.

The balance changes like x log|x| where a link slides on with its centre of rotation inside, like
|x| when it comes to rest; where mu_f and mu_b differ, also where the tangential velocity changes
its sign; and where a balance ends in a fold, the body jumps.
"""

from __future__ import annotations

import numpy as np

from colloc.mechanics.bodies import Body
from colloc.mechanics.chain import Chain
from colloc.mechanics.law import Law
from colloc.verification.adaptive_motion import FineMotion, rates_at
from colloc.verification.replay_record import Path

SLOW = 30.0
"""A point counts as at rest below this many delta."""
_ZOOMS, _SAMPLES = 5, 9
_SEPARATE = 1e-6


def kink_phases(
    body: Body, friction: Law, path: Path, delta: float, fine: FineMotion
) -> np.ndarray:
    """Phases of kinks and jumps inside the solved part of a gait, ascending; delta is per
    period."""
    t, velocity = fine.nodes.ravel(), fine.rates.z.reshape(3, -1)
    speed = _slowness(body, friction, *path(t), velocity)  # vanishes at a kink
    inner = speed[:, 1:-1]
    link, index = np.nonzero((inner <= speed[:, :-2]) & (inner <= speed[:, 2:]))
    centre, least = t[index + 1], inner[link, index]
    radius, rows = np.maximum(t[index + 2] - centre, centre - t[index]), np.arange(centre.size)
    for _ in range(_ZOOMS if centre.size else 0):
        near = centre[:, None] + radius[:, None] * np.linspace(-1, 1, _SAMPLES)
        z = rates_at(body, friction, path, delta, near, near=fine.velocity(near)).z.reshape(3, -1)
        sampled = _slowness(body, friction, *path(near.ravel()), z)
        sampled = sampled[np.repeat(link, _SAMPLES), np.arange(near.size)].reshape(near.shape)
        best = sampled.argmin(axis=1)
        centre, least = near[rows, best], sampled[rows, best]
        radius *= 2.0 / (_SAMPLES - 1)
    jumps = (np.abs(np.diff(velocity)).max(axis=0) > SLOW * delta) & (np.diff(t) < _SEPARATE)
    kinks = np.sort(np.concatenate([centre[least < SLOW * delta], 0.5 * (t[1:] + t[:-1])[jumps]]))
    kinks = kinks[(kinks > fine.edges[0] + _SEPARATE) & (kinks < fine.edges[-1] - _SEPARATE)]
    return kinks[np.diff(kinks, prepend=-np.inf) > _SEPARATE]


def _slowness(
    body: Body, friction: Law, angles: np.ndarray, rates: np.ndarray, z: np.ndarray
) -> np.ndarray:
    """Speeds that vanish at kinks, ``(n_part, n_time)``; smooth bodies, and drag, make none."""
    if not (isinstance(body, Chain) and body.law(friction).regularised):
        return np.empty((0, z.shape[1]))
    velocity = body.velocity(body.posture(angles), rates, z)
    return body.contact.sticking_speeds(friction, velocity)
