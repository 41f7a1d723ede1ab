"""Gaits to start from where none is given: travelling waves of bending, of a size that any body can do.

With joint j at s_j along the body, tail at 0, head at 1,

    q_j(t) = a sin(2 pi t - 2 pi w (s_j - 1/2))

has both symmetries, about the middle of the body: q_j(t + 1/2) = -q_j(t), and q_j(-t) = -q_(n+1-j)(t) where the lengths read
the same from both ends. Bending travels towards the head for w > 0, towards the tail for w < 0.
"""

from __future__ import annotations

import numpy as np

from colloc.gaits.harmonic import Fourier
from colloc.mechanics.body import Chain
from colloc.mechanics.contact import largest_factor

WAVES = -1.0
"""Waves along the body: one, towards the tail, which carries a body with mu_t > mu_f head first."""
_SHARE, _LARGEST = 0.6, 1.5
"""Amplitude: a share of the largest admissible one, and at most so much [rad]."""
_PHASES = np.linspace(0.0, 1.0, 201)


def travelling_wave(body: Chain, joint_limit: float, waves: float = WAVES, share: float = _SHARE) -> Fourier:
    """A wave of bending along a body.

    Parameters
    ----------
    body : Chain
    joint_limit : float
    waves : float
        How many stand along the body; positive ones travel towards the head.
    share : float
        Amplitude over the largest that is admissible; at most 1.5 rad.
    """
    place = np.cumsum(body.lengths)[:-1] - 0.5
    phase = 2 * np.pi * waves * place
    unit = Fourier(np.zeros(body.n_joint), -np.sin(phase)[:, None], np.cos(phase)[:, None])
    size = min(share * largest_factor(body, joint_limit, unit.angles(_PHASES)), _LARGEST)
    return Fourier(unit.mean, size * unit.cos, size * unit.sin)
