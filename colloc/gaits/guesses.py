"""Gaits to start from: what is asked of them, and, where none is given, travelling waves of a size
that any body can do.

With joint j at s_j along the body, tail at 0, head at 1,

    q_j(t) = a sin(2 pi t - 2 pi w (s_j - 1/2))

has both symmetries, about the middle of the body: q_j(t + 1/2) = -q_j(t), and q_j(-t) =
-q_(n+1-j)(t) where the lengths read the same from both ends. Bending travels towards the head for w
> 0, towards the tail for w < 0.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from colloc.gaits.harmonic import Fourier
from colloc.gaits.limits import Limit, under_one_limit
from colloc.mechanics.bodies import Body
from colloc.system.errors import ProblemError

WAVES = -1.0
"""Waves along the body: one, towards the tail, which carries a body with mu_t > mu_f head first."""
_SHARE, _LARGEST, _MOVING = 0.6, 1.5, 1.05
"""Amplitude: a share of the largest admissible one, and at most so much [rad], or so many times the
least that moves enough."""
_PHASES = np.linspace(0.0, 1.0, 201)
SAFE = 1 - 1e-3
"""Shapes as large as may be are scaled by this, to be clearly admissible."""
_BISECTIONS = 21
"""Each halves what the factor may be missed by: to a thousandth of the margin above."""
_CHECKED_PHASES = 2000
_SLACK = 1e-6
"""Depth of a crossing at which a guess still counts as admissible: what a certificate allows."""
_AT_THE_BOUND = 1e-2
"""An optimum that lies on the lower bound of the shape speed is a good guess for a richer class,
although sampling cuts its corners and makes it a little shorter."""


def largest_factor(
    body: Body, joint_limit: Limit, angles: np.ndarray, rest: np.ndarray | float = 0.0
) -> float:
    """The largest factor by which shapes ``(n_joint, n)``, but for what is at rest of them, can be
    multiplied and stay admissible; inf for straight ones."""
    angles = angles - rest
    stretched, joint_limit = under_one_limit(angles, joint_limit)
    peak = body.largest_angles(stretched).max()
    if peak == 0:
        return np.inf
    low, high = 0.0, joint_limit / peak
    if not body.crossing_depth(high * angles + rest).any():
        return high * SAFE
    for _ in range(_BISECTIONS):
        middle = 0.5 * (low + high)
        crossing = bool(body.crossing_depth(middle * angles + rest).any())
        low, high = (low, middle) if crossing else (middle, high)
    return low * SAFE


def travelling_wave(
    body: Body, joint_limit: Limit, waves: float = WAVES, share: float = _SHARE, least: float = 0.0
) -> Fourier:
    """A wave of bending along a body: so many waves stand along it, positive ones travel towards
    the head. Its amplitude is a share of the largest that is admissible, at most 1.5 rad; where its
    shape speed would be below `least`, it is larger, and each joint bends in proportion to its own
    limit."""
    cos, sin = body.wave(waves)
    unit = Fourier(np.zeros(body.n_joint), cos[:, None], sin[:, None])
    wave = unit.grown(
        min(share * largest_factor(body, joint_limit, unit.angles(_PHASES)), _LARGEST)
    )
    if wave.shape_speed >= least:
        return wave
    angles = unit.angles(_PHASES)
    stretched = np.abs(under_one_limit(angles, joint_limit)[0]).max(axis=1)
    each = unit.mapped(
        np.diag(np.abs(angles).max(axis=1) / np.maximum(stretched, np.finfo(float).tiny))
    )
    return each.grown(
        min(
            largest_factor(body, joint_limit, each.angles(_PHASES)),
            _MOVING * least / each.shape_speed,
        )
    )


def largest_share(gait: Any, speeds: tuple[float, ...]) -> float:
    """Of the largest speeds of the joints [rad per period], that a gait moves at; 0 where there are
    none."""
    return (
        float((np.abs(gait.driven.rates(_PHASES)).max(axis=1) / np.array(speeds)).max())
        if speeds
        else 0.0
    )


def usual_guess(
    body: Body,
    gait_class: Any,
    joint_limit: Limit,
    speeds: tuple[float, ...],
    smallest_shape_speed: float,
) -> Any:
    """A wave laid into a class, no joint of it faster than allowed. `ProblemError` if it hardly
    moves."""
    gait = gait_class.first_guess(travelling_wave(body, joint_limit, least=smallest_shape_speed))
    if gait.joint_map is not None:
        most = largest_factor(body, joint_limit, gait.angles(_PHASES), gait.rest)
        gait = gait.scaled(min(1.0, most))
    if (share := largest_share(gait, speeds)) > 1:
        gait = gait.scaled(1 / share)
    _, rms = gait_class.guessed(gait)
    if rms < smallest_shape_speed * (1 - _AT_THE_BOUND):
        raise ProblemError(
            f"with {'speed_limit' if share > 1 else 'joint_limit'} the usual first gait has a "
            f"root-mean-square shape speed of "
            f"{rms:.2g}, less than smallest_shape_speed = {smallest_shape_speed:g}: make that "
            f"smaller, or give a guess."
        )
    return gait


def check_guess(
    body: Body, gait_class: Any, stated: Any, joint_limit: Limit, smallest_shape_speed: float
) -> None:
    """Raise a `ProblemError` for a gait that no search can begin with: of another body, at rest, or
    inadmissible."""
    if stated.n_joint != body.n_joint:
        raise ProblemError(
            f"guess has {stated.n_joint} {body.coordinate}s but the body has {body.n_joint}."
        )
    guess, rms = gait_class.guessed(stated)
    if rms < smallest_shape_speed * (1 - _AT_THE_BOUND):
        raise ProblemError(
            f"guess hardly moves (root-mean-square shape speed {rms:.3g} < smallest_shape_speed "
            f"{smallest_shape_speed:g}); does it have the symmetry {gait_class.symmetry!r} of its "
            f"class?"
        )
    angles = guess.angles(np.arange(_CHECKED_PHASES) / _CHECKED_PHASES)
    stretched, limit = under_one_limit(angles, joint_limit)
    largest = body.largest_angles(stretched).max()
    if largest > limit + body.usual.excess:
        each = np.abs(body.limited @ stretched).max(axis=1, initial=0.0)
        which = body.limit_names[np.argmax(each)] if each.size else "the tangent"
        beyond = f"{which} reaches {largest:.4g} rad, beyond the limit {limit:.4g}"
        raise ProblemError(f"guess is inadmissible: {beyond}; make its amplitude smaller.")
    depth = body.crossing_depth(angles)
    if depth.max() > _SLACK:
        when = np.argmax(depth) / _CHECKED_PHASES
        if body.drawn_width:
            raise ProblemError(f"guess is inadmissible: links overlap at phase {when:.3f}.")
        raise ProblemError(f"guess is inadmissible: links cross each other at phase {when:.3f}.")
