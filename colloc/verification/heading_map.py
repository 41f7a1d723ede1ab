"""What a slope does to headings, period by period: which of them last, and whether others come closer to those.

A period takes the heading h at its start to one at its end, h -> f(h). The equation is of first order, so f is a monotone map
of the circle: a heading either lasts, f(h) = h, and then others come closer to it period by period where f'(h) < 1 and leave it
where f'(h) > 1; or none does, and the body turns for ever.
"""

from __future__ import annotations

from itertools import pairwise
from typing import NamedTuple

import numpy as np

from colloc.mechanics.bodies import Body
from colloc.mechanics.law import Law
from colloc.system.arguments import MOST_PERIODS, check_count, check_finite
from colloc.verification.played import Path
from colloc.verification.slope import SlopeMotion, gait_on_slope

_NEUTRAL = 10.0
"""Turns within so many times the tolerance are none."""


class HeadingMap(NamedTuple):
    """What a period on a slope does to headings.

    Attributes
    ----------
    headings, turns : (n,)
        Headings over a full circle, and how far a period turns each [rad].
    neutral : bool
        No heading is turned, within the accuracy.
    lasting : tuple of SlopeMotion
        One period from each heading that is its own image; none where the body turns for ever, or where all are.
    """

    headings: np.ndarray
    turns: np.ndarray
    neutral: bool
    lasting: tuple[SlopeMotion, ...]

    def __repr__(self) -> str:
        kinds = (f"{ran.headings[0]:.4f} ({'stable' if ran.stable else 'unstable'})" for ran in self.lasting)
        found = ", ".join(kinds) if self.lasting else "every one" if self.neutral else "none"
        return f"<HeadingMap of {self.headings.size} headings; lasting: {found}>"


def heading_map(
    body: Body,
    friction: Law,
    gait: Path,
    delta: float,
    grade: float,
    *,
    count: int = 12,
    tolerance: float = 1e-6,
    breaks: np.ndarray | tuple[float, ...] = (),
) -> HeadingMap:
    """How a period turns a body on a slope, by its heading, and which headings last.

    Other parameters and errors are those of `colloc.verification.slope.slope_motion`.

    Parameters
    ----------
    count : int
        Headings that are tried; lasting ones are found between two of them that turn opposite ways.

    Examples
    --------
    >>> import colloc
    >>> gait = colloc.Fourier([0, 0], [[1.5], [0]], [[0], [1]])
    >>> at = colloc.Chain(), colloc.Friction(mu_t=2, mu_f=1, mu_b=1), gait
    >>> found = colloc.heading_map(*at, delta=1e-2, grade=0.1, count=4, tolerance=1e-4)
    >>> [(round(float(ran.headings[0]), 2), ran.stable) for ran in found.lasting]
    [(-3.13, True), (-0.01, False)]
    """
    from scipy.optimize import brentq

    on = gait_on_slope(body, friction, gait, delta, grade, breaks)
    check_finite(positive=True, tolerance=tolerance)
    check_count(MOST_PERIODS, count=count)
    course = on.course(tolerance)

    def turn(heading: float) -> float:
        return float(np.angle(np.exp(1j * on.run(course, heading, 1, tolerance).turn)))

    headings = np.linspace(-np.pi, np.pi, count, endpoint=False)
    turns = np.array([turn(heading) for heading in headings])
    lasting = []
    neutral = bool(np.abs(turns).max() <= _NEUTRAL * tolerance)
    for (first, there), (last, back) in pairwise(zip([*headings, np.pi], [*turns, turns[0]], strict=True)):
        if not neutral and there * back <= 0 and abs(there - back) < np.pi:
            lasting.append(on.run(course, brentq(turn, first, last, xtol=tolerance), 1, tolerance))
    return HeadingMap(headings, turns, neutral, tuple(lasting))
