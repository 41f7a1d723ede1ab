"""One balance by the compiled kernel and by NumPy."""

from __future__ import annotations

import numpy as np

from colloc.mechanics.bodies import BalancedMotion
from colloc.mechanics.fixed_point import motion_and_derivatives, solve_balance
from colloc.mechanics.native_kernel import numpy_instead


def by_both(
    body, law, angles, rates, delta, load=None
) -> tuple[tuple[np.ndarray, BalancedMotion, np.ndarray], ...]:
    """Compiled, then by NumPy: the balanced velocities, the motion there, and its derivatives over
    the largest of an instant."""
    solved = solve_balance(body, law, angles, rates, delta, load=load)
    at = body, law, angles, rates, delta, solved, load
    motion, slopes = motion_and_derivatives(*at)
    with numpy_instead():
        same = solve_balance(body, law, angles, rates, delta, load=load, start=solved.z)
        known, reference = motion_and_derivatives(*at)
    scale = np.abs(reference).max(axis=(0, 1))
    return (solved.z, motion, slopes / scale), (same.z, known, reference / scale)
