"""Symmetries of a gait q(t), phase t in [0, 1], with the exchange of tail and head
``(S q)_j = -q_(n+1-j)``. For any friction the net rotation vanishes.

- ``bilateral``: q(-t) = S q(t). The second half period repeats the displacement and work of the
  first (paper, appendix A).
- ``antipodal``: q(t + 1/2) = -q(t). The second half period is the mirror image of the first.
"""

from __future__ import annotations

from typing import Any

import numpy as np

NONE, BILATERAL, ANTIPODAL = SYMMETRIES = ("none", "bilateral", "antipodal")
_DENSE = 2000


def fraction(symmetry: str) -> float:
    """Part of the period that is solved; symmetry gives the rest."""
    return 1.0 if symmetry == NONE else 0.5


def solved_phases(symmetry: str, t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Phases ``(n_time,)`` of the solved part that give phases t, and whether as images."""
    t = np.asarray(t, dtype=float)
    # whole periods are ends, not starts, so that a path that fails to close shows it
    phase = np.where((t > 0) & (t % 1.0 == 0), 1.0, t % 1.0)
    image = phase > fraction(symmetry)
    other = {NONE: phase, BILATERAL: 1.0 - phase, ANTIPODAL: phase - 0.5}[symmetry]
    return np.where(image, other, phase), image


def both_halves(symmetry: str, phases: np.ndarray) -> np.ndarray:
    """Phases in (0, 1) of phases ``(n,)`` of the solved part and of their images."""
    images = {NONE: phases, BILATERAL: 1 - phases, ANTIPODAL: 0.5 + phases}[symmetry]
    both = np.concatenate([phases, images])
    return np.unique(both[(both > 0) & (both < 1)])


def symmetric_samples(gait: Any, symmetry: str, count: int = _DENSE) -> np.ndarray:
    """Sample the solved part of the symmetric gait nearest to a gait, ``(n_joint, count + 1)``.

    Phase 0 moves to the phase about which the gait is closest to the symmetry, if not there.
    """
    if symmetry == NONE:
        return gait.angles(np.linspace(0.0, 1.0, count + 1))
    n = 2 * count
    t = np.arange(n) / n
    angles = gait.angles(t)
    if symmetry == ANTIPODAL:
        angles = 0.5 * (angles - np.roll(angles, count, axis=1))
        return np.concatenate([angles[:, :count], -angles[:, :1]], axis=1)
    exchanged = -angles[::-1]
    # asymmetry about phase k/(2n): sum over i of |q(i) - S q(k - i)|^2, up to a constant minus
    # twice a circular convolution
    spectrum = np.fft.rfft(angles, axis=1) * np.fft.rfft(exchanged, axis=1)
    match = np.fft.irfft(spectrum, n, axis=1).sum(axis=0)
    shift = 0 if match[0] > match.max() - 1e-9 * n else int(np.argmax(match))
    shift += shift % 2 * (1 if match[(shift + 1) % n] > match[shift - 1] else -1)
    angles = np.roll(angles, -(shift // 2), axis=1)
    angles = 0.5 * (angles - np.roll(angles[::-1, ::-1], 1, axis=1))
    return angles[:, : count + 1]
