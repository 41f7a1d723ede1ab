"""One balance by the compiled kernel and by NumPy."""

from __future__ import annotations

import numpy as np

from colloc.mechanics.bodies import BalancedMotion
from colloc.mechanics.chain_motion import chain_motion, motion_derivatives
from colloc.mechanics.native_kernel import numpy_instead


def by_both(
    body, law, angles, rates, delta
) -> tuple[tuple[np.ndarray, BalancedMotion, np.ndarray], ...]:
    """Compiled, then by NumPy: the balanced velocities, what the body does there, its slopes over
    the largest of an instant."""
    solved = body.solve(law, angles, rates, delta)
    at = body, law, angles, rates, delta, solved
    motion, slopes = chain_motion(*at), motion_derivatives(*at)
    with numpy_instead():
        same = body.solve(law, angles, rates, delta, start=solved.z)
        known, reference = chain_motion(*at), motion_derivatives(*at)
    scale = np.abs(reference).max(axis=(0, 1))
    return (solved.z, motion, slopes / scale), (same.z, known, reference / scale)
