"""What an animation needs: the body in the lab frame, frame by frame, with the friction along its links."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from colloc.mechanics.balance import instant
from colloc.mechanics.body import Chain
from colloc.mechanics.friction import force_density
from colloc.results.relaxed_solution import RelaxedSolution
from colloc.results.solution import Solution

_STRAIGHT = 1e-2
"""A body that turns by less a period [rad] is shown over several periods, one after the other along a straight line."""


@dataclass(frozen=True, eq=False)
class Frames:
    """One period of a motion, from phase 0 to 1, both included.

    Attributes
    ----------
    t : (n_time,)
    angles : (n_joint, n_time)
    ends : (2, n_link + 1, n_time)
        Lab positions of the link ends, tail first.
    centre : (2, n_time)
        Of mass.
    arrow_base, arrow : (2, n_arrow, n_time)
        Where friction is shown, `per_link` points a link, and the force per length there, in lab axes.
    step : (2,)
        What a period adds to every position.
    periods : int
        How many periods can be shown in a row.
    """

    t: np.ndarray
    angles: np.ndarray
    ends: np.ndarray
    centre: np.ndarray
    arrow_base: np.ndarray
    arrow: np.ndarray
    step: np.ndarray
    periods: int


def link_ends(body: Chain, angles: np.ndarray, theta: np.ndarray, tail: np.ndarray) -> np.ndarray:
    """Lab positions of the ends of all links, ``(2, n_link + 1, n_time)``."""
    x, y = body.joints(angles)
    c, s = np.cos(theta), np.sin(theta)
    return np.stack([tail[0] + c * x - s * y, tail[1] + s * x + c * y])


def frames(solution: Solution | RelaxedSolution, count: int = 241, per_link: int | None = None, periods: int = 3) -> Frames:
    """Sample a solution's motion and the friction that acts on it.

    Parameters
    ----------
    solution : Solution
        With at least one level.
    count : int
        Instants, both ends of the period included.
    per_link : int, optional
        Arrows a link; by default fewer on bodies of many links.
    periods : int
        How many periods to show where the body does not turn.
    """
    problem = solution.problem
    body, delta = problem.body, solution.delta_per_period
    motion = solution.sample(np.linspace(0.0, 1.0, count))
    ends = link_ends(body, motion.angles, motion.theta, motion.tail)
    velocity = instant(body, problem.friction, motion.angles, motion.rates, motion.z, delta).velocity
    many = per_link or max(2, 12 // body.n_link)
    share = (np.arange(many) + 0.5) / many
    heading = body.tangent_angles(motion.angles) + motion.theta
    bases, arrows = [], []
    for at in share:
        normal = velocity.vn + (at - 0.5) * body.length_column() * velocity.w
        along, across = force_density(velocity.vs, normal, delta, problem.friction)
        cos, sin = np.cos(heading), np.sin(heading)
        arrows.append(np.stack([along * cos - across * sin, along * sin + across * cos]))
        bases.append((1 - at) * ends[:, :-1] + at * ends[:, 1:])
    straight = abs(float(motion.theta[-1] - motion.theta[0])) < _STRAIGHT
    return Frames(
        motion.t,
        motion.angles,
        ends,
        motion.centre,
        np.concatenate(bases, axis=1),
        np.concatenate(arrows, axis=1),
        motion.centre[:, -1] - motion.centre[:, 0],
        periods if straight else 1,
    )
