"""Gaits to start from where none is given: travelling waves of bending, of a size that any body can do.

With joint j at s_j along the body, tail at 0, head at 1,

    q_j(t) = a sin(2 pi t - 2 pi w (s_j - 1/2))

has both symmetries, about the middle of the body: q_j(t + 1/2) = -q_j(t), and q_j(-t) = -q_(n+1-j)(t) where the lengths read
the same from both ends. Bending travels towards the head for w > 0, towards the tail for w < 0.
"""

from __future__ import annotations

import numpy as np

from colloc.gaits.harmonic import Fourier
from colloc.mechanics.bodies import Body

WAVES = -1.0
"""Waves along the body: one, towards the tail, which carries a body with mu_t > mu_f head first."""
_SHARE, _LARGEST = 0.6, 1.5
"""Amplitude: a share of the largest admissible one, and at most so much [rad]."""
_PHASES = np.linspace(0.0, 1.0, 201)
SAFE = 1 - 1e-3
"""Shapes as large as may be are scaled by this, to be clearly admissible."""
_BISECTIONS = 40


def largest_factor(body: Body, joint_limit: float, angles: np.ndarray) -> float:
    """The largest factor by which shapes ``(n_joint, n)`` can be multiplied and stay admissible; inf for straight ones."""
    peak = body.largest_angles(angles).max()
    if peak == 0:
        return np.inf
    low, high = 0.0, joint_limit / peak
    if not body.crossing_depth(high * angles).any():
        return high * SAFE
    for _ in range(_BISECTIONS):
        middle = 0.5 * (low + high)
        crossing = bool(body.crossing_depth(middle * angles).any())
        low, high = (low, middle) if crossing else (middle, high)
    return low * SAFE


def travelling_wave(body: Body, joint_limit: float, waves: float = WAVES, share: float = _SHARE) -> Fourier:
    """A wave of bending along a body.

    Parameters
    ----------
    body : Body
    joint_limit : float
    waves : float
        How many stand along the body; positive ones travel towards the head.
    share : float
        Amplitude over the largest that is admissible; at most 1.5 rad.
    """
    cos, sin = body.wave(waves)
    unit = Fourier(np.zeros(body.n_joint), cos[:, None], sin[:, None])
    size = min(share * largest_factor(body, joint_limit, unit.angles(_PHASES)), _LARGEST)
    return Fourier(unit.mean, size * unit.cos, size * unit.sin)
