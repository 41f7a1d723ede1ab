"""A gait laid into another class of gaits, or into a chain of other links: where a search there begins."""

from __future__ import annotations

import numpy as np

from colloc.gaits.gait_fields import AnyClass, AnyGait
from colloc.gaits.guesses import Limit, largest_factor
from colloc.gaits.harmonic import Fourier, Harmonic
from colloc.gaits.path_samples import fourier_through, path_length
from colloc.gaits.polygon import Corners
from colloc.gaits.problem import Problem
from colloc.mechanics.bodies import Body
from colloc.mechanics.body import Chain

_SHORT = 1.002
"""An optimum on the lower bound of the path length is not too short; its length as a polyline is, by the corners it cuts."""
_PHASES = np.linspace(0.0, 1.0, 1001)
_CORNERS = 200
"""Vertices by which a path of arcs is laid into a chain of other links."""
_NEAR = 10.0
"""A search from a known optimum begins at so many times the final delta: friction more regularised than that prefers other
gaits, and leaves it (six harmonics from the best of five: 0.4013, from 100 times the final delta 0.3998)."""


def over_links(gait: AnyGait, body: Chain, other: Body, joint_limit: Limit = float(np.pi)) -> AnyGait:
    """A gait of a chain laid into another body: every link gets the mean tangent angle of the part of the body it covers.

    That is linear in the joint angles and keeps the symmetries, if both bodies have them. A path of arcs becomes a polygon of
    many corners. Where links would cross, or a joint pass its limit, all angles shrink.
    """
    matrix = other.laid(np.array(body.lengths))
    angles = matrix @ gait.angles(_PHASES)
    matrix = matrix * min(1.0, largest_factor(other, joint_limit, angles))
    if isinstance(gait, Fourier):
        return Fourier(matrix @ gait.mean, matrix @ gait.cos, matrix @ gait.sin)
    if isinstance(gait, Corners):
        return Corners(matrix @ gait.corners, gait.symmetry)
    last = gait.edges[-1]
    vertices = matrix @ gait.angles(np.linspace(0.0, last, _CORNERS + 1))
    return Corners(vertices[:, :-1] if gait.symmetry == "none" else vertices, gait.symmetry)


def laid_into(
    gait_class: AnyClass, gait: AnyGait, body: Body, joint_limit: Limit = float(np.pi), smallest_shape_speed: float = 0.1
) -> AnyGait:
    """The gait that starts a search in a class: its Fourier series for harmonics, else itself, made admissible.

    A truncated series overshoots, and a path that touches its limits is no longer admissible then: all angles shrink. It cuts
    corners, and a path as short as it may be becomes too short: it grows about its mean.
    """
    near = fourier_through(gait, gait_class) if isinstance(gait_class, Harmonic) else gait
    growth = 2 * np.pi * smallest_shape_speed / path_length(near)
    if growth > _SHORT and isinstance(near, Fourier):
        near = Fourier(near.mean, growth * near.cos, growth * near.sin)
    elif growth > _SHORT and isinstance(near, Corners):
        mean = near.angles(_PHASES[:-1]).mean(axis=1, keepdims=True)
        near = Corners(mean + growth * (near.corners - mean), near.symmetry)
    if near is gait or not isinstance(near, Fourier):
        return near
    factor = min(1.0, largest_factor(body, joint_limit, near.angles(_PHASES)))
    return Fourier(factor * near.mean, factor * near.cos, factor * near.sin)


def delta_in(gait_class: AnyClass, gait: AnyGait, at_unit_speed: float) -> float:
    """Delta in the units of a class, from delta at unit shape speed, for a gait of the same path length.

    Harmonic gaits measure it per period, paths at unit shape speed.
    """
    return at_unit_speed * (1.0 if gait_class.unit_speed else path_length(gait))


def prolonged(problem: Problem, gait: AnyGait, gait_class: AnyClass, **changes: object) -> Problem:
    """The problem in another class of gaits, to be searched from a known optimum of any class.

    Delta stays what it is relative to the shape speed; other fields may be changed too (``intervals=...``).

    Examples
    --------
    >>> from colloc import FreePath, Harmonic, Problem, ellipse
    >>> best = ellipse(0, 2.86, 1.30)
    >>> prolonged(Problem("loop", best, gait=Harmonic(1, "bilateral")), best, FreePath(8.0, "bilateral")).gait
    FreePath(curvature=8.0, symmetry='bilateral', winding=None)
    """
    at_unit_speed = problem.delta / delta_in(problem.gait, problem.guess, 1.0)
    delta = delta_in(gait_class, gait, at_unit_speed)
    guess = laid_into(gait_class, gait, problem.body, problem.joint_limit, problem.smallest_shape_speed)
    stated = {"guess": guess, "gait": gait_class, "delta": delta, "delta_start": _NEAR * delta}
    return problem.with_(**(stated | changes))
