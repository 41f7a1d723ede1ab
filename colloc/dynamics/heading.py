"""Closing of a period by symmetry: direction of travel and orientations from the solved part.

A bilateral gait repeats its displacement and travels along it. The second half of an antipodal gait
mirrors the first; together they travel along the bisector of the orientations at its ends.
"""

from __future__ import annotations

import numpy as np

from colloc.gaits.symmetry import ANTIPODAL, BILATERAL, NONE


def heading(symmetry: str, displacement: complex, rotation: float) -> float:
    """Direction of travel from the initial orientation [rad]."""
    if symmetry != ANTIPODAL:
        return float(np.angle(displacement))
    # it may travel either way along its axis
    along = (displacement * np.exp(-0.5j * rotation)).real >= 0
    return float(0.5 * rotation if along else 0.5 * rotation - np.pi)


def closing_sign(symmetry: str) -> float | None:
    """Sign s with which theta_end + s theta_0 = 0 (or whole turns) closes a period; None: nothing
    to close."""
    return {NONE: -1.0, ANTIPODAL: 1.0, BILATERAL: None}[symmetry]


def whole_turns(first: float, last: float) -> float:
    """Whole turns [rad] that the orientations at the ends of an antipodal half period add up to."""
    return float(2 * np.pi * np.round((first + last) / (2 * np.pi)))


def momenta_image(symmetry: str) -> np.ndarray | None:
    """Map ``(3, 3)`` of the momenta (Vx, Vy, H) in tail axes from the begin of the solved part to
    its end; None for the identity."""
    return {NONE: None, ANTIPODAL: np.diag([1.0, -1.0, -1.0])}[symmetry]
