"""The arc that a body crawls in a period, whatever phase it is begun at (`colloc.gaits.period`)."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

_INSTANTS = 2001
"""Of the trapezoidal rule, whose integrand is a period's smooth motion: the radius is good to
1e-7."""
PHASES = np.linspace(0.0, 1.0, _INSTANTS)


class Arc(NamedTuple):
    """What a period comes to on the floor.

    Attributes
    ----------
    angle : float
        By which it turns the body, counter-clockwise [rad].
    chord : float
        Between the ends of the period on its circle [body lengths].
    """

    angle: float
    chord: float

    @property
    def radius(self) -> float:
        """Of the circle; infinite for one that does not turn [body lengths]."""
        across = abs(2 * math.sin(0.5 * self.angle))
        return self.chord / across if across else math.inf

    @property
    def length(self) -> float:
        """Along the circle, the shorter way if it turns by more than half [body lengths]."""
        half = 0.5 * math.remainder(self.angle, 2 * math.pi)
        return self.chord if half == 0 else self.chord * half / math.sin(half)


def arc(angle: float, centre: np.ndarray) -> Arc:
    """The arc of a period that turns by an angle and moves the centre of mass along a path.

    Parameters
    ----------
    angle : float
        [rad]
    centre : (2, n)
        At equally spaced phases, both ends of the period among them.

    Examples
    --------
    >>> import numpy as np
    >>> t = np.linspace(0, 1, 2001)
    >>> wriggle = (2 + 0.1 * np.exp(2j * np.pi * t)) * np.exp(0.5j * t)
    >>> round(arc(0.5, np.array([wriggle.real, wriggle.imag])).radius, 6)
    2.0
    """
    path = centre[0] + 1j * centre[1]
    t = np.linspace(0.0, 1.0, path.size)
    turn, displacement = np.exp(1j * angle) - 1, path[-1] - path[0]
    # integrated by parts, which needs no velocities; what is integrated is periodic, so that the
    # rule is as good as any
    return Arc(
        angle,
        float(
            abs(np.trapezoid(np.exp(-1j * angle * t) * (turn * (path - path[0]) + displacement), t))
        ),
    )
