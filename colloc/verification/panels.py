"""Panels of a period: Simpson's rule on each and on its halves, and the error that leaves.

A kink of stick and slip may lie where halving its panel changes nothing, and halving that again
much. So a panel is also judged by what halving would change if it lay one or two instants earlier
or later, and the error follows from the falloff against the panel twice as wide.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

HALF = np.array([[0.0, 0.0, 0.0], [5.0, 8.0, -1.0], [4.0, 16.0, 4.0]]) / 24
"""Integrals from the first of three instants to each of the parabola through them, over the
width."""
WHOLE = np.zeros((5, 5))
WHOLE[:3, :3] = 0.5 * HALF
WHOLE[3:] = WHOLE[2]
WHOLE[2:, 2:] += 0.5 * HALF
"""`HALF` for five instants, parabola by parabola."""
_SMOOTH = 1 / (2 * 16 * 15)
"""What a rule of fourth order leaves of the change on the panel twice as wide in smooth motion."""
_MARGIN = 1.25  # factor of safety where three grids tell the falloff (Roache, 1998)
_KINK = 0.25
"""What halving a panel with a kink leaves of its change: the width, and the lift of the
parabola."""
_BESIDE = 2
"""Instants by which panels are moved at most: half of a panel."""
_CORNER = 1e-6  # relative jump between neighbouring panels that is a corner or another branch


class Panels(NamedTuple):
    """Panels in order of time, with values at five instants of each; k quantities."""

    left: np.ndarray  # (n,)
    width: np.ndarray
    z: np.ndarray  # tail velocity, (n, 5, 3)
    rates: np.ndarray
    """Rotation rate from evenly turning axes, velocity of the centre of mass in the body frame,
    power, densities: complex, ``(n, 5, 3 + k)``."""
    joint_power: np.ndarray  # (n, 5)
    apart: np.ndarray  # `colloc.dynamics.branches.FollowedMotion.apart`, (n, 5, 3 + k)
    wider: np.ndarray  # `changes` of the panel that each is half of, (n, 3 + k)

    def take(self, chosen: np.ndarray) -> Panels:
        return Panels(*(a[chosen] for a in self))

    def join(self, other: Panels) -> Panels:
        both = Panels(*(np.concatenate(pair) for pair in zip(self, other, strict=True)))
        return both.take(np.argsort(both.left))

    def halves(self, between: tuple[np.ndarray, ...], changed: np.ndarray) -> Panels:
        """Both halves of each, from values (z, rates, joint_power, apart) between the instants
        ``(n, 4)``, and what halving changed."""
        fields = []
        for old, new in zip(self[2:-1], between, strict=True):
            merged = np.empty((len(old), 9, *old.shape[2:]), dtype=old.dtype)
            merged[:, ::2], merged[:, 1::2] = old, new
            both = np.stack([merged[:, :5], merged[:, 4:]], axis=1)
            fields.append(both.reshape(2 * len(old), *old.shape[1:]))
        left, width = np.repeat(self.left, 2), 0.5 * np.repeat(self.width, 2)
        left[1::2] += width[1::2]
        return Panels(left, width, *[*fields, np.repeat(changed, 2, axis=0)])


def first_panels(left: np.ndarray, width: np.ndarray, values: tuple[np.ndarray, ...]) -> Panels:
    """An even number of equal panels between any two corners, with the changes of their pairs."""
    paired = [np.concatenate([a[::2, ::2], a[1::2, 2::2]], axis=1) for a in values]
    pairs = Panels(left[::2], 2 * width[::2], *[*paired, np.empty(0)])
    return Panels(left, width, *[*values, np.repeat(changes(pairs)[0], 2, axis=0)])


def poses(turn: np.ndarray, move: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Heading and place (complex) before every panel and after the last ``(n + 1,)``."""
    heading = np.concatenate([[0.0], np.cumsum(turn)])
    return heading, np.concatenate([[0.0], np.cumsum(np.exp(1j * heading[:-1]) * move)])


