"""The best small gait known at the fold, in rational arithmetic: efficiency 462/1013 as a matter of
integers.

At joint angles (pi, 0) the first link lies on the second, so the body is a rod of twice a link's
length whose first half is double. All velocities are lateral. In units of a link, xi in [0, 1]
along each link away from the first joint, they are

    a + w1 xi (first link),      a + w2 xi (second),      a + w2 + w3 xi (third).

Dry friction of isotropic unit coefficient pushes with the sign of the velocity; a link at rest
pushes back with up to as much.
"""

from fractions import Fraction as F
from itertools import pairwise

import numpy as np
import pytest

from colloc import Chain, Friction
from research import small_gaits

MOTIONS = {
    "the first link turns": (F(0), F(10), F(0), F(0)),
    "all slide": (F(5), F(-11), F(-12), F(132, 7)),
    "all slide back": (F(-1), F(1), F(12), F(-132, 7)),
}
"""Velocities (a, w1, w2, w3) of the three motions, each for the same time."""
LINKS = 3


def links(motion):
    """Each link's velocity at xi = 0, its slope, and where xi = 0 lies on the rod."""
    a, w1, w2, w3 = motion
    return (a, w1, F(0)), (a, w2, F(0)), (a + w2, w3, F(1))


def pieces(value, slope):
    """Stretches of [0, 1] on which ``value + slope xi`` keeps its sign: (from, to, sign)."""
    ends = sorted({F(0), F(1), *([-value / slope] if slope and 0 < -value / slope < 1 else [])})
    for low, high in pairwise(ends):
        speed = value + slope * (low + high) / 2
        yield low, high, (speed > 0) - (speed < 0)


def power(motion):
    """Integral of |velocity| over the body."""
    return sum(
        sign * (value * (high - low) + slope * (high**2 - low**2) / 2)
        for value, slope, _ in links(motion)
        for low, high, sign in pieces(value, slope)
    )


def push(motion):
    """Net force and torque about the first joint of all links that slide."""
    force = torque = F(0)
    for value, slope, start in links(motion):
        for low, high, sign in pieces(value, slope):
            force += sign * (high - low)
            torque += sign * (start * (high - low) + (high**2 - low**2) / 2)
    return force, torque


@pytest.mark.parametrize("name", MOTIONS)
def test_each_motion_is_in_balance(name):
    force, torque = push(MOTIONS[name])
    if name == "the first link turns":
        # the second link, at rest beneath it, holds it: it pushes with the whole of its friction,
        # the third with none
        assert (force, torque) == (F(1), F(1, 2))
    else:
        assert (force, torque) == (0, 0)


def test_the_gait_closes_and_advances():
    assert [sum(parts) for parts in zip(*MOTIONS.values(), strict=True)] == [4, 0, 0, 0]


def test_its_efficiency_is_462_over_1013():
    work = sum(power(motion) for motion in MOTIONS.values())
    assert [power(motion) for motion in MOTIONS.values()] == [F(5), F(838, 77), F(73, 7)]
    # lengths are thirds of the body, so are weights: d scales by 1/3, W by 1/3 twice
    assert LINKS * F(4) / work == F(462, 1013)


def missing(monkeypatch, delta):
    """How much less than the exact value the linear program finds at a finite regularisation."""
    monkeypatch.setattr(small_gaits, "_DELTA", delta)
    found = small_gaits.small_gait(Chain(), Friction(), np.array([np.pi, 0.0]))
    return 462 / 1013 - found.efficiency


def test_the_linear_program_over_directions_finds_the_same_value(monkeypatch):
    assert 0 < missing(monkeypatch, 1e-6) < 2e-5


@pytest.mark.slow
def test_what_it_misses_is_the_creep_of_regularised_friction(monkeypatch):
    coarse, fine = (missing(monkeypatch, delta) for delta in (1e-5, 1e-8))
    assert np.log10(coarse / fine) / 3 == pytest.approx(1.0, abs=0.03)  # first order in delta
