"""When the velocities of a gait have kinks: instants at which a point of a link comes to rest.

The friction on a point of the body has the direction of its velocity, and turns around when that
passes through zero. So a link on which some point is at rest, or nearly, makes the balance change
quickly: like x log|x| when it slides on with its centre of rotation inside, like |x| when it comes
to rest as a whole. Where mu_f and mu_b differ, the force also has a kink whenever the tangential
velocity changes its sign. And where a balance ends in a fold, the body jumps to another one.
"""

from __future__ import annotations

import numpy as np

from colloc.mechanics.bodies import Body
from colloc.mechanics.law import Law
from colloc.verification.adaptive_motion import FineMotion, rates_at
from colloc.verification.played import Path

SLOW = 30.0
"""A point counts as at rest below this many delta."""
_ZOOMS, _SAMPLES = 5, 9
_SEPARATE = 1e-6


def kink_phases(
    body: Body, friction: Law, path: Path, delta: float, fine: FineMotion
) -> np.ndarray:
    """Phases of kinks and jumps inside the solved part of a gait, ascending, to 1e-3 of the spacing
    of the panels of its motion there, which are narrow where velocities change quickly; delta is
    per period."""
    t, velocity = fine.nodes.ravel(), fine.rates.z.reshape(3, -1)
    speed = _slowness(body, friction, path, delta, t, velocity)
    inner = speed[:, 1:-1]
    link, index = np.nonzero((inner <= speed[:, :-2]) & (inner <= speed[:, 2:]))
    centre = t[index + 1]
    radius = np.maximum(t[index + 2] - centre, centre - t[index])
    least = inner[link, index]
    for _ in range(_ZOOMS if centre.size else 0):
        near = centre[:, None] + radius[:, None] * np.linspace(-1, 1, _SAMPLES)
        z = rates_at(body, friction, path, delta, near, near=fine.velocity(near)).z.reshape(3, -1)
        sampled = _slowness(body, friction, path, delta, near.ravel(), z)
        own = sampled[np.repeat(link, _SAMPLES), np.arange(near.size)].reshape(near.shape)
        best = own.argmin(axis=1)
        rows = np.arange(centre.size)
        centre, least = near[rows, best], own[rows, best]
        radius *= 2.0 / (_SAMPLES - 1)
    jumps = (np.abs(np.diff(velocity)).max(axis=0) > SLOW * delta) & (np.diff(t) < _SEPARATE)
    found = np.sort(np.concatenate([centre[least < SLOW * delta], 0.5 * (t[1:] + t[:-1])[jumps]]))
    found = found[(found > fine.edges[0] + _SEPARATE) & (found < fine.edges[-1] - _SEPARATE)]
    return found[np.concatenate([[True], np.diff(found) > _SEPARATE])] if found.size else found


def _slowness(
    body: Body, friction: Law, path: Path, delta: float, t: np.ndarray, z: np.ndarray
) -> np.ndarray:
    """What has to vanish for a kink, ``(n_part, n_time)``."""
    return body.slowness(friction, *path(t), delta, z)