def increments(panels: Panels, rule: np.ndarray = WHOLE) -> tuple[np.ndarray, ...]:
    """Rotation, displacement in the axes at the panel's begin (complex), work and integrals of
    panels."""
    every = 4 // (len(rule) - 1)
    return _integrals(rule, panels.width, np.moveaxis(panels.rates[:, ::every], -1, 0))


def _integrals(rule: np.ndarray, h: np.ndarray, rates: np.ndarray) -> tuple[np.ndarray, ...]:
    """`increments` from rates ``(3 + k, ..., n, m)`` at m instants."""
    omega, centre, others, b = rates[0].real, rates[1], rates[2:].real, rule[-1]
    turn = np.exp(1j * h[:, None] * (omega @ rule.T))
    return h * (omega @ b), h * ((turn * centre) @ b), *(h * (other @ b) for other in others)


def changes(panels: Panels) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Changes by halving each panel of the period's rotation, distance, work and integrals ``(n, 3
    + k)``, and the largest if the panel lay up to one, and up to two instants beside;
    magnitudes."""
    heading, place = poses(*increments(panels)[:2])
    rates, (index, seen) = np.moveaxis(panels.rates, -1, 0), _beside(panels)
    more = rates[:, :, :4].reshape(len(rates), -1)[:, index]
    extended = np.concatenate([more[..., :_BESIDE], rates, more[..., _BESIDE:]], axis=2)
    inside = np.ones((panels.left.size, 5), dtype=bool)
    known = np.concatenate([seen[:, :_BESIDE], inside, seen[:, _BESIDE:]], axis=1)
    offsets = range(2 * _BESIDE + 1)
    windows = np.stack([extended[..., k : k + 5] for k in offsets], axis=1)
    there = np.stack([known[:, k : k + 5].all(axis=1) for k in offsets])
    whole = _integrals(WHOLE, panels.width, windows)
    once = _integrals(HALF, panels.width, windows[..., ::2])
    turned, moved, *others = (a - b for a, b in zip(whole, once, strict=True))
    # what comes after the panel turns with it
    end = place[-1] - np.exp(1j * heading[:-1]) * moved - 1j * turned * (place[-1] - place[1:])
    sizes = np.abs(np.stack([turned, abs(place[-1]) - np.abs(end), *others], axis=2))
    sizes = sizes * there[..., None]
    return sizes[_BESIDE], sizes[1:-1].max(axis=0), sizes.max(axis=0)


def _beside(panels: Panels) -> tuple[np.ndarray, np.ndarray]:
    """Indices among all instants of the two before and after each panel, at its spacing ``(n, 4)``;
    and whether there are such, with no corner between."""
    left, width = panels.left[:, None], panels.width[:, None]
    instants = (left + 0.25 * width * np.arange(4)).ravel()
    state = np.concatenate([panels.z, panels.rates[:, :, 2:3].real], axis=2)
    steps = np.abs(state[:, 4] - np.roll(state[:, 0], -1, axis=0))
    corners = (steps > _CORNER * np.abs(state).max(axis=(0, 1))).any(axis=1)
    stretch = np.concatenate([[0], np.cumsum(corners[:-1])])
    if not corners[-1]:
        stretch[stretch == stretch[-1]] = 0
    wanted = left + 0.25 * width * np.array([*range(-_BESIDE, 0), *range(5, 5 + _BESIDE)])
    slack = 0.05 * width
    index = np.searchsorted(instants, wanted % 1.0 - slack) % instants.size
    off = np.abs(instants[index] - wanted % 1.0)
    seen = (np.minimum(off, 1 - off) < slack) & (stretch[index // 4] == stretch[:, None])
    return index, seen & ~(corners[-1] & ((wanted < -slack) | (wanted > 1 - slack)))


def remaining_error(near: np.ndarray, far: np.ndarray, wider: np.ndarray) -> np.ndarray:
    """Error of the halves of panels from the changes up to one and two instants beside them, and
    from those of the panels twice as wide: the rest of a geometric series, which falls no faster
    than at a kink, but no less than smooth motion would leave."""
    falloff = np.minimum(2 * far / np.maximum(np.maximum(wider, far), 1e-300), _KINK)
    return np.maximum(near * falloff / (1 - falloff), _MARGIN * _SMOOTH * wider)
