"""Panels of a period: Simpson's rule on each and on its halves, and what that says of the error.

Kinks of stick and slip lie anywhere between the instants. So the error of a panel is judged by how much less halving it
changes than halving the panel twice as wide did, and those of different panels add up as magnitudes.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

HALF = np.array([[0.0, 0.0, 0.0], [5.0, 8.0, -1.0], [4.0, 16.0, 4.0]]) / 24
"""Integrals from the first of three instants to each of them of the parabola through them, over unit distance of the outer."""
WHOLE = np.zeros((5, 5))
WHOLE[:3, :3] = 0.5 * HALF
WHOLE[3:] = WHOLE[2]
WHOLE[2:, 2:] += 0.5 * HALF
"""The same for five instants, parabola by parabola."""
_SMOOTH = 1 / (2 * 16 * 15)
"""What a rule of fourth order leaves on a panel of the change on the panel twice as wide, where the motion is smooth."""
_MARGIN = 3.0
"""Factor of safety (Roache, 1994)."""


class Panels(NamedTuple):
    """Panels in order of time: left end and width ``(n,)``, and at five instants of each: tail velocity ``(n, 5, 3)``, velocity
    of the centre of mass in the body frame (complex), power, power of the joints, shape speed, driven power, residual and lever
    ``(n, 5)``; shares of the actuators' limits ``(n, 5, n_share)``; and how far all balanced motions lie apart ``(n, 5, 3)``
    (`colloc.verification.followed_motion.FollowedMotion`).
    At last the differences of both rules on the panel twice as wide that each is half of ``(n, 5)`` (see `differences`)."""

    left: np.ndarray
    width: np.ndarray
    z: np.ndarray
    centre: np.ndarray
    power: np.ndarray
    actuator: np.ndarray
    pace: np.ndarray
    driven: np.ndarray
    residual: np.ndarray
    lever: np.ndarray
    shares: np.ndarray
    apart: np.ndarray
    wider: np.ndarray

    def take(self, chosen: np.ndarray) -> Panels:
        return Panels(*(a[chosen] for a in self))

    def joined(self, other: Panels) -> Panels:
        """These and others, in order of time."""
        both = Panels(*(np.concatenate(pair) for pair in zip(self, other, strict=True)))
        return both.take(np.argsort(both.left))


def halves(panels: Panels, new: tuple[np.ndarray, ...]) -> Panels:
    """Both halves of panels, from the values at their instants and half way between these ``(n, 4)``."""
    fields = []
    for old, between in zip(panels[2:-1], new, strict=True):
        merged = np.empty((old.shape[0], 9, *old.shape[2:]), dtype=old.dtype)
        merged[:, ::2], merged[:, 1::2] = old, between
        fields.append(np.stack([merged[:, :5], merged[:, 4:]], axis=1).reshape(2 * old.shape[0], *old.shape[1:]))
    left, width = np.repeat(panels.left, 2), 0.5 * np.repeat(panels.width, 2)
    left[1::2] += width[1::2]
    return Panels(left, width, *[*fields, np.repeat(differences(panels), 2, axis=0)])


def begun(left: np.ndarray, width: np.ndarray, values: tuple[np.ndarray, ...]) -> Panels:
    """The first panels, an even number of equal ones between any two corners, with the differences on their pairs."""
    paired = [np.concatenate([a[::2, ::2], a[1::2, 2::2]], axis=1) for a in values]
    pairs = Panels(left[::2], 2 * width[::2], *[*paired, np.empty(0)])
    return Panels(left, width, *[*values, np.repeat(differences(pairs), 2, axis=0)])


def differences(panels: Panels) -> np.ndarray:
    """What halving changes in rotation, displacement, work, path length and driven work of panels, magnitudes ``(n, 5)``."""
    whole, once = increments(WHOLE, panels, 1), increments(HALF, panels, 2)
    return np.stack([np.abs(a - b) for a, b in zip(whole, once, strict=True)], axis=1)


def left_over(changed: np.ndarray, wider: np.ndarray) -> np.ndarray:
    """Error of the halves of panels ``(n, 5)``, from the last change and the one before, on the panel twice as wide.

    The rest of a geometric series; but no less than smooth motion would leave of the change before, with a margin, since a
    change that falls faster does so by accident.
    """
    falloff = np.minimum(2 * changed / np.maximum(wider, 1e-300), 0.5)
    return np.maximum(changed * falloff / (1 - falloff), _MARGIN * _SMOOTH * wider)


def increments(rule: np.ndarray, panels: Panels, every: int) -> tuple[np.ndarray, ...]:
    """Rotation, displacement in the axes at the panel's begin (complex), work, path length and driven work of panels, ``(n,)``
    each, on every `every`-th instant."""
    omega, centre, *others = (
        a[:, ::every] for a in (panels.z[..., 2], panels.centre, panels.power, panels.pace, panels.driven)
    )
    h, b = panels.width, rule[-1]
    turn = np.exp(1j * h[:, None] * (omega @ rule.T))
    return h * (omega @ b), h * ((turn * centre) @ b), *(h * (other @ b) for other in others)
