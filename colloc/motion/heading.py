"""How a symmetry closes a period: the direction in which a gait travels, and its orientations, from the part that is solved.

A bilateral gait repeats its displacement, so it travels along it. The second half of an antipodal gait is the mirror image of
the first; together they travel along the bisector of the orientations at the ends of the first. A gait with both symmetries is
solved for a quarter: a mirror image of that, seen from the head, follows, and the bend of the whole body counts, too.
"""

from __future__ import annotations

import numpy as np

from colloc.gaits.symmetry import ANTIPODAL, BILATERAL, BOTH, NONE


def heading_shares(symmetry: str) -> tuple[float, float] | None:
    """The shares of the solved part's rotation, and of the change of the sum of its joint angles, by which the heading turns
    from the initial orientation. None: the gait travels along the displacement of the solved part, whatever that is."""
    return {ANTIPODAL: (0.5, 0.0), BOTH: (1.0, 0.5)}.get(symmetry)


def heading(symmetry: str, displacement: complex, rotation: float, bend: float = 0.0) -> float:
    """Angle of the travel from the initial orientation [rad], from displacement, rotation [rad] and change of the sum of all
    joint angles [rad] of the solved part."""
    shares = heading_shares(symmetry)
    if shares is None:
        return float(np.angle(displacement))
    angle = shares[0] * rotation + shares[1] * bend
    # it may travel the other way along its axis
    return float(angle if (displacement * np.exp(-1j * angle)).real >= 0 else angle - np.pi)


def closing_sign(symmetry: str) -> float | None:
    """The sign with which the first orientation counts where the last one and it add up to nothing, or
    a whole number of turns. None: nothing has to close."""
    return {NONE: -1.0, ANTIPODAL: 1.0, BILATERAL: None}[symmetry]


def whole_turns(first: float, last: float) -> float:
    """The whole turns [rad] that the orientations at the ends of an antipodal gait's first half add up to: 0, or, where it
    travels the other way along its axis, one."""
    return float(2 * np.pi * np.round((first + last) / (2 * np.pi)))


def momenta_image(symmetry: str) -> np.ndarray | None:
    """What a symmetry makes of the momenta (Vx, Vy, H) in the axes of the tail at the begin of the solved part, to be those at
    its end, ``(3, 3)``; None: they are the same. Bilateral gaits run backwards in time, as no motion with inertia does."""
    return {NONE: None, ANTIPODAL: np.diag([1.0, -1.0, -1.0])}[symmetry]
