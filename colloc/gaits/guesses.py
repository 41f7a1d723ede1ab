"""Gaits to start from: by default a travelling wave of an amplitude that any body can do,

    q_j(t) = a sin(2 pi t - 2 pi w (s_j - 1/2)),

joint j at s_j along the body, tail at 0 and head at 1; w > 0 travels towards the head. It has both
symmetries about the middle of a body whose lengths read the same from both ends.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from colloc.gaits.harmonic import Fourier, Harmonic
from colloc.gaits.limits import Limit, under_one_limit
from colloc.gaits.symmetry import symmetric_samples
from colloc.mechanics.bodies import Body
from colloc.mechanics.contact import crossing_depth, link_width
from colloc.system.errors import ProblemError

WAVES = -1.0
"""Waves along the body: towards the tail, which carries a body with mu_t > mu_f head first."""
_SHARE, _LARGEST, _MOVING = 0.6, 1.5, 1.05
"""Amplitude: a share of the largest admissible one, and at most so much [rad], or so many times the
least that moves enough."""
_PHASES, _CHECKED = np.linspace(0.0, 1.0, 201), np.arange(2000) / 2000
SAFE = 1 - 1e-3
"""Shapes as large as may be are scaled by this, to be clearly admissible."""
_BISECTIONS = 21  # to a thousandth of the margin above
_SLACK = 1e-6  # depth of a crossing that a certificate allows
_AT_THE_BOUND = 1e-2
"""Sampling cuts the corners of an optimum on the lower bound of the shape speed: it is still a good
guess for a richer class."""
_MOVES = 1e-3  # shape speed, of a wave's, below which a class has nothing of the wave


def largest_factor(
    body: Body, joint_limit: Limit, angles: np.ndarray, rest: np.ndarray | float = 0.0
) -> float:
    """The largest factor by which shapes ``(n_joint, n)``, less those at rest, can be multiplied
    and stay admissible; inf for straight ones."""
    angles = angles - rest
    stretched, joint_limit = under_one_limit(angles, joint_limit)
    peak = body.bounded_angles.largest(stretched).max()
    if peak == 0:
        return np.inf

    def crosses(factor: float) -> bool:
        return bool(crossing_depth(body, factor * angles + rest).any())

    low, high = 0.0, joint_limit / peak
    if not crosses(high):
        return high * SAFE
    for _ in range(_BISECTIONS):
        middle = 0.5 * (low + high)
        low, high = (low, middle) if crosses(middle) else (middle, high)
    return low * SAFE


def travelling_wave(
    body: Body, joint_limit: Limit, waves: float = WAVES, least: float = 0.0
) -> Fourier:
    """A wave along a body. If its shape speed were below `least` it is larger, and each joint bends
    in proportion to its own limit."""
    cos, sin = body.wave(waves)
    unit = Fourier(np.zeros(body.n_joint), cos[:, None], sin[:, None])
    angles = unit.angles(_PHASES)
    wave = unit.grown(min(_SHARE * largest_factor(body, joint_limit, angles), _LARGEST))
    if wave.shape_speed >= least:
        return wave
    stretched = np.abs(under_one_limit(angles, joint_limit)[0]).max(axis=1)
    proportions = np.abs(angles).max(axis=1) / np.maximum(stretched, np.finfo(float).tiny)
    each = unit.mapped(np.diag(proportions))
    largest = largest_factor(body, joint_limit, each.angles(_PHASES))
    return each.grown(min(largest, _MOVING * least / each.shape_speed))


def largest_share(gait: Any, speeds: tuple[float, ...]) -> float:
    """Largest ratio of a gait's motor speeds to their limits [rad per period]; 0 without limits."""
    if not speeds:
        return 0.0
    fastest = np.abs(gait.motor_gait.rates(_PHASES)).max(axis=1)
    return float((fastest / np.array(speeds)).max())


