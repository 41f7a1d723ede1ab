"""Frames of a motion in the lab, with the friction along the body."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from colloc.mechanics.bodies import Body
from colloc.mechanics.chain import Chain
from colloc.mechanics.floor_contact import FOOT, PAD, WHEEL
from colloc.results.body_marks import ARROWS, footprints, friction_arrows
from colloc.results.motion import RigidMotion, SampledMotion, rotate
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
    """Positions in the lab of a period from phase 0 to 1, or of several from rest."""

    t: np.ndarray  # (n_time,)
    angles: np.ndarray  # (n_joint, n_time)
    ends: np.ndarray  # (2, n_point, n_time), outline, tail first
    centre: np.ndarray  # (2, n_time), of mass
    arrow_base: np.ndarray  # (2, n_arrow, n_time), where friction is shown
    arrow: np.ndarray  # (2, n_arrow, n_time), force per length
    holding: np.ndarray  # (n_foot, n_time), feet that stick
    feet: np.ndarray  # (2, 2, n_foot, n_time), both their ends
    before: tuple[RigidMotion, ...]  # of the periods before each one that is shown

    @property
    def window(self) -> tuple[np.ndarray, np.ndarray]:
        """Low and high corner ``(2,)`` of all periods with their arrows."""
        ends = self.ends.reshape(2, -1)
        reach = np.concatenate([moved.of(ends) for moved in self.before], axis=1)
        return reach.min(axis=1) - _ARROW, reach.max(axis=1) + _ARROW

    @property
    def arrow_scale(self) -> float:
        """Length of an arrow [body lengths] per force."""
        return _ARROW / max(float(np.hypot(*self.arrow).max()), 1e-300)


def foot_kinds(body: Body) -> tuple[str, ...]:
    """Kinds of the feet of a body (`colloc.mechanics.floor_contact.Foot.kind`)."""
    return tuple(foot.kind for foot in body.standing_on) if isinstance(body, Chain) else ()


def foot_words(kinds: Sequence[str]) -> str:
    """Meaning of the marks of feet; empty for a body that lies on the floor."""
    words = [_WORDS[kind] for kind in dict.fromkeys(kinds)]
    return " ".join([*words, "Filled: it holds."] if words else [])


def lab_outline(body: Body, angles: np.ndarray, theta: np.ndarray, tail: np.ndarray) -> np.ndarray:
    """Outline in the lab, ``(2, n_point, n_time)``."""
    return tail[:, None] + rotate(np.stack(body.outline(angles)), theta)


def lab_feet(body: Body, angles: np.ndarray, theta: np.ndarray, tail: np.ndarray) -> np.ndarray:
    """Both ends of the feet in the lab, ``(2, 2, n_foot, n_time)``."""
    return tail[:, None, None] + rotate(footprints(body, angles, _WHEEL), theta)


def frames(solution: Solution, count: int = 241, arrows: int = ARROWS, periods: int = 3) -> Frames:
    """Frames at `count` phases, both ends included, with about so many arrows of friction."""
    return frames_of(solution, solution.sample(np.linspace(0.0, 1.0, count)), arrows, periods)


def frames_of(
    solution: Solution, motion: SampledMotion, arrows: int = ARROWS, periods: int = 1
) -> Frames:
    """Frames of any motion of a solution's gait, repeated so many times."""
    body, delta = solution.problem.body, solution.delta_per_period
    at = (body, motion.angles, motion.theta, motion.tail)
    places, forces = friction_arrows(
        body, solution.problem.law, motion.angles, motion.rates, delta, motion.z, arrows
    )
    way = motion.centre[:, -1] - motion.centre[:, 0]
    period = RigidMotion(float(motion.theta[-1] - motion.theta[0]), complex(*way))
    return Frames(
        motion.t,
        motion.angles,
        lab_outline(*at),
        motion.centre,
        motion.tail[:, None] + rotate(places, motion.theta),
        rotate(forces, motion.theta),
        solution.holding(motion),
        lab_feet(*at),
        tuple(period.repeat(k) for k in range(periods)),
    )
