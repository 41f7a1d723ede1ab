"""A gait followed on a slope, as people ask for it: what can be asked, and the error of the answer."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from colloc.gaits.sloped import checked_chain
from colloc.mechanics.bodies import Body
from colloc.mechanics.law import Law
from colloc.system.arguments import check_finite
from colloc.system.errors import ProblemError
from colloc.verification.gait_on_slope import GaitOnSlope, SlopeMotion
from colloc.verification.played import Path

_LOOSER = 30.0


def gait_on_slope(
    body: Body, friction: Law, gait: Path, delta: float, grade: float, breaks: np.ndarray | tuple[float, ...]
) -> GaitOnSlope:
    """A gait of a body on a slope, or a `ProblemError` that says why it cannot be there."""
    chain = checked_chain(body, friction, grade)
    if len(gait(np.zeros(1))) != 2:
        raise ProblemError("a relaxed gait cannot be put on a slope, where it matters how long each of its directions lasts.")
    return GaitOnSlope(chain, friction, gait, delta, tuple(sorted(float(t) for t in breaks)), float(grade))


def slope_motion(
    body: Body,
    friction: Law,
    gait: Path,
    delta: float,
    grade: float,
    *,
    heading: float | None = None,
    theta: float | None = None,
    periods: int = 1,
    tolerance: float = 1e-6,
    breaks: np.ndarray | tuple[float, ...] = (),
) -> SlopeMotion:
    """Follow a gait on a slope through periods, from a heading.

    Parameters
    ----------
    body : Chain
    friction : Law
        Coefficients are in units of the force that presses the body on the slope, its weight times the cosine of the
        inclination; so are all forces and works.
    gait : callable
        Joint angles and rates at phases in [0, 1]; any gait of colloc.
    delta : float
        Regularisation speed, per period. A body at rest creeps down at about delta x grade / mu.
    grade : float
        Tangent of the inclination, from 0.
    heading : float, optional
        At the start: the direction in which the gait would go on the level, from straight uphill, positive to the left [rad].
        Of a gait that goes nowhere on the level, the direction of its tail link at phase 0. By default 0, or of a solution's
        gait for a slope its own.
    theta : float, optional
        The same by the direction of the tail link at phase 0 from straight uphill; instead of a heading.
    periods : int
    tolerance : float
        Of headings, ways and works over a period, about; what is left is stated (`SlopeMotion.error`).
    breaks : (n,), optional
        Phases in (0, 1) where the rates jump, as `gait.corner_phases`.

    Raises
    ------
    ProblemError
        For a body that is no chain, or a slope that is steeper than friction can hold.
    NotConvergedError
        If no balance is found at some instant: unequal coefficients may hold the body in one direction and not in another.

    Examples
    --------
    The most efficient gait of one harmonic is none for slopes:

    >>> import colloc
    >>> gait = colloc.ellipse(A0=0, A1=2.859, B1=1.302)
    >>> for grade in (0.0, 0.05, 0.1):
    ...     ran = colloc.slope_motion(colloc.Chain(), colloc.Friction(), gait, delta=1e-4, grade=grade)
    ...     print(ran.climb.round(3), ran.joint_work.round(3))
    [0.268] [1.03]
    [0.181] [1.041]
    [0.091] [1.048]
    """
    on = gait_on_slope(body, friction, gait, delta, grade, breaks)
    if heading is None and theta is None:
        theta = getattr(gait, "theta", None)
    check_finite(heading=0.0 if heading is None else heading, theta=0.0 if theta is None else theta)
    check_finite(positive=True, tolerance=tolerance)
    if not isinstance(periods, (int, np.integer)) or periods < 1:
        raise ProblemError(f"periods must be a whole number from 1, not {periods!r}.")
    course = on.course(tolerance)
    heading = (heading or 0.0) if theta is None else theta + course
    loose = on.run(course, heading, periods, _LOOSER * tolerance).states[:5, -1]
    ran = on.run(course, heading, periods, tolerance)
    return replace(ran, error=float(np.abs(ran.states[:5, -1] - loose).max()), several=on.several(ran.phases, ran.states[0]))