def initial_member(gait_class: Any, wave: Fourier) -> Any:
    """The gait that stands for a wave in a class: itself, or the nearest member as fast, or if
    there is none all its functions at once."""
    if gait_class.relative_delta or not gait_class.free or isinstance(gait_class, Harmonic):
        return wave
    member = gait_class.through(wave)
    if member.shape_speed <= _MOVES * wave.shape_speed:
        member = gait_class.member(np.ones(gait_class.size(wave.n_joint)), wave.n_joint)
    return member.scaled(wave.shape_speed / member.shape_speed)


def checked_member(gait_class: Any, gait: Any) -> tuple[Any, float]:
    """The gait of a class that a guess stands for, a path itself, and its shape speed [rad per
    radian of phase]."""
    if gait_class.free and not gait_class.relative_delta:
        member = gait_class.member(gait_class.parameters(gait_class.through(gait)), gait.n_joint)
        return member, member.shape_speed
    points = symmetric_samples(gait, gait_class.symmetry)
    length = np.linalg.norm(np.diff(points), axis=0).sum()
    return gait, float(length / (2 * np.pi * gait_class.fraction))


def default_guess(
    body: Body,
    gait_class: Any,
    joint_limit: Limit,
    speeds: tuple[float, ...],
    smallest_shape_speed: float,
) -> Any:
    """A wave in a class, no joint of it faster than allowed. `ProblemError` if it hardly moves."""
    wave = travelling_wave(body, joint_limit, least=smallest_shape_speed)
    gait = initial_member(gait_class, wave)
    if gait.joint_map is not None:
        most = largest_factor(body, joint_limit, gait.angles(_PHASES), gait.rest)
        gait = gait.scaled(min(1.0, most))
    if (share := largest_share(gait, speeds)) > 1:
        gait = gait.scaled(1 / share)
    _, rms = checked_member(gait_class, gait)
    if rms < smallest_shape_speed * (1 - _AT_THE_BOUND):
        raise ProblemError(
            f"with {'speed_limit' if share > 1 else 'joint_limit'} the usual first gait has a "
            f"root-mean-square shape speed of {rms:.2g}, less than smallest_shape_speed = "
            f"{smallest_shape_speed:g}: make that smaller, or give a guess."
        )
    return gait


def check_guess(
    body: Body, gait_class: Any, guess: Any, joint_limit: Limit, smallest_shape_speed: float
) -> None:
    """Raise a `ProblemError` for a gait of another body, at rest, or inadmissible."""
    if guess.n_joint != body.n_joint:
        raise ProblemError(
            f"guess has {guess.n_joint} {body.defaults.coordinate}s but the body has "
            f"{body.n_joint}."
        )
    member, rms = checked_member(gait_class, guess)
    if rms < smallest_shape_speed * (1 - _AT_THE_BOUND):
        raise ProblemError(
            f"guess hardly moves (root-mean-square shape speed {rms:.3g} < smallest_shape_speed "
            f"{smallest_shape_speed:g}); does it have the symmetry {gait_class.symmetry!r} of its "
            f"class?"
        )
    angles, bounded = member.angles(_CHECKED), body.bounded_angles
    stretched, limit = under_one_limit(angles, joint_limit)
    largest, depth, what = bounded.largest(stretched).max(), crossing_depth(body, angles), ""
    if largest > limit + body.defaults.excess:
        each = np.abs(bounded.rows @ stretched).max(axis=1, initial=0.0)
        which = bounded.names[np.argmax(each)] if each.size else "the tangent"
        what = f"{which} reaches {largest:.4g} rad, beyond the limit {limit:.4g}"
    elif depth.max() > _SLACK:
        how = "overlap" if link_width(body) else "cross each other"
        what = f"links {how} at phase {_CHECKED[np.argmax(depth)]:.3f}"
    if what:
        raise ProblemError(f"guess is inadmissible: {what}; make its amplitude smaller.")
