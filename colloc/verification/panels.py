"""Panels of a period: Simpson's rule on each and on its halves, and what that says of the error.

Kinks of stick and slip lie anywhere between the instants. At some places within a panel a kink
changes nothing when the panel is halved, and yet much when that is done again: the change of one
panel tells little. So a panel is also judged by what halving would change if it lay one or two
instants earlier or later. The error follows from how much less that is than the change on the panel
twice as wide, and those of different panels add up as magnitudes.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

HALF = np.array([[0.0, 0.0, 0.0], [5.0, 8.0, -1.0], [4.0, 16.0, 4.0]]) / 24
"""Integrals from the first of three instants to each of them of the parabola through them, over
unit distance of the outer."""
WHOLE = np.zeros((5, 5))
WHOLE[:3, :3] = 0.5 * HALF
WHOLE[3:] = WHOLE[2]
WHOLE[2:, 2:] += 0.5 * HALF
"""The same for five instants, parabola by parabola."""
_SMOOTH = 1 / (2 * 16 * 15)
"""What a rule of fourth order leaves on a panel of the change on the panel twice as wide, where the
motion is smooth."""
_MARGIN = 1.25
"""Factor of safety where three grids tell the falloff (Roache, 1998)."""
_KINK = 0.25
"""What is left of the change when a panel with a kink is halved: the width, and how far the kink
lifts the parabola."""
_BESIDE = 2
"""Instants by which panels are moved at most: half of a panel, so that a kink lies in the middle of
one of them."""
_CORNER = 1e-6
"""Values on both sides of an instant that differ by more, relative to the largest, belong to a
corner or another branch."""


class Panels(NamedTuple):
    """Panels in order of time: left end and width ``(n,)``, and at five instants of each: tail
    velocity ``(n, 5, 3)``; rate of rotation as it is seen from axes that turn evenly by the turn
    that is asked for, velocity of the centre of mass in the body frame (complex), power, power of
    the joints ``(n, 5)``; densities of k quantities ``(n, 5, k)``; residual and lever ``(n, 5)``;
    shares of the actuators' limits ``(n, 5, n_share)``; and how far all balanced motions lie apart
    ``(n, 5, 3 + k)`` (`colloc.motion.followed_motion.FollowedMotion`).
    At last what halving the panel changed that each is half of ``(n, 5)`` (see `changes`)."""

    left: np.ndarray
    width: np.ndarray
    z: np.ndarray
    spin: np.ndarray
    centre: np.ndarray
    power: np.ndarray
    actuator: np.ndarray
    densities: np.ndarray
    residual: np.ndarray
    lever: np.ndarray
    shares: np.ndarray
    apart: np.ndarray
    wider: np.ndarray

    @property
    def rates(self) -> np.ndarray:
        """What is integrated, ``(3 + k, n, 5)``: spin, velocity of the centre, power, densities."""
        return np.stack([self.spin, self.centre, self.power, *np.moveaxis(self.densities, -1, 0)])

    def take(self, chosen: np.ndarray) -> Panels:
        return Panels(*(a[chosen] for a in self))

    def joined(self, other: Panels) -> Panels:
        """These and others, in order of time."""
        both = Panels(*(np.concatenate(pair) for pair in zip(self, other, strict=True)))
        return both.take(np.argsort(both.left))


def halves(panels: Panels, new: tuple[np.ndarray, ...], changed: np.ndarray) -> Panels:
    """Both halves of panels, from the values at their instants and half way between these ``(n,
    4)``; and what that changes."""
    fields = []
    for old, between in zip(panels[2:-1], new, strict=True):
        merged = np.empty((old.shape[0], 9, *old.shape[2:]), dtype=old.dtype)
        merged[:, ::2], merged[:, 1::2] = old, between
        fields.append(
            np.stack([merged[:, :5], merged[:, 4:]], axis=1).reshape(
                2 * old.shape[0], *old.shape[1:]
            )
        )
    left, width = np.repeat(panels.left, 2), 0.5 * np.repeat(panels.width, 2)
    left[1::2] += width[1::2]
    return Panels(left, width, *[*fields, np.repeat(changed, 2, axis=0)])


def begun(left: np.ndarray, width: np.ndarray, values: tuple[np.ndarray, ...]) -> Panels:
    """The first panels, an even number of equal ones between any two corners, with the changes of
    their pairs."""
    paired = [np.concatenate([a[::2, ::2], a[1::2, 2::2]], axis=1) for a in values]
    pairs = Panels(left[::2], 2 * width[::2], *[*paired, np.empty(0)])
    return Panels(left, width, *[*values, np.repeat(changes(pairs)[0], 2, axis=0)])


def travelled(turn: np.ndarray, move: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Heading and place (complex) before every panel and after the last ``(n + 1,)``, from
    rotations and displacements."""
    heading = np.concatenate([[0.0], np.cumsum(turn)])
    return heading, np.concatenate([[0.0], np.cumsum(np.exp(1j * heading[:-1]) * move)])


