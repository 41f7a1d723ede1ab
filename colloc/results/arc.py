"""Arc that a body crawls in a period, independent of the phase at which that begins."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

PHASES = np.linspace(0.0, 1.0, 2001)  # the radius is accurate to 1e-7


class Arc(NamedTuple):
    """Angle that a period turns, counter-clockwise [rad]; chord between its ends [body lengths]."""

    angle: float
    chord: float

    @property
    def radius(self) -> float:
        """Radius of the circle [body lengths], infinite without turning."""
        across = abs(2 * math.sin(0.5 * self.angle))
        return self.chord / across if across else math.inf

    @property
    def length(self) -> float:
        """Length along the circle, the shorter way round [body lengths]."""
        half = 0.5 * math.remainder(self.angle, 2 * math.pi)
        return self.chord if half == 0 else self.chord * half / math.sin(half)


def arc(angle: float, centre: np.ndarray) -> Arc:
    """Arc of a period with a turn [rad] and a path of the centre of mass ``(2, n)`` in equal steps.

    >>> import numpy as np
    >>> t = np.linspace(0, 1, 2001)
    >>> wriggle = (2 + 0.1 * np.exp(2j * np.pi * t)) * np.exp(0.5j * t)
    >>> round(arc(0.5, np.array([wriggle.real, wriggle.imag])).radius, 6)
    2.0
    """
    path = centre[0] + 1j * centre[1]
    t = np.linspace(0.0, 1.0, path.size)
    turn, displacement = np.exp(1j * angle) - 1, path[-1] - path[0]
    # integrated by parts, which needs no velocities; the integrand is periodic
    integrand = np.exp(-1j * angle * t) * (turn * (path - path[0]) + displacement)
    return Arc(angle, float(abs(np.trapezoid(integrand, t))))
