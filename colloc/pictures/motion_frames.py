"""What an animation needs: the body in the lab frame, frame by frame, with the friction along its
links."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from colloc.mechanics.bodies import ARROWS, Body
from colloc.mechanics.chain import Chain
from colloc.mechanics.feet import FOOT, PAD, WHEEL
from colloc.results.motion import RigidMotion, SampledMotion, turned
from colloc.results.solution import Solution

_ARROW = 0.12  # length of the arrow of the largest friction [body lengths]
_WHEEL = 0.25  # drawn length of a wheel over that of its link
_WORDS = {
    FOOT: "Squares: feet.",
    WHEEL: "Green bars: wheels, along their rolling direction.",
    PAD: "Orange bars: pads.",
}


@dataclass(frozen=True, eq=False)
class Frames:
    """One period of a motion, from phase 0 to 1, both included; or several, from rest.

    Attributes
    ----------
    t : (n_time,)
    angles : (n_joint, n_time)
    ends : (2, n_point, n_time)
        Lab positions of the body's outline (the ends of links), tail first.
    centre : (2, n_time)
        Of mass.
    arrow_base, arrow : (2, n_arrow, n_time)
        Where friction is shown, and the force per length there, in lab axes.
    holding : (n_foot, n_time)
        Feet that hold; no rows for a body without.
    feet : (2, 2, n_foot, n_time)
        Lab positions of their two ends, one of a point.
    before : tuple of RigidMotion
        What the periods before do to each one that is shown, the first of which has none before.
    """

    t: np.ndarray
    angles: np.ndarray
    ends: np.ndarray
    centre: np.ndarray
    arrow_base: np.ndarray
    arrow: np.ndarray
    holding: np.ndarray
    feet: np.ndarray
    before: tuple[RigidMotion, ...]

    @property
    def window(self) -> tuple[np.ndarray, np.ndarray]:
        """Corners ``(2,)``, low and high, of what all periods need with their arrows."""
        ends = self.ends.reshape(2, -1)
        reach = np.concatenate([moved.of(ends) for moved in self.before], axis=1)
        return reach.min(axis=1) - _ARROW, reach.max(axis=1) + _ARROW

    @property
    def arrow_scale(self) -> float:
        """Length of an arrow [body lengths] over the force."""
        return _ARROW / max(float(np.hypot(*self.arrow).max()), 1e-300)


def foot_kinds(body: Body) -> tuple[str, ...]:
    """Kinds of the feet of a body, in the order of `lab_feet`
    (`colloc.mechanics.feet.Foot.kind`)."""
    if isinstance(body, Chain):
        return tuple(foot.kind for foot in body.standing_on)
    return (FOOT,) * body.footprints(np.zeros((body.n_joint, 1))).shape[2]


def foot_words(kinds: Sequence[str]) -> str:
    """The meaning of the marks of such feet; empty for a body that lies on the floor."""
    words = [_WORDS[kind] for kind in dict.fromkeys(kinds)]
    return " ".join([*words, "Filled: it holds."] if words else [])


def lab_outline(body: Body, angles: np.ndarray, theta: np.ndarray, tail: np.ndarray) -> np.ndarray:
    """Lab positions of the outline of a body, ``(2, n_point, n_time)``."""
    return tail[:, None] + turned(np.stack(body.outline(angles)), theta)


def lab_feet(body: Body, angles: np.ndarray, theta: np.ndarray, tail: np.ndarray) -> np.ndarray:
    """Lab positions of both ends of the feet of a body, wheels as they are drawn, ``(2, 2, n_foot,
    n_time)``; none where it has none."""
    return tail[:, None, None] + turned(body.footprints(angles, _WHEEL), theta)


def frames(solution: Solution, count: int = 241, arrows: int = ARROWS, periods: int = 3) -> Frames:
    """Sample a solution's motion at `count` instants, both ends of the period included, and the
    friction that acts on it at about so many arrows along the body; `periods` are shown in a
    row."""
    return frames_of(solution, solution.sample(np.linspace(0.0, 1.0, count)), arrows, periods)


def frames_of(
    solution: Solution, motion: SampledMotion, arrows: int = ARROWS, periods: int = 1
) -> Frames:
    """Frames of any motion of a solution's gait, which is repeated so many times."""
    body, delta = solution.problem.body, solution.delta_per_period
    at = (body, motion.angles, motion.theta, motion.tail)
    places, forces = body.rubbing(
        solution.problem.law, motion.angles, motion.rates, delta, motion.z, arrows
    )
    way = motion.centre[:, -1] - motion.centre[:, 0]
    period = RigidMotion(float(motion.theta[-1] - motion.theta[0]), complex(*way))
    return Frames(
        motion.t,
        motion.angles,
        lab_outline(*at),
        motion.centre,
        motion.tail[:, None] + turned(places, motion.theta),
        turned(forces, motion.theta),
        solution.holding(motion),
        lab_feet(*at),
        tuple(period.repeated(k) for k in range(periods)),
    )
