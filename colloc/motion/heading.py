"""How a symmetry closes a period: the direction in which a gait travels, and its orientations, from
the part that is solved.

A bilateral gait repeats its displacement, so it travels along it. The second half of an antipodal
gait is the mirror image of the first; together they travel along the bisector of the orientations
at the ends of the first.
"""

from __future__ import annotations

import numpy as np

from colloc.gaits.symmetry import ANTIPODAL, BILATERAL, NONE


def heading(symmetry: str, displacement: complex, rotation: float) -> float:
    """Angle of the travel from the initial orientation [rad], from displacement and rotation [rad]
    of the solved part."""
    if symmetry != ANTIPODAL:
        return float(np.angle(displacement))
    # it may travel either way along its axis
    along = (displacement * np.exp(-0.5j * rotation)).real >= 0
    return float(0.5 * rotation if along else 0.5 * rotation - np.pi)


def closing_sign(symmetry: str) -> float | None:
    """The sign with which the first orientation counts where the last one and it add up to nothing,
    or a whole number of turns. None: nothing has to close."""
    return {NONE: -1.0, ANTIPODAL: 1.0, BILATERAL: None}[symmetry]


def whole_turns(first: float, last: float) -> float:
    """The whole turns [rad] that the orientations at the ends of an antipodal gait's first half add
    up to: 0, or, where it travels the other way along its axis, one."""
    return float(2 * np.pi * np.round((first + last) / (2 * np.pi)))


def momenta_image(symmetry: str) -> np.ndarray | None:
    """What a symmetry makes of the momenta (Vx, Vy, H) in the axes of the tail at the begin of the
    solved part, to be those at its end, ``(3, 3)``; None: they are the same. Bilateral gaits run
    backwards in time, as no motion with inertia does."""
    return {NONE: None, ANTIPODAL: np.diag([1.0, -1.0, -1.0])}[symmetry]