def changes(panels: Panels) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """What halving each panel changes in the period's rotation, distance, work and integrals ``(n,
    3 + k)``.

    And the most that it would change if the panel lay up to one, and up to two instants earlier or
    later. All are magnitudes.
    """
    turn, move, *_ = increments(WHOLE, panels, 1)
    heading, place = travelled(turn, move)
    rates, (index, seen) = panels.rates, _beside(panels)
    more = rates[:, :, :4].reshape(rates.shape[0], -1)[:, index]
    extended = np.concatenate([more[..., :_BESIDE], rates, more[..., _BESIDE:]], axis=2)
    known = np.concatenate(
        [seen[:, :_BESIDE], np.ones((panels.left.size, 5), dtype=bool), seen[:, _BESIDE:]], axis=1
    )
    moved_by = range(2 * _BESIDE + 1)
    windows = np.stack([extended[..., k : k + 5] for k in moved_by], axis=1)
    there = np.stack([known[:, k : k + 5].all(axis=1) for k in moved_by])
    whole, once = (
        _integrals(WHOLE, panels.width, windows),
        _integrals(HALF, panels.width, windows[..., ::2]),
    )
    turned, moved, *others = (a - b for a, b in zip(whole, once, strict=True))
    # what comes after the panel turns with it
    end = place[-1] - np.exp(1j * heading[:-1]) * moved - 1j * turned * (place[-1] - place[1:])
    found = (
        np.abs(np.stack([turned, abs(place[-1]) - np.abs(end), *others], axis=2)) * there[..., None]
    )
    return found[_BESIDE], found[1:-1].max(axis=0), found.max(axis=0)


def _beside(panels: Panels) -> tuple[np.ndarray, np.ndarray]:
    """Which of all instants lie two before and two after those of each panel, as far apart ``(n,
    4)``; and whether there are such, with no corner between."""
    instants = (panels.left[:, None] + 0.25 * panels.width[:, None] * np.arange(4)).ravel()
    state = np.concatenate([panels.z, panels.power[:, :, None]], axis=2)
    steps = np.abs(state[:, 4] - np.roll(state[:, 0], -1, axis=0)) > _CORNER * np.abs(state).max(
        axis=(0, 1)
    )
    corners = steps.any(axis=1)
    stretch = np.concatenate([[0], np.cumsum(corners[:-1])])
    if not corners[-1]:
        stretch[stretch == stretch[-1]] = 0
    wanted = panels.left[:, None] + 0.25 * panels.width[:, None] * np.array(
        [*range(-_BESIDE, 0), *range(5, 5 + _BESIDE)]
    )
    slack = 0.05 * panels.width[:, None]
    index = np.searchsorted(instants, wanted % 1.0 - slack) % instants.size
    off = np.abs(instants[index] - wanted % 1.0)
    seen = (np.minimum(off, 1 - off) < slack) & (stretch[index // 4] == stretch[:, None])
    return index, seen & ~(corners[-1] & ((wanted < -slack) | (wanted > 1 - slack)))


def left_over(near: np.ndarray, far: np.ndarray, wider: np.ndarray) -> np.ndarray:
    """Error of the halves of panels ``(n, 3 + k)``, from the changes up to one and two instants
    beside them, and from those of the panels twice as wide.

    The rest of a geometric series, which falls no faster than at a kink that lies anywhere; but no
    less than smooth motion would leave of the change before, with a margin.
    """
    falloff = np.minimum(2 * far / np.maximum(np.maximum(wider, far), 1e-300), _KINK)
    return np.maximum(near * falloff / (1 - falloff), _MARGIN * _SMOOTH * wider)


def increments(rule: np.ndarray, panels: Panels, every: int) -> tuple[np.ndarray, ...]:
    """Rotation, displacement in the axes at the panel's begin (complex), work and integrals of
    panels, ``(n,)`` each, on every `every`-th instant."""
    return _integrals(rule, panels.width, panels.rates[..., ::every])


def _integrals(rule: np.ndarray, h: np.ndarray, rates: np.ndarray) -> tuple[np.ndarray, ...]:
    """The same of `Panels.rates` at more instants ``(3 + k, ..., n, m)``."""
    omega, centre, others, b = rates[0].real, rates[1], rates[2:].real, rule[-1]
    turn = np.exp(1j * h[:, None] * (omega @ rule.T))
    return h * (omega @ b), h * ((turn * centre) @ b), *(h * (other @ b) for other in others)
